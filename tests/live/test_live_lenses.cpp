// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "core/recording.h"
#include "live/live_missions.h"
#include "pmsp/camera.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

constexpr double kDistance = 0.03;

/// Through a room, with images large enough to estimate the lens distance.
const synth::Mission& cheap() {
  static const synth::Mission kCheap = [] {
    synth::Recipe recipe;
    recipe.keyframes = 10;
    recipe.width = 1280;
    recipe.height = 640;
    recipe.mission.render.samples = 2;
    recipe.mission.render.lens_distance = kDistance;
    return synth::textured_room(recipe);
  }();
  return kCheap;
}

/// Median distance of the final points from the surfaces, relative to that from the camera.
double error_of(const LiveSnapshot& snapshot, const synth::Mission& mission) {
  std::vector<KeyframeCloud> clouds;
  for (const LiveCloud& live : snapshot.clouds) {
    clouds.push_back(*live.cloud);
    clouds.back().cam_from_world = live.pose.cam_from_world;
  }
  return median_surface_error(mission.scene, clouds);
}

void end(LiveDensifier& live) {
  live.finish();
  REQUIRE(live.wait(kLong));
  REQUIRE(live.stats().errors == 0);
}

}  // namespace

TEST_CASE("A live mission estimates the lens distance and matches earlier keyframes again", PMSP_ACCURACY) {
  LiveOptions options = small_live(320);
  LiveDensifier live(options);
  const std::vector<LiveKeyframe> keyframes = live_keyframes(cheap());
  for (std::size_t i = 0; i < 7; ++i) live.add(keyframes[i]);
  end(live);  // too few to estimate
  CHECK(live.stats().lens_distance == 0.0);
  const double ignored = error_of(*live.snapshot(), cheap());
  for (std::size_t i = 7; i < keyframes.size(); ++i) live.add(keyframes[i]);
  end(live);
  CHECK(live.stats().lens_distance == Approx(kDistance).epsilon(0.15));
  CHECK(live.snapshot()->clouds.size() == keyframes.size());
  CHECK(error_of(*live.snapshot(), cheap()) < 0.6 * ignored);

  live.reset();
  CHECK(live.wait(kLong));
  CHECK(live.stats().lens_distance == 0.0);
  for (const LiveKeyframe& keyframe : keyframes) live.add(keyframe);
  end(live);
  CHECK(live.stats().lens_distance == Approx(kDistance).epsilon(0.15));
}

TEST_CASE("The lens distance is not estimated across maps or from removed keyframes", PMSP_ACCURACY) {
  LiveOptions options = small_live(64);
  std::vector<LiveKeyframe> keyframes = live_keyframes(cheap());
  SECTION("two maps") {
    for (std::size_t i = 5; i < keyframes.size(); ++i) keyframes[i].map_id = 1;
    LiveDensifier live(options);
    for (const LiveKeyframe& keyframe : keyframes) live.add(keyframe);
    end(live);
    CHECK(live.stats().lens_distance == 0.0);
  }
  SECTION("erased ones") {
    LiveDensifier live(options);
    for (std::size_t i = 0; i < 7; ++i) live.add(keyframes[i]);
    end(live);
    live.erase({0, 1, 2});
    for (std::size_t i = 7; i < keyframes.size(); ++i) live.add(keyframes[i]);
    end(live);
    CHECK(live.stats().lens_distance == 0.0);
  }
  SECTION("dropped ones") {
    options.max_waiting = 4;
    LiveDensifier live(options);
    live.pause();
    for (const LiveKeyframe& keyframe : keyframes) live.add(keyframe);
    live.resume();
    end(live);
    CHECK(live.stats().dropped_late > 2);
    CHECK(live.stats().lens_distance == 0.0);
  }
}

TEST_CASE("The lens distance is estimated with the current poses", PMSP_ACCURACY) {
  LiveOptions options = small_live(64);
  options.stable_after = options.stable_at_latest = 0;
  const std::vector<LiveKeyframe> keyframes = live_keyframes(cheap());
  LiveDensifier live(options);
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    LiveKeyframe early = keyframes[i];
    const Eigen::Vector3d off =
        0.05 * Eigen::Vector3d(std::sin(2.0 * static_cast<double>(i)), 0.0, std::cos(3.0 * static_cast<double>(i)));
    early.cam_from_world.translation += off;
    const Eigen::Vector3d off_in_world = early.cam_from_world.rotation.transpose() * off;
    for (Landmark& landmark : early.landmarks) landmark.position_world -= off_in_world;
    live.add(early);
  }
  REQUIRE(live.wait(kLong));
  CHECK(live.stats().used == static_cast<std::int64_t>(keyframes.size()));
  live.update(keyframes);
  end(live);
  CHECK(live.stats().lens_distance == Approx(kDistance).epsilon(0.15));
}

TEST_CASE("A given or disabled lens distance is not estimated", PMSP_ACCURACY) {
  LiveOptions options = small_live(64);
  const std::vector<LiveKeyframe> keyframes = live_keyframes(cheap());
  const auto distance = [&] {
    LiveDensifier live(options);
    for (const LiveKeyframe& keyframe : keyframes) live.add(keyframe);
    end(live);
    return live.stats().lens_distance;
  };
  CHECK(distance() == Approx(kDistance).epsilon(0.15));
  options.calibrate_lenses = false;
  CHECK(distance() == 0.0);
  options.calibrate_lenses = true;
  options.densifier.lens_distance = 0.01;
  CHECK(distance() == 0.01);
}

TEST_CASE("A single-centre camera gives the same points with and without lens estimation") {
  LiveOptions options = small_live(32);
  const auto looked = at_once(live_keyframes(room()), options);
  options.calibrate_lenses = false;
  const auto not_looked = at_once(live_keyframes(room()), options);
  REQUIRE_FALSE(looked->clouds.empty());
  CHECK(same_points(*looked, *not_looked));
}

TEST_CASE("A live mission finds its rig mask and no points lie on the rig", PMSP_ACCURACY) {
  synth::Recipe recipe;
  recipe.keyframes = 10;
  recipe.rider = true;
  recipe.mission.render.samples = 2;
  const synth::Mission mission = synth::textured_room(recipe);
  const Image<std::uint8_t>& label = mission.frames.front().label;
  LiveOptions options = small_live(128);
  const auto on_rider = [&](bool find_rig) {
    options.find_rig = find_rig;
    LiveDensifier live(options);
    for (const LiveKeyframe& keyframe : live_keyframes(mission)) live.add(keyframe);
    end(live);
    CHECK((live.stats().rig > 0.02) == find_rig);
    std::size_t points = 0;
    for (const LiveCloud& cloud : live.snapshot()->clouds) {
      for (const CloudPoint& point : cloud.cloud->points) {
        const Eigen::Vector2d at =
            pixel_from_bearing(point.position.cast<double>().normalized(), label.width(), label.height());
        const int x = std::min(static_cast<int>(at.x()), label.width() - 1);
        const int y = std::min(static_cast<int>(at.y()), label.height() - 1);
        points += label(x, y) == static_cast<std::uint8_t>(synth::Label::kRider) ? 1 : 0;
      }
    }
    return points;
  };
  const std::size_t before = on_rider(false);
  CHECK(before > 50);
  CHECK(4 * on_rider(true) < before);
}
