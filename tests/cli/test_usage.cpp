// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>

#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "pmsp/io/plan_io.h"

using namespace pmsp;
using namespace pmsp_test;
using Catch::Contains;

TEST_CASE("help and version go to standard output") {
  for (const char* flag : {"--help", "-h"}) {
    const Result help = densify({flag});
    CHECK(help.code == 0);
    CHECK(help.err.empty());
    for (const char* word :
         {"run", "info", "config", "Examples:", "--images", "--patchmatch-iterations", "Exit codes", "143"}) {
      CHECK_THAT(help.out, Contains(word));
    }
  }
  CHECK_THAT(densify({"info", "--help"}).out, Contains("--json"));
  CHECK_THAT(densify({"merge", "--help"}).out, Contains("WORKSPACE") && Contains("--output"));
  const Result version = densify({"--version"});
  CHECK(version.code == 0);
  CHECK_THAT(version.out, Contains("pmsp-densify ") && Contains("SIMD") && Contains("cpu"));
}

TEST_CASE("usage errors give 2 and name what is wrong") {
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases{
      {{}, "MAP"},
      {{"run"}, "MAP"},
      {{"info"}, "MAP"},
      {{"m.msg"}, "--images"},
      {{"run", "m.msg", "--images", "a", "--video", "b"}, "--video"},
      {{"m.msg", "--images", "a", "--patchmatch-iteration", "3"}, "--patchmatch-iterations"},
      {{"m.msg", "--images", "a", "--no-median-enable"}, "--no-median-enabled"},
      {{"m.msg", "--images", "a", "--median-enabled=maybe"}, "--median-enabled"},
      {{"m.msg", "--images", "a", "n.msg"}, "n.msg"},
      {{"m.msg", "--images"}, "--images"},
      {{"m.msg", "--images", "a", "--fusion-window", "32"},
       "--fusion-window is 32; expected a whole number from 1 to 31"},
      {{"m.msg", "--images", "a", "--fusion-window", "nan"}, "--fusion-window"},
      {{"m.msg", "--images", "a", "--view-filter-min-share", "nan"}, "--view-filter-min-share"},
      {{"m.msg", "--images", "a", "--seed", "-1"}, "--seed"},
      {{"m.msg", "--images", "a", "--width", "333"}, "even"},
      {{"m.msg", "--images", "a", "--simd", "mmx"}, "--simd"},
      {{"m.msg", "--images", "a", "--quality", "best"}, "best"},
      {{"m.msg", "--images", "a", "--progress", "loud"}, "--progress"},
      {{"m.msg", "--images", "a", "--backend", "opencl"}, "--backend"},
      {{"m.msg", "--images", "a", "--fps", "-3"}, "--fps is \"-3\"; expected"},
      {{"m.msg", "--images", "a", "--fps", "fast"}, "--fps is \"fast\"; expected"},
      {{"m.msg", "--images", "a", "--frame-offset", "1e3"}, "--frame-offset is \"1e3\"; expected a whole number"},
      {{"m.msg", "--images", "a", "--free-space-history", "100001"}, "a whole number from 1 to 100000 "},
      {{"m.msg", "--images", "a", "--depth-maps", "d", "--raw-depth-maps", "./d/"}, "--raw-depth-maps"},
      {{"m.msg", "--images", "a", "-o", "c.ply", "--stats", "./c.ply"}, "--output c.ply and --stats ./c.ply"},
      {{"m.msg", "--images", "a", "-o", "c", "--preview", "c"}, "--output c and --preview c"},
      {{"m.msg", "--images", "a", "-o", "c", "--depth-maps", "c/d"}, "--output c and --depth-maps c/d"},
      {{"m.msg", "--images", "a", "--stats", "d/index.json", "--depth-maps", "d"}, "--stats d/index.json and"},
      {{"m.msg", "--images", "a", "-o", "look/cloud_above.png", "--preview", "look"}, "and --preview look"},
      {{"m.msg", "--images", "a", "--preview", "./a"}, "--preview ./a is the folder of the images"},
  };
  for (const auto& [arguments, word] : cases) {
    const Result result = densify(arguments);
    INFO(word << " -> " << result.err);
    CHECK(result.code == 2);
    CHECK(result.out.empty());
    CHECK_THAT(result.err, Contains(word));
  }
}

TEST_CASE("a backend that is not built gives 4 and says what to do") {
  const TempDir dir;
  const Result result = densify(quick_run(dir / "c.ply", {"--backend", "cuda"}));
  CHECK(result.code == 4);
  CHECK_THAT(result.err, Contains("cuda") && Contains("backend cpu"));
}

TEST_CASE("input that cannot be used gives 3 and names the file") {
  const TempDir dir;
  const std::string map = (mission() / "map.msg").string();
  const std::string images = (mission() / "images").string();
  const std::string out = (dir / "c.ply").string();
  write_text(dir / "rubbish", "rubbish");
  const std::string rubbish = (dir / "rubbish").string();
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases{
      {{"no.msg", "--images", images, "-o", out}, "no.msg"},
      {{rubbish, "--images", images, "-o", out}, "rubbish"},
      {{map, "--images", "no-folder", "-o", out}, "no-folder"},
      {{map, "--images", dir.path().string(), "-o", out}, dir.path().string()},
      {{map, "--video", "no.mp4", "-o", out}, "no.mp4"},
      {{map, "--images", images, "--mask", "no.png", "-o", out}, "no.png"},
      {{map, "--images", images, "--mask", rubbish, "-o", out}, "rubbish"},
      {{map, "--images", images, "--config", "no.json", "-o", out}, "no.json: cannot be read: there is no such file"},
      {{map, "--images", images, "--config", images, "-o", out}, "it is a folder"},
      {{"info", "no.msg"}, "no.msg"},
      {{"info", map, "--images", "no-folder"}, "no-folder"},
  };
  for (const auto& [arguments, word] : cases) {
    const Result result = densify(arguments);
    INFO(word << " -> " << result.err);
    CHECK(result.code == 3);
    CHECK_THAT(result.err, Contains(word));
  }
  CHECK(dir.entries() == 1);
}

TEST_CASE("outputs that exist are refused before any work, with 6") {
  const TempDir dir;
  write_text(dir / "old", "old");
  std::filesystem::create_directory(dir / "full");
  write_text(dir / "full/file", "old");
  const std::string old = (dir / "old").string();
  const std::vector<std::vector<std::string>> cases{
      {"-o", old},
      {"-o", (dir / "c.ply").string(), "--stats", old},
      {"-o", (dir / "c.ply").string(), "--preview", (dir / "full").string()},
      {"-o", (dir / "c.ply").string(), "--depth-maps", (dir / "full").string()}};
  for (std::vector<std::string> arguments : cases) {
    arguments.insert(arguments.begin(), {"no-such-map", "--images", "no-such-folder"});
    const Result result = densify(arguments);
    INFO(result.err);
    CHECK(result.code == 6);
    CHECK_THAT(result.err, Contains("--force") && Contains(arguments.back()));
  }
  CHECK(read_text(dir / "old") == "old");
  const Result folder = densify(quick_run(dir / "no/such/folder/c.ply"));
  CHECK(folder.code == 6);
  CHECK_THAT(folder.err, Contains("no/such/folder"));
}

TEST_CASE("outputs that get along may share a folder") {
  const TempDir dir;
  const std::string folder = (dir / "out").string();
  std::filesystem::create_directory(folder);
  const Result result = densify(quick_run(folder + "/c.ply", {"--force", "--stats", folder + "/s.json", "--depth-maps",
                                                              folder, "--preview", folder + "/"}));
  INFO(result.err);
  CHECK(result.code == 0);
  for (const char* name : {"c.ply", "s.json", "index.json", "cloud_above.png"}) {
    CHECK(std::filesystem::exists(std::filesystem::path(folder) / name));
  }
}

TEST_CASE("inputs are never overwritten, even with --force") {
  const TempDir dir;
  std::filesystem::copy(mission() / "map.msg", dir / "map.msg");
  const std::string map = (dir / "map.msg").string();
  const Result result = densify({map, "--images", (mission() / "images").string(), "--force", "-o", map});
  CHECK(result.code == 2);
  CHECK(read_text(map) == read_text(mission() / "map.msg"));
}

TEST_CASE("info tells what is in a map and which images belong to it") {
  const TempDir dir;
  std::filesystem::copy(mission() / "images", dir / "images");
  std::filesystem::remove(dir / "images/000003.png");
  const std::string map = (mission() / "map.msg").string();
  const std::string images = (dir / "images").string();
  const Result people = densify({"info", map, "--images", images});
  CHECK(people.code == 0);
  CHECK_THAT(people.out, Contains("256 x 128") && Contains("stella_vslam") && Contains("4 of 5 keyframes"));
  CHECK_THAT(people.out, Contains("keyframe 3:"));

  const Result machine = densify({"info", map, "--images", images, "--json"});
  CHECK(machine.code == 0);
  const auto json = nlohmann::json::parse(machine.out);
  CHECK(json["cameras"][0]["width"] == 256);
  CHECK(json["keyframes"] == 5);
  CHECK(json["trajectory"]["last_timestamp"].get<double>() == Approx(0.4));
  CHECK(json["trajectory"]["path_length"].get<double>() ==
        Approx(4.0 * json["trajectory"]["keyframe_distance"]["median"].get<double>()).epsilon(0.05));
  CHECK(json["landmarks"]["count"] == 1500);
  CHECK(json["landmarks"]["depth"]["p2"].get<double>() > 0.2);
  CHECK(json["landmarks"]["depth"]["p98"].get<double>() < 8.0);
  CHECK(json["images"]["found"] == 4);
  REQUIRE(json["images"]["missing"].size() == 1);
  CHECK(json["images"]["missing"][0]["keyframe_id"] == 3);
  CHECK_FALSE(nlohmann::json::parse(densify({"info", map, "--json"}).out).contains("images"));
}

TEST_CASE("info writes the plan of a run with the same options") {
  const TempDir dir;
  std::filesystem::copy(mission() / "images", dir / "images");
  write_text(dir / "images/000003.png", "no image");
  const std::string map = (mission() / "map.msg").string();
  const std::string file = (dir / "plan.json").string();
  const Result all = densify({"info", map, "--plan", file, "--view-filter-min-parallax-deg", "0.1"});
  INFO(all.err);
  REQUIRE(all.code == 0);
  CHECK_THAT(all.out, Contains("plan.json, 5 keyframes") && Contains("depth map: 5"));
  const Plan plan = read_plan(file);
  REQUIRE(plan.entries.size() == 5);
  for (const PlanEntry& entry : plan.entries) CHECK(entry.near.size() == 2);

  CHECK(densify({"info", map, "--plan", file}).code == 6);  // exists
  const Result seen = densify({"info", map, "--images", (dir / "images").string(), "--plan", file, "--force", "--json",
                               "--view-filter-min-parallax-deg", "0.1"});
  INFO(seen.err);
  REQUIRE(seen.code == 0);
  const auto json = nlohmann::json::parse(seen.out);
  CHECK(json["plan"]["keyframes"] == 4);
  REQUIRE(json["images"]["missing"].size() == 1);
  CHECK(json["images"]["missing"][0]["keyframe_id"] == 3);
  CHECK(read_plan(file).entries.size() == 4);
  CHECK(densify({"info", map, "--plan", map, "--force"}).code == 2);  // would overwrite the map
}
