// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include <zlib.h>
#include <catch2/catch.hpp>

#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "export/little_endian.h"
#include "page_depth.h"
#include "report_page.h"
#include "web/page.h"

using namespace pmsp_test;
using Catch::Contains;
using nlohmann::ordered_json;

namespace {

const std::string kBegin = "<script type=\"application/json\" id=\"pmsp-data\">";

ordered_json data_of(const std::string& page) {
  const std::size_t begin = page.find(kBegin) + kBegin.size();
  return ordered_json::parse(page.substr(begin, page.find("</script>", begin) - begin));
}

struct Depths {
  std::uint32_t width = 0, height = 0;
  double least = 0.0;
  std::vector<unsigned char> planes;
};

/// Reads what page_depth wrote.
Depths depths_from(const std::string& bytes) {
  REQUIRE(bytes.size() > 16);
  Depths depths{pmsp::get_little<std::uint32_t>(bytes.data()),
                pmsp::get_little<std::uint32_t>(bytes.data() + 4),
                pmsp::get_little<double>(bytes.data() + 8),
                {}};
  depths.planes.resize(std::size_t{3} * depths.width * depths.height);
  uLongf length = depths.planes.size();
  REQUIRE(::uncompress(depths.planes.data(), &length, reinterpret_cast<const Bytef*>(bytes.data() + 16),
                       static_cast<uLong>(bytes.size() - 16)) == Z_OK);
  REQUIRE(length == depths.planes.size());
  return depths;
}

}  // namespace

TEST_CASE("a report contains the command and the points") {
  if (!pmsp::web::has_report_page()) return;
  const TempDir dir;
  const std::string las = (dir / "c, d.las").string();
  const Result result =
      densify(quick_run(dir / "c.splat.ply", {"-o", las, "--report", (dir / "r.html").string(), "--stats",
                                              (dir / "s.json").string(), "--report-points", "5000",
                                              "--report-panoramas", "2", "--scale", "2", "--report-unit", "metres"}));
  INFO(result.err);
  REQUIRE(result.code == 0);
  const std::string page = read_text(dir / "r.html");
  CHECK(page.substr(0, 15) == "<!doctype html>");
  const ordered_json data = data_of(page);
  const ordered_json stats = ordered_json::parse(read_text(dir / "s.json"));
  CHECK(data["points_in"] == stats["points_written"]);
  CHECK(data["points"].get<int>() <= 5000);
  CHECK(data["points"].get<int>() > 4000);
  CHECK(data["unit"] == "m");
  CHECK(data["convert"] == las);
  CHECK(data["notes"].dump().find("no network") != std::string::npos);
  CHECK(data["keyframes"].size() == stats["keyframes"]["in_map"]);
  std::size_t panoramas = 0, strips = 0, depth_maps = 0;
  for (const ordered_json& keyframe : data["keyframes"]) {
    depth_maps += keyframe["use"] == "depth map" ? 1 : 0;
    if (keyframe.contains("panorama")) {
      ++panoramas;
      CHECK_THAT(page, Contains("id=\"pmsp-" + keyframe["panorama"].get<std::string>() + "\">/9j/"));  // JPEG
      CHECK_THAT(page, Contains("id=\"pmsp-" + keyframe.at("depths").get<std::string>() + "\">"));
    }
    if (!keyframe.contains("strip")) continue;
    ++strips;
    CHECK(keyframe["coverage"].get<double>() > 0.3);
    CHECK_THAT(page, Contains("id=\"pmsp-" + keyframe["strip"]["depth"].get<std::string>() + "\">/9j/"));
  }
  CHECK(panoramas == 2);
  CHECK(depth_maps == stats["keyframes"]["depth_maps"]);
  CHECK(strips == depth_maps);
  std::int64_t points = 0;
  for (const ordered_json& count : data["confidences"]) points += count.get<std::int64_t>();
  CHECK(points == stats["points_written"]);
  CHECK(data["times"].size() > 5);
  for (std::size_t i = 0; i < data["nodes"].size(); ++i) {
    CHECK_THAT(page, Contains("id=\"pmsp-node-" + std::to_string(i) + "\">"));
  }
}

TEST_CASE("depths of a page are right to 0.05 % and keep holes and confidence") {
  pmsp::DepthMap map;
  map.depth = pmsp::Image<float>(6, 3, 0.0F);
  map.confidence = pmsp::Image<float>(6, 3, 0.0F);
  for (int i = 0; i < 18; i += i % 5 == 3 ? 2 : 1) {
    map.depth(i % 6, i / 6) = 0.3F * std::pow(3.0F, static_cast<float>(i * 7 % 11));
    map.confidence(i % 6, i / 6) = static_cast<float>(i % 4) / 3.0F;
  }
  const Depths depths = depths_from(pmsp::tool::page_depth(map.depth.view(), map.confidence.view(), 2.0));
  REQUIRE(depths.width == 6);
  REQUIRE(depths.height == 3);
  const std::vector<unsigned char>& planes = depths.planes;
  int code = 0;
  for (std::size_t i = 0; i < 18; ++i) {
    const float depth = map.depth.pixels()[i];
    CHECK((planes[36 + i] > 0) == (depth > 0.0F));
    if (depth <= 0.0F) continue;
    const int folded = planes[i] + 256 * planes[18 + i];
    code += folded % 2 == 0 ? folded / 2 : -(folded + 1) / 2;
    CHECK(depths.least * std::exp(code / 1024.0) == Approx(2.0 * static_cast<double>(depth)).epsilon(5.1e-4));
    const double root = std::sqrt(static_cast<double>(map.confidence.pixels()[i]));
    CHECK(planes[36 + i] == Approx(15.0 * root).margin(1.0));
  }
}

TEST_CASE("the depth map of a page has at most 1024 columns, and one without depth has none") {
  const auto packed = [](int width, float depth) {
    const pmsp::Image<float> depths(width, width / 2, depth), confidences(width, width / 2, 0.5F);
    return pmsp::tool::page_depth(depths.view(), confidences.view(), 1.0);
  };
  CHECK(depths_from(packed(2000, 1.0F)).width == 1024);
  CHECK(depths_from(packed(2000, 1.0F)).height == 512);
  CHECK(packed(8, 0.0F).empty());
}

TEST_CASE("a report of a workspace covers the whole mission") {
  if (!pmsp::web::has_report_page()) return;
  const TempDir dir;
  const auto report = [&](const std::string& name) {
    const Result result = densify(quick_run(dir / "c.ply", {"--report", (dir / name).string(), "--workspace",
                                                            (dir / "work").string(), "--report-points", "2000"}));
    INFO(result.err);
    REQUIRE(result.code == 0);
    return data_of(read_text(dir / name));
  };
  const ordered_json first = report("1.html"), again = report("2.html");
  CHECK(again["nodes"] == first["nodes"]);
  CHECK(again["confidences"] == first["confidences"]);
  for (std::size_t i = 0; i < first["keyframes"].size(); ++i) {
    CHECK(again["keyframes"][i]["use"] == first["keyframes"][i]["use"]);
  }
}

TEST_CASE("photos and depth maps of all keyframes are beside a report, photos kept by a later run of a workspace") {
  if (!pmsp::web::has_report_page()) return;
  const TempDir dir;
  const std::filesystem::path photos = dir / "of it" / "photos";
  const auto report = [&](const std::vector<std::string>& more) {
    std::vector<std::string> words{"--report", (dir / "r.html").string(), "--report-photos", photos.string()};
    words.insert(words.end(), more.begin(), more.end());
    const Result result = densify(quick_run(dir / "c.ply", words));
    INFO(result.err);
    REQUIRE(result.code == 0);
    return read_text(dir / "r.html");
  };
  const auto check = [&](const std::string& page, bool all) {
    CHECK_THAT(page, Contains("img-src 'self' data:") && Contains("connect-src 'self'"));
    const ordered_json data = data_of(page);
    CHECK_THAT(data["notes"].dump(), !Contains("no network"));
    CHECK(data["keyframes"].size() > 3);
    std::ptrdiff_t files = 0;
    for (const ordered_json& keyframe : data["keyframes"]) {
      const bool has_depth = keyframe["use"] == "depth map";
      if (!all && !has_depth) continue;  // whose image is not read
      const std::string id = std::to_string(keyframe["id"].get<std::int64_t>()), folder = "./of%20it/photos/";
      CHECK(keyframe["photo"] == folder + id + ".jpg");
      CHECK(read_text(photos / (id + ".jpg")).substr(0, 2) == "\xff\xd8");
      files += has_depth ? 2 : 1;
      CHECK(keyframe.contains("photo_depths") == has_depth);
      if (!has_depth) continue;
      CHECK(keyframe["photo_depths"] == folder + id + ".depth");
      const Depths depths = depths_from(read_text(photos / (id + ".depth")));
      CHECK(depths.width == 128);
      CHECK(depths.least == Approx(keyframe["strip"]["near"].get<double>()).epsilon(0.5));
    }
    const std::filesystem::directory_iterator entries(photos);
    CHECK(std::distance(begin(entries), end(entries)) == files);
  };
  std::filesystem::create_directory(dir / "of it");
  check(report({"--workspace", (dir / "work").string()}), false);
  check(report({"--workspace", (dir / "work").string(), "--force", "--scale", "2"}), false);
  check(report({"--force"}), true);
}

TEST_CASE("an unwritable report is refused before any work") {
  if (!pmsp::web::has_report_page()) return;
  const TempDir dir;
  CHECK(densify(quick_run(dir / "c.ply", {"--report", (dir / "no" / "r.html").string()})).code == 6);
  CHECK(densify(quick_run(dir / "c.ply", {"--report", (dir / "c.ply").string()})).code == 2);
  CHECK(densify(quick_run(dir / "c.ply", {"--report-points", "5000001"})).code == 2);
  CHECK(densify(quick_run(dir / "c.ply", {"--report-panoramas", "-1"})).code == 2);
  CHECK(densify(quick_run(dir / "c.ply", {"--report-photos", (dir / "p").string()})).code == 2);
  const auto photos = [&](const std::string& folder) {
    return densify(quick_run(dir / "c.ply", {"--report", (dir / "r.html").string(), "--report-photos", folder})).code;
  };
  CHECK(photos(dir.path().parent_path().string()) == 2);
  CHECK(photos(dir.path().string()) == 2);
  CHECK(dir.entries() == 0);
}

TEST_CASE("data embedded in a page cannot close its element") {
  const std::string evil = "</script><!--<script>&\xe2\x80\xa8\xff\"\\";
  const std::string text = pmsp::web::script_json({{"map", evil}, {evil, 1}});
  for (const char* mark : {"<", ">", "&", "\xe2\x80\xa8"}) CHECK(text.find(mark) == std::string::npos);
  const ordered_json back = ordered_json::parse(text);
  CHECK(back["map"].get<std::string>().substr(0, 23) == evil.substr(0, 23));
}

TEST_CASE("invalid statistics give no facts and no error") {
  const ordered_json odd{{"map", 5},        {"outputs", "x"}, {"keyframes", {1, 2}}, {"pixels", nullptr},
                         {"seconds", "no"}, {"seed", {}},     {"pairing", "yes"},    {"options", {{"width", "x"}}}};
  CHECK(pmsp::tool::report_facts(odd).size() == 1);  // points
  CHECK(pmsp::tool::report_times(odd).empty());
  CHECK(pmsp::tool::report_problems(odd).empty());
}

TEST_CASE("keyframe ids are listed as ranges") {
  const std::vector<std::int64_t> order{1, 2, 5, 6, 7, 9, 12};
  CHECK(pmsp::tool::list_of_keyframes({5}, order) == "5");
  CHECK(pmsp::tool::list_of_keyframes({1, 2}, order) == "1 and 2");
  CHECK(pmsp::tool::list_of_keyframes({1, 5, 6, 7, 12}, order) == "1, 5 to 7 and 12");
}

TEST_CASE("a report from a cloud or a workspace alone lists missing parts") {
  if (!pmsp::web::has_report_page()) return;
  const TempDir dir;
  const Result run =
      densify(quick_run(dir / "c.ply", {"--workspace", (dir / "work").string(), "--stats", (dir / "s.json").string()}));
  INFO(run.err);
  REQUIRE(run.code == 0);
  const ordered_json stats = ordered_json::parse(read_text(dir / "s.json"));
  const auto report = [&](const std::string& from, const std::string& name, const std::vector<std::string>& more = {}) {
    std::vector<std::string> words{"report", (dir / from).string(), "-o", (dir / name).string()};
    words.insert(words.end(), more.begin(), more.end());
    return densify(words);
  };
  REQUIRE(report("c.ply", "cloud.html", {"--points", "1000"}).code == 0);
  const ordered_json cloud = data_of(read_text(dir / "cloud.html"));
  CHECK(cloud["points_in"] == stats["points_written"]);
  CHECK(cloud["points"].get<int>() <= 1000);
  CHECK(cloud["unit"] == "map units");
  CHECK(cloud["keyframes"].empty());
  CHECK(cloud["normals"] == true);
  CHECK_THAT(cloud["notes"].dump(), Contains("without keyframes, pictures") && Contains("follow its -y axis"));
  CHECK(cloud["up"] == ordered_json({0.0, -1.0, 0.0}));
  CHECK(cloud["convert"] == (dir / "c.ply").string());
  REQUIRE(report("work", "work.html").code == 0);
  const ordered_json work = data_of(read_text(dir / "work.html"));
  CHECK(work["points_in"] == stats["points_written"]);
  CHECK(work["confidences"] == cloud["confidences"]);
  std::size_t used = 0;
  for (const ordered_json& keyframe : work["keyframes"]) used += keyframe["use"] == "depth map" ? 1 : 0;
  CHECK(used == stats["keyframes"]["depth_maps"]);
  CHECK_THAT(work["notes"].dump(), Contains("without pictures"));
  CHECK(work["convert"] == (dir / "work").string());
  CHECK(report("work", "work.html").code == 6);
  CHECK(report("work", "work.html", {"--force"}).code == 0);
  CHECK(report("c.ply", "c.ply", {"--force"}).code == 2);
  CHECK(report("none.ply", "n.html").code == 3);
  CHECK(densify({"report", dir.path().string(), "-o", (dir / "n.html").string()}).code == 3);
  CHECK(densify({"report", (dir / "c.ply").string()}).code == 2);
}

TEST_CASE("a report from a cloud that is not in the frame of a map has z up and says so") {
  if (!pmsp::web::has_report_page()) return;
  const TempDir dir;
  const std::string header = "ply\nformat ascii 1.0\n", vertices =
                                                            "element vertex 2\nproperty float x\nproperty float y\n"
                                                            "property float z\nend_header\n0 0 0\n1 2 3\n";
  const std::string turned =
      "comment cloud {\"file_from_map\":[[1,0,0,0],[0,0,1,0],[0,-1,0,0],[0,0,0,1]],\"scale\":1}\n";
  for (const std::string& comment : {std::string(), turned}) {
    std::ofstream(dir / "c.ply") << header << comment << vertices;
    const Result result = densify({"report", (dir / "c.ply").string(), "-o", (dir / "r.html").string(), "--force",
                                   "--unit", comment.empty() ? "feet" : "steps"});
    INFO(result.err);
    REQUIRE(result.code == 0);
    const ordered_json data = data_of(read_text(dir / "r.html"));
    CHECK(data["up"] == ordered_json({0.0, 0.0, 1.0}));
    CHECK_THAT(data["notes"].dump(), Contains("follow its z axis"));
    CHECK(data["unit"] == (comment.empty() ? "ft" : "steps"));
  }
}

TEST_CASE("merged shards give a report") {
  if (!pmsp::web::has_report_page()) return;
  const TempDir dir;
  const auto shard = [&](const std::string& which) {
    std::vector<std::string> words =
        quick_run("unused.ply", {"--workspace", (dir / "work").string(), "--shard", which});
    words.erase(std::remove(words.begin(), words.end(), "unused.ply"), words.end());
    words.erase(std::remove(words.begin(), words.end(), "-o"), words.end());
    const Result result = densify(words);
    INFO(result.err);
    REQUIRE(result.code == 0);
  };
  shard("0/1");
  const Result merged = densify({"merge", (dir / "work").string(), "-o", (dir / "c.ply").string(), "--report",
                                 (dir / "r.html").string(), "--stats", (dir / "s.json").string()});
  INFO(merged.err);
  REQUIRE(merged.code == 0);
  const ordered_json data = data_of(read_text(dir / "r.html"));
  CHECK(data["points_in"] == ordered_json::parse(read_text(dir / "s.json"))["points_written"]);
  CHECK_THAT(data["notes"].dump(), Contains("not available from shards"));
}
