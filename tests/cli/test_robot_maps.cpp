// SPDX-License-Identifier: BSD-2-Clause
// Maps for robots: -o with .bt, .ot and .pgm.
#include <algorithm>

#include <catch2/catch.hpp>

#include "cli/command.h"
#include "export/robot_scene.h"
#include "pmsp/io/cloud.h"

using namespace pmsp_test;
using Catch::Contains;

namespace fs = std::filesystem;

namespace {

const Words kMetres{"--up", "--scale", "1"};

Words outputs(const std::vector<fs::path>& paths) {
  Words words;
  for (const fs::path& path : paths) words.insert(words.end(), {"-o", path.string()});
  return words;
}

/// A quick run with other outputs.
Words run_to(const std::vector<fs::path>& paths, const Words& more) {
  Words words = quick_run("", more);
  const auto output = std::find(words.begin(), words.end(), "-o");
  words.erase(output, output + 2);
  return joined(words, outputs(paths));
}

/// The same from the true depth maps of the room, with cells of 0.1 m.
Words fuse_to(const std::vector<fs::path>& paths, const Words& more) {
  const Words words{"fuse",
                    (mission() / "gt/range_mm").string(),
                    (mission() / "map.msg").string(),
                    "--images",
                    (mission() / "images").string(),
                    "--quality",
                    "online",
                    "--depth-scale",
                    "0.001",
                    "--cell-size",
                    "0.1"};
  return joined(joined(words, more), outputs(paths));
}

}  // namespace

TEST_CASE("a map without a known scale is refused before the run", "[robot]") {
  const TempDir dir;
  const Result refused = densify(run_to({dir / "a.bt"}, {}));
  CHECK(refused.code == 2);
  CHECK_THAT(refused.err, Contains("no metres") && Contains("--scale") && Contains("--map-units"));
  const Result sizeless = densify(run_to({dir / "a.pgm"}, {"--map-units", "--up"}));
  CHECK(sizeless.code == 2);
  CHECK_THAT(sizeless.err, Contains("--robot-height"));
  CHECK(dir.entries() == 0);
  require_ok(densify(run_to({dir / "a.bt"}, {"--map-units"})));
  CHECK_THAT(read_text(dir / "a.bt").substr(0, 200), Contains("map units, not metres"));
}

TEST_CASE("options that no output uses are refused", "[robot]") {
  const TempDir dir;
  const auto check = [&](const std::vector<fs::path>& paths, const Words& more, const char* remedy) {
    const Result refused = densify(run_to(paths, joined(kMetres, more)));
    CHECK(refused.code == 2);
    CHECK_THAT(refused.err, Contains(more[0]) && Contains(remedy));
  };
  check({dir / "a.las"}, {"--cell-size", "0.1"}, "--resolution");
  check({dir / "a.bt"}, {"--resolution", "0.1"}, "--cell-size");
  check({dir / "a.bt"}, {"--robot-step", "0.1"}, ".pgm");
  check({dir / "a.bt"}, {"--cell-size", "0"}, "a number > 0");
  check({dir / "a.pgm"}, {"--robot-height", "0"}, "a number > 0");
  check({dir / "a.pgm"}, {"--least-rays", "0"}, "1 to 255");
  CHECK(dir.entries() == 0);
}

TEST_CASE("a grid of a room has its floor and is free where it was seen", "[robot]") {
  const TempDir dir;
  require_ok(densify(fuse_to({dir / "a.pgm", dir / "a.bt"}, kMetres)));
  const ReadGrid grid(dir / "a.yaml");
  CHECK(grid.cell == 0.1);
  cv::Mat_<unsigned char> is_free(grid.image.size());
  cv::compare(grid.image, 254, is_free, cv::CMP_EQ);
  CHECK(cv::countNonZero(is_free) > 1500);  // of 48 m2, with furniture
  CHECK((grid.image.cols < 100 && grid.image.rows < 100));
  const cv::Mat_<float> elevation = cv::imread((dir / "a.elevation.tif").string(), cv::IMREAD_UNCHANGED);
  double low = 0.0, high = 0.0;
  cv::minMaxLoc(elevation, &low, &high, nullptr, nullptr, is_free);
  CHECK(low == Approx(-1.5).margin(0.16));
  CHECK(high == Approx(-1.5).margin(0.16));
}

TEST_CASE("files beside a grid are not overwritten without --force", "[robot]") {
  const TempDir dir;
  write_text(dir / "a.yaml", "mine");
  const Result refused = densify(fuse_to({dir / "a.pgm"}, kMetres));
  CHECK(refused.code == 6);
  CHECK_THAT(refused.err, Contains("a.yaml") && Contains("--force"));
  const Result twice = densify(fuse_to({dir / "b.pgm"}, joined(kMetres, {"--stats", (dir / "b.yaml").string()})));
  CHECK(twice.code == 2);
  CHECK(read_text(dir / "a.yaml") == "mine");
  CHECK(dir.entries() == 1);
}

TEST_CASE("a map that cannot be made leaves the cloud and is an error", "[robot]") {
  const TempDir dir;
  const std::vector<fs::path> paths{dir / "a.pgm", dir / "a.ply"};
  const Result result = densify(fuse_to(paths, joined(kMetres, {"--robot-height", "500"})));
  CHECK(result.code == 3);
  CHECK_THAT(result.err, Contains("--robot-height"));
  CHECK(pmsp::read_ply(dir / "a.ply").positions.size() > 1000);
  CHECK(dir.entries() == 1);

  const Words followed{"--workspace", (dir / "work").string(), "--follow", "--until-idle", "0.1", "--force"};
  const Result follows = densify(run_to(paths, joined(joined(kMetres, {"--robot-height", "500"}), followed)));
  CHECK_THAT(follows.err, Contains("waiting for a newer state"));
}

TEST_CASE("a map converted from a workspace is that of the run, and none is made from a cloud", "[robot]") {
  const TempDir dir;
  const fs::path work = dir / "work";
  const Words options = joined(kMetres, {"--crop", "-2,-2,-2,2,2,2"});
  const Words cached{"--workspace", work.string()};
  require_ok(densify(run_to({dir / "a.bt", dir / "a.ot", dir / "a.ply"}, joined(options, cached))));
  require_ok(densify(joined(joined({"convert", work.string()}, outputs({dir / "b.bt", dir / "b.ot"})), options)));
  CHECK(same_bytes(dir / "a.bt", dir / "b.bt"));
  CHECK(same_bytes(dir / "a.ot", dir / "b.ot"));
  const Result refused = densify(joined({"convert", (dir / "a.ply").string(), "-o", (dir / "c.bt").string()}, {}));
  CHECK(refused.code == 2);
  CHECK_THAT(refused.err, Contains("keyframes") && Contains("workspace"));
}
