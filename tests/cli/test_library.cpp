// SPDX-License-Identifier: BSD-2-Clause
// pmsp::densify and pmsp-densify run on the same mission.
#include <catch2/catch.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "cli/command.h"
#include "map/scene_files.h"
#include "pmsp/io/densify.h"
#include "support/sanitized.h"

using namespace pmsp;
using namespace pmsp::test;
using namespace pmsp_test;
using Catch::Contains;

namespace {

namespace fs = std::filesystem;

/// The bytes of a PLY after its header.
std::string points_of(const fs::path& path) {
  const std::string text = read_text(path);
  return text.substr(text.find("end_header\n"));
}

/// As quick_run.
DensifierOptions quick(Quality quality) {
  DensifierOptions options = preset(quality);
  options.width = 128;
  options.height = 64;
  if (kSanitized) {
    options.simd = Simd::kScalar;
    options.advanced.patchmatch.iterations = 1;
    options.advanced.patchmatch.refinements = 1;
    options.advanced.patchmatch.geometric_passes = 0;
  }
  return options;
}

void write_with_library(const SlamMap& map, const fs::path& cloud, Quality quality) {
  const auto images = open_image_folder(map, mission() / "images");
  DensifyExtras extras;
  extras.calibrate.lenses = quality != Quality::kPaper;
  CloudOutput output(cloud, cloud_header_of(map));
  densify(map, *images, quick(quality), output, extras);
  output.commit();
}

}  // namespace

TEST_CASE("the library gives the points of the tool, with each preset") {
  const TempDir dir;
  const char* const name = GENERATE("paper", "online", "normal", "high");
  CAPTURE(name);
  const Result tool = densify(quick_run(dir / "tool.ply", {"--quality", name}));
  INFO(tool.err);
  REQUIRE(tool.code == 0);
  write_with_library(read_map(mission() / "map.msg"), dir / "library.ply", quality_from_name(name));
  CHECK(points_of(dir / "tool.ply").size() > 10000);
  CHECK(points_of(dir / "tool.ply") == points_of(dir / "library.ply"));
}

TEST_CASE("the library gives the points of the tool for a map without landmarks") {
  const TempDir dir;
  SlamMap map = read_map(mission() / "map.msg");
  for (MapKeyframe& keyframe : map.keyframes) {
    const std::string number = std::to_string(keyframe.id);
    keyframe.image = std::string(6 - number.size(), '0') + number + ".png";
  }
  fs::create_directories(dir / "poses");
  write_tum(dir / "poses" / "t.txt", map);
  ReadMapOptions options;
  options.image_list = dir / "poses" / "images.txt";
  std::vector<std::string> words = quick_run(dir / "tool.ply", {"--image-list", options.image_list.string()});
  words[1] = (dir / "poses" / "t.txt").string();
  const Result tool = densify(words);
  INFO(tool.err);
  REQUIRE(tool.code == 0);
  write_with_library(read_map(dir / "poses" / "t.txt", options), dir / "library.ply", Quality::kOnline);
  CHECK(points_of(dir / "tool.ply").size() > 10000);
  CHECK(points_of(dir / "tool.ply") == points_of(dir / "library.ply"));
}

TEST_CASE("the library gives the points of the tool with prior depth and warns of unreadable images") {
  const TempDir dir;
  fs::copy(mission() / "images", dir / "images");
  const fs::path broken = fs::directory_iterator(dir / "images")->path();
  write_text(broken, "no image");
  const fs::path depth = mission() / "gt" / "range_mm";
  std::vector<std::string> words = quick_run(dir / "tool.ply", {"--prior-depth", depth.string()});
  words[3] = (dir / "images").string();
  const Result tool = densify(words);
  INFO(tool.err);
  REQUIRE(tool.code == 0);
  CHECK_THAT(tool.err, Contains("have one that fits"));
  const SlamMap map = read_map(mission() / "map.msg");
  const auto images = open_image_folder(map, dir / "images");
  DensifyExtras extras;
  extras.prior_depth = depth;
  extras.image_folder = dir / "images";
  std::string warnings;
  extras.warning = [&](const std::string& text) { warnings += text + "\n"; };
  CloudOutput output(dir / "library.ply", cloud_header_of(map));
  pmsp::densify(map, *images, quick(Quality::kOnline), output, extras);
  output.commit();
  CHECK_THAT(warnings, Contains(broken.filename().string()));
  CHECK(points_of(dir / "tool.ply").size() > 10000);
  CHECK(points_of(dir / "tool.ply") == points_of(dir / "library.ply"));
}
