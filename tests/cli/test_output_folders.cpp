// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include <catch2/catch.hpp>

#include "cli/command.h"
#include "disk_space.h"
#include "pmsp/error.h"
#include "pmsp/io/cloud.h"

using namespace pmsp;
using namespace pmsp_test;
using Catch::Contains;

namespace fs = std::filesystem;

namespace {

const Words kFolders{"c.colmap", "c.nerfstudio", "c.potree", "depth", "raw", "look"};

/// A run that writes all kinds of folders.
Words run_into(const fs::path& dir, const Words& more = {}) {
  Words words = quick_run(dir / "c.ply", more);
  for (const std::string& name : Words{"c.colmap", "c.nerfstudio", "c.potree"}) {
    words = joined(words, {"-o", (dir / name).string()});
  }
  return joined(words, {"--depth-maps", (dir / "depth").string(), "--raw-depth-maps", (dir / "raw").string(),
                        "--preview", (dir / "look").string()});
}

/// Outputs of an uninterrupted run.
const fs::path& undisturbed() {
  static const TempDir dir;
  static const Result result = densify(run_into(dir.path()));
  INFO(result.err);
  REQUIRE(result.code == 0);
  return dir.path();
}

void check_all(const fs::path& dir) {
  for (const std::string& name : kFolders) {
    INFO(name);
    CHECK((all_bytes(dir / name) == all_bytes(undisturbed() / name)));  // not to be printed
  }
  CHECK(read_text(dir / "c.ply") == read_text(undisturbed() / "c.ply"));
  CHECK(std::distance(fs::directory_iterator(dir), fs::directory_iterator()) == 7);
}

std::string shell_line(const std::string& begin, const Words& words) {
  std::string line = begin + " exec";
  for (const std::string& word : words) line += " '" + word + "'";
  return line;
}

/// Waits for a text on standard error.
void wait_for(const Command& command, const char* text) {
  for (int i = 0; i < 30000 && command.err_so_far().find(text) == std::string::npos; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
}

}  // namespace

TEST_CASE("a killed run leaves no partial directory and the same command resumes", "[folders]") {
  const TempDir dir;
  for (const char* moment : {"keyframe 1/5", "keyframe 4/5"}) {
    Command command(densify_words(run_into(dir.path(), {"--progress", "plain"})));
    wait_for(command, moment);
    kill(command.pid(), SIGKILL);
    CHECK(command.wait().code == 137);
    for (const std::string& name : kFolders) CHECK_FALSE(fs::exists(dir / name));
  }
  CHECK(fs::exists(dir / "depth.part"));
  const Result result = densify(run_into(dir.path()));
  INFO(result.err);
  REQUIRE(result.code == 0);
  check_all(dir.path());
}

TEST_CASE("a run killed while writing leaves complete directories or none", "[folders]") {
  const TempDir dir;
  for (int delay = 0; delay < 60; delay += 20) {
    Command command(densify_words(run_into(dir.path(), {"--progress", "plain", "--force"})));
    wait_for(command, "writing");
    std::this_thread::sleep_for(std::chrono::milliseconds(delay));
    kill(command.pid(), SIGKILL);
    command.wait();
    for (const std::string& name : kFolders) {
      INFO(name);
      if (fs::exists(dir / name)) CHECK((all_bytes(dir / name) == all_bytes(undisturbed() / name)));
      fs::remove_all(dir / name);
    }
  }
  REQUIRE(densify(run_into(dir.path(), {"--force"})).code == 0);
  check_all(dir.path());
}

TEST_CASE("Ctrl-C leaves no directory and with --force the old ones", "[folders]") {
  const TempDir dir;
  const Words slow{"--width", "2048",       "--height", "1024",   "--patchmatch-iterations",
                   "100",     "--progress", "plain",    "--force"};
  fs::create_directory(dir / "depth");
  write_text(dir / "depth/index.json", "old");
  write_text(dir / "depth/depth_000000.pfm", "old");
  Command command(densify_words(run_into(dir.path(), slow)));
  wait_for(command, "keyframe 2/5");
  kill(command.pid(), SIGINT);
  CHECK(command.wait().code == 130);
  CHECK(dir.entries() == 1);
  CHECK(all_bytes(dir / "depth") == "depth_000000.pfm\noldindex.json\nold");
  CHECK(std::distance(fs::directory_iterator(dir / "depth"), fs::directory_iterator()) == 2);
}

TEST_CASE("a full disk leaves no directory and with more space the same command succeeds", "[folders]") {
  const TempDir dir;
  for (const char* limit : {"100", "400"}) {  // units of 512 bytes: not even a depth map, not the clouds
    const Result full = Command({"/bin/sh", "-c",
                                 shell_line(std::string("ulimit -f ") + limit + "; trap '' XFSZ;",
                                            densify_words(run_into(dir.path())))})
                            .wait();
    INFO(full.err);
    CHECK(full.code == 6);
    CHECK(dir.entries() == 0);
  }
  REQUIRE(densify(run_into(dir.path())).code == 0);
  check_all(dir.path());
}

TEST_CASE("an own directory is replaced with --force and keeps foreign files", "[folders]") {
  const TempDir dir;
  for (const std::string& name : kFolders) {
    fs::create_directories(dir / name / "images");
    write_text(dir / name / "notes", "mine");
    write_text(dir / name / "images/notes", "mine");
  }
  write_text(dir / "depth/depth_000077.pfm", "of an earlier run");
  const Result refused = densify(run_into(dir.path()));
  CHECK(refused.code == 6);
  CHECK_THAT(refused.err, Contains("is not empty"));
  REQUIRE(densify(run_into(dir.path(), {"--force"})).code == 0);
  CHECK_FALSE(fs::exists(dir / "depth/depth_000077.pfm"));
  for (const std::string& name : kFolders) {
    for (const char* notes : {"notes", "images/notes"}) {
      CHECK(read_text(dir / name / notes) == "mine");
      fs::remove(dir / name / notes);
    }
    if (fs::is_empty(dir / name / "images")) fs::remove(dir / name / "images");
  }
  check_all(dir.path());
}

TEST_CASE("a symbolic link as output is followed and standard output is refused", "[folders]") {
  const TempDir dir;
  fs::create_directory(dir / "disk");
  fs::create_symlink("disk/c.ply", dir / "c.ply");
  fs::create_directory_symlink("disk/depth", dir / "depth");
  const Words words = quick_run(dir / "c.ply", {"--depth-maps", (dir / "depth").string()});
  for (const bool force : {false, true}) {
    REQUIRE(densify(force ? joined(words, {"--force"}) : words).code == 0);
    CHECK(densify(words).code == 6);
    CHECK(fs::is_symlink(dir / "c.ply"));
    CHECK(fs::is_symlink(dir / "depth"));
    CHECK(read_text(dir / "disk/c.ply") == read_text(undisturbed() / "c.ply"));
    CHECK(all_bytes(dir / "disk/depth") == all_bytes(undisturbed() / "depth"));
  }
  const Result collides = densify(quick_run(dir / "c.ply", {"--force", "-o", (dir / "disk/c.ply").string()}));
  CHECK(collides.code == 2);
  for (const Words& output : {Words{"-o", "-"}, Words{"-o", (dir / "d.ply").string(), "--depth-maps", "-"}}) {
    const Result refused = densify(joined(quick_run("x.ply"), output));
    CHECK(refused.code == 2);
    CHECK_THAT(refused.err, Contains("standard output"));
  }
}

TEST_CASE("the forecast is compared with the free space as certain or likely or enough", "[folders]") {
  constexpr double kGiB = 1024.0 * 1024.0 * 1024.0;
  const tool::DiskNeed need{"out", 10.0 * kGiB, 5.0 * kGiB};
  CHECK(tool::compare_disk_space(need, 15.0 * kGiB).empty());
  CHECK_THAT(tool::compare_disk_space(need, 6.0 * kGiB),
             Contains("about 15 GiB") && Contains("6.0 GiB are free") && Contains("may become full"));
  CHECK_THROWS_AS(tool::compare_disk_space(need, 5.0 * kGiB), OutputError);
  CHECK(!tool::compare_disk_space({"out", 0.0, 5.0 * kGiB}, 1.0 * kGiB)
             .empty());  // the predicted number of points may be wrong
  CHECK_THROWS_AS(tool::compare_disk_space({"out", 0.0, 50.0 * kGiB}, 1.0 * kGiB), OutputError);
  CHECK_NOTHROW(tool::check_disk_space({{"no/such/folder", 1.0, 1.0}, {"/no/such", 0.0, 1.0}}));
  CHECK_THROWS_WITH(tool::check_disk_space({{"a/b", 1e18, 0.0}, {"c", 1e18, 0.0}}), Contains("will be written there"));
}
