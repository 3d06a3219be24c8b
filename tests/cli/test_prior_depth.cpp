// SPDX-License-Identifier: BSD-2-Clause
// run --prior-depth
#include <filesystem>
#include <string>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "pmsp/io/depth.h"

using namespace pmsp_test;
using Catch::Contains;

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

namespace {

/// The true disparities of the mission: values without a unit.
void write_disparities(const fs::path& folder) {
  fs::create_directories(folder);
  for (const fs::directory_entry& file : fs::directory_iterator(mission() / "gt/range_mm")) {
    pmsp::Image<float> values = pmsp::read_png16(file.path(), 0.001);
    for (float& value : values.pixels()) value = value > 0.0F ? 100.0F / value + 7.0F : 0.0F;
    pmsp::write_pfm(folder / (file.path().stem().string() + ".pfm"), values);
  }
}

Json stats_of(const fs::path& path) { return Json::parse(read_text(path)); }

std::size_t used(const Json& stats) {
  std::size_t count = 0;
  for (const Json& entry : stats["prior_depth"]) count += entry.contains("model");
  return count;
}

}  // namespace

TEST_CASE("Prior depth is aligned and contradictory depth images are skipped and counted", "[prior depth]") {
  const TempDir dir;
  write_disparities(dir / "depth");
  const auto run = [&](const std::string& name) {
    return densify(quick_run(dir / (name + ".ply"), {"--prior-depth", (dir / "depth").string(), "--stats",
                                                     (dir / (name + ".json")).string()}));
  };
  const Result all = run("all");
  REQUIRE(all.code == 0);
  CHECK_THAT(all.err, Contains("have one that fits"));
  const Json stats = stats_of(dir / "all.json");
  const std::size_t keyframes = stats["prior_depth"].size();
  CHECK(keyframes > 2);
  CHECK(used(stats) == keyframes);
  CHECK(stats["prior_depth"][0]["model"] == "inverse depth");
  CHECK(stats["prior_depth"][0]["scale"].get<double>() > 0.0);

  // A broken file, a wrong shape and a missing file affect their own keyframe only.
  std::vector<fs::path> files;
  for (const fs::directory_entry& file : fs::directory_iterator(dir / "depth")) files.push_back(file.path());
  REQUIRE(files.size() >= 3);
  write_text(files[0], "Pf\n640 320\n-1\n");
  pmsp::write_pfm(files[1], pmsp::Image<float>(64, 64, 1.0F));
  fs::remove(files[2]);
  const Result some = run("some");
  REQUIRE(some.code == 0);
  CHECK_THAT(some.err, Contains("1 have none") && Contains("2 are left out"));
  CHECK(used(stats_of(dir / "some.json")) == keyframes - 3);

  CHECK(densify(quick_run(dir / "no.ply", {"--prior-depth", (dir / "nothing").string()})).code == 3);
}

TEST_CASE("Prior depth is an input of a workspace", "[prior depth]") {
  const TempDir dir;
  write_disparities(dir / "depth");
  const std::vector<std::string> more{
      "--prior-depth", (dir / "depth").string(),  "--workspace", (dir / "work").string(),
      "--stats",       (dir / "s.json").string(), "--force"};
  REQUIRE(densify(quick_run(dir / "a.ply", more)).code == 0);
  REQUIRE(densify(quick_run(dir / "b.ply", more)).code == 0);
  const Json kept = stats_of(dir / "s.json")["workspace"];
  CHECK(kept["kept"] == kept["depth_maps"]);
  CHECK(read_text(dir / "a.ply") == read_text(dir / "b.ply"));
  REQUIRE(densify(quick_run(dir / "alone.ply", {"--prior-depth", (dir / "depth").string()})).code == 0);
  CHECK(read_text(dir / "a.ply") == read_text(dir / "alone.ply"));

  const fs::path first = fs::directory_iterator(dir / "depth")->path();
  pmsp::Image<float> values = pmsp::read_pfm(first);
  values(0, 0) += 1.0F;
  pmsp::write_pfm(first, values);
  REQUIRE(densify(quick_run(dir / "c.ply", more)).code == 0);
  const Json changed = stats_of(dir / "s.json")["workspace"];
  CHECK(changed["made"] >= 1);
  CHECK(changed["kept"] < kept["kept"]);
}
