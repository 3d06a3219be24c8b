// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "cli/command.h"
#include "pmsp/io/densify.h"

using namespace pmsp_test;
using Catch::Matchers::Contains;

namespace {

namespace fs = std::filesystem;

/// A room seen by two lenses 30 mm apart.
const fs::path& two_lenses() {
  static const TempDir dir;
  static const fs::path folder =
      made_mission(dir, {"--keyframes", "10", "--width", "1280", "--samples", "2", "--lens-distance", "0.03"});
  return folder;
}

Result run(const TempDir& dir, std::vector<std::string> more) {
  std::vector<std::string> words{"run",
                                 (two_lenses() / "map.msg").string(),
                                 "--images",
                                 (two_lenses() / "images").string(),
                                 "--width",
                                 "64",
                                 "--height",
                                 "32",
                                 "--force",
                                 "-o",
                                 (dir / "c.ply").string(),
                                 "--stats",
                                 (dir / "s.json").string(),
                                 "--patchmatch-geometric-passes",
                                 "0"};
  words.insert(words.end(), more.begin(), more.end());
  const Result result = densify(words);
  INFO(result.err);
  REQUIRE(result.code == 0);
  return result;
}

nlohmann::json stats(const TempDir& dir) { return nlohmann::json::parse(read_text(dir / "s.json")); }

}  // namespace

// One test case, so that its images are rendered once.
TEST_CASE("two lenses") {
  const TempDir dir;
  SECTION("are detected and reported and corrected") {
    const Result result = run(dir, {});
    CHECK_THAT(result.err, Contains("lenses: 0.0") && Contains("map units apart") && Contains("corrected"));
    const nlohmann::json found = stats(dir);
    CHECK(found["lenses"]["corrected"] == true);
    CHECK(found["lenses"]["distance"].get<double>() == Approx(0.03).epsilon(0.15));
    CHECK(found["options"]["lens_distance"] == found["lenses"]["distance"]);
  }

  SECTION("are corrected by the library and the tool with the same points") {
    run(dir, {});
    const pmsp::SlamMap map = pmsp::read_map(two_lenses() / "map.msg");
    const auto images = pmsp::open_image_folder(map, two_lenses() / "images");
    pmsp::DensifierOptions options = pmsp::preset(pmsp::Quality::kNormal);
    options.width = 64;
    options.height = 32;
    options.advanced.patchmatch.geometric_passes = 0;
    pmsp::CloudOutput cloud(dir / "library.ply", pmsp::cloud_header_of(map));
    pmsp::densify(map, *images, options, cloud);
    cloud.commit();
    const auto points_of = [&](const char* name) {
      const std::string text = read_text(dir / name);
      return text.substr(text.find("end_header\n"));
    };
    CHECK(points_of("library.ply").size() > 10000);
    CHECK(points_of("library.ply") == points_of("c.ply"));
  }

  SECTION("are not estimated if given or disabled") {
    CHECK_THAT(run(dir, {"--lens-distance", "0.05"}).err, !Contains("map units apart"));
    CHECK(stats(dir)["options"]["lens_distance"] == 0.05);
    CHECK_FALSE(stats(dir).contains("lenses"));
    CHECK_THAT(run(dir, {"--no-lens-calibration"}).err, !Contains("map units apart"));
    CHECK(stats(dir)["options"]["lens_distance"] == 0.0);
    std::ofstream(dir / "paper.json") << R"({"quality": "paper"})";
    CHECK_THAT(run(dir, {"--config", (dir / "paper.json").string()}).err, !Contains("map units apart"));
  }

  SECTION("are estimated once and stored in a workspace") {
    const std::string workspace = (dir / "work").string();
    CHECK_THAT(run(dir, {"--workspace", workspace}).err, Contains("map units apart"));
    const nlohmann::json first = stats(dir);
    CHECK_THAT(run(dir, {"--workspace", workspace}).err, !Contains("map units apart") && Contains("0 made"));
    CHECK(stats(dir)["options"]["lens_distance"] == first["options"]["lens_distance"]);
  }
}
