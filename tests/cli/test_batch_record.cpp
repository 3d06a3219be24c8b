// SPDX-License-Identifier: BSD-2-Clause
#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "batch_mission.h"
#include "cli/batch_missions.h"

using namespace pmsp_test;
using Catch::Contains;

namespace fs = std::filesystem;

TEST_CASE("a results directory resumes with its recorded missions and options", "[batch]") {
  const Missions missions;
  missions.write(
      {Missions::line("a"), Missions::line("b", {{"map", "later.msg"}}), Missions::line("c"), Missions::line("d")});
  Command command(densify_words(missions.words({"--fusion-window", "5", "--keep-workspaces"})));
  stop_run_of(missions, "c");
  kill(command.pid(), SIGKILL);
  command.wait();
  const std::string first = missions.status("a").dump();
  const std::string files = missions.files();

  const Result table = missions.bare({"--summary"});
  CHECK(table.code == 7);
  CHECK_THAT(table.out, Contains("1 of 4 missions done, 1 failed, 1 interrupted, 1 waiting"));
  CHECK(missions.files() == files);
  const Result resumed = densify({"batch", (missions / "m.jsonl").string(), "-o", (missions / "out").string()});
  CHECK(resumed.code == 7);
  CHECK_THAT(resumed.err, Contains("1 done before, 1 failed") && Contains("2 to do") && Contains("--fusion-window=5"));
  CHECK(missions.status("a").dump() == first);
  CHECK_THAT(missions.status("d")["command"].dump(), Contains("--fusion-window=5"));
  CHECK(fs::exists(missions.result("a") / "work/workspace.json"));

  const std::string failure = read_text(missions.result("b") / "log.txt");
  CHECK(missions.bare({"--retry"}).code == 7);
  const std::string log = read_text(missions.result("b") / "log.txt");
  CHECK(log.rfind(failure, 0) == 0);
  const std::string again = log.substr(failure.size());
  CHECK_THAT(again, Contains("Z, host ") && Contains(", pmsp-densify ") && Contains(" run ") &&
                        Contains("later.msg: there is no such file"));
  fs::copy_file(missions / "map.msg", missions / "later.msg");
  fs::remove(missions.result("d") / "cloud.ply");
  CHECK(missions.bare({"--retry"}).code == 0);
  CHECK_THAT(missions.status("b")["command"].dump(), Contains("--fusion-window=5"));
  CHECK(missions.status("a").dump() == first);

  const std::string done = missions.files();
  CHECK(missions.bare({}).code == 0);
  CHECK(missions.bare({"--summary"}).code == 0);
  CHECK(missions.files() == done);  // nothing was computed
}

TEST_CASE("other options on a results directory are refused without --force", "[batch]") {
  const Missions missions;
  missions.write({Missions::line("a"), Missions::line("b", {{"options", {{"fusion-window", 5}}}})});
  REQUIRE(missions.batch({"--seed", "1"}).code == 0);
  const std::string files = missions.files();
  for (const char* call : {"--retry", "--summary", "--dry-run", "--quiet"}) {
    const Result refused = missions.bare({call, "--seed", "2"});
    CHECK(refused.code == 2);
    CHECK_THAT(refused.err, Contains("recorded --seed=1, given --seed=2") && Contains("--force"));
  }
  CHECK_THAT(missions.bare({"--min-confidence", "0.5"}).err,
             Contains("recorded none, given --fusion-min-confidence=0.5"));
  CHECK(missions.bare({"--seed", "1", "--threads", "1", "--backend", "cpu"}).code == 0);
  missions.write({Missions::line("a"), Missions::line("b")});
  CHECK_THAT(missions.batch().err, Contains("recorded --fusion-window=5, given none"));
  fs::rename(missions / "map.msg", missions / "away.msg");  // as on an unmounted disk
  CHECK(missions.bare({"--retry"}).code == 0);
  fs::rename(missions / "away.msg", missions / "map.msg");

  const std::string unchanged = missions.status("a").dump();
  CHECK(missions.batch({"--force"}).code == 0);
  CHECK(missions.status("a").dump() == unchanged);
  CHECK_THAT(missions.status("b")["command"].dump(), !Contains("--fusion-window"));
  CHECK(missions.bare({"--force", "--seed", "2"}).code == 0);
  CHECK_THAT(missions.status("a")["command"].dump(), Contains("--seed=2") && Contains("--width=128"));
}

TEST_CASE("a batch without work writes nothing", "[batch]") {
  const Missions missions;
  const Result no_batch = missions.bare({"--summary"});
  CHECK(no_batch.code == 3);
  CHECK_THAT(no_batch.err, Contains("is no directory of a batch"));
  missions.write({Missions::line("a", {{"options", {{"fusion-window", 99}}}})});
  for (const std::vector<std::string>& call : {std::vector<std::string>{}, {"--summary"}, {"--dry-run"}}) {
    const Result result = missions.batch(call);
    CHECK(result.code == 8);
    CHECK_THAT(result.out, Contains("line 1: --fusion-window is 99"));
  }
  CHECK_FALSE(fs::exists(missions / "out"));
  fs::create_directories(missions / "out");
  write_text(missions / "out/batch.json", "{}");
  CHECK_THAT(missions.batch().err, Contains("is no record of a batch"));
}

TEST_CASE("batch --dry-run checks missions like info and computes nothing", "[batch]") {
  const Missions missions;
  missions.write({Missions::line("a"), Missions::line("b", {{"map", "nowhere.msg"}}),
                  Missions::line("c", {{"images", "nowhere"}}), Missions::line("d", {{"picture", "x"}})});
  const Result result = missions.batch({"--dry-run", "--jobs", "2"});
  INFO(result.err);
  CHECK(result.code == 7);
  CHECK_THAT(result.out, Contains("a: ok\n") && Contains("b: refused: ") && Contains("nowhere.msg: there is no such") &&
                             Contains("c: refused: ") && Contains("d: refused: ") &&
                             Contains("1 of 4 missions can be run, 3 refused"));
  CHECK_FALSE(fs::exists(missions / "out"));
  missions.write({Missions::line("a")});
  CHECK(missions.batch({"--dry-run"}).code == 0);
  missions.write({Missions::line("b", {{"map", "nowhere.msg"}})});
  CHECK(missions.batch({"--dry-run"}).code == 8);
}

TEST_CASE("missions.csv has a row for each mission", "[batch]") {
  const Missions missions;
  missions.write({Missions::line("a"), Missions::line("b", {{"map", "no, \"where\".msg"}})});
  CHECK(missions.batch().code == 7);
  std::map<std::string, std::string> row = missions.row("a");
  CHECK(row["state"] == "done");
  CHECK(row["points"] == missions.status("a")["points"].dump());
  for (const char* share : {"coverage", "confidence", "fit"}) {
    INFO(share);
    CHECK(std::stod(row[share]) > 0.1);
    CHECK(std::stod(row[share]) < 1.0);
  }
  CHECK(std::stod(row["MiB"]) > 1.0);
  CHECK(std::stod(row["seconds"]) > 0.0);
  CHECK(row["exit_code"] == "0");
  CHECK_THAT(row["version"], Contains("pmsp-densify "));
  CHECK_FALSE(row["host"].empty());
  CHECK(missions.row("b")["exit_code"] == "3");
  CHECK_THAT(read_text(missions / "out/missions.csv"), Contains("no, \"\"where\"\".msg: there is no such file\"\n"));
}

TEST_CASE("jobs of a batch use all devices round-robin", "[batch]") {
  using pmsp::tool::devices_of_job;
  using Devices = std::vector<int>;
  CHECK(devices_of_job(0, 2, {}).empty());
  const Devices three{0, 2, 5};
  CHECK(devices_of_job(0, 1, three) == three);
  CHECK(devices_of_job(0, 2, three) == Devices{0, 5});
  CHECK(devices_of_job(1, 2, three) == Devices{2});
  CHECK(devices_of_job(2, 3, three) == Devices{5});
  CHECK(devices_of_job(3, 7, three) == Devices{0});

  const Missions missions;  // without a GPU, all are none
  missions.write({Missions::line("a")});
  CHECK(missions.batch({"--device", "all", "--backend", "cpu"}).code == 0);
}

TEST_CASE("batch --scan finds reconstructions of COLMAP and OpenSfM", "[batch]") {
  const TempDir dir;
  const auto add = [&](const std::vector<std::string>& files) {
    for (const std::string& file : files) {
      fs::create_directories((dir / file).parent_path());
      write_text(dir / file, "");
    }
  };
  add({"colmap/images/1.jpg", "colmap/sparse/0/cameras.bin", "colmap/sparse/0/images.bin", "colmap/database.db"});
  add({"many/images/1.jpg", "many/sparse/0/cameras.txt", "many/sparse/0/images.txt", "many/sparse/1/cameras.txt",
       "many/sparse/1/images.txt"});
  add({"flat/images/1.jpg", "flat/cameras.txt", "flat/images.txt"});
  add({"sfm/images/1.jpg", "sfm/reconstruction.json", "sfm/masks/1.jpg.png"});
  const Result scan = densify({"batch", "--scan", dir.path().string()});
  INFO(scan.err);
  CHECK(scan.code == 0);
  const std::string root = dir.path().string() + "/";
  const auto line = [&](const std::string& name, const std::string& map) {
    return R"({"name":")" + name + R"(","map":")" + root + name + map + R"(","images":")" + root + name +
           "/images\"}\n";
  };
  CHECK(scan.out ==
        line("colmap", "/sparse/0") + line("flat", "") + line("many", "/sparse") + line("sfm", "/reconstruction.json"));
  CHECK(scan.err.empty());
}
