// SPDX-License-Identifier: BSD-2-Clause
#include <chrono>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "batch_mission.h"
#include "cli/batch_missions.h"
#include "report_page.h"
#include "web/page.h"

using namespace pmsp_test;
using Catch::Contains;

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

TEST_CASE("table and JSON lines have the same content") {
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
  CHECK(window("a") == 7);  // the mission's own option precedes the common one
  CHECK(window("map") == 5);
  const Result table = missions.batch(for_all, "m.tsv");
  CHECK(table.code == 0);
  CHECK_THAT(table.err, Contains("2 done before, 0 to do"));
  CHECK(missions.status("map")["state"] == "done");  // called as its map
}

TEST_CASE("a batch prints events and output directories lie beside their mission") {
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
  CHECK(fs::exists(missions.result("a") / "work"));  // as recorded
}

TEST_CASE("a batch has a page with its table and links to each mission's outputs") {
  const Missions missions;
  missions.write({Missions::line("a"), Missions::line("b", {{"options", {{"format", "ply,potree"}}}}),
                  Missions::line("c<b>", {{"map", "none & nowhere.msg"}}),
                  Missions::line("d", {{"map", "none<i>.msg"}})});
  const bool has_page = pmsp::web::has_report_page();
  const std::vector<std::string> more =
      has_page ? std::vector<std::string>{"--report", "report.html", "--report-points", "500"}
               : std::vector<std::string>{};
  CHECK(missions.batch(more).code == 7);
  const std::string page = read_text(missions / "out" / "index.html");
  CHECK(page.rfind("<!doctype html>", 0) == 0);
  CHECK_THAT(page, Contains("2 of 4 missions done, 2 failed") && Contains("default-src 'none'"));
  CHECK_THAT(page, Contains("<a href=\"./a/cloud.ply\">cloud.ply</a>") && Contains("<a href=\"./a/log.txt\">"));
  CHECK_THAT(page, !Contains("none<i>") && Contains("none&#60;i&#62;.msg"));
  CHECK_THAT(page, Contains("<th scope=\"col\">coverage</th>"));
  CHECK_THAT(page, !Contains("cloud.potree\""));  // a directory is no report
  if (!has_page) return;
  for (const char* name : {"a", "b"}) {
    CHECK_THAT(page, Contains("<a href=\"./" + std::string(name) + "/report.html\">" + name + "</a>"));
    CHECK(fs::exists(missions.result(name) / "report.html"));
  }
  CHECK_THAT(read_text(missions.result("b") / "report.html"), Contains("\"potree\":\"./cloud.potree\""));
  const auto before = fs::last_write_time(missions.result("a") / "report.html");
  fs::remove(missions.result("b") / "report.html");  // only the mission without a report runs again
  CHECK(missions.batch(more).code == 7);
  CHECK(fs::exists(missions.result("b") / "report.html"));
  CHECK(fs::last_write_time(missions.result("a") / "report.html") == before);
}

TEST_CASE("an invalid manifest or command line is refused before the batch begins") {
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
  refused(good + "\n" + good, 3, {}, "lines 1 and 3 are both named \"a\"");
  refused("", 3, {}, "contains no mission");
  refused("name\tmap\tpicture\n", 3, {}, "there is no column \"picture\"");
  refused(good, 2, {"--jobs", "0"}, "--jobs is \"0\"");
  refused(good, 2, {"--memory", "0"}, "--memory is \"0\"");
  refused(good, 2, {"--memory", "8G"}, "--memory is \"8G\"");
  refused(good, 2, {"--print-memory"}, "there is no option --print-memory");
  refused(good, 2, {"--device", "0,x"}, "--device is \"0,x\"");
  refused(good, 2, {"--summary", "--dry-run"}, "--summary and --dry-run exclude each other");
  refused(good, 2, {"--fusion-window", "99"}, "--fusion-window is 99");
  refused(good, 2, {"--fusion-windw", "9"}, "did you mean --fusion-window?");
  refused(good, 2, {"--follow"}, "--follow is not available in a batch");
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

TEST_CASE("a directory of no batch stays unchanged") {
  const Missions missions;
  missions.write({Missions::line("a"), Missions::line("b")});
  fs::create_directories(missions.result("a"));
  write_text(missions.result("a") / "cloud.ply", "somebody's");
  fs::create_directories(missions.result("b"));
  write_text(missions.result("b") / "status.json", "somebody's");
  const Result result = missions.batch();
  CHECK(result.code == 8);
  CHECK_THAT(result.out, Contains("no result of a batch") && Contains("is no status of a mission"));
  CHECK(read_text(missions.result("a") / "cloud.ply") == "somebody's");
  CHECK(read_text(missions.result("b") / "status.json") == "somebody's");
}

TEST_CASE("batch --scan finds maps with images or video beside them and its list can be run") {
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

TEST_CASE("batch --slurm prints the commands that submit a batch") {
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

  // With replacements for sbatch that fail or print a job id.
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

TEST_CASE("Missions of a batch have clouds in the requested formats", "[batch]") {
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
  CHECK_THAT(wrong.err, Contains("las,obj") && Contains("ply, splat, las"));
}

TEST_CASE("the fingerprint of a mission changes with each of its files", "[batch]") {
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
