// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "pmsp/error.h"
#include "pmsp/view_filter.h"

using namespace pmsp;
using Eigen::Vector3d;

namespace {

constexpr double kRadians = 3.14159265358979323846 / 180.0;

/// Seen from (-1, 0, 0) and (1, 0, 0) under `parallax_deg`.
Landmark landmark(std::int64_t id, double parallax_deg) {
  return {id, Vector3d(0.0, 0.0, 1.0 / std::tan(0.5 * parallax_deg * kRadians))};
}

const Vector3d kLeft(-1.0, 0.0, 0.0);
const Vector3d kRight(1.0, 0.0, 0.0);

Keyframe keyframe(std::int64_t id, const Vector3d& center, const std::vector<Landmark>& landmarks) {
  Keyframe result;
  result.id = id;
  result.cam_from_world.rotation << 0, 0, -1, 0, 1, 0, 1, 0, 0;  // the camera's own turning must not matter
  result.cam_from_world.translation = -(result.cam_from_world.rotation * center);
  result.landmarks = landmarks;
  return result;
}

/// Whether the second of two keyframes is accepted that see `good` landmarks under 20 degrees and `bad` ones under 2.
bool accepts(int good, int bad, const ViewFilterOptions& options = {}) {
  std::vector<Landmark> landmarks;
  for (int i = 0; i < good; ++i) landmarks.push_back(landmark(i, 20.0));
  for (int i = 0; i < bad; ++i) landmarks.push_back(landmark(100 + i, 2.0));
  ViewFilter filter(options);
  REQUIRE(filter.accept(keyframe(0, kLeft, landmarks)));
  return filter.accept(keyframe(1, kRight, landmarks));
}

bool accepts_parallax(double degrees) {
  ViewFilter filter{ViewFilterOptions{}};
  REQUIRE(filter.accept(keyframe(0, kLeft, {landmark(1, degrees)})));
  return filter.accept(keyframe(1, kRight, {landmark(1, degrees)}));
}

}  // namespace

TEST_CASE("common_parallax counts common landmarks and gives their angles", "[view_filter]") {
  const std::vector<Landmark> a = {landmark(5, 10.0), landmark(1, 70.0), landmark(3, 30.0), landmark(8, 20.0)};
  const std::vector<Landmark> b = {landmark(1, 70.0), landmark(9, 20.0), landmark(5, 10.0), landmark(3, 30.0)};
  const CommonParallax common = common_parallax(a, kLeft, b, kRight, 6.0, 60.0);
  CHECK(common.landmarks == 3);
  CHECK(common.in_range == 2);
  CHECK(common.median_deg == Approx(30.0).margin(0.01));
  const CommonParallax swapped = common_parallax(b, kRight, a, kLeft, 6.0, 60.0);
  CHECK(swapped.landmarks == 3);
  CHECK(swapped.in_range == 2);
  CHECK(swapped.median_deg == Approx(common.median_deg));
}

TEST_CASE("common_parallax measures any angle", "[view_filter]") {
  for (const double degrees : {0.05, 1.0, 6.0, 45.0, 90.0, 135.0, 179.0}) {
    INFO(degrees);
    const std::vector<Landmark> one = {landmark(1, degrees)};
    CHECK(common_parallax(one, kLeft, one, kRight, 0.0, 180.0).median_deg == Approx(degrees).margin(0.005));
  }
  const std::vector<Landmark> one = {landmark(1, 10.0)};
  CHECK(common_parallax(one, kLeft, one, kLeft, 0.0, 180.0).median_deg == Approx(0.0).margin(0.005));
}

TEST_CASE("common_parallax of nothing in common is zero", "[view_filter]") {
  const CommonParallax common = common_parallax({landmark(1, 10.0)}, kLeft, {landmark(2, 10.0)}, kRight, 0.0, 180.0);
  CHECK(common.landmarks == 0);
  CHECK(common.in_range == 0);
  CHECK(common.median_deg == 0.0);
  CHECK(common_parallax({}, kLeft, {}, kRight, 0.0, 180.0).landmarks == 0);
}

TEST_CASE("the first keyframe is accepted whatever it is, one with nothing in common never", "[view_filter]") {
  ViewFilter filter{ViewFilterOptions{}};
  CHECK(filter.accept(keyframe(0, kLeft, {})));
  CHECK_FALSE(filter.accept(keyframe(1, kRight, {landmark(1, 20.0)})));
  filter.reset();
  CHECK(filter.accept(keyframe(2, kRight, {landmark(1, 20.0)})));
}

TEST_CASE("the share of landmarks with useful parallax decides, its border included", "[view_filter]") {
  CHECK(accepts(2, 8));
  CHECK_FALSE(accepts(19, 81));
  CHECK(accepts(20, 80));
  CHECK_FALSE(accepts(0, 10));
  ViewFilterOptions all;
  all.min_share = 1.0;
  CHECK(accepts(10, 0, all));
  CHECK_FALSE(accepts(99, 1, all));
}

TEST_CASE("parallax counts between 6 and 60 degrees", "[view_filter]") {
  CHECK_FALSE(accepts_parallax(5.98));
  CHECK(accepts_parallax(6.02));
  CHECK(accepts_parallax(59.98));
  CHECK_FALSE(accepts_parallax(60.02));
}

TEST_CASE("keyframes are compared with the newest accepted one, not with a rejected one", "[view_filter]") {
  ViewFilter filter{ViewFilterOptions{}};
  const std::vector<Landmark> far = {{1, Vector3d(0.0, 0.0, 10.0)}};
  REQUIRE(filter.accept(keyframe(0, Vector3d(0.0, 0.0, 0.0), far)));
  CHECK_FALSE(filter.accept(keyframe(1, Vector3d(0.7, 0.0, 0.0), far)));  // 4 degrees
  CHECK(filter.accept(keyframe(2, Vector3d(1.4, 0.0, 0.0), far)));        // 8 degrees from the first
  CHECK_FALSE(filter.accept(keyframe(3, Vector3d(2.1, 0.0, 0.0), far)));  // 12 from the first, 4 from the newest
}

TEST_CASE("a view filter that is switched off accepts all", "[view_filter]") {
  ViewFilterOptions options;
  options.enabled = false;
  CHECK(accepts(0, 10, options));
  ViewFilter filter(options);
  CHECK(filter.accept(keyframe(0, kLeft, {})));
  CHECK(filter.accept(keyframe(1, kLeft, {})));
}

TEST_CASE("a view filter refuses bad options", "[view_filter]") {
  ViewFilterOptions options;
  options.min_share = 1.5;
  CHECK_THROWS_AS(ViewFilter(options), InvalidOption);
}
