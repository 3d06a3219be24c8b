// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "progress.h"
#include "stats.h"

using namespace pmsp_test;
using namespace pmsp::tool;
using Catch::Contains;

namespace {

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

}  // namespace

TEST_CASE("progress is printed in words without empty counts") {
  CHECK(run_progress_text({0.0, 0, 0, 0}, -1.0) == "0 %");
  CHECK(run_progress_text({0.37, 1, 812'345, 0}, 65.0) == "37 %, 1 min 05 s left; 1 depth map, 812 k pixels");
  CHECK(run_progress_text({0.995, 54, 48'300'000, 210'400}, 0.0) == "100 %, 0 s left; 54 depth maps, 210 k points");
  CHECK(short_count(9'999) == "9 999");
}

TEST_CASE("the finished share assumes that remaining keyframes are like the previous ones") {
  pmsp::DensifierStats stats;
  CHECK(run_progress_of(stats, 10).share == 0.0);
  stats.keyframes_added = 5;
  stats.work_done = 3.0;
  stats.work_remaining = 2.0;
  CHECK(run_progress_of(stats, 10).share == Approx(0.3));
  CHECK(run_progress_of(stats, 5).share == Approx(0.6));
  CHECK(run_progress_of(stats, 0).share == Approx(0.6));
}

TEST_CASE("statistics contain each count under its own name") {
  RunReport report;
  report.keyframes = 1;
  report.with_image = 2;
  report.points_written = 3;
  pmsp::DensifierStats& s = report.stats;
  std::int64_t number = 10;
  for (std::int64_t* count : {&s.keyframes_added, &s.keyframes_accepted, &s.keyframes_rejected, &s.keyframes_blurred,
                              &s.depth_maps, &s.keyframes_without_neighbour, &s.keyframes_without_range}) {
    *count = number++;
  }
  for (std::int64_t* count : {&s.pixels, &s.pixels_matched, &s.pixels_after_median, &s.pixels_after_consistency,
                              &s.points_fused, &s.points_repeated, &s.points}) {
    *count = number++;
  }
  const nlohmann::ordered_json json = to_json(report);
  number = 10;
  CHECK(json["keyframes"]["in_map"] == 1);
  CHECK(json["keyframes"]["with_image"] == 2);
  CHECK(json["points_written"] == 3);
  for (const char* name :
       {"added", "accepted", "rejected", "blurred", "depth_maps", "without_neighbour", "without_range"}) {
    CHECK(json["keyframes"][name] == number++);
  }
  for (const char* name : {"unmasked", "matched", "after_median", "after_consistency"}) {
    CHECK(json["pixels"][name] == number++);
  }
  for (const char* name : {"points_fused", "points_repeated", "points"}) CHECK(json[name] == number++);
}

TEST_CASE("a run with points at the end reports its progress") {
  const TempDir dir;
  const Result result = densify(quick_run(dir / "c.ply", {"--progress", "json", "--free-space-whole-mission"}));
  INFO(result.err);
  REQUIRE(result.code == 0);
  std::vector<nlohmann::json> steps;
  for (const std::string& line : lines_of(result.out)) {
    const nlohmann::json event = nlohmann::json::parse(line);
    if (event["event"] == "keyframe" || event["event"] == "progress") steps.push_back(event);
  }
  REQUIRE(steps.size() >= 5);
  double before = 0.0;
  std::int64_t depth_maps = 0, pixels = 0;
  for (const nlohmann::json& step : steps) {
    CHECK(step["share"] >= before);
    CHECK(step["share"] <= 1.0);
    before = step["share"];
    CHECK(step["depth_maps"] >= depth_maps);
    depth_maps = step["depth_maps"];
    pixels = step["pixels"];
  }
  CHECK(depth_maps > 0);
  CHECK(pixels > 0);
  CHECK(before == Approx(1.0));
}

TEST_CASE("a run reports its stage while points are pending and ends with at most ten lines") {
  const TempDir dir;
  const Result result =
      densify(quick_run(dir / "c.ply", {"--free-space-whole-mission", "--preview", (dir / "look").string(),
                                        "--workspace", (dir / "work").string(), "--depth-maps",
                                        (dir / "depth").string(), "--stats", (dir / "s.json").string()}));
  INFO(result.err);
  REQUIRE(result.code == 0);
  CHECK_THAT(result.err, !Contains(" 0 points") && Contains(" %, ") && Contains(" s left"));
  const std::vector<std::string> lines = lines_of(result.err);
  const auto drawing =
      std::find_if(lines.begin(), lines.end(), [](const std::string& line) { return line.rfind("drawing ", 0) == 0; });
  REQUIRE(drawing != lines.end());
  CHECK(lines.end() - drawing - 1 <= 10);
  const auto wrote =
      std::find_if(lines.begin(), lines.end(), [](const std::string& line) { return line.rfind("wrote ", 0) == 0; });
  REQUIRE(wrote != lines.end());
  CHECK_THAT(lines.back(), Contains("convert"));
  CHECK_THAT(*wrote, Contains("wrote " + (dir / "c.ply").string()) && Contains("pictures ") &&
                         Contains("depth maps ") && Contains("statistics "));
}
