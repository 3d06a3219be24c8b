// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <catch2/catch.hpp>

#include "cli/command.h"
#include "machine.h"
#include "pmsp/stages.h"
#include "support/sanitized.h"

using namespace pmsp_test;
using Catch::Contains;

namespace fs = std::filesystem;

namespace {

/// A quick shard: its words are those of a quick run but for the cloud.
Words shard(const TempDir& dir, const std::string& which, const Words& more = {}) {
  Words words = quick_run("", {"--workspace", (dir / "work").string(), "--shard", which});
  const auto output = std::find(words.begin(), words.end(), "-o");
  words.erase(output, output + 2);
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

Words merge(const TempDir& dir, const Words& more = {}) {
  Words words{"merge", (dir / "work").string(), "-o", (dir / "c.ply").string()};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

void check_fails(const Words& words, int code, const std::vector<std::string>& complaints) {
  const Result result = densify(words);
  CHECK(result.code == code);
  for (const std::string& complaint : complaints) CHECK_THAT(result.err, Contains(complaint));
}

/// The cloud of a single run.
fs::path plain(const TempDir& dir, const Words& more = {}) {
  require_ok(densify(quick_run(dir / "plain.ply", more)));
  return dir / "plain.ply";
}

/// An instruction set with results different from those of a quick run; "" if there is none.
std::string other_engine() {
  if (pmsp::widest_simd() == pmsp::Simd::kScalar) return "";
  return pmsp::test::kSanitized ? "auto" : "scalar";
}

}  // namespace

TEST_CASE("shards in any order or at once merge to the bytes of a single run", "[shards]") {
  const TempDir dir, at_once;
  const fs::path expected = plain(dir);
  std::mt19937 random(static_cast<std::uint32_t>(std::chrono::steady_clock::now().time_since_epoch().count()));
  Words order{"0/3", "1/3", "2/3"};
  std::shuffle(order.begin(), order.end(), random);
  for (const std::string& which : order) {
    INFO(which);
    const Result result = require_ok(densify(shard(dir, which, {"--stats", (dir / "shard.json").string(), "--force"})));
    CHECK_THAT(result.err, Contains("shard " + which + ": points of "));
    CHECK_THAT(read_text(dir / "shard.json"), Contains("\"engine\""));
  }
  CHECK_THAT(densify(shard(dir, "1/3")).err, Contains("0 made"));
  CHECK_THAT(require_ok(densify(merge(dir))).err, Contains("found from shards"));
  CHECK(same_bytes(dir / "c.ply", expected));

  Command first(densify_words(shard(at_once, "0/3"))), second(densify_words(shard(at_once, "1/3")));
  Command twin(densify_words(shard(at_once, "1/3")));
  require_ok(first.wait());
  require_ok(second.wait());
  require_ok(twin.wait());
  require_ok(densify(shard(at_once, "2/3")));
  require_ok(densify(merge(at_once)));
  CHECK(same_bytes(at_once / "c.ply", expected));

  // A merged workspace is complete and may be merged again.
  require_ok(densify(merge(dir, {"--stats", (dir / "s.json").string()})));
  require_ok(densify(merge(dir)));
  CHECK(same_bytes(dir / "c.ply", expected));
  const Result run = require_ok(
      densify(quick_run(dir / "c.ply", {"--workspace", (dir / "work").string(), "--preview", (dir / "p").string()})));
  CHECK_THAT(run.err, Contains("0 refined, 0 made"));
  CHECK(same_bytes(dir / "c.ply", expected));
}

TEST_CASE("in two waves planes of all shards are computed before the points that need them", "[shards]") {
  const TempDir dir;
  // With a geometric pass; otherwise a shard would compute all planes before its own.
  const Words whole_mission{"--free-space-whole-mission", "--patchmatch-geometric-passes", "1"};
  const fs::path expected = plain(dir, whole_mission);
  const auto wave = [&](const std::string& which, const char* name) {
    Words more{"--wave", name};
    more.insert(more.end(), whole_mission.begin(), whole_mission.end());
    return shard(dir, which, more);
  };
  require_ok(densify(wave("1/3", "planes")));
  check_fails(wave("1/3", "points"), 3,
              {"points of shard 1/3 need missing planes", "shards 0 and 2 of 3 have not finished"});
  check_fails(merge(dir), 3, {"shards 0, 1 and 2 of 3 have not finished (planes of ", "shard 1 failed on "});
  CHECK_FALSE(fs::exists(dir / "c.ply"));
  require_ok(densify(wave("0/3", "planes")));
  require_ok(densify(wave("2/3", "planes")));
  for (const char* which : {"2/3", "0/3", "1/3"}) require_ok(densify(wave(which, "points")));
  require_ok(densify(merge(dir)));
  CHECK(same_bytes(dir / "c.ply", expected));
}

TEST_CASE("more shards than keyframes are allowed and a missing shard is named", "[shards]") {
  const TempDir dir;
  for (const char* which : {"0/8", "1/8", "2/8", "3/8", "5/8", "6/8", "7/8"}) require_ok(densify(shard(dir, which)));
  check_fails(merge(dir), 3, {"shard 4 of 8 has not finished (points of 1 keyframe", "run them again"});
  // Missing and unused directories are no shards.
  check_fails({"merge", (dir / "other").string()}, 3, {"is no workspace"});
  CHECK_FALSE(fs::exists(dir / "other"));
  require_ok(densify(shard(dir, "4/8")));
  require_ok(densify(merge(dir)));
  CHECK(same_bytes(dir / "c.ply", plain(dir)));
}

TEST_CASE("a single run resumes the work of shards", "[shards]") {
  const TempDir dir;
  require_ok(densify(shard(dir, "0/2")));
  const Result run = require_ok(densify(quick_run(dir / "c.ply", {"--workspace", (dir / "work").string()})));
  CHECK_THAT(run.err, Contains("found from an interrupted run"));
  CHECK(same_bytes(dir / "c.ply", plain(dir)));
  check_fails(merge(dir, {"--force"}), 0, {"are kept"});
}

TEST_CASE("shards of a follow-up step give the bytes of a single run", "[shards]") {
  const TempDir dir, whole;
  const auto copy_images = [&](std::size_t count) {
    std::vector<fs::path> files;
    for (const auto& file : fs::directory_iterator(mission() / "images")) files.push_back(file.path());
    std::sort(files.begin(), files.end());
    fs::create_directories(dir / "images");
    for (std::size_t i = 0; i < std::min(count, files.size()); ++i) {
      fs::copy_file(files[i], dir / "images" / files[i].filename(), fs::copy_options::skip_existing);
    }
  };
  const Words images{"--images", (dir / "images").string()};
  const auto run = [&](const TempDir& at) {
    return quick_run(at / "c.ply", {"--workspace", (at / "work").string(), images[0], images[1]});
  };
  copy_images(4);
  require_ok(densify(run(dir)));
  fs::copy(dir / "work", whole / "work", fs::copy_options::recursive);
  copy_images(99);
  require_ok(densify(run(whole)));
  for (const char* wave : {"planes", "points"}) {
    for (const char* which : {"1/2", "0/2"}) {
      require_ok(densify(shard(dir, which, {images[0], images[1], "--wave", wave})));
    }
  }
  require_ok(densify(merge(dir, {"--force"})));
  CHECK(same_bytes(dir / "c.ply", whole / "c.ply"));
}

TEST_CASE("a shard killed at any moment resumes", "[shards]") {
  constexpr int kKills = pmsp::test::kSanitized ? 1 : 8;
  const TempDir dir;
  std::mt19937 random(static_cast<std::uint32_t>(std::chrono::steady_clock::now().time_since_epoch().count()));
  for (int kill_at = 0; kill_at < kKills; ++kill_at) {
    Command command(densify_words(shard(dir, kill_at % 2 == 0 ? "0/2" : "1/2")));
    std::this_thread::sleep_for(std::chrono::milliseconds(random() % 600));
    kill(command.pid(), SIGKILL);
    command.wait();
  }
  require_ok(densify(shard(dir, "1/2")));
  require_ok(densify(shard(dir, "0/2")));
  require_ok(densify(merge(dir)));
  CHECK(same_bytes(dir / "c.ply", plain(dir)));
}

TEST_CASE("an inconsistent shard is refused and merge reports the reason", "[shards]") {
  const TempDir dir;
  require_ok(densify(shard(dir, "0/3")));
  check_fails(shard(dir, "1/3", {"--seed", "7"}), 3, {"shard 1/3 does not match", "seed 7 instead of 1"});
  check_fails(merge(dir), 3, {"shards 1 and 2 of 3 have not finished", "shard 1 failed on ", "seed 7 instead of 1"});
  check_fails(shard(dir, "1/4"), 3, {"one of 4 shards, not of 3"});
  const std::string engine = other_engine();
  if (!engine.empty()) {
    check_fails(shard(dir, "1/3", {"--simd", engine}), 3, {"engine", "CPU, plain code", "CPU, fused multiply-add"});
    check_fails(merge(dir), 3, {"shard 1 failed on ", "CPU, plain code", "CPU, fused multiply-add"});
  }
  require_ok(densify(shard(dir, "1/3")));
  require_ok(densify(shard(dir, "2/3")));

  // As with merged directories of several machines.
  const fs::path marker = dir / "work/shards/points-2-of-3.json";
  const std::string text = read_text(marker);
  std::string other = text;
  const std::size_t at = other.find(", CPU, ");
  REQUIRE(at != std::string::npos);
  other.replace(at, 7, ", GPU, ");
  write_text(marker, other);
  check_fails(merge(dir), 3, {"shard 2/3 (points, on ", ", GPU, ", ", CPU, "});
  CHECK_FALSE(fs::exists(dir / "c.ply"));
  write_text(marker, text);
  require_ok(densify(merge(dir)));
  CHECK(same_bytes(dir / "c.ply", plain(dir)));
}

TEST_CASE("workspace and map and images may be moved together before the merge", "[shards]") {
  const TempDir dir;
  fs::create_directories(dir / "a");
  fs::copy(mission() / "images", dir / "a/images");
  fs::copy_file(mission() / "map.msg", dir / "a/map.msg");
  for (const char* which : {"0/2", "1/2"}) {
    Words words =
        shard(dir, which, {"--workspace", (dir / "a/work").string(), "--images", (dir / "a/images").string()});
    words[1] = (dir / "a/map.msg").string();
    require_ok(densify(words));
  }
  fs::rename(dir / "a", dir / "b");
  const Words moved{"merge", (dir / "b/work").string(), "-o", (dir / "c.ply").string()};
  fs::rename(dir / "b/images", dir / "b/elsewhere");
  check_fails(moved, 3, {"b/images"});
  fs::rename(dir / "b/elsewhere", dir / "b/images");
  write_text(dir / "b/map.msg", read_text(mission() / "map.msg") + " ");
  check_fails(moved, 3, {"cannot be merged", "map"});
  write_text(dir / "b/map.msg", read_text(mission() / "map.msg"));
  require_ok(densify(moved));
  CHECK(same_bytes(dir / "c.ply", plain(dir)));
}

TEST_CASE("a job array determines the shard of a task", "[shards]") {
  const TempDir dir;
  check_fails(shard(dir, "auto"), 2, {"SLURM_ARRAY_TASK_ID"});
  const auto set = [](const char* name, const char* value) { setenv(name, value, 1); };
  set("SLURM_ARRAY_TASK_ID", "7");
  set("SLURM_ARRAY_TASK_COUNT", "3");
  set("SLURM_ARRAY_TASK_MIN", "5");
  const Result result = densify(shard(dir, "auto"));
  set("SLURM_ARRAY_TASK_ID", "8");
  const Result beyond = densify(shard(dir, "auto"));
  for (const char* name : {"SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_COUNT", "SLURM_ARRAY_TASK_MIN"}) unsetenv(name);
  CHECK_THAT(require_ok(result).err, Contains("shard 2/3: "));
  CHECK(beyond.code == 2);
  CHECK_THAT(beyond.err, Contains("task 8 of an array of 3"));
}

TEST_CASE("options incompatible with shards are a usage error", "[shards]") {
  const TempDir dir;
  for (const char* which : {"3/3", "-1/3", "x", "1", "/", "0/0", "1/2/3", "0.5/2", ""}) {
    INFO(which);
    check_fails(shard(dir, which), 2, {"--shard"});
  }
  check_fails(shard(dir, "0/2", {"--wave", "both"}), 2, {"--wave is \"both\""});
  check_fails(shard(dir, "0/2", {"-o", "c.ply"}), 2, {"merge"});
  check_fails(shard(dir, "0/2", {"--depth-maps", "d"}), 2, {"merge"});
  check_fails(shard(dir, "0/2", {"--follow"}), 2, {"--follow"});
  check_fails(shard(dir, "0/2", {"--growing"}), 2, {"--growing"});
  check_fails(shard(dir, "0/2", {"--delete-workspace"}), 2, {"--delete-workspace"});
  check_fails(shard(dir, "0/2", {"--quality", "paper"}), 2, {"init.chain_keyframes"});
  check_fails(quick_run(dir / "c.ply", {"--shard", "0/2"}), 2, {"--shard needs --workspace"});
  check_fails(quick_run(dir / "c.ply", {"--wave", "planes"}), 2, {"--wave needs --shard"});
  check_fails({"merge"}, 2, {"WORKSPACE is missing"});
  check_fails({"merge", "w", "--depth-maps", "d"}, 2, {"--depth-maps"});
  CHECK_FALSE(fs::exists(dir / "work"));
}
