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

#include "batch_run.h"
#include "cli/command.h"
#include "report_page.h"

using namespace pmsp_test;
using Catch::Contains;

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

namespace {

/// The options of a quick run, without its inputs and outputs.
std::vector<std::string> quick_options() {
  const std::vector<std::string> words = quick_run("");
  std::vector<std::string> options;
  for (std::size_t i = 4; i < words.size(); ++i) {
    if (words[i] == "-o") {
      ++i;
    } else {
      options.push_back(words[i]);
    }
  }
  return options;
}

/// Batches in a folder of their own, beside copies of the mission's map and a link to its images.
class Missions {
 public:
  Missions() {
    fs::create_directory_symlink(mission() / "images", dir_ / "images");
    fs::copy_file(mission() / "map.msg", dir_ / "map.msg");
  }

  fs::path operator/(const std::string& name) const { return dir_ / name; }
  fs::path result(const std::string& name) const { return dir_ / "out" / name; }

  /// A line of a manifest; `more` takes precedence.
  static Json line(const std::string& name, const Json& more = Json::object()) {
    Json line{{"name", name}, {"map", "map.msg"}, {"images", "images"}};
    line.update(more);
    return line;
  }

  void write(const std::vector<Json>& lines) const {
    std::string text;
    for (const Json& line : lines) text += line.dump() + "\n";
    write_text(dir_ / "m.jsonl", text);
  }

  std::vector<std::string> words(const std::vector<std::string>& more = {}, const char* manifest = "m.jsonl") const {
    std::vector<std::string> words{"batch", (dir_ / manifest).string(), "-o", (dir_ / "out").string()};
    for (const auto* options : {&kQuick, &more}) words.insert(words.end(), options->begin(), options->end());
    return words;
  }
  Result batch(const std::vector<std::string>& more = {}, const char* manifest = "m.jsonl") const {
    return densify(words(more, manifest));
  }

  Json status(const std::string& name) const {
    const std::string text = read_text(result(name) / "status.json");
    return text.empty() ? Json{{"state", "waiting"}} : Json::parse(text);
  }
  Json report() const { return Json::parse(read_text(dir_ / "out/batch.json")); }

 private:
  const std::vector<std::string> kQuick = quick_options();
  TempDir dir_;
};

bool is_alive(pid_t process) {
  if (kill(process, 0) != 0) return false;
  const std::string stat =
      read_text("/proc/" + std::to_string(process) + "/stat");  // nobody may have asked how it ended
  const std::size_t name_end = stat.rfind(')');
  return name_end == std::string::npos || stat.substr(name_end + 2, 1) != "Z";
}

/// Waits for what must come, and not for ever.
template <class Condition>
bool comes(const Condition& condition) {
  for (int i = 0; i < 6000; ++i) {
    if (condition()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

/// Holds on to a mission that is being run, in the middle; returns its process.
pid_t stop_run_of(const Missions& missions, const std::string& name) {
  const bool is_running = comes([&] {
    return missions.status(name).contains("process") && fs::exists(missions.result(name) / "work/workspace.json");
  });
  REQUIRE(is_running);
  const pid_t process = missions.status(name)["process"].get<pid_t>();
  kill(process, SIGSTOP);
  return process;
}

}  // namespace

TEST_CASE("a batch isolates what fails, and says why in the table, as JSON and by its exit code") {
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
      {"own", "line 7: --workspace is not for missions"},
  };
  std::istringstream table(result.out);
  std::string head;
  std::getline(table, head);
  CHECK_THAT(head, Contains("mission") && Contains("state") && Contains("points") && Contains("reason"));
  for (const auto& [name, reason] : reasons) {
    INFO(name);
    CHECK(missions.status(name)["state"] == "failed");
    CHECK_THAT(missions.status(name)["reason"].get<std::string>(), Contains(reason));
    CHECK_FALSE(fs::exists(missions.result(name) / "cloud.ply"));
    CHECK_THAT(result.out, Contains("\n" + name + " ") && Contains(reason));
    CHECK_THAT(result.err, Contains(name + ": failed: "));
  }
  CHECK_THAT(result.out, Contains("2 of 8 missions done, 6 failed"));
  CHECK_THAT(read_text(missions.result("gone") / "log.txt"), Contains("nowhere.msg: there is no such file"));
  const Json report = missions.report();
  CHECK(report["done"] == 2);
  CHECK(report["failed"] == 6);
  REQUIRE(report["missions"].size() == 8);
  CHECK(report["missions"][1]["name"] == "gone");
  CHECK(report["missions"][1]["exit_code"] == 3);
}

TEST_CASE("what is done is not made again, what has failed only with --retry, what has changed is") {
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
  CHECK(missions.batch().code == 0);  // its input has come
  CHECK(missions.status("b")["state"] == "done");

  missions.write({Missions::line("a", {{"options", {{"fusion-spacing-px", 3}}}}), bad});
  const std::string cloud = read_text(missions.result("a") / "cloud.ply");
  const Result changed = missions.batch();
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

TEST_CASE("a batch that is killed takes its runs with it, and goes on from there") {
  const Missions missions;
  std::vector<Json> lines;
  for (const char* name : {"a", "b", "c", "d", "e"}) lines.push_back(Missions::line(name));
  lines[1]["map"] = "nowhere.msg";
  missions.write(lines);
  Command command(densify_words(missions.words({"--jobs", "2"})));
  const pid_t child = stop_run_of(missions, "c");
  const Result second = missions.batch();
  CHECK(second.code == 6);
  CHECK_THAT(second.err, Contains("another process works in this folder of a batch"));
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

TEST_CASE("a batch that was killed while it took a mission's folder goes on with it") {
  const Missions missions;
  missions.write({Missions::line("a")});
  fs::create_directories(missions.result("a"));
  write_text(missions.result("a") / ".status.json.77-0.tmp", "{");
  const Result result = missions.batch();
  INFO(result.err);
  CHECK(result.code == 0);
  CHECK(missions.status("a")["state"] == "done");
}

TEST_CASE("a signal ends a batch and its runs, the same command goes on") {
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
  CHECK(missions.report()["waiting"] == 1);
  CHECK(missions.batch().code == 0);
}

TEST_CASE("missions whose memory is not there wait for others, and are made then") {
  const Missions missions;
  missions.write({Missions::line("a"), Missions::line("b"), Missions::line("c", {{"map", "nowhere.msg"}})});
  const std::vector<std::string> words = missions.words({"--jobs", "2", "--memory", "0.001"});  // each alone
  Command command(densify_words(words));
  const auto is_running = [&](const char* name) { return missions.status(name).contains("process"); };
  REQUIRE(comes([&] { return is_running("a") || is_running("b"); }));
  const bool is_a = is_running("a");
  const pid_t first = stop_run_of(missions, is_a ? "a" : "b");
  const std::string second = is_a ? "b" : "a";
  REQUIRE(comes([&] { return command.err_so_far().find(second + ": waits until others have") != std::string::npos; }));
  CHECK(missions.status(second)["state"] == "running");
  CHECK_FALSE(is_running(second.c_str()));
  CHECK_FALSE(fs::exists(missions.result(second) / "work"));

  SECTION("when these have ended") {
    kill(first, SIGCONT);
    const Result result = command.wait();
    INFO(result.err);
    CHECK(result.code == 7);  // c has no map
    CHECK(missions.status("a")["state"] == "done");
    CHECK(missions.status("b")["state"] == "done");
    CHECK_THAT(missions.status("c")["reason"].get<std::string>(), Contains("nowhere.msg: there is no such file"));
  }
  SECTION("and a signal ends their wait") {
    kill(command.pid(), SIGTERM);
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    kill(first, SIGCONT);
    CHECK(command.wait().code == 143);
    for (const char* name : {"a", "b"}) CHECK(missions.status(name)["state"] == "interrupted");
    CHECK(missions.batch().code == 7);
    CHECK(missions.status(second)["state"] == "done");
  }
}

TEST_CASE("a table and JSON lines say the same") {
  const Missions missions;
  missions.write({Missions::line("a", {{"options", {{"fusion", {{"window", 7}}}, {"median", {{"enabled", false}}}}}}),
                  {{"map", "./map.msg"}, {"images", "images"}}});
  write_text(missions / "m.tsv",
             "# two missions\r\noptions\tname\tmap\timages\tvideo\r\n"
             "--no-median-enabled --fusion-window '7'\ta\tmap.msg\timages\t\r\n"
             "\t\t./map.msg\timages\r\n");
  const std::vector<std::string> for_all{"--fusion-window", "5"};
  REQUIRE(missions.batch(for_all).code == 0);
  const std::string status = read_text(missions.result("a") / "status.json");
  CHECK_THAT(status, Contains("--median-enabled=false") && Contains("--fusion-window=7"));
  const auto window = [&](const std::string& name) {
    return Json::parse(read_text(missions.result(name) / "stats.json"))["options"]["fusion"]["window"];
  };
  CHECK(window("a") == 7);  // its own before that of all
  CHECK(window("map") == 5);
  const Result table = missions.batch(for_all, "m.tsv");
  CHECK(table.code == 0);
  CHECK_THAT(table.err, Contains("2 done before, 0 to do"));
  CHECK(missions.status("map")["state"] == "done");  // called as its map
}

TEST_CASE("the program that reads a batch gets events, and output folders lie with their mission") {
  const Missions missions;
  missions.write({Missions::line("a", {{"options", {{"depth-maps", "depth"}}}})});
  const Result result = missions.batch({"--progress", "json", "--keep-workspaces"});
  CHECK(result.code == 0);
  CHECK(result.err.empty());
  std::istringstream events(result.out);
  std::vector<Json> all;
  for (std::string event; std::getline(events, event);) all.push_back(Json::parse(event));
  REQUIRE(all.size() == 3);
  CHECK(all[1]["event"] == "mission");
  CHECK(all[1]["name"] == "a");
  CHECK(all[1]["state"] == "done");
  CHECK(all[2]["event"] == "done");
  CHECK(all[2]["done"] == 1);
  CHECK(fs::exists(missions.result("a") / "depth/index.json"));
  CHECK(fs::exists(missions.result("a") / "work/workspace.json"));
  REQUIRE(missions.batch().code == 0);
  CHECK(fs::exists(missions.result("a") / "work"));  // it was asked for
}

TEST_CASE("a batch has a page with its table, which leads to what each mission has left") {
  const Missions missions;
  missions.write({Missions::line("a"), Missions::line("b", {{"options", {{"format", "ply,potree"}}}}),
                  Missions::line("c<b>", {{"map", "none & nowhere.msg"}}),
                  Missions::line("d", {{"map", "none<i>.msg"}})});
  const bool has_page = pmsp::tool::has_report_page();
  const std::vector<std::string> more =
      has_page ? std::vector<std::string>{"--report", "report.html", "--report-points", "500"}
               : std::vector<std::string>{};
  CHECK(missions.batch(more).code == 7);
  const std::string page = read_text(missions / "out" / "index.html");
  CHECK(page.rfind("<!doctype html>", 0) == 0);
  CHECK_THAT(page, Contains("2 of 4 missions done, 2 failed") && Contains("default-src 'none'"));
  CHECK_THAT(page, Contains("<a href=\"./a/cloud.ply\">cloud.ply</a>") && Contains("<a href=\"./a/log.txt\">"));
  CHECK_THAT(page, !Contains("none<i>") && Contains("none&#60;i&#62;.msg"));
  CHECK_THAT(page, Contains("5 of 5"));           // depth maps
  CHECK_THAT(page, !Contains("cloud.potree\""));  // a folder is nothing to look at
  if (!has_page) return;
  for (const char* name : {"a", "b"}) {
    CHECK_THAT(page, Contains("<a href=\"./" + std::string(name) + "/report.html\">" + name + "</a>"));
    CHECK(fs::exists(missions.result(name) / "report.html"));
  }
  CHECK_THAT(read_text(missions.result("b") / "report.html"), Contains("\"potree\":\"./cloud.potree\""));
  const auto before = fs::last_write_time(missions.result("a") / "report.html");
  fs::remove(missions.result("b") / "report.html");  // what has lost its report is made again, and nothing else
  CHECK(missions.batch(more).code == 7);
  CHECK(fs::exists(missions.result("b") / "report.html"));
  CHECK(fs::last_write_time(missions.result("a") / "report.html") == before);
}

TEST_CASE("a manifest or a command line that makes no sense ends a batch before it begins") {
  const Missions missions;
  const auto refused = [&](const std::string& manifest, int code, const std::vector<std::string>& more,
                           const std::string& complaint) {
    write_text(missions / "m.jsonl", manifest);
    const Result result = missions.batch(more);
    INFO(result.err);
    CHECK(result.code == code);
    CHECK_THAT(result.err, Contains(complaint));
    CHECK_FALSE(fs::exists(missions / "out"));
  };
  const std::string good = Missions::line("a").dump() + "\n";
  refused(good + "\n" + good, 3, {}, "lines 1 and 3 are both called \"a\"");
  refused("", 3, {}, "there is no mission in it");
  refused("name\tmap\tpicture\n", 3, {}, "there is no column \"picture\"");
  refused(good, 2, {"--jobs", "0"}, "--jobs is \"0\"");
  refused(good, 2, {"--memory", "0"}, "--memory is \"0\"");
  refused(good, 2, {"--memory", "8G"}, "--memory is \"8G\"");
  refused(good, 2, {"--print-memory"}, "there is no option --print-memory");
  refused(good, 2, {"--device", "0,x"}, "--device is \"0,x\"");
  refused(good, 2, {"--fusion-window", "99"}, "--fusion-window is 99");
  refused(good, 2, {"--fusion-windw", "9"}, "did you mean --fusion-window?");
  refused(good, 2, {"--follow"}, "--follow is not for missions of a batch");
  refused(good, 2, {"--preview", "../look"}, "--preview is \"../look\"");
  refused(good, 2, {"--preview", "work"}, "--preview is \"work\"");
  refused(good, 2, {"--report", "../r.html"}, "--report is \"../r.html\"");
  refused(good, 2, {"--report", "log.txt"}, "--report is \"log.txt\"");
  CHECK(densify({"batch"}).code == 2);
  CHECK(densify({"batch", (missions / "m.jsonl").string()}).code == 2);
  CHECK(densify({"batch", (missions / "none.jsonl").string(), "-o", (missions / "out").string()}).code == 3);
  const Result help = densify({"batch", "--help"});
  CHECK(help.code == 0);
  CHECK_THAT(help.out, Contains("--retry") && Contains("Examples:") && Contains("--scan") && Contains("7 some"));
}

TEST_CASE("a folder that is not of a batch stays as it is") {
  const Missions missions;
  missions.write({Missions::line("a"), Missions::line("b")});
  fs::create_directories(missions.result("a"));
  write_text(missions.result("a") / "cloud.ply", "somebody's");
  fs::create_directories(missions.result("b"));
  write_text(missions.result("b") / "status.json", "somebody's");
  const Result result = missions.batch();
  CHECK(result.code == 8);
  CHECK_THAT(result.out, Contains("not of a batch") && Contains("is no status of a mission"));
  CHECK(read_text(missions.result("a") / "cloud.ply") == "somebody's");
  CHECK(read_text(missions.result("b") / "status.json") == "somebody's");
}

TEST_CASE("batch --scan finds maps with the images or the video beside them, and its list can be run") {
  const TempDir dir;
  const auto add = [&](const std::string& folder, const std::string& map, const std::vector<std::string>& files) {
    fs::create_directories(dir / folder);
    fs::copy_file(mission() / "map.msg", dir / (folder + "/" + map));
    for (const std::string& file : files) {
      fs::create_directories((dir / (folder + "/" + file)).parent_path());
      write_text(dir / (folder + "/" + file), "");
    }
  };
  add("tree/one", "map.msg", {"mask.png", "other/1.png"});
  fs::create_directory_symlink(mission() / "images", dir / "tree/one/images");
  add("tree/site/two", "fly.msg", {"fly.mp4", "else.mp4", "notes/n.txt"});
  add("tree/site/two", "walk.db", {});
  add("tree/none", "map.msg", {"b/1.png", "c/1.png"});
  const Result scan = densify({"batch", "--scan", (dir / "tree").string()});
  CHECK(scan.code == 0);
  std::istringstream text(scan.out);
  std::vector<Json> lines;
  for (std::string line; std::getline(text, line);) lines.push_back(Json::parse(line));
  REQUIRE(lines.size() == 3);
  CHECK(lines[0]["name"] == "one");
  CHECK(lines[0]["images"] == (dir / "tree/one/images").string());
  CHECK(lines[0]["mask"] == (dir / "tree/one/mask.png").string());
  CHECK(lines[1]["name"] == "site-two-fly");
  CHECK(lines[1]["video"] == (dir / "tree/site/two/fly.mp4").string());
  CHECK(lines[2]["video"] == (dir / "tree/site/two/else.mp4").string());
  CHECK_THAT(scan.err, Contains("tree/none/map.msg") && Contains("no images or video beside it"));
  fs::remove(dir / "tree/one/mask.png");
  write_text(dir / "list.jsonl", densify({"batch", "--scan", (dir / "tree/one").string()}).out);
  std::vector<std::string> words{"batch", (dir / "list.jsonl").string(), "-o", (dir / "out").string()};
  for (const std::string& option : quick_options()) words.push_back(option);
  CHECK(densify(words).code == 0);
  fs::create_directory(dir / "nothing");
  CHECK(densify({"batch", "--scan", (dir / "nothing").string()}).code == 3);
}

TEST_CASE("processes that have a share each make a batch together, the table says how far they are") {
  const Missions missions;
  std::vector<Json> lines;
  for (const char* name : {"a", "b", "c", "d", "e"}) lines.push_back(Missions::line(name));
  lines[3]["map"] = "nowhere.msg";
  missions.write(lines);
  const Result nothing = missions.batch({"--summary"});
  CHECK(nothing.code == 8);
  CHECK_THAT(nothing.out, Contains("0 of 5 missions done, 0 failed, 5 waiting"));
  CHECK_FALSE(fs::exists(missions.result("a")));

  Command first(densify_words(missions.words({"--only", "0/2"})));
  const pid_t child = stop_run_of(missions, "a");
  const Result second = missions.batch({"--only", "1/2"});
  CHECK(second.code == 7);
  CHECK_THAT(second.out, Contains("\nb ") && Contains("1 of 2 missions done, 1 failed") && !Contains("\na "));
  CHECK(missions.report()["waiting"] == 5);  // that of the summary: a share writes none
  const Result middle = missions.batch({"--summary"});
  CHECK(middle.code == 7);
  CHECK_THAT(middle.out, Contains("1 of 5 missions done (1 of them before), 1 failed, 1 running, 2 waiting"));
  CHECK_THAT(missions.batch().err, Contains("another process works in this folder of a batch"));

  const std::string before = read_text(missions.result("a") / "status.json");
  const Result same = missions.batch({"--only", "0/5"});  // somebody makes it already
  CHECK(same.code == 8);
  CHECK_THAT(same.out, Contains("another process works in this folder of a mission"));
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
  CHECK_THAT(all.out, Contains("4 of 5 missions done (4 of them before), 1 failed"));
  CHECK(missions.report()["done"] == 4);
  for (const char* name : {"b", "c", "e"}) {
    CHECK(read_text(missions.result(name) / "cloud.ply") == read_text(missions.result("a") / "cloud.ply"));
  }
}

TEST_CASE("batch --slurm prints what submits a batch") {
  const Missions missions;
  missions.write({Missions::line("a"), Missions::line("b"), Missions::line("c")});
  const Result script = missions.batch({"--slurm", "--sbatch", "--time=2:00:00 --comment 'a b'", "--retry"});
  CHECK(script.code == 0);
  CHECK_FALSE(fs::exists(missions / "out"));
  CHECK_THAT(script.out, Contains("--array=0-2 ") && Contains("--only auto") && Contains("--summary") &&
                             Contains("options=(--time=2:00:00 --comment 'a b')") && Contains("--retry)") &&
                             Contains("#SBATCH --requeue"));
  const auto refused = [&](const std::vector<std::string>& more, const std::string& complaint) {
    const Result result = missions.batch(more);
    CHECK(result.code == 2);
    CHECK_THAT(result.err, Contains(complaint));
  };
  refused({"--slurm=run"}, "--slurm is \"run\"");
  refused({"--slurm", "--only", "0/2"}, "--slurm excludes --only");
  refused({"--sbatch", "-p x"}, "--sbatch needs --slurm");
  refused({"--only", "2/2"}, "--only is \"2/2\"");
  refused({"--only", "auto"}, "--only auto: SLURM_ARRAY_TASK_ID");
  refused({"--only", "0/2", "--summary"}, "exclude each other");

  // With programs of its own for sbatch, which fail or say which job it is.
  const auto submit = [&](const std::string& sbatch) {
    fs::create_directories(missions / "bin");
    write_text(missions / "bin/sbatch", "#!/bin/sh\n" + sbatch + "\n");
    fs::permissions(missions / "bin/sbatch", fs::perms::owner_all);
    std::vector<std::string> words{"/usr/bin/env", "PATH=" + (missions / "bin").string() + ":/usr/bin:/bin"};
    for (const std::string& word : densify_words(missions.words({"--slurm=submit"}))) words.push_back(word);
    return Command(words).wait();
  };
  const Result submitted = submit("echo \"$*\" >>" + (missions / "said").string() + "; echo '12;cluster'");
  CHECK(submitted.code == 0);
  CHECK_THAT(submitted.out, Contains("job 12 makes the missions"));
  CHECK_THAT(read_text(missions / "said"), Contains("--array=0-2") && Contains("--dependency=afterany:12 "));
  CHECK(submit("exit 3").code == 6);
}

TEST_CASE("Missions of a batch have clouds in the formats that they ask for", "[batch]") {
  const Missions missions;
  missions.write({Missions::line("plain"), Missions::line("both", {{"options", {{"format", "las,ply"}}}})});
  REQUIRE(missions.batch({"--format", "las"}).code == 0);
  CHECK(fs::exists(missions.result("plain") / "cloud.las"));
  CHECK_FALSE(fs::exists(missions.result("plain") / "cloud.ply"));
  CHECK(fs::exists(missions.result("both") / "cloud.las"));
  CHECK(fs::exists(missions.result("both") / "cloud.ply"));
  fs::remove(missions.result("both") / "cloud.ply");
  REQUIRE(missions.batch({"--format", "las"}).code == 0);
  CHECK(fs::exists(missions.result("both") / "cloud.ply"));

  const Result wrong = missions.batch({"--format", "las,obj"});
  CHECK(wrong.code == 2);
  CHECK_THAT(wrong.err, Contains("las,obj") && Contains("ply, las"));
}

TEST_CASE("the fingerprint of a mission tells when one of its files has changed", "[batch]") {
  const TempDir dir;
  std::filesystem::create_directory(dir / "images");
  pmsp::tool::Mission mission;
  mission.map = "map.msg";
  mission.images = "images";
  mission.video = "video.mp4";
  mission.mask = "mask.png";
  const auto fingerprint = [&] { return fingerprint_of(mission, {}, dir.path()); };
  std::string before = fingerprint();
  CHECK(fingerprint() == before);
  for (const char* name : {"map.msg", "images/1.jpg", "video.mp4", "mask.png", "mask.png"}) {
    write_text(dir / name, read_text(dir / name) + "more");
    const std::string now = fingerprint();
    CAPTURE(name);
    CHECK(now != before);
    before = now;
  }
}
