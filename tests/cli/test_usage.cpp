// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "cost.h"
#include "estimates.h"
#include "exit_code.h"
#include "io/plan_io.h"

using namespace pmsp;
using namespace pmsp_test;
using Catch::Contains;

TEST_CASE("help and version go to standard output") {
  for (const char* flag : {"--help", "-h"}) {
    const Result help = densify({flag});
    CHECK(help.code == 0);
    CHECK(help.err.empty());
    for (const char* word : {"run", "info", "config", "Usage:", "--images", "--help-all", "Exit codes"}) {
      CHECK_THAT(help.out, Contains(word));
    }
    CHECK_THAT(help.out, !Contains("--patchmatch-iterations"));
    std::istringstream lines(help.out);
    std::size_t count = 0;
    for (std::string line; std::getline(lines, line); ++count) CHECK(line.size() <= 100);
    CHECK(count <= 40);
  }
  CHECK(densify({"run", "--help"}).out == densify({"--help"}).out);
  const std::string all = densify({"--help-all"}).out;
  CHECK_THAT(all, Contains("--patchmatch-iterations"));
  std::istringstream lines(all);
  for (std::string line; std::getline(lines, line);) CHECK(line.size() <= 100);
  CHECK_THAT(densify({"info", "--help"}).out, Contains("--json"));
  CHECK_THAT(densify({"merge", "--help"}).out, Contains("WORKSPACE") && Contains("--output"));
  const Result version = densify({"--version"});
  CHECK(version.code == 0);
  CHECK_THAT(
      version.out,
      Catch::Matches(
          "pmsp-densify [0-9.]+ \\((commit [0-9a-f]+\\+?; )?[A-Z][a-zA-Z]+; backends: cpu(, cuda)?; SIMD: .*\\)\n"));
}

TEST_CASE("a mistyped verb or option is suggested up to two letters off") {
  const auto error = [](const std::vector<std::string>& words) {
    const Result result = densify(words);
    CHECK(result.code == 2);
    return result.err;
  };
  CHECK_THAT(error({"reprot", "c.ply"}), Contains("did you mean report?"));
  CHECK_THAT(error({"bach", "m.jsonl"}), Contains("did you mean batch?"));
  CHECK_THAT(error({"m.msg", "--images", "a", "--qualty", "high"}), Contains("did you mean --quality?"));
  CHECK_THAT(error({"m.msg", "--images", "a", "--photogrammetry"}),
             !Contains("did you mean") && Contains("--help-all"));
}

TEST_CASE("usage errors exit with 2 and name the cause") {
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases{
      {{}, "MAP"},
      {{"run"}, "MAP"},
      {{"info"}, "MAP"},
      {{(mission() / "map.msg").string()}, "--images"},
      {{"m.msg", "--component", "-1"}, "--component is \"-1\"; expected"},
      {{"run", "m.msg", "--images", "a", "--video", "b"}, "--video"},
      {{"m.msg", "--images", "a", "--patchmatch-iteration", "3"}, "--patchmatch-iterations"},
      {{"m.msg", "--images", "a", "--no-median-enable"}, "--no-median-enabled"},
      {{"m.msg", "--images", "a", "--median-enabled=maybe"}, "--median-enabled"},
      {{"m.msg", "--images", "a", "n.msg"}, "n.msg"},
      {{"m.msg", "--images"}, "--images"},
      {{"m.msg", "--images", "a", "--fusion-window", "32"},
       "--fusion-window is 32; expected an odd number from 1 to 31"},
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
      {{"m.msg", "--images", "a", "-o", "look/cloud_above.png", "--format", "ply", "--preview", "look"},
       "and --preview look"},
      {{"m.msg", "--images", "a", "-o", "c.laz"}, "no format has the extension .laz; expected --format"},
      {{"m.msg", "--images", "a", "-o", "c.ply", "-o", "./c.ply"}, "--output c.ply and --output ./c.ply"},
      {{"m.msg", "--images", "a", "-o", "c.ply", "--format", "e57"},
       "--format is \"e57\"; expected one of ply, splat, las"},
      {{"m.msg", "--images", "a", "-o", "c.ply", "--format", "ply", "--format", "las"}, "--format is given 2 and -o 1"},
      {{"m.msg", "--images", "a", "--crop", "1,2,3,0,4,5"}, "--crop is \"1,2,3,0,4,5\"; expected two"},
      {{"m.msg", "--images", "a", "--crop", "1,2,3,4,5,6,7"}, "--crop is"},
      {{"m.msg", "--images", "a", "--voxel", "0"}, "--voxel is \"0\"; expected a number > 0"},
      {{"m.msg", "--images", "a", "--max-points", "1e6"}, "--max-points is \"1e6\"; expected a whole number"},
      {{"m.msg", "--images", "a", "--scale", "-1"}, "--scale is \"-1\""},
      {{"m.msg", "--images", "a", "--date", "2026-02-29"}, "--date is \"2026-02-29\"; expected a day"},
      {{"m.msg", "--images", "a", "--depth-format", "pfm,tiff"}, "--depth-format is \"pfm,tiff\"; expected"},
      {{"m.msg", "--images", "a", "--align", "t.txt", "--up"}, "--align and --up exclude each other"},
      {{"m.msg", "--images", "a", "--preview", "./a"}, "--preview ./a is the directory of the images"},
  };
  for (const auto& [arguments, word] : cases) {
    const Result result = densify(arguments);
    INFO(word << " -> " << result.err);
    CHECK(result.code == 2);
    CHECK(result.out.empty());
    CHECK_THAT(result.err, Contains(word));
  }
}

TEST_CASE("each kind of error has the documented exit code") {
  CHECK(tool::exit_code_of(std::runtime_error("")) == 1);
  CHECK(tool::exit_code_of(tool::UsageError("")) == 2);
  CHECK(tool::exit_code_of(InvalidOption("")) == 2);
  CHECK(tool::exit_code_of(InvalidInput("")) == 3);
  CHECK(tool::exit_code_of(IoError("")) == 3);
  CHECK(tool::exit_code_of(BackendUnavailable("")) == 4);
  CHECK(tool::exit_code_of(DeviceError("")) == 4);
  CHECK(tool::exit_code_of(tool::EmptyResult("")) == 5);
  CHECK(tool::exit_code_of(OutputError("")) == 6);
  CHECK(tool::exit_code_of(tool::Interrupted(15)) == 143);
}

TEST_CASE("a backend that is not built exits with 4 and names the remedy") {
  const TempDir dir;
  const Result result = densify(quick_run(dir / "c.ply", {"--backend", "cuda"}));
  CHECK(result.code == 4);
  CHECK_THAT(result.err, Contains("cuda") && Contains("backend cpu"));
}

TEST_CASE("unusable input exits with 3 and names the file") {
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
      {{map, "--images", images, "--config", images, "-o", out}, "it is a directory"},
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

TEST_CASE("existing outputs are refused before any work with exit code 6") {
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

TEST_CASE("compatible outputs may share a directory") {
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

TEST_CASE("inputs are never overwritten even with --force") {
  const TempDir dir;
  std::filesystem::copy(mission() / "map.msg", dir / "map.msg");
  const std::string map = (dir / "map.msg").string();
  const Result result = densify({map, "--images", (mission() / "images").string(), "--force", "-o", map});
  CHECK(result.code == 2);
  CHECK(read_text(map) == read_text(mission() / "map.msg"));
}

TEST_CASE("info reports the content of a map and its images") {
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

TEST_CASE("info before a command refuses the same input as the run with its exit code") {
  const TempDir dir;
  write_text(dir / "old.ply", "old");
  const std::string map = (mission() / "map.msg").string();
  const std::string images = (mission() / "images").string();
  std::filesystem::create_directory(dir / "shifted");
  for (int i = 0; i < 5; ++i) {
    const std::string from = "00000" + std::to_string(i) + ".png";
    const std::string to = "00000" + std::to_string(4 - i) + ".png";
    std::filesystem::copy(mission() / "images" / from, dir / "shifted" / to);
  }
  const std::vector<std::vector<std::string>> commands{
      {map, "--images", images, "-o", (dir / "old.ply").string()},
      {map, "--images", images, "--mask", "no.png", "-o", (dir / "c.ply").string()},
      {map, "--images", images, "--align", "no.txt", "-o", (dir / "c.ply").string()},
      {map, "--images", images, "--prior-depth", "no-folder", "-o", (dir / "c.ply").string()},
      {map, "--images", images, "--backend", "cuda", "--device", "97", "-o", (dir / "c.ply").string()},
      {map, "--images", (dir / "shifted").string(), "-o", (dir / "c.ply").string()},
      {map, "--images", images, "--video", images},
      {map, "--images", images, "--fusion-window", "32"},
  };
  for (const std::vector<std::string>& command : commands) {
    const Result run = densify(command);
    std::vector<std::string> words = command;
    words.insert(words.begin(), "info");
    const Result info = densify(words);
    INFO(run.err << info.err);
    CHECK(run.code > 1);
    CHECK(info.code == run.code);
    const std::string last = run.err.substr(run.err.rfind("pmsp-densify: "));
    CHECK_THAT(info.err, Contains(last));
  }
  CHECK(densify({"info", "run", map, "--images", images, "-o", (dir / "c.ply").string(), "--stats",
                 (dir / "s.json").string(), "--up"})
            .code == 0);
  CHECK(dir.entries() == 2);
}

TEST_CASE("info writes the plan of a run with the same options") {
  const TempDir dir;
  std::filesystem::copy(mission() / "images", dir / "images");
  write_text(dir / "images/000003.png", "no image");
  const std::string map = (mission() / "map.msg").string();
  const std::string file = (dir / "plan.json").string();
  const Result all =
      densify({"info", map, "--quality", "online", "--plan", file, "--view-filter-min-parallax-deg", "0.1"});
  INFO(all.err);
  REQUIRE(all.code == 0);
  CHECK_THAT(all.out, Contains("plan.json, 5 keyframes") && Contains("depth map: 5"));
  const Plan plan = plan_from_json(read_text(file));
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
  CHECK(plan_from_json(read_text(file)).entries.size() == 4);
  CHECK(densify({"info", map, "--plan", map, "--force"}).code == 2);  // would overwrite the map
}

namespace {

nlohmann::json budget_of(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "info");
  arguments.push_back("--json");
  const Result result = densify(arguments);
  INFO(result.err);
  REQUIRE(result.code == 0);
  return nlohmann::json::parse(result.out).at("budget");
}

}  // namespace

TEST_CASE("info predicts memory and disk space and points of a run") {
  const std::string map = (mission() / "map.msg").string();
  const std::string images = (mission() / "images").string();
  const Result people = densify({"info", map, "--images", images, "--quality", "normal"});
  CHECK(people.code == 0);
  for (const char* word : {"a run:", "1440 x 720", "disk:", "temporary data", "CPU:", "CPU time", "GPU:", "H200"}) {
    CHECK_THAT(people.out, Contains(word));
  }
  const nlohmann::json online = budget_of({map, "--images", images, "--quality", "online"});
  CHECK(online["width"] == 640);
  CHECK(online["keyframes"] == 5);
  CHECK(online["scratch_bytes"] == 0);
  CHECK(online["cpu"]["cpu_seconds"].get<double>() > 0.0);
  CHECK(online["gpu"]["device_bytes"].get<double>() >= online["gpu"]["least_device_bytes"].get<double>());
  CHECK(online["gpu"]["least_device_bytes"].get<double>() > 1e7);  // in builds without CUDA, too

  const nlohmann::json high = budget_of({map, "--images", images, "--quality", "high"});
  CHECK(high["width"] == 384);  // 1.5 times that of the images, which are small
  const nlohmann::json normal = budget_of({map, "--images", images, "--quality", "normal"});
  const nlohmann::json wide =
      budget_of({map, "--images", images, "--quality", "normal", "--width", "2880", "--height", "1440"});
  for (const char* key : {"cloud_bytes", "workspace_bytes", "scratch_bytes"}) {
    CHECK(normal[key].get<double>() > 100.0);
    CHECK(wide[key].get<double>() == Approx(4.0 * normal[key].get<double>()).epsilon(0.1));
  }
  CHECK(wide["cpu"]["memory_bytes"].get<double>() > 2.0 * normal["cpu"]["memory_bytes"].get<double>());
  CHECK(wide["gpu"]["device_bytes"].get<double>() > 2.0 * normal["gpu"]["device_bytes"].get<double>());
}

TEST_CASE("run --print-memory prints the memory estimate of info and runs nothing") {
  const TempDir dir;
  const std::string map = (mission() / "map.msg").string();
  const std::string images = (mission() / "images").string();
  const std::vector<std::string> inputs{map, "--images", images, "--quality", "high", "--backend", "cpu"};
  std::vector<std::string> words{"run", "-o", (dir / "cloud.ply").string(), "--print-memory"};
  words.insert(words.end(), inputs.begin(), inputs.end());
  const Result result = densify(words);
  CHECK(result.code == 0);
  CHECK_FALSE(std::filesystem::exists(dir / "cloud.ply"));
  const nlohmann::json said = nlohmann::json::parse(result.out);
  const nlohmann::json predicted = budget_of(inputs);
  DensifierOptions options = preset(Quality::kHigh);  // of a device, before images are seen: they may be of any width
  options.width = predicted["width"];
  options.height = predicted["height"];
  options.advanced.expected_keyframes = predicted["keyframes"];
  CHECK(said["gpu"]["device_bytes"] == device_memory_needed(options));
  options.scratch_folder = "somewhere";
  CHECK(said["gpu"]["least_device_bytes"] ==
        std::min(device_memory_needed(options), said["gpu"]["device_bytes"].get<std::size_t>()));
  for (const char* key : {"device_bytes", "least_device_bytes"}) {
    CHECK(said["gpu"][key].get<double>() > predicted["gpu"][key].get<double>());
    CHECK(said["gpu"][key].get<double>() < predicted["gpu"][key].get<double>() + 256e6);
  }
  CHECK(said["gpu"]["free_device_bytes"] == 0);                     // of none
  const double memory = said["cpu"]["memory_bytes"].get<double>();  // of all keyframes: the used ones are not known yet
  CHECK(memory >= predicted["cpu"]["memory_bytes"].get<double>());
  CHECK(memory < 1.2 * predicted["cpu"]["memory_bytes"].get<double>());

  words[1] = "--workspace";
  words[2] = (dir / "work").string();
  const Result with_workspace = densify(words);
  CHECK(nlohmann::json::parse(with_workspace.out)["cpu"]["memory_bytes"].get<double>() > memory);
  CHECK_FALSE(std::filesystem::exists(dir / "work"));
}

TEST_CASE("predictions of info grow with the mission and match the run") {
  const TempDir dir;
  const std::string map = (mission() / "map.msg").string();
  std::filesystem::copy(mission() / "images", dir / "images");
  const std::vector<std::string> options{"--width", "128", "--height", "64", "--view-filter-min-parallax-deg", "0.1"};
  const auto predicted = [&] {
    std::vector<std::string> arguments{map, "--images", (dir / "images").string()};
    arguments.insert(arguments.end(), options.begin(), options.end());
    return budget_of(arguments);
  };
  const nlohmann::json all = predicted();
  std::vector<std::string> run{map,
                               "--images",
                               (dir / "images").string(),
                               "--backend",
                               "cpu",
                               "-o",
                               (dir / "c.ply").string(),
                               "--workspace",
                               (dir / "w").string(),
                               "--stats",
                               (dir / "s.json").string()};
  run.insert(run.end(), options.begin(), options.end());
  const Result result = densify(run);
  INFO(result.err);
  REQUIRE(result.code == 0);
  const auto stats = nlohmann::json::parse(read_text(dir / "s.json"));
  CHECK(all["depth_maps"] == stats["keyframes"]["depth_maps"]);
  const double factor = all["points"].get<double>() / stats["points"].get<double>();
  CHECK(factor > 0.5);
  CHECK(factor < 2.0);
  const double cloud = static_cast<double>(std::filesystem::file_size(dir / "c.ply"));
  CHECK(all["cloud_bytes"].get<double>() / cloud == Approx(factor).epsilon(0.05));
  double workspace = 0.0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(dir / "w")) {
    if (entry.is_regular_file()) workspace += static_cast<double>(entry.file_size());
  }
  CHECK(all["workspace_bytes"].get<double>() / workspace == Approx(1.0).epsilon(0.5));

  std::filesystem::remove(dir / "images/000004.png");
  const nlohmann::json less = predicted();
  CHECK(less["keyframes"] == 4);
  for (const char* key : {"points", "cloud_bytes", "workspace_bytes"}) {
    CHECK(less[key].get<double>() < all[key].get<double>());
  }
  CHECK(less["cpu"]["memory_bytes"].get<double>() <= all["cpu"]["memory_bytes"].get<double>());
}

namespace {

/// Two adjacent keyframes with landmarks at these ranges, some of them common.
tool::Budget budget_of_pair(const std::vector<double>& ranges, bool overlap) {
  SlamMap map;
  map.cameras.push_back({"camera", 640, 320, 10.0});
  Plan plan;
  for (std::int64_t id = 0; id < 2; ++id) {
    MapKeyframe keyframe;
    keyframe.id = id;
    keyframe.cam_from_world.translation.x() = 0.1 * static_cast<double>(id);
    for (std::size_t i = 0; i < ranges.size(); ++i) {
      const auto number = static_cast<std::int64_t>(i + (overlap ? 0 : ranges.size() * static_cast<std::size_t>(id)));
      keyframe.observations.push_back({number, {0.0F, 0.0F}});
      if (id == 1 && overlap) continue;
      const double angle = 6.28 * static_cast<double>(i) / static_cast<double>(ranges.size());
      map.landmarks.push_back({number, {ranges[i] * std::cos(angle), 0.0, ranges[i] * std::sin(angle)}});
    }
    map.keyframes.push_back(keyframe);
    PlanEntry entry;
    entry.id = id;
    entry.use = KeyframeUse::kDepthMap;
    entry.near = entry.fusion = entry.duplicate_views = {1 - id};
    plan.entries.push_back(entry);
  }
  return tool::estimate_budget({map, plan, preset(Quality::kOnline), 0, 0, {}});
}

}  // namespace

TEST_CASE("predicted points account for duplicates by shared landmarks and for far landmarks") {
  const std::vector<double> room(20, 5.0);
  const double alone = budget_of_pair(room, false).points_per_pixel;
  const double shared = budget_of_pair(room, true).points_per_pixel;
  CHECK(alone > 0.85);
  CHECK(shared < 0.9 * alone);
  std::vector<double> yard = room;
  std::fill_n(yard.begin(), 4, 25.0);
  CHECK(budget_of_pair(yard, false).points_per_pixel < 0.7 * alone);
}

TEST_CASE("unused keyframes take no memory in the prediction") {
  SlamMap map;
  map.cameras.push_back({"camera", 640, 320, 10.0});
  Plan plan;
  for (std::int64_t id = 0; id < 6; ++id) {
    PlanEntry entry;
    entry.id = id;
    entry.use = KeyframeUse::kDepthMap;
    entry.near = {id == 0 ? 1 : id - 1};
    plan.entries.push_back(entry);
  }
  const DensifierOptions options = preset(Quality::kNormal);
  const tool::Budget before = tool::estimate_budget({map, plan, options, 0, 0, {}});
  CHECK(before.used == 6);
  CHECK(before.memory.host > 0.0);
  for (std::int64_t id = 6; id < 300; ++id) {
    PlanEntry entry;
    entry.id = id;
    entry.use = KeyframeUse::kTooLittleParallax;
    plan.entries.push_back(entry);
  }
  const tool::Budget after = tool::estimate_budget({map, plan, options, 0, 0, {}});
  CHECK(after.keyframes == 300);
  CHECK(after.used == 6);
  CHECK(after.memory.host == before.memory.host);
  CHECK(after.memory.scratch == before.memory.scratch);
}
