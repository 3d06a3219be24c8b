// SPDX-License-Identifier: BSD-2-Clause
#include <chrono>
#include <csignal>
#include <filesystem>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "cli/batch_missions.h"

using namespace pmsp_test;
using Catch::Contains;

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

TEST_CASE("a failed mission does not affect others and is reported by table and CSV and exit code") {
  const Missions missions;
  write_text(missions / "garbage.msg", "no map at all");
  fs::create_directory(missions / "empty");
  missions.write({Missions::line("good"), Missions::line("gone", {{"map", "nowhere.msg"}}),
                  Missions::line("garbage", {{"map", "garbage.msg"}}), Missions::line("blind", {{"images", "empty"}}),
                  Missions::line("odd", {{"picture", "x"}}),
                  Missions::line("wrong", {{"options", {{"fusion", {{"window", 99}}}}}}),
                  Missions::line("own", {{"options", {{"workspace", "w"}}}}), Missions::line("too")});
  const Result result = missions.batch({"--jobs", "2", "--backend", "cpu", "--device", "3,5"});
  INFO(result.err);
  CHECK(result.code == 7);
  CHECK_THAT(missions.status("good")["command"].dump(), Contains("--threads=") && Contains("--device=3"));
  CHECK_THAT(missions.status("gone")["command"].dump(), Contains("--threads=") && Contains("--device=5"));
  for (const char* name : {"good", "too"}) {
    CHECK(missions.status(name)["state"] == "done");
    CHECK(missions.status(name)["points"].get<int>() > 1000);
    CHECK(read_text(missions.result(name) / "cloud.ply") == read_text(missions.result("good") / "cloud.ply"));
    CHECK(fs::exists(missions.result(name) / "stats.json"));
    CHECK_FALSE(fs::exists(missions.result(name) / "work"));
  }
  const std::vector<std::pair<std::string, std::string>> reasons{
      {"gone", "nowhere.msg: there is no such file"},
      {"garbage", "garbage.msg: is no map"},
      {"blind", "empty"},
      {"odd", "line 5: there is no key \"picture\""},
      {"wrong", "line 6: --fusion-window is 99"},
      {"own", "line 7: --workspace is not available in a batch"},
  };
  std::istringstream table(result.out);
  std::string head;
  std::getline(table, head);
  CHECK_THAT(head, Contains("mission") && Contains("state") && Contains("points") && Contains("reason"));
  for (const auto& [name, reason] : reasons) {
    INFO(name);
    CHECK(missions.row(name)["state"] == "failed");
    CHECK_THAT(missions.row(name)["reason"], Contains(reason));
    CHECK_FALSE(fs::exists(missions.result(name) / "cloud.ply"));
    CHECK_THAT(result.out, Contains("\n" + name + " ") && Contains(reason));
    CHECK_THAT(result.err, Contains(name + ": failed: "));
  }
  CHECK_THAT(result.out, Contains("2 of 8 missions done, 6 failed"));
  CHECK_THAT(read_text(missions.result("gone") / "log.txt"), Contains("nowhere.msg: there is no such file"));
  CHECK(missions.row("gone")["exit_code"] == "3");
}

TEST_CASE("finished missions are skipped and failed ones run with --retry and changed ones run again") {
  const Missions missions;
  fs::remove(missions / "images");  // a link; one of them will change
  fs::copy(mission() / "images", missions / "images");
  const Json bad = Missions::line("b", {{"map", "later.msg"}});
  missions.write({Missions::line("a"), bad});
  REQUIRE(missions.batch().code == 7);
  const std::string first = read_text(missions.result("a") / "status.json");
  const std::string failed = read_text(missions.result("b") / "status.json");
  CHECK(missions.batch().code == 7);
  CHECK(read_text(missions.result("a") / "status.json") == first);
  CHECK(read_text(missions.result("b") / "status.json") == failed);
  const Result retried = missions.batch({"--retry", "--jobs", "2", "--threads", "1"});
  CHECK(retried.code == 7);
  CHECK_THAT(retried.err, Contains("1 done before, 1 to do"));
  CHECK(read_text(missions.result("a") / "status.json") == first);  // machine and jobs are no change
  fs::copy_file(missions / "map.msg", missions / "later.msg");
  CHECK(missions.batch().code == 0);  // its input exists now
  CHECK(missions.status("b")["state"] == "done");

  missions.write({Missions::line("a", {{"options", {{"fusion-spacing-px", 3}}}}), bad});
  const std::string cloud = read_text(missions.result("a") / "cloud.ply");
  const std::string files = missions.files();
  const Result refused = missions.batch();
  CHECK(refused.code == 2);
  CHECK_THAT(refused.err, Contains("line 1: mission a") && Contains("given --fusion-spacing-px=3"));
  CHECK(missions.files() == files);
  const Result changed = missions.batch({"--force"});
  CHECK(changed.code == 0);
  CHECK_THAT(changed.err, Contains("1 done before, 1 to do"));
  CHECK(read_text(missions.result("a") / "cloud.ply") != cloud);
  fs::remove(missions.result("b") / "cloud.ply");
  CHECK_THAT(missions.batch().err, Contains("1 done before, 1 to do"));
  CHECK(fs::exists(missions.result("b") / "cloud.ply"));
  const fs::path image = fs::directory_iterator(missions / "images")->path();
  fs::last_write_time(image, fs::last_write_time(image) + std::chrono::hours(1));
  CHECK_THAT(missions.batch().err, Contains("0 done before, 2 to do"));
  fs::remove(missions / "map.msg");
  missions.write({Missions::line("c")});
  CHECK(missions.batch().code == 8);
}

TEST_CASE("a killed batch ends its runs and resumes") {
  const Missions missions;
  std::vector<Json> lines;
  for (const char* name : {"a", "b", "c", "d", "e"}) lines.push_back(Missions::line(name));
  lines[1]["map"] = "nowhere.msg";
  missions.write(lines);
  Command command(densify_words(missions.words({"--jobs", "2"})));
  const pid_t child = stop_run_of(missions, "c");
  const Result second = missions.batch();
  CHECK(second.code == 6);
  CHECK_THAT(second.err, Contains("another process works in this directory of a batch"));
  kill(command.pid(), SIGKILL);
  CHECK(command.wait().code == 137);
#if defined(__linux__)
  CHECK(comes([&] { return !is_alive(child); }));
#endif
  CHECK_FALSE(fs::exists(missions.result("c") / "cloud.ply"));
  const Result again = missions.batch({"--jobs", "2"});
  INFO(again.err);
  CHECK(again.code == 7);
  CHECK_THAT(again.out, Contains("4 of 5 missions done") && Contains("1 failed"));
  for (const char* name : {"c", "d", "e"}) {
    CHECK(read_text(missions.result(name) / "cloud.ply") == read_text(missions.result("a") / "cloud.ply"));
  }
}

TEST_CASE("a batch killed while claiming a mission's directory resumes") {
  const Missions missions;
  missions.write({Missions::line("a")});
  fs::create_directories(missions.result("a"));
  write_text(missions.result("a") / ".status.json.77-0.tmp", "{");
  const Result result = missions.batch();
  INFO(result.err);
  CHECK(result.code == 0);
  CHECK(missions.status("a")["state"] == "done");
}

TEST_CASE("a signal ends a batch and its runs and the same command resumes") {
  const Missions missions;
  missions.write({Missions::line("a"), Missions::line("b")});
  Command command(densify_words(missions.words()));
  const pid_t child = stop_run_of(missions, "a");
  kill(command.pid(), SIGTERM);
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  kill(child, SIGCONT);
  const Result result = command.wait();
  INFO(result.err);
  CHECK(result.code == 143);
  CHECK(missions.status("a")["state"] == "interrupted");
  CHECK_FALSE(fs::exists(missions.result("b")));
  CHECK_THAT(result.out, Contains("0 of 2 missions done, 0 failed, 1 interrupted, 1 waiting"));
  CHECK(missions.row("b")["state"] == "waiting");
  CHECK(missions.bare({}).code == 0);
}

TEST_CASE("missions without enough memory wait for others to end") {
  const Missions missions;
  missions.write({Missions::line("a"), Missions::line("b"), Missions::line("c", {{"map", "nowhere.msg"}})});
  const std::vector<std::string> words = missions.words({"--jobs", "2", "--memory", "0.001"});  // each alone
  Command command(densify_words(words));
  const auto is_running = [&](const char* name) { return missions.status(name).contains("process"); };
  REQUIRE(comes([&] { return is_running("a") || is_running("b"); }));
  const bool is_a = is_running("a");
  const pid_t first = stop_run_of(missions, is_a ? "a" : "b");
  const std::string second = is_a ? "b" : "a";
  REQUIRE(comes([&] { return command.err_so_far().find(second + ": waits for memory") != std::string::npos; }));
  CHECK(missions.status(second)["state"] == "running");
  CHECK_FALSE(is_running(second.c_str()));
  CHECK_FALSE(fs::exists(missions.result(second) / "work"));

  SECTION("and run afterwards") {
    kill(first, SIGCONT);
    const Result result = command.wait();
    INFO(result.err);
    CHECK(result.code == 7);  // c has no map
    CHECK(missions.status("a")["state"] == "done");
    CHECK(missions.status("b")["state"] == "done");
    CHECK_THAT(missions.status("c")["reason"].get<std::string>(), Contains("nowhere.msg: there is no such file"));
  }
  SECTION("and a signal ends the wait") {
    kill(command.pid(), SIGTERM);
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    kill(first, SIGCONT);
    CHECK(command.wait().code == 143);
    for (const char* name : {"a", "b"}) CHECK(missions.status(name)["state"] == "interrupted");
    CHECK(missions.batch().code == 7);
    CHECK(missions.status(second)["state"] == "done");
  }
}

TEST_CASE("processes with one share each complete a batch and the table shows their progress") {
  const Missions missions;
  std::vector<Json> lines;
  for (const char* name : {"a", "b", "c", "d", "e"}) lines.push_back(Missions::line(name));
  lines[3]["map"] = "nowhere.msg";
  missions.write(lines);
  const Result nothing = missions.batch({"--summary"});
  CHECK(nothing.code == 7);
  CHECK_THAT(nothing.out, Contains("0 of 5 missions done, 0 failed, 5 waiting"));
  CHECK_FALSE(fs::exists(missions / "out"));

  Command first(densify_words(missions.words({"--only", "0/2"})));
  const pid_t child = stop_run_of(missions, "a");
  const Result second = missions.batch({"--only", "1/2"});
  CHECK(second.code == 7);
  CHECK_THAT(second.out, Contains("\nb ") && Contains("1 of 2 missions done, 1 failed") && !Contains("\na "));
  CHECK(missions.row("e")["state"] == "waiting");  // the table covers all shards
  const Result middle = missions.bare({"--summary"});
  CHECK(middle.code == 7);
  CHECK_THAT(middle.out, Contains("1 of 5 missions done, 1 failed, 1 running, 2 waiting"));
  CHECK_THAT(missions.batch().err, Contains("another process works in this directory of a batch"));

  const std::string before = read_text(missions.result("a") / "status.json");
  const Result same = missions.batch({"--only", "0/5"});  // another process runs it already
  CHECK(same.code == 8);
  CHECK_THAT(same.out, Contains("another process works in this directory of a mission"));
  CHECK(read_text(missions.result("a") / "status.json") == before);

  kill(first.pid(), SIGKILL);
  first.wait();
#if defined(__linux__)
  CHECK(comes([&] { return !is_alive(child); }));
#endif
  CHECK_THAT(missions.batch({"--summary"}).out, Contains("1 failed, 1 interrupted, 2 waiting"));
  CHECK(missions.batch({"--only", "0/2"}).code == 0);
  const Result all = missions.batch({"--summary", "--retry"});
  CHECK(all.code == 7);
  CHECK_THAT(all.out, Contains("4 of 5 missions done, 1 failed"));
  CHECK(missions.row("e")["state"] == "done");
  for (const char* name : {"b", "c", "e"}) {
    CHECK(read_text(missions.result(name) / "cloud.ply") == read_text(missions.result("a") / "cloud.ply"));
  }
}
