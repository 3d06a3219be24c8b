// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include <Eigen/Geometry>

#include "core/recording.h"
#include "patchmatch/revisits.h"

using namespace pmsp;
using namespace pmsp::test;
using Eigen::Vector3d;

namespace {

/// A keyframe in the middle of landmarks in all directions, `range` away from it unless a wall in front of the camera's
/// z axis is nearer.
Keyframe surrounded(std::int64_t id, const Vector3d& center, double range = 3.0, double wall = 100.0) {
  Keyframe result;
  result.id = id;
  result.cam_from_world = RigidTransform{Eigen::Matrix3d::Identity(), -center};
  for (int i = 0; i < 400; ++i) {
    const double z = -1.0 + (i + 0.5) / 200.0;
    const double lon = 2.39996 * i;  // the golden angle: evenly spread
    const double r = std::sqrt(1.0 - z * z);
    const Vector3d bearing(r * std::cos(lon), r * std::sin(lon), z);
    const double distance = z > 0.1 ? std::min(range, wall / z) : range;
    result.landmarks.push_back({1000 * id + i, center + distance * bearing});
  }
  return result;
}

std::vector<std::size_t> revisits(const Keyframe& reference, const std::vector<Keyframe>& chosen,
                                  const std::vector<Keyframe>& candidates, int count = 2) {
  std::vector<Vector3d> there;
  std::vector<Covisibility> covisibilities(candidates.begin(), candidates.end());
  std::vector<const Covisibility*> past;
  for (const Keyframe& keyframe : chosen) there.push_back(keyframe.cam_from_world.center());
  for (const Covisibility& covisibility : covisibilities) past.push_back(&covisibility);
  return choose_revisits(Covisibility(reference), there, past, count);
}

/// A flight along z, and back beside it; the way back is shifted by `aside`.
synth::Mission out_and_back(double aside) {
  synth::Recipe recipe = small_recipe(kFlightWidth);
  synth::Mission mission = synth::empty_room(recipe);
  synth::Flight out;
  out.start = Vector3d(0.2, 0.1, -1.6);
  out.keyframes = 6;
  synth::Flight back = out;
  back.start = Vector3d(0.2 + aside, 0.1, 0.4);
  back.direction = -out.direction;
  std::vector<RigidTransform> poses = fly(out);
  for (const RigidTransform& pose : fly(back)) poses.push_back(pose);
  return make_mission(mission.scene, poses, recipe.width, recipe.height, recipe.mission);
}

}  // namespace

TEST_CASE("a place passed before is matched with where it adds parallax", "[revisits]") {
  const Keyframe reference = surrounded(0, {0, 0, 0});
  const std::vector<Keyframe> line = {surrounded(1, {0, 0, -0.4}), surrounded(2, {0, 0, 0.4})};
  const Keyframe beside = surrounded(3, {0.5, 0, 0});  // looks at what lies ahead and behind from the side
  const Keyframe same_line = surrounded(4, {0, 0, -0.42});
  const Keyframe far_away = surrounded(5, {40, 0, 0});
  CHECK(revisits(reference, line, {same_line, far_away, beside}) == std::vector<std::size_t>{2});
  CHECK(revisits(reference, line, {same_line, far_away}).empty());
  CHECK(revisits(reference, line, {}).empty());
  CHECK(revisits(reference, line, {reference}).empty());
  CHECK(revisits(reference, {}, {beside, same_line, surrounded(6, {0, 0.5, 0})}, 1).size() == 1);
}

TEST_CASE("a keyframe behind a wall is not matched with", "[revisits]") {
  const Keyframe reference = surrounded(0, {0, 0, 0});
  const std::vector<Keyframe> line = {surrounded(1, {0, 0, -0.4}), surrounded(2, {0, 0, 0.4})};
  CHECK(revisits(reference, line, {surrounded(3, {0.5, 0, 0}, 0.3)}).empty());  // in a closet: sees nothing of all that
}

TEST_CASE("keyframes without landmarks are never revisited and have no revisits", "[revisits]") {
  Keyframe blind = surrounded(1, {0.5, 0, 0});
  blind.landmarks.clear();
  const Keyframe reference = surrounded(0, {0, 0, 0});
  CHECK(revisits(reference, {}, {blind}).empty());
  CHECK(revisits(blind, {}, {reference}).empty());
}

TEST_CASE("where a flight comes back, keyframes of the way there do no harm", "[revisits][densifier]" PMSP_ACCURACY) {
  const synth::Mission mission = out_and_back(0.5);
  DensifierOptions options = fast_options();
  const Recording without = densify(mission, options);
  options.patchmatch.revisits = 2;
  const Recording with = densify(mission, options);
  const auto share = [&](const Recording& recording) {
    double sum = 0.0;
    for (std::size_t i = 6; i < recording.raw.size(); ++i) {
      const synth::Frame& frame = mission.frames[static_cast<std::size_t>(recording.raw[i].keyframe_id)];
      sum += synth::share_within(recording.raw[i].depth, frame.depth, 0.02) /
             static_cast<double>(recording.raw.size() - 6);
    }
    return sum;
  };
  REQUIRE(without.raw.size() == mission.frames.size());
  REQUIRE(with.raw.size() == mission.frames.size());
  CHECK(share(with) > share(without) - 0.01);
}

TEST_CASE("what is not remembered is not matched with", "[revisits][densifier]") {
  const synth::Mission mission = out_and_back(0.5);
  DensifierOptions options = fast_options();
  const Recording without = densify(mission, options);
  options.patchmatch.revisits = 2;
  options.patchmatch.history = 2;  // no farther than the neighbours are
  CHECK(same(without, densify(mission, options)));
  options.patchmatch.history = 100;
  const Recording with = densify(mission, options);
  CHECK_FALSE(same(without, with));
  CHECK(same(with, densify(mission, options)));
}
