// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include <catch2/catch.hpp>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "cli/command.h"
#include "pmsp/io/cloud.h"
#include "pmsp/io/depth.h"

using namespace pmsp;
using namespace pmsp_test;
using Catch::Contains;

namespace fs = std::filesystem;

namespace {

/// -o for each format of clouds.
Words all_formats(const TempDir& dir, const std::string& name) {
  Words words;
  for (const CloudFormat& format : cloud_formats()) {
    if (format.is_map) continue;
    words.insert(words.end(), {"-o", (dir / (name + format.extension)).string()});
  }
  return words;
}

void check_same_clouds(const TempDir& dir, const std::string& a, const std::string& b) {
  for (const CloudFormat& format : cloud_formats()) {
    if (format.is_map) continue;
    INFO(format.name);
    const std::string bytes = all_bytes(dir / (a + format.extension));
    CHECK(bytes.size() > 10000);
    CHECK((bytes == all_bytes(dir / (b + format.extension))));  // not to be printed
  }
}

/// A quick run without its -o.
Words quick(const Words& more) {
  Words words = quick_run("", more);
  const auto output = std::find(words.begin(), words.end(), "-o");
  words.erase(output, output + 2);
  return words;
}

}  // namespace

TEST_CASE("all formats have equal bytes for any threads and with a workspace and merged shards", "[outputs]") {
  const TempDir dir;
  const Words plain = joined(all_formats(dir, "plain"), {"--threads", "1", "--stats", (dir / "s.json").string()});
  require_ok(densify(quick(plain)));
  const auto stats = nlohmann::json::parse(read_text(dir / "s.json"));
  const std::vector<CloudFormat>& formats = cloud_formats();
  const auto clouds = std::count_if(formats.begin(), formats.end(), [](const CloudFormat& it) { return !it.is_map; });
  CHECK(stats["outputs"].size() == static_cast<std::size_t>(clouds));
  CHECK(stats["points_written"] == stats["points"]);
  CHECK(stats["points"] == read_ply(dir / "plain.ply").positions.size());

  const std::string work = (dir / "work").string(), shared = (dir / "shared").string();
  require_ok(densify(quick(joined(all_formats(dir, "work"), {"--threads", "2", "--workspace", work}))));
  check_same_clouds(dir, "plain", "work");
  require_ok(densify(quick(joined(all_formats(dir, "again"), {"--workspace", work}))));
  check_same_clouds(dir, "plain", "again");

  for (const char* which : {"1/2", "0/2"}) require_ok(densify(quick({"--workspace", shared, "--shard", which})));
  require_ok(densify(joined({"merge", shared}, all_formats(dir, "merged"))));
  check_same_clouds(dir, "plain", "merged");

  const Result refused = densify(quick(all_formats(dir, "plain")));  // all exist
  CHECK(refused.code == 6);
  require_ok(densify(quick(joined(all_formats(dir, "plain"), {"--force"}))));
  check_same_clouds(dir, "plain", "work");
}

TEST_CASE("the requested frame and thinning are applied to the points and reported", "[outputs]") {
  const TempDir dir;
  require_ok(densify(quick_run(dir / "map.ply")));
  const PlyCloud map = read_ply(dir / "map.ply");
  write_text(dir / "m.txt", "0 -1 0 0\n1 0 0 5\n0 0 1 0\n0 0 0 1\n");
  const Words frame{"--transform", (dir / "m.txt").string(), "--scale", "2", "--double"};
  require_ok(densify(quick_run(dir / "moved.ply", frame)));
  const PlyCloud moved = read_ply(dir / "moved.ply");
  REQUIRE(moved.positions.size() == map.positions.size());
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < map.positions.size(); ++i) {
    const Eigen::Vector3d& p = map.positions[i];
    const Eigen::Vector3f& n = map.normals[i];
    wrong += (moved.positions[i] - 2.0 * Eigen::Vector3d(-p.y(), p.x() + 5.0, p.z())).norm() > 1e-5;
    wrong += (moved.normals[i] - Eigen::Vector3f(-n.y(), n.x(), n.z())).norm() > 1e-5F;
    wrong += moved.confidence[i] != map.confidence[i] || moved.views[i] != map.views[i];
  }
  CHECK(wrong == 0);

  const Words amount{"--crop", "-4,8,-4,4,12,4", "--voxel", "0.05", "--max-points", "1000"};
  require_ok(
      densify(quick_run(dir / "few.ply", joined(joined(frame, amount), {"--stats", (dir / "s.json").string()}))));
  const PlyCloud few = read_ply(dir / "few.ply");
  CHECK(few.positions.size() == 1000);
  for (const Eigen::Vector3d& p : few.positions) {
    CHECK((p.x() >= -4 && p.x() <= 4 && p.y() >= 8 && p.y() <= 12 && p.z() >= -4 && p.z() <= 4));
  }
  std::string comments;
  for (const std::string& comment : few.comments) comments += comment;
  CHECK_THAT(comments, Contains("\"file_from_map\":[[0.0,-2.0,0.0,0.0],[2.0,0.0,0.0,10.0]") &&
                           Contains("\"voxel\":0.05") && Contains("\"max_points\":1000"));
  const auto stats = nlohmann::json::parse(read_text(dir / "s.json"));
  CHECK(stats["points"] == map.positions.size());
  CHECK(stats["points_written"] == 1000);
  CHECK(stats["cloud"]["scale"] == 2.0);
  CHECK(stats["cloud"]["crop"][1][1] == 12.0);
}

TEST_CASE("a crop without points is reported and keeps the old cloud", "[outputs]") {
  const TempDir dir;
  write_text(dir / "c.ply", "old");
  const Result result = densify(quick_run(dir / "c.ply", {"--force", "--crop", "100,100,100,101,101,101"}));
  CHECK(result.code == 5);
  CHECK_THAT(result.err, Contains("lies in the box of --crop"));
  CHECK(read_text(dir / "c.ply") == "old");
}

TEST_CASE("a cloud is aligned with its camera positions and the residuals are reported", "[outputs]") {
  const TempDir dir;
  write_text(dir / "places.csv", "0,0,0,0\n1,0,0,1\n2,0,3,2\n");
  const Words align{"--align", (dir / "places.csv").string()};
  const Result result = densify(quick_run(dir / "c.ply", joined(align, {"--stats", (dir / "s.json").string()})));
  require_ok(result);
  CHECK_THAT(result.err, Contains("cloud: aligned with 3 points of") && Contains("residuals"));
  const auto stats = nlohmann::json::parse(read_text(dir / "s.json"));
  CHECK(stats["cloud"]["align"]["residuals"].size() == 3);
  CHECK(stats["cloud"]["align"]["residuals"].contains("keyframe 2"));
  write_text(dir / "places.csv", "0,0,0,0\n");
  const Result few = densify(quick_run(dir / "d.ply", align));
  CHECK(few.code == 3);
  CHECK_THAT(few.err, Contains("at least 3"));
}

TEST_CASE("depth maps have the requested formats and an index", "[outputs]") {
  const TempDir dir;
  const std::string depth = (dir / "d").string();
  require_ok(densify(quick_run(dir / "c.ply", {"--depth-maps", depth, "--depth-format", "exr,png", "--scale", "3"})));
  const auto index = nlohmann::json::parse(read_text(dir / "d/index.json"));
  REQUIRE(index["maps"].size() == 5);
  CHECK(index["cloud"]["scale"] == 3.0);
  std::size_t files = 1;
  for (const auto& map : index["maps"]) {
    CHECK(!map.contains("depth"));
    for (const char* key : {"exr", "depth_png", "normal_png", "confidence_png"}) {
      CHECK(read_text(dir / "d" / map[key].get<std::string>()).size() > 100);
      ++files;
    }
  }
  CHECK(static_cast<std::size_t>(std::distance(fs::directory_iterator(dir / "d"), fs::directory_iterator())) == files);
  require_ok(densify(quick_run(dir / "c.ply", {"--depth-maps", depth, "--depth-format", "pfm", "--force"})));
  CHECK(std::distance(fs::directory_iterator(dir / "d"), fs::directory_iterator()) ==
        1 + 3 * 5);  // old ones are removed
}

TEST_CASE("datasets contain the depth maps of the run for readers of transforms.json", "[outputs]") {
  const TempDir dir;
  const std::string work = (dir / "work").string(), depth = (dir / "d").string();
  const Words wanted{"--dataset-depth", "png,exr", "--scale", "3"};
  const Words targets{"-o", (dir / "c.colmap").string(), "-o", (dir / "n.nerfstudio").string()};
  require_ok(densify(quick(joined(joined(targets, wanted), {"--depth-maps", depth, "--depth-format", "exr"}))));
  const auto index = nlohmann::json::parse(read_text(dir / "d/index.json"));
  const double lens = index["lens_distance"].get<double>();
  const auto json = nlohmann::json::parse(read_text(dir / "n.nerfstudio/transforms.json"));
  CHECK(json["depth_unit_scale_factor"] == 0.001);  // nerfstudio's default, since the cloud is in metres
  REQUIRE(json["frames"].size() == 5);
  std::size_t with_depth = 0;
  for (const auto& map : index["maps"]) {
    const auto& frame = json["frames"][map["keyframe_id"].get<std::size_t>()];
    const Image<float> expected = read_exr_depth(dir / "d" / map["exr"].get<std::string>());
    const fs::path png = dir / "n.nerfstudio" / frame["depth_file_path"].get<std::string>();
    const Image<float> millimetres = read_png16(png, 0.001);
    const Image<float> exr = read_exr_depth(dir / "n.nerfstudio" / frame["exr_file_path"].get<std::string>());
    REQUIRE(exr.width() == expected.width());
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < exr.size(); ++i) {
      const float from = 3.0F * expected.pixels()[i], to = exr.pixels()[i];
      wrong += (to > 0.0F) != (from > 0.0F) || std::abs(to - from) > 1.5 * std::abs(lens) + 1e-5;
      wrong += std::abs(millimetres.pixels()[i] - to) > 0.00051F;
      with_depth += to > 0.0F;
    }
    CHECK(wrong == 0);
    CHECK(read_text(png) == read_text(dir / "c.colmap" / frame["depth_file_path"].get<std::string>()));
  }
  CHECK(with_depth > 1000);

  const Words kept{"--workspace", work};
  require_ok(densify(quick(joined(kept, {"-o", (dir / "w.ply").string(), "--scale", "3"}))));
  require_ok(densify(quick(joined(joined(kept, wanted), {"-o", (dir / "w.nerfstudio").string()}))));
  CHECK((all_bytes(dir / "w.nerfstudio") == all_bytes(dir / "n.nerfstudio")));

  const Result none = densify(quick(joined({"-o", (dir / "x.ply").string()}, wanted)));
  CHECK(none.code == 2);
  CHECK_THAT(none.err, Contains("--dataset-depth") && Contains(".nerfstudio") && Contains("--depth-maps"));
  const Result pfm = densify(quick(joined(targets, {"--dataset-depth", "pfm"})));
  CHECK(pfm.code == 2);
  CHECK_THAT(pfm.err, Contains("expected exr or png"));
}

TEST_CASE("datasets contain the masks under the names that their readers expect", "[outputs]") {
  const TempDir dir;
  fs::create_directory(dir / "masks");
  fs::copy(mission() / "mask.png", dir / "masks/000001.png.png");  // the others are unmasked
  const Words targets{"-o", (dir / "c.colmap").string(), "-o", (dir / "n.nerfstudio").string(), "--force"};
  require_ok(densify(quick(joined(targets, {"--mask", (dir / "masks").string()}))));
  const auto json = nlohmann::json::parse(read_text(dir / "n.nerfstudio/transforms.json"));
  const cv::Mat given = cv::imread((mission() / "mask.png").string(), cv::IMREAD_GRAYSCALE);
  for (int i = 0; i < 5; ++i) {
    const std::string image = "00000" + std::to_string(i) + ".png", name = image + ".png";
    CAPTURE(image);
    const cv::Mat mask = cv::imread((dir / "c.colmap/masks" / name).string(), cv::IMREAD_UNCHANGED);
    const cv::Mat pixels = cv::imread((dir / "c.colmap/images" / image).string());
    REQUIRE(mask.type() == CV_8UC1);
    REQUIRE(mask.size() == pixels.size());
    REQUIRE(mask.size() == given.size());
    const cv::Mat expected = i == 1 ? given != 0 : cv::Mat(mask.size(), CV_8UC1, cv::Scalar(255));
    CHECK(cv::countNonZero(mask != expected) == 0);
    CHECK(json["frames"][static_cast<std::size_t>(i)]["mask_path"] == "masks/" + name);
    CHECK(read_text(dir / "n.nerfstudio/masks" / name) == read_text(dir / "c.colmap/masks" / name));
  }
  require_ok(densify(quick(targets)));  // without a mask the old one is removed
  CHECK_FALSE(fs::exists(dir / "c.colmap/masks"));
  CHECK_FALSE(fs::exists(dir / "n.nerfstudio/masks"));
  CHECK_FALSE(
      nlohmann::json::parse(read_text(dir / "n.nerfstudio/transforms.json"))["frames"][0].contains("mask_path"));
}

TEST_CASE("images rotated by EXIF data are upright in a dataset", "[outputs]") {
  const TempDir dir;
  fs::copy(mission() / "images", dir / "images");
  // The eXIf chunk of a TIFF block that says: orientation 3, upside down.
  const std::string tiff("II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x03\0\0\0\0\0\0\0", 26);
  const std::string chunk = "eXIf" + tiff;
  std::uint32_t crc = 0xffffffffU;
  for (const char c : chunk) {
    crc ^= static_cast<unsigned char>(c);
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 1U) != 0 ? 0xedb88320U ^ crc >> 1U : crc >> 1U;
  }
  const auto big = [](std::uint32_t value) {
    std::string bytes;
    for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> static_cast<unsigned>(shift));
    return bytes;
  };
  const fs::path turned = dir / "images/000002.png";
  const cv::Mat upright = cv::imread(turned.string());
  cv::Mat upside_down;
  cv::rotate(upright, upside_down, cv::ROTATE_180);
  cv::imwrite(turned.string(), upside_down);
  const std::string png = read_text(turned);
  write_text(turned, png.substr(0, 33) + big(26) + chunk + big(crc ^ 0xffffffffU) + png.substr(33));
  Words words = quick({"-o", (dir / "c.colmap").string(), "-o", (dir / "c.ply").string()});
  *(std::find(words.begin(), words.end(), "--images") + 1) = (dir / "images").string();
  require_ok(densify(words));
  const cv::Mat written =
      cv::imread((dir / "c.colmap/images/000002.jpg").string(), cv::IMREAD_IGNORE_ORIENTATION | cv::IMREAD_COLOR);
  REQUIRE(written.size() == upright.size());
  CHECK(cv::norm(written, upright, cv::NORM_L1) / static_cast<double>(3 * upright.total()) < 4.0);
  require_ok(densify(quick({"-o", (dir / "plain.ply").string()})));
  CHECK((read_text(dir / "plain.ply") == read_text(dir / "c.ply")));
}
