// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "support/sanitized.h"

using namespace pmsp_test;
using Catch::Contains;

namespace fs = std::filesystem;

namespace {

constexpr int kKills = pmsp::test::kSanitized ? 1 : 6;

std::vector<fs::path> files_in(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const fs::directory_entry& file : fs::directory_iterator(folder)) files.push_back(file.path());
  std::sort(files.begin(), files.end());
  return files;
}

/// The mission's images without the last ones.
void copy_images(const fs::path& to, std::size_t count) {
  fs::create_directories(to);
  const std::vector<fs::path> files = files_in(mission() / "images");
  for (std::size_t i = 0; i < std::min(count, files.size()); ++i) {
    fs::copy_file(files[i], to / files[i].filename(), fs::copy_options::skip_existing);
  }
}

/// A quick run on separate images, in a workspace.
std::vector<std::string> step(const TempDir& dir, const std::vector<std::string>& more = {}) {
  return joined(
      quick_run(dir / "c.ply", {"--images", (dir / "images").string(), "--workspace", (dir / "work").string()}), more);
}

/// Kills the run at random times and repeats it until one completes.
int run_with_kills(const std::vector<std::string>& arguments, int kills, std::mt19937& random) {
  int killed = 0;
  for (int left = kills;; --left) {
    Command command(densify_words(arguments));
    if (left > 0) {
      std::this_thread::sleep_for(std::chrono::milliseconds(random() % 500));
      kill(command.pid(), SIGKILL);
    }
    const Result result = command.wait();
    killed += result.code == 137;
    if (result.code == 137) continue;
    require_ok(result);
    if (left <= 0) return killed;
  }
}

}  // namespace

TEST_CASE("a new workspace gives the bytes of a run without one and a second run has no work") {
  const TempDir dir;
  copy_images(dir / "images", 9);
  require_ok(densify(quick_run(dir / "plain.ply")));
  const Result first = densify(step(dir));
  require_ok(first);
  CHECK_THAT(first.err, Contains("0 are kept"));
  CHECK(same_bytes(dir / "c.ply", dir / "plain.ply"));
  const Result second = densify(step(dir, {"--stats", (dir / "s.json").string()}));
  require_ok(second);
  CHECK_THAT(second.err, Contains("0 refined, 0 made"));
  CHECK(same_bytes(dir / "c.ply", dir / "plain.ply"));
  const nlohmann::json stats = nlohmann::json::parse(read_text(dir / "s.json"));
  CHECK(stats["workspace"]["passes"] == 0);
  CHECK(stats["workspace"]["kept"] == stats["workspace"]["depth_maps"]);
  CHECK(stats["keyframes"]["added"] == 5);
  fs::rename(dir / "work", dir / "moved");  // it holds no path that leads to itself
  const Result elsewhere = densify(joined(step(dir), {"--workspace", (dir / "moved").string()}));
  require_ok(elsewhere);
  CHECK_THAT(elsewhere.err, Contains("0 refined, 0 made"));
}

TEST_CASE("depth maps and pictures equal those of a run without a workspace also with cached planes") {
  const TempDir dir;
  copy_images(dir / "images", 9);
  require_ok(densify(quick_run(dir / "plain.ply", {"--depth-maps", (dir / "plain").string()})));
  require_ok(densify(step(dir)));
  require_ok(densify(step(dir, {"--depth-maps", (dir / "depth").string(), "--preview", (dir / "look").string()})));
  std::size_t files = 0;
  for (const fs::directory_entry& file : fs::directory_iterator(dir / "plain")) {
    CHECK(same_bytes(file.path(), dir / "depth" / file.path().filename().string()));
    ++files;
  }
  CHECK(files > 8);
  CHECK(fs::exists(dir / "look"));
  CHECK(same_bytes(dir / "c.ply", dir / "plain.ply"));
}

TEST_CASE("a step killed at any moment and run again gives the same bytes") {
  std::mt19937 random(static_cast<std::uint32_t>(std::chrono::steady_clock::now().time_since_epoch().count()));
  const TempDir first, second;
  copy_images(first / "images", 4);
  require_ok(densify(step(first)));
  copy_images(second / "images", 4);
  run_with_kills(step(second), kKills, random);
  CHECK(same_bytes(first / "c.ply", second / "c.ply"));
  fs::remove_all(second / "work");
  fs::copy(first / "work", second / "work", fs::copy_options::recursive);
  for (const TempDir* dir : {&first, &second}) copy_images(*dir / "images", 9);
  const Result grown = densify(step(first));
  require_ok(grown);
  CHECK_THAT(grown.err, !Contains(" 0 made"));
  run_with_kills(step(second), kKills, random);
  CHECK(same_bytes(first / "c.ply", second / "c.ply"));
  std::size_t files = 0;
  for (const char* part : {"work/planes", "work/points"}) {
    for (const fs::directory_entry& file : fs::directory_iterator(first / part)) {
      CHECK(same_bytes(file.path(), second / part / file.path().filename()));
      ++files;
    }
  }
  CHECK(files > 6);
}

TEST_CASE("a temporary workspace is kept until the cloud is written") {
  std::mt19937 random(static_cast<std::uint32_t>(std::chrono::steady_clock::now().time_since_epoch().count()));
  const TempDir dir;
  copy_images(dir / "images", 9);
  require_ok(densify(quick_run(dir / "plain.ply")));
  // A kill may come between the end of the cloud and that of the workspace.
  const auto words = step(dir, {"--delete-workspace", "--threads", "1", "--force"});
  run_with_kills(words, kKills, random);
  CHECK(same_bytes(dir / "c.ply", dir / "plain.ply"));
  CHECK_FALSE(fs::exists(dir / "work"));

  fs::remove(dir / "c.ply");
  std::string line = "ulimit -f 400; trap '' XFSZ; exec";  // space for planes, not for the cloud
  for (const std::string& word : densify_words(words)) line += " '" + word + "'";
  const Result full = Command({"/bin/sh", "-c", line}).wait();
  INFO(full.err);
  CHECK(full.code == 6);
  CHECK(files_in(dir / "work" / "planes").size() == 4);  // no time estimate from the first ones
  CHECK(files_in(dir / "work" / "points").empty());
  const Result again = densify(words);
  require_ok(again);
  CHECK_THAT(again.err, Contains("1 made, 4 found from an interrupted run"));
  CHECK(same_bytes(dir / "c.ply", dir / "plain.ply"));
  CHECK_FALSE(fs::exists(dir / "work"));
}

TEST_CASE("a full disk ends a step with 6 and with more space it resumes to the same bytes") {
  const TempDir dir;
  copy_images(dir / "images", 9);
  require_ok(densify(quick_run(dir / "plain.ply")));
  std::string line = "ulimit -f 100; trap '' XFSZ; exec";
  for (const std::string& word : densify_words(step(dir))) line += " '" + word + "'";
  const Result full = Command({"/bin/sh", "-c", line}).wait();
  INFO(full.err);
  CHECK(full.code == 6);
  CHECK_FALSE(fs::exists(dir / "c.ply"));
  require_ok(densify(step(dir)));
  CHECK(same_bytes(dir / "c.ply", dir / "plain.ply"));
}

TEST_CASE("run --follow uses images as they appear and ends after the idle timeout") {
  const TempDir dir;
  copy_images(dir / "images", 3);
  Command follow(densify_words(step(dir, {"--follow", "--until-idle", "4"})));
  REQUIRE(comes([&] { return fs::exists(dir / "c.ply"); }));
  const std::string first = read_text(dir / "c.ply");
  copy_images(dir / "images", 9);
  const Result result = follow.wait();
  require_ok(result);
  CHECK(read_text(dir / "c.ply").size() > first.size());
  if (!pmsp::test::kSanitized) {  // with sanitizers there is one pass only
    CHECK_THAT(result.err,
               Contains("lack passes until a later run") && Contains("had too few passes"));  // completed at the end
  }
  const Result after = densify(step(dir));
  require_ok(after);
  CHECK_THAT(after.err, Contains("0 refined, 0 made"));
}

TEST_CASE("run --growing defers passes and a run without it completes them") {
  const TempDir dir;
  copy_images(dir / "images", 4);
  const Result first = densify(step(dir, {"--growing"}));
  require_ok(first);
  copy_images(dir / "images", 9);
  require_ok(densify(step(dir, {"--growing"})));
  const Result last = densify(step(dir));
  require_ok(last);
  if (!pmsp::test::kSanitized) {  // with sanitizers there is one pass only
    CHECK_THAT(first.err, Contains("lack passes until a later run"));
    CHECK_THAT(last.err, Contains("had too few passes 5") && !Contains("lack passes until a later run"));
  }
  require_ok(densify(quick_run(dir / "plain.ply", {"--images", (dir / "images").string()})));
  CHECK(same_bytes(dir / "c.ply", dir / "plain.ply"));  // all were matched again
  CHECK(densify(quick_run(dir / "n.ply", {"--growing"})).code == 2);
  CHECK(densify(step(dir, {"--growing", "--follow"})).code == 2);
}

TEST_CASE("run --follow ends with a run that expects no more keyframes for any previous state") {
  const TempDir dir;
  copy_images(dir / "images", 9);
  require_ok(densify(step(dir)));
  const Result result = densify(step(dir, {"--follow", "--until-idle", "0.1"}));
  require_ok(result);
  const std::size_t first = result.err.find("workspace:   ");
  CHECK(first != std::string::npos);
  CHECK(result.err.find("workspace:   ", first + 1) != std::string::npos);
}

TEST_CASE("run --follow waits for a newer state after an unusable one and ends at a signal") {
  const TempDir dir;
  copy_images(dir / "images", 9);
  const std::string map = read_text(mission() / "map.msg");
  write_text(dir / "map.msg", map.substr(0, map.size() / 2));
  std::vector<std::string> words = step(dir, {"--follow"});
  words[1] = (dir / "map.msg").string();
  Command follow(densify_words(words));
  REQUIRE(comes([&] { return follow.err_so_far().find("waiting for a newer state") != std::string::npos; }));
  CHECK_THAT(follow.err_so_far(), Contains("map.msg") && Contains("waiting for a newer state"));
  write_text(dir / "map.msg", map);
  REQUIRE(comes([&] { return follow.err_so_far().find("wrote ") != std::string::npos; }));
  CHECK(fs::exists(dir / "c.ply"));
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  kill(follow.pid(), SIGINT);
  CHECK(follow.wait().code == 0);
  write_text(dir / "map.msg", "nonsense");
  words.push_back("--until-idle");
  words.push_back("0.5");
  CHECK(densify(words).code == 3);  // an error at the end is reported
}

TEST_CASE("run --follow waits for a newer state after one without points") {
  const TempDir dir;
  copy_images(dir / "images", 2);  // with too little parallax between them
  Command follow(densify_words(step(dir, {"--follow", "--until-idle", "4", "--view-filter-min-parallax-deg", "20"})));
  REQUIRE(comes([&] { return follow.err_so_far().find("no points") != std::string::npos; }));
  copy_images(dir / "images", 9);
  const Result result = follow.wait();
  require_ok(result);
  CHECK_THAT(result.err, Contains("waiting for a newer state") && Contains("wrote "));
}

TEST_CASE("outputs of the same workspace are replaced and others are not") {
  const TempDir dir;
  copy_images(dir / "images", 9);
  write_text(dir / "c.ply", "somebody's");
  CHECK(densify(step(dir)).code == 6);
  CHECK(read_text(dir / "c.ply") == "somebody's");
  require_ok(densify(step(dir, {"--force"})));
  require_ok(densify(step(dir)));
  write_text(dir / "d.ply", "somebody's");
  CHECK(densify(joined(step(dir), {"-o", (dir / "d.ply").string()})).code == 6);
}

TEST_CASE("relative paths are resolved also from another working directory") {
  const TempDir dir;
  copy_images(dir / "images", 9);
  std::string line = "cd '" + dir.path().string() + "' && exec";
  for (const std::string& word :
       densify_words(joined(quick_run("c.ply"), {"--images", "images", "--workspace", "work"}))) {
    line += " '" + word + "'";
  }
  for (int round = 0; round < 3; ++round) require_ok(Command({"/bin/sh", "-c", line}).wait());
  const Result elsewhere = densify(step(dir));
  require_ok(elsewhere);
  CHECK_THAT(elsewhere.err, Contains("0 refined, 0 made"));
  write_text(dir / "work/c.ply", "somebody's");
  CHECK(densify(joined(step(dir), {"-o", (dir / "work/c.ply").string()})).code == 6);
}

TEST_CASE("changed options give the result of a new workspace") {
  const TempDir dir, fresh;
  copy_images(dir / "images", 9);
  require_ok(densify(step(dir, {"--view-filter-min-sharpness", "0", "--force"})));
  for (const std::vector<std::string>& options :
       std::vector<std::vector<std::string>>{{"--init-range-margin", "3.2"},
                                             {"--quality", "normal"},
                                             {"--fusion-spacing-px", "0.6"},
                                             {"--quality", "paper"},
                                             {"--quality", "paper", "--seed", "4"}}) {
    require_ok(densify(step(dir, joined(options, {"--force"}))));
    require_ok(densify(joined(quick_run(fresh / "c.ply"), joined(options, {"--force"}))));
    INFO(options[1]);
    CHECK(same_bytes(dir / "c.ply", fresh / "c.ply"));
    require_ok(densify(step(dir, options)));  // and again, with nothing left to do
    CHECK(same_bytes(dir / "c.ply", fresh / "c.ply"));
    if (kKills == 1) break;  // with sanitizers each run takes long
  }
}

TEST_CASE("options that invalidate a whole workspace are refused before any work without --force") {
  const TempDir dir;
  copy_images(dir / "images", 9);
  require_ok(densify(step(dir)));
  const std::string cloud = read_text(dir / "c.ply");
  const auto refused = [&](const std::vector<std::string>& options, const char* complaint) {
    const Result result = densify(step(dir, options));
    CHECK(result.code == 6);
    CHECK_THAT(result.err, Contains(complaint) && Contains("nothing of 5 depth maps can be kept") &&
                               Contains("--force") && !Contains("backend: "));
    std::vector<std::string> dry_run = step(dir, options);
    dry_run.insert(dry_run.begin(), "info");
    const Result checked = densify(dry_run);
    CHECK(checked.code == 6);
    CHECK_THAT(checked.err, Contains("nothing of 5 depth maps can be kept"));
  };
  refused({"--width", "64", "--height", "32"}, "width 128 -> 64, height 64 -> 32: ");
  refused({"--quality", "paper"}, " -> ");
  refused({"--seed", "4"}, "seed 1 -> 4");
  refused({"--mask", (mission() / "mask.png").string()}, "mask");
  std::vector<std::string> shard = step(dir, {"--shard", "0/2", "--seed", "4"});
  const auto output = std::find(shard.begin(), shard.end(), "-o");
  shard.erase(output, output + 2);
  CHECK_THAT(densify(shard).err, Contains("nothing of 5 depth maps can be kept"));
  require_ok(densify(step(dir, {"--fusion-spacing-px", "0.7"})));  // keeps planes
  require_ok(densify(step(dir)));
  CHECK(read_text(dir / "c.ply") == cloud);
  require_ok(densify(step(dir, {"--width", "64", "--height", "32", "--force"})));
  CHECK(read_text(dir / "c.ply") != cloud);
}

TEST_CASE("options that invalidate an interrupted run are refused without --force") {
  const TempDir dir;
  copy_images(dir / "images", 9);
  for (const bool is_deleted : {false, true}) {
    auto words = step(dir, {"--patchmatch-iterations", "8", "--threads", "1"});
    if (is_deleted) words.emplace_back("--delete-workspace");
    Command command(densify_words(words));
    comes([&] {
      const fs::path planes = dir / "work/planes";
      if (command.err_so_far().find("wrote ") != std::string::npos) return true;
      return fs::exists(planes) && files_in(planes).size() > 1;
    });
    kill(command.pid(), SIGKILL);
    REQUIRE(command.wait().code == 137);
    const Result other = densify(joined(words, {"--seed", "4"}));
    CHECK(other.code == 6);
    CHECK_THAT(other.err, Contains("seed 1 -> 4") && Contains("of a run that was interrupted"));
    const Result same = densify(words);
    require_ok(same);
    CHECK_THAT(same.err, Contains("found from an interrupted run"));
    CHECK_FALSE(fs::exists(dir / "work/begun.json"));
    for (const char* name : {"work", "c.ply"}) fs::remove_all(dir / name);
  }
}

TEST_CASE("a workspace of another mission is refused and that of a moved mission resumes") {
  const TempDir dir;
  copy_images(dir / "images", 9);
  require_ok(densify(step(dir)));
  fs::create_directory(dir / "mission");  // copied to another place, under other names
  fs::copy(mission() / "map.msg", dir / "mission/m.msg");
  fs::rename(dir / "images", dir / "mission/i");
  std::vector<std::string> words = joined(step(dir), {"--images", (dir / "mission/i").string()});
  words[1] = (dir / "mission/m.msg").string();
  const Result moved = densify(words);
  require_ok(moved);
  CHECK_THAT(moved.err, Contains("0 refined, 0 made"));
  for (const fs::path& image : files_in(dir / "mission/i")) write_text(image, read_text(image) + "another flight's");
  const std::string cloud = read_text(dir / "c.ply");
  const Result other = densify(words);
  CHECK(other.code == 6);
  CHECK_THAT(other.err, Contains("this workspace is of ") && Contains("m.msg") && Contains("--force"));
  CHECK(read_text(dir / "c.ply") == cloud);
  CHECK(densify(joined(words, {"--follow", "--until-idle", "0.1"})).code == 6);
  require_ok(densify(joined(words, {"--force"})));
}

TEST_CASE("a single-centre result is estimated again at twice the images and at the end") {
  const TempDir dir;
  struct Run {
    std::size_t images;
    bool growing, great_circles;
  };
  for (const Run& run :
       {Run{2, true, true}, {3, true, false}, {4, true, true}, {5, true, false}, {5, false, true}, {5, false, false}}) {
    CAPTURE(run.images, run.growing);
    copy_images(dir / "images", run.images);
    const Result result =
        densify(step(dir, run.growing ? std::vector<std::string>{"--growing"} : std::vector<std::string>{}));
    require_ok(result);
    CHECK((result.err.find("lenses: ") != std::string::npos) == run.great_circles);
  }
}

TEST_CASE("an unreadable image skips only its keyframe") {
  const TempDir dir;
  copy_images(dir / "images", 9);
  const std::vector<fs::path> files = files_in(dir / "images");
  write_text(files[4], "no image");
  const Result result = densify(step(dir));
  require_ok(result);
  CHECK_THAT(result.err, Contains("skipped"));
  fs::remove(files[4]);
  fs::copy_file(mission() / "images" / files[4].filename(), files[4]);
  const Result mended = densify(step(dir));
  require_ok(mended);
  CHECK_THAT(mended.err, Contains("new 1"));
}

TEST_CASE("options incompatible with a workspace are refused before any work") {
  const TempDir dir;
  copy_images(dir / "images", 9);
  const auto refused = [&](const std::vector<std::string>& words, int code, const char* complaint) {
    const Result result = densify(words);
    CHECK(result.code == code);
    CHECK_THAT(result.err, Contains(complaint));
  };
  refused(quick_run(dir / "c.ply", {"--follow"}), 2, "--follow needs --workspace");
  refused(quick_run(dir / "c.ply", {"--until-idle", "3"}), 2, "--until-idle needs --follow");
  refused(step(dir, {"--follow", "--until-idle", "-1"}), 2, "--until-idle is \"-1\"");
  refused(step(dir, {"--raw-depth-maps", (dir / "raw").string()}), 2, "exclude each other");
  refused(joined(step(dir), {"-o", (dir / "work/planes/c.ply").string()}), 2, "--workspace");
  refused(joined(step(dir), {"--workspace", (dir / "images").string()}), 3, "no workspace");
  refused(joined(step(dir), {"--workspace", ""}), 2, "--workspace is empty");
  refused(quick_run(dir / "c.ply", {"--delete-workspace"}), 2, "--delete-workspace needs --workspace");
  refused(step(dir, {"--delete-workspace", "--growing"}), 2, "--growing exclude each other");
  refused(step(dir, {"--delete-workspace", "--follow"}), 2, "--follow exclude each other");
  CHECK_FALSE(fs::exists(dir / "c.ply"));
}
