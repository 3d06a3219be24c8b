// SPDX-License-Identifier: BSD-2-Clause
#include <chrono>
#include <csignal>
#include <set>
#include <sstream>
#include <thread>

#include <catch2/catch.hpp>

#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "pmsp/io/cloud.h"
#include "pmsp/io/depth.h"
#include "pmsp/io/map.h"
#include "stats.h"

using namespace pmsp;
using namespace pmsp_test;
using Catch::Contains;

TEST_CASE("spilled results lie in the scratch directory and are removed") {
  const TempDir dir;
  const std::vector<std::string> mission_wide = {"--free-space-whole-mission", "--scratch"};
  std::vector<std::string> missing = mission_wide;
  missing.push_back((dir / "missing").string());
  const Result refused = densify(quick_run(dir / "c.ply", missing));
  CHECK(refused.code == 6);
  CHECK_THAT(refused.err, Contains("missing: no scratch file can be made there"));
  CHECK(dir.entries() == 0);
  const TempDir scratch;
  std::vector<std::string> there = mission_wide;
  there.push_back(scratch.path().string());
  CHECK(densify(quick_run(dir / "c.ply", there)).code == 0);
  CHECK(scratch.entries() == 0);
  CHECK(densify(quick_run(dir / "beside.ply", {"--free-space-whole-mission"})).code == 0);
  CHECK(read_text(dir / "beside.ply") == read_text(dir / "c.ply"));
  CHECK(dir.entries() == 2);
}

TEST_CASE("a run writes all requested outputs") {
  const TempDir dir;
  const Result result = densify(quick_run(
      dir / "c.ply", {"--mask", (mission() / "mask.png").string(), "--quality", "online", "--backend", "cpu", "--stats",
                      (dir / "s.json").string(), "--depth-maps", (dir / "depth").string(), "--raw-depth-maps",
                      (dir / "raw").string(), "--preview", (dir / "look").string(), "--double", "--seed", "77"}));
  INFO(result.err);
  REQUIRE(result.code == 0);
  CHECK(result.out.empty());
  CHECK_THAT(result.err, Contains("5/5") && Contains("points:") && Contains("c.ply"));

  const PlyCloud cloud = read_ply(dir / "c.ply");
  CHECK(cloud.positions.size() > 3000);
  CHECK(cloud.normals.size() == cloud.positions.size());
  CHECK(cloud.views.size() == cloud.positions.size());
  CHECK_THAT(read_text(dir / "c.ply").substr(0, 400), Contains("property double x") || Contains("seed 77"));
  std::string comments;
  for (const std::string& comment : cloud.comments) comments += comment + "\n";
  CHECK_THAT(comments, Contains("pmsp-densify") && Contains("seed 77") && Contains("\"width\":128"));

  const auto stats = nlohmann::json::parse(read_text(dir / "s.json"));
  CHECK(stats["points"] == cloud.positions.size());
  CHECK(stats["seed"] == 77);
  CHECK(stats["keyframes"]["added"] == 5);
  CHECK(stats["options"]["width"] == 128);
  CHECK(stats["skipped"].empty());
  CHECK(stats["pixels"]["unmasked"].get<int>() < 5 * 128 * 64);
  CHECK(stats["peak_memory_mib"].get<double>() > 1.0);
  double accounted = 0.0;
  for (const auto& [what, seconds] : stats["critical_path"].items()) accounted += seconds.get<double>();
  CHECK(accounted == Approx(stats["seconds"]["total"].get<double>()).margin(0.01));
  CHECK(stats["critical_path"]["other"].get<double>() < 0.5 * accounted);

  std::size_t pictures = 0;
  for (const auto& entry : std::filesystem::directory_iterator(dir / "look")) {
    CHECK(read_text(entry.path()).substr(0, 4) == "\x89PNG");
    ++pictures;
  }
  CHECK(pictures == 4 + 2);

  const SlamMap map = read_map(mission() / "map.msg");
  for (const char* kind : {"depth", "raw"}) {
    const auto index = nlohmann::json::parse(read_text(dir / kind / "index.json"));
    REQUIRE(index["maps"].size() == 5);
    CHECK_THAT(index["confidence"].get<std::string>(), Contains(kind == std::string("raw") ? "NCC" : "relative error"));
    for (const auto& entry : index["maps"]) {
      const MapKeyframe* keyframe = map.find_keyframe(entry["keyframe_id"].get<std::int64_t>());
      REQUIRE(keyframe != nullptr);
      CHECK(entry["timestamp"].get<double>() == keyframe->timestamp);
      CHECK(entry["cam_from_world"][1][3].get<double>() == keyframe->cam_from_world.translation.y());
      CHECK(entry["cam_from_world"][2][0].get<double>() == keyframe->cam_from_world.rotation(2, 0));
      const auto file = [&](const char* key) { return dir / kind / entry[key].get<std::string>(); };
      const Image<float> depth = read_pfm(file("depth"));
      const Image<float> png = read_png16(file("depth_png"), index["png_scale"].get<double>());
      CHECK(read_pfm3(file("normal")).width() == 128);
      CHECK(read_pfm(file("confidence")).height() == 64);
      REQUIRE(png.size() == depth.size());
      int wrong = 0;
      for (std::size_t i = 0; i < depth.size(); ++i) {
        wrong += std::abs(png.pixels()[i] - depth.pixels()[i]) > 0.51F * index["png_scale"].get<float>() ? 1 : 0;
      }
      CHECK(wrong == 0);
    }
  }
}

TEST_CASE("the default verb and --force replace an old cloud") {
  const TempDir dir;
  write_text(dir / "c.ply", "old");
  std::vector<std::string> words = quick_run(dir / "c.ply", {"--force", "-q"});
  words.erase(words.begin());
  const Result result = densify(words);
  CHECK(result.code == 0);
  CHECK(result.err.empty());
  CHECK(read_ply(dir / "c.ply").positions.size() > 3000);
  CHECK(dir.entries() == 1);
}

TEST_CASE("the bytes depend on the seed but not on the number of threads") {
  const TempDir dir;
  REQUIRE(densify(quick_run(dir / "1.ply", {"--threads", "1"})).code == 0);
  REQUIRE(densify(quick_run(dir / "2.ply", {"--threads", "2"})).code == 0);
  REQUIRE(densify(quick_run(dir / "s.ply", {"--seed", "2"})).code == 0);
  const std::string one = read_text(dir / "1.ply");
  CHECK(one == read_text(dir / "2.ply"));
  CHECK(one != read_text(dir / "s.ply"));
}

TEST_CASE("masks are one image or one per image or a cap at the nadir") {
  const TempDir dir;
  const std::string one = (mission() / "mask.png").string();
  std::filesystem::create_directory(dir / "masks");
  for (int i = 0; i < 5; ++i) {
    std::filesystem::copy(one, dir / "masks" / ("00000" + std::to_string(i) + ".png.png"));
  }
  REQUIRE(densify(quick_run(dir / "one.ply", {"--mask", one})).code == 0);
  const Result each = densify(quick_run(dir / "each.ply", {"--mask", (dir / "masks").string()}));
  INFO(each.err);
  REQUIRE(each.code == 0);
  CHECK_THAT(each.err, Contains("5 of 5 images have one"));
  REQUIRE(densify(quick_run(dir / "nadir.ply", {"--mask-nadir", "20"})).code == 0);
  REQUIRE(densify(quick_run(dir / "none.ply", {})).code == 0);
  const bool each_as_one = read_text(dir / "each.ply") == read_text(dir / "one.ply");
  CHECK(each_as_one);
  const bool nadir_matters = read_text(dir / "nadir.ply") != read_text(dir / "none.ply");
  CHECK(nadir_matters);
  const bool one_matters = read_text(dir / "one.ply") != read_text(dir / "none.ply");
  CHECK(one_matters);
  CHECK(densify(quick_run(dir / "c.ply", {"--mask", (mission() / "images" / "000000.png").string()})).code == 3);
  CHECK(densify(quick_run(dir / "c.ply", {"--mask-nadir", "100"})).code == 2);
}

TEST_CASE("images of other keyframes are refused unless the check is disabled") {
  const TempDir dir;
  std::filesystem::create_directory(dir / "images");
  const int shuffled[] = {3, 0, 4, 2, 1};  // no constant offset, which would be detected and compensated
  for (int i = 0; i < 5; ++i) {
    const auto name = [](int n) { return "00000" + std::to_string(n) + ".png"; };
    std::filesystem::copy(mission() / "images" / name(i), dir / "images" / name(shuffled[i]));
  }
  std::vector<std::string> words = quick_run(dir / "c.ply");
  words[3] = (dir / "images").string();
  const Result refused = densify(words);
  INFO(refused.err);
  CHECK(refused.code == 3);
  CHECK_THAT(refused.err, Contains("--no-verify"));
  CHECK(dir.entries() == 1);
  words.push_back("--no-verify");
  const int code = densify(words).code;
  CHECK((code == 0 || code == 5));
}

TEST_CASE("an empty result exits with 5 and names the stage and an option and writes no file") {
  const TempDir dir;
  const std::vector<std::pair<std::vector<std::string>, std::vector<std::string>>> cases{
      {{"--view-filter-min-parallax-deg", "170", "--view-filter-max-parallax-deg", "180"},
       {"view filter", "--view-filter-"}},
      {{"--median-enabled", "--median-min-score", "1", "--no-patchmatch-plane-priors"},
       {"median filter", "--median-min-score"}},
      {{"--fusion-min-confidence", "1"}, {"fusion", "--fusion-min-confidence"}},
  };
  for (const auto& [arguments, expected] : cases) {
    std::vector<std::string> more = arguments;
    more.insert(more.end(), {"--force", "--stats", (dir / "s.json").string()});
    const Result result = densify(quick_run(dir / "c.ply", more));
    INFO(result.err);
    CHECK(result.code == 5);
    for (const std::string& word : expected) CHECK_THAT(result.err, Contains(word));
    CHECK_FALSE(std::filesystem::exists(dir / "c.ply"));
    CHECK_FALSE(nlohmann::json::parse(read_text(dir / "s.json"))["empty"].get<std::string>().empty());
  }
}

TEST_CASE("each stage that may lose all points is named with an existing option") {
  DensifierStats stats;
  const std::string help = densify({"run", "--help-all"}).out;
  const auto check = [&](const std::string& stage) {
    const std::string text = tool::explain_empty(stats);
    INFO(text);
    CHECK_THAT(text, Contains(stage));
    const std::size_t dashes = text.find("--");
    REQUIRE(dashes != std::string::npos);
    CHECK_THAT(help, Contains(text.substr(dashes, text.find_first_of(" ,", dashes) - dashes) + " "));
  };
  check("no keyframe has an image");
  stats.keyframes_added = 9;
  stats.keyframes_accepted = 1;
  stats.keyframes_without_neighbour = 1;
  check("source view");
  stats.keyframes_without_range = 1;
  CHECK_THAT(tool::explain_empty(stats), Contains("no landmarks") && Contains("pmsp-densify info"));
  stats.depth_maps = 1;
  check("mask");
  stats.pixels = 10;
  check("PatchMatch");
  stats.pixels_matched = 9;
  check("median");
  stats.pixels_after_median = 8;
  check("consistency");
  stats.pixels_after_consistency = 7;
  check("fusion");
  stats.points_fused = 6;
  check("free-space filter");
}

TEST_CASE("the summary and the statistics name keyframes without a depth map") {
  tool::RunReport report;
  report.stats.keyframes_added = report.stats.keyframes_accepted = 9;
  report.stats.depth_maps = 9;
  CHECK_THAT(tool::summary(report), !Contains("without"));
  report.stats.depth_maps = 6;
  report.stats.keyframes_without_neighbour = 1;
  report.stats.keyframes_without_range = 2;
  CHECK_THAT(tool::summary(report), Contains("6 depth maps, 1 without one (no source view), "
                                             "2 without one (too few landmarks for a depth range)\n"));
  const auto keyframes = tool::to_json(report)["keyframes"];
  CHECK(keyframes["without_neighbour"] == 1);
  CHECK(keyframes["without_range"] == 2);
}

TEST_CASE("progress for programs is JSON lines on standard output") {
  const TempDir dir;
  const Result result = densify(quick_run(dir / "c.ply", {"--progress", "json"}));
  REQUIRE(result.code == 0);
  CHECK(result.err.empty());
  std::istringstream lines(result.out);
  std::string line;
  int keyframes = 0;
  nlohmann::json last;
  while (std::getline(lines, line)) {
    last = nlohmann::json::parse(line);
    if (last["event"] != "keyframe") continue;
    ++keyframes;
    CHECK(last["index"] == keyframes);
    CHECK(last["count"] == 5);
  }
  CHECK(keyframes == 5);
  CHECK(last["event"] == "done");
  CHECK(last["points"] == read_ply(dir / "c.ply").positions.size());
}

TEST_CASE("a forced run removes only depth maps and pictures of an earlier run") {
  const TempDir dir;
  for (const char* folder : {"depth", "look"}) {
    std::filesystem::create_directory(dir / folder);
    for (const char* name : {"depth_000077.pfm", "depth_000077.png", "normal_000077.pfm", "confidence_1234567.pfm",
                             "keyframe_000077.png", "depth_77.pfm", "depth_000077_mine.pfm", "notes.txt"}) {
      write_text(dir / folder / name, "old");
    }
  }
  REQUIRE(densify(quick_run(dir / "c.ply", {"--force", "--depth-maps", (dir / "depth").string(), "--preview",
                                            (dir / "look").string()}))
              .code == 0);
  const auto entries = [&](const char* folder) {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(dir / folder)) names.insert(entry.path().filename());
    return names;
  };
  const std::set<std::string> depth = entries("depth");
  for (const char* own : {"depth_000077.pfm", "depth_000077.png", "normal_000077.pfm", "confidence_1234567.pfm"}) {
    INFO(own);
    CHECK(depth.count(own) == 0);
  }
  CHECK(depth.size() == 4 + 5 * 4 + 1);  // the foreign file, five keyframes, the index
  const std::set<std::string> look = entries("look");
  CHECK(look.count("keyframe_000077.png") == 0);
  CHECK(look.size() == 7 + 4 + 2);
}

TEST_CASE("SIGTERM ends a run with 143") {
  const TempDir dir;
  Command command(densify_words(quick_run(dir / "c.ply", {"--width", "2048", "--height", "1024",
                                                          "--patchmatch-iterations", "100", "--progress", "plain"})));
  for (int i = 0; i < 600 && command.err_so_far().find("keyframe 1/5") == std::string::npos; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  kill(command.pid(), SIGTERM);
  CHECK(command.wait().code == 143);
  CHECK(dir.entries() == 0);
}

TEST_CASE("SIGINT ends a run with 130 and keeps only the old cloud") {
  const TempDir dir;
  write_text(dir / "c.ply", "old");
  Command command(densify_words(quick_run(dir / "c.ply", {"--force", "--width", "2048", "--height", "1024",
                                                          "--patchmatch-iterations", "100", "--progress", "plain"})));
  for (int i = 0; i < 600 && command.err_so_far().find("keyframe 2/5") == std::string::npos; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  REQUIRE_THAT(command.err_so_far(), Contains("keyframe 2/5"));
  kill(command.pid(), SIGINT);
  const Result result = command.wait();
  INFO(result.err);
  CHECK(result.code == 130);
  CHECK_THAT(result.err, Contains("interrupted"));
  CHECK(read_text(dir / "c.ply") == "old");
  CHECK(dir.entries() == 1);
}

TEST_CASE("a second SIGINT ends a run at once") {
  const TempDir dir;
  Command command(
      densify_words(quick_run(dir / "c.ply", {"--width", "4096", "--height", "2048", "--patchmatch-iterations", "100",
                                              "--patchmatch-refinements", "32", "--progress", "plain"})));
  for (int i = 0; i < 600 && command.err_so_far().find("keyframe 2/5") == std::string::npos; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  kill(command.pid(), SIGINT);
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  kill(command.pid(), SIGINT);
  CHECK(command.wait().code == 130);
  CHECK_FALSE(std::filesystem::exists(dir / "c.ply"));
}
