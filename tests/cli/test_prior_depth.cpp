// SPDX-License-Identifier: BSD-2-Clause
// run --prior-depth
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "pmsp/camera.h"
#include "pmsp/io/cloud.h"
#include "pmsp/io/depth.h"
#include "pmsp/io/map.h"
#include "support/sanitized.h"

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

/// Depth as networks give it: smooth, noisy, wrong by up to 10 % in large parts, and in another unit for each image.
void write_learned_depth(const fs::path& mission, const fs::path& folder) {
  fs::create_directories(folder);
  std::mt19937 random(3);
  std::normal_distribution<float> noise(1.0F, 0.02F);
  for (const fs::directory_entry& file : fs::directory_iterator(mission / "gt/range_mm")) {
    const pmsp::Image<float> truth = pmsp::read_png16(file.path(), 0.001);
    const int width = truth.width(), height = truth.height();
    const float number = std::stof(file.path().stem().string());
    pmsp::Image<float> depth(width, height);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        float mean = 0.0F;
        for (int k = 0; k < 9; ++k)
          mean += truth((x + width + k % 3 - 1) % width, std::clamp(y + k / 3 - 1, 0, height - 1)) / 9;
        const float longitude = 6.2832F * static_cast<float>(x) / static_cast<float>(width);
        const float latitude = 3.1416F * static_cast<float>(y) / static_cast<float>(height);
        const float wave = 1.0F + 0.06F * std::sin(2.0F * longitude + number) * std::sin(latitude) +
                           0.04F * std::cos(3.0F * latitude + 2.0F * number);
        depth(x, y) = (0.2F + 0.1F * number) * wave * noise(random) * mean;
      }
    }
    pmsp::write_pfm(folder / (file.path().stem().string() + ".pfm"), depth);
  }
}

struct PointErrors {
  double median = 0.0;  ///< relative to the distance
  double wrong = 0.0;   ///< share above 5 %
};

/// Errors along the ray of the keyframe that a point fits best.
PointErrors errors_of(const fs::path& cloud, const fs::path& mission) {
  const pmsp::SlamMap map = pmsp::read_map(mission / "map.msg");
  std::vector<pmsp::Image<float>> truth;
  for (const pmsp::MapKeyframe& keyframe : map.keyframes) {
    truth.push_back(
        pmsp::read_png16(mission / "gt/range_mm" / ("00000" + std::to_string(keyframe.id) + ".png"), 0.001));
  }
  std::vector<double> errors;
  for (const Eigen::Vector3d& position : pmsp::read_ply(cloud).positions) {
    double least = 1.0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const Eigen::Vector3d ray = map.keyframes[i].cam_from_world * position;
      const Eigen::Vector2d pixel = pmsp::pixel_from_bearing(ray, truth[i].width(), truth[i].height());
      const int x = std::clamp(static_cast<int>(pixel.x()), 0, truth[i].width() - 1);
      const int y = std::clamp(static_cast<int>(pixel.y()), 0, truth[i].height() - 1);
      least = std::min(least, std::abs(ray.norm() / static_cast<double>(truth[i](x, y)) - 1.0));
    }
    errors.push_back(least);
  }
  REQUIRE(errors.size() > 1000);
  std::sort(errors.begin(), errors.end());
  const auto right = std::upper_bound(errors.begin(), errors.end(), 0.05) - errors.begin();
  return {errors[errors.size() / 2], 1.0 - static_cast<double>(right) / static_cast<double>(errors.size())};
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

TEST_CASE("depth of a network becomes consistent with the images and fills bare walls", PMSP_ACCURACY) {
  const TempDir dir;
  const fs::path room = dir / "room";
  require_ok(
      Command({PMSP_SYNTH, "--scene", "painted", "--keyframes", "5", "--width", "256", "-o", room.string()}).wait());
  write_learned_depth(room, dir / "depth");
  const auto errors = [&](const std::string& name, const Words& words) {
    const fs::path cloud = dir / (name + ".ply");
    require_ok(densify(joined(words, {(room / "map.msg").string(), "--images", (room / "images").string(), "--quality",
                                      "online", "--width", "128", "--height", "64", "-o", cloud.string()})));
    return errors_of(cloud, room);
  };
  const PointErrors without = errors("without", {"run"});
  const PointErrors with = errors("with", {"run", "--prior-depth", (dir / "depth").string()});
  const PointErrors alone = errors("alone", {"fuse", (dir / "depth").string(), "--depth-scale", "auto"});
  CAPTURE(without.median, without.wrong, with.median, with.wrong, alone.median, alone.wrong);
  CHECK(with.median < 0.5 * alone.median);
  CHECK(with.wrong < 0.9 * without.wrong);
  CHECK(alone.median < 0.05);  // in map units, though each image has a unit of its own
}
