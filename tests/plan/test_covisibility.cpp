// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include <Eigen/Core>

#include "plan/covisibility.h"

using namespace pmsp;
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

std::vector<std::size_t> choose(const Keyframe& reference, const std::vector<Keyframe>& candidates, int count) {
  const std::vector<Covisibility> covisibilities(candidates.begin(), candidates.end());
  std::vector<const Covisibility*> all;
  for (const Covisibility& covisibility : covisibilities) all.push_back(&covisibility);
  return choose_covisible(Covisibility(reference), all, count);
}

}  // namespace

TEST_CASE("source views are those that add parallax", "[plan][covisibility]") {
  const Keyframe reference = surrounded(0, {0, 0, 0});
  const Keyframe ahead = surrounded(1, {0, 0, 0.4});
  const Keyframe same_line = surrounded(2, {0, 0, 0.42});
  const Keyframe beside = surrounded(3, {0.5, 0, 0});  // looks at what lies ahead and behind from the side
  const Keyframe far_away = surrounded(4, {40, 0, 0});
  const std::vector<std::size_t> two = choose(reference, {ahead, same_line, far_away, beside}, 2);
  REQUIRE(two.size() == 2);
  CHECK((two[0] == 3 || two[1] == 3));
  CHECK((two[0] < 2 || two[1] < 2));
  CHECK(choose(reference, {ahead, far_away}, 2) == std::vector<std::size_t>{0});
  CHECK(choose(reference, {ahead, same_line, beside}, 1).size() == 1);
  CHECK(choose(reference, {}, 2).empty());
  CHECK(choose(reference, {reference}, 2).empty());
}

TEST_CASE("a keyframe behind a wall is no source view", "[plan][covisibility]") {
  const Keyframe reference = surrounded(0, {0, 0, 0});
  const Keyframe ahead = surrounded(1, {0, 0, 0.4});
  const Keyframe in_a_closet = surrounded(2, {0.5, 0, 0}, 0.3);  // sees nothing of all that
  CHECK(choose(reference, {in_a_closet, ahead}, 2) == std::vector<std::size_t>{1});
}

TEST_CASE("keyframes without landmarks are no source views and have none", "[plan][covisibility]") {
  Keyframe blind = surrounded(1, {0.5, 0, 0});
  blind.landmarks.clear();
  const Keyframe reference = surrounded(0, {0, 0, 0});
  CHECK(choose(reference, {blind}, 2).empty());
  CHECK(choose(blind, {reference}, 2).empty());
}

TEST_CASE("usefulness is that of the best source view and grows with their number", "[plan][covisibility]") {
  const Covisibility reference(surrounded(0, {0, 0, 0}));
  const Covisibility ahead(surrounded(1, {0, 0, 0.4}));
  const Covisibility beside(surrounded(2, {0.5, 0, 0}));
  const double one = covisible_usefulness(reference, {&ahead});
  const double both = covisible_usefulness(reference, {&ahead, &beside});
  CHECK(covisible_usefulness(reference, {}) == 0.0);
  CHECK(one > 0.0);
  CHECK(both > one);
  CHECK(both <= 1.0 + 1e-9);
  CHECK(covisible_usefulness(reference, {&ahead, &ahead}) == one);
}
