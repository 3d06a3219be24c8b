// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Geometry>

#include "core/on_depth_maps.h"
#include "elementary.h"
#include "pmsp/camera.h"
#include "pmsp/stages.h"
#include "synth/rng.h"

using namespace pmsp;
using namespace pmsp::test;
using Eigen::Vector3d;

namespace {

constexpr int kWidth = 160;
constexpr int kHeight = 80;

RigidTransform some_pose() {
  return {Eigen::AngleAxisd(0.8, Vector3d(1.0, 2.0, -0.5).normalized()).toRotationMatrix(), Vector3d(3.0, -1.0, 2.0)};
}

/// A keyframe that observes points given in its own camera frame.
Keyframe observing(const std::vector<Vector3d>& in_camera) {
  Keyframe keyframe;
  keyframe.cam_from_world = some_pose();
  for (const Vector3d& point : in_camera) {
    keyframe.landmarks.push_back(
        {static_cast<std::int64_t>(keyframe.landmarks.size()), keyframe.cam_from_world.inverse() * point});
  }
  return keyframe;
}

Vector3d toward(double x, double y) { return bearing_from_pixel({x, y}, kWidth, kHeight); }

InitOptions with_radius(double radius) {
  InitOptions options;
  options.sparse_radius_px = radius;
  return options;
}

/// Range at which the plane of a pixel meets the pixel's ray; 0 = no plane.
PlaneImage landmark_planes(const Keyframe& keyframe, int width, int height, const InitOptions& options) {
  return image_of(planes_from_landmarks(keyframe, width, height, options, Executor(1)));
}

double range_at(const PlaneImage& planes, int x, int y) {
  const double inverse = planes(x, y).cast<double>().dot(toward(x + 0.5, y + 0.5));
  return inverse > 0.0 ? 1.0 / inverse : 0.0;
}

int count_planes(const PlaneImage& planes) {
  return static_cast<int>(std::count_if(planes.pixels().begin(), planes.pixels().end(),
                                        [](const Eigen::Vector3f& plane) { return plane.norm() > 0.0F; }));
}

}  // namespace

TEST_CASE("the depth range excludes the outer two percent and is widened", "[init]") {
  std::vector<Vector3d> points;
  for (int range = 101; range >= 1; --range) points.push_back(range * toward(1.5 * range, 0.7 * range));
  InitOptions options;
  options.range_margin = 1.0;
  DepthRange range = depth_range(observing(points), options);
  CHECK(range.min == Approx(3.0));
  CHECK(range.max == Approx(99.0));
  options.range_margin = 3.0;
  range = depth_range(observing(points), options);
  CHECK(range.min == Approx(1.0));
  CHECK(range.max == Approx(297.0));
  points[0] *= 1e3;  // a stray landmark
  range = depth_range(observing(points), options);
  CHECK(range.max == Approx(297.0));
}

TEST_CASE("landmarks at unusable depths are ignored and the depth range is limited to usable ones", "[init]") {
  const std::vector<Vector3d> stray = {1e-7 * toward(10, 10), 1e7 * toward(70, 31), Vector3d(0.0, 0.0, 0.0)};
  CHECK(depth_range(observing(stray), InitOptions{}).max == 0.0);
  CHECK(count_planes(landmark_planes(observing(stray), kWidth, kHeight, with_radius(6.0))) == 0);
  const DepthRange range = depth_range(observing({2e-6 * toward(10, 10), 8e5 * toward(70, 31)}), InitOptions{});
  CHECK(range.min == kMinDepth);
  CHECK(range.max == kMaxDepth);
}

TEST_CASE("the depth range of few landmarks spans them all and of none is empty", "[init]") {
  const DepthRange one = depth_range(observing({2.0 * toward(10, 10)}), InitOptions{});
  CHECK(one.min == Approx(2.0 / 3.0));
  CHECK(one.max == Approx(6.0));
  const DepthRange none = depth_range(observing({}), InitOptions{});
  CHECK(none.min == 0.0);
  CHECK(none.max == 0.0);
}

TEST_CASE("a landmark's plane contains the landmark and faces the camera", "[init]") {
  const Vector3d point = 2.5 * toward(70.2, 31.9);
  const PlaneImage planes = landmark_planes(observing({point}), kWidth, kHeight, with_radius(6.0));
  CHECK(planes.width() == kWidth);
  CHECK(planes.height() == kHeight);
  const Vector3d plane = planes(70, 31).cast<double>();
  CHECK(plane.dot(point) == Approx(1.0).epsilon(1e-5));
  CHECK(plane.normalized().dot(point.normalized()) == Approx(1.0).epsilon(1e-6));
}

TEST_CASE("a landmark spreads over a disc of the given radius", "[init]") {
  const Vector3d point = toward(80.0, 40.0);
  for (const double radius : {1.0, 6.0, 12.0}) {
    INFO(radius);
    const PlaneImage planes = landmark_planes(observing({point}), kWidth, kHeight, with_radius(radius));
    CHECK(count_planes(planes) == Approx(kernels::kPi * radius * radius).epsilon(0.1).margin(1.5));
  }
  const PlaneImage planes = landmark_planes(observing({point}), kWidth, kHeight, with_radius(6.0));
  CHECK(range_at(planes, 85, 40) > 0.0);
  CHECK(range_at(planes, 87, 40) == 0.0);
  CHECK(range_at(planes, 80, 46) == 0.0);
  CHECK(count_planes(landmark_planes(observing({}), kWidth, kHeight, with_radius(6.0))) == 0);
}

TEST_CASE("a landmark at the seam spreads over it", "[init]") {
  const PlaneImage planes = landmark_planes(observing({2.0 * toward(159.5, 40.5)}), kWidth, kHeight, with_radius(6.0));
  for (const int x : {154, 157, 159, 0, 2, 5}) {
    INFO(x);
    CHECK(range_at(planes, x, 40) == Approx(2.0).epsilon(0.05));
  }
  CHECK(range_at(planes, 8, 40) == 0.0);
  CHECK(range_at(planes, 151, 40) == 0.0);
}

TEST_CASE("a landmark near a pole covers more columns", "[init]") {
  for (const double y : {0.3, kHeight - 0.3}) {
    INFO(y);
    const PlaneImage planes = landmark_planes(observing({2.0 * toward(20.0, y)}), kWidth, kHeight, with_radius(6.0));
    const int row = y < 1.0 ? 0 : kHeight - 1;
    int in_row = 0;
    for (int x = 0; x < kWidth; ++x) in_row += range_at(planes, x, row) > 0.0 ? 1 : 0;
    CHECK(in_row >= kWidth - 4);
    CHECK(range_at(planes, 20, kHeight / 2) == 0.0);
  }
}

TEST_CASE("the nearest of many landmarks wins, anywhere on the sphere", "[init]") {
  constexpr double kRadius = 6.0;
  constexpr double kPixel = 2.0 * kernels::kPi / kWidth;
  std::vector<Vector3d> points;
  for (std::uint64_t i = 0; i < 150; ++i) {
    const Vector3d direction(synth::gaussian(1, 3 * i), synth::gaussian(1, 3 * i + 1), synth::gaussian(1, 3 * i + 2));
    points.push_back((1.0 + static_cast<double>(i)) * direction.normalized());
  }
  const PlaneImage planes = landmark_planes(observing(points), kWidth, kHeight, with_radius(kRadius));
  int wrong_winner = 0;
  int wrong_reach = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const Vector3d bearing = toward(x + 0.5, y + 0.5);
      const auto distance_px = [&](const Vector3d& p) {
        return std::acos(std::min(bearing.dot(p) / p.norm(), 1.0)) / kPixel;
      };
      double nearest = std::numeric_limits<double>::max();
      for (const Vector3d& p : points) nearest = std::min(nearest, distance_px(p));
      const Eigen::Vector3d plane = planes(x, y).cast<double>();
      const bool present = plane.norm() > 0.0;
      // Distances along a row are measured on its circle, by up to pi / 2 longer than on the sphere.
      wrong_reach += (nearest < 0.6 * kRadius && !present) || (nearest > 1.4 * kRadius && present) ? 1 : 0;
      if (!present) continue;
      const auto winner = static_cast<std::size_t>(std::lround(1.0 / plane.norm())) - 1;
      REQUIRE(winner < points.size());
      wrong_winner += distance_px(points[winner]) > 1.6 * nearest + 0.5 ? 1 : 0;
    }
  }
  CHECK(wrong_reach == 0);
  CHECK(wrong_winner == 0);
}

TEST_CASE("of two landmarks around a pixel the closer in the image wins and not the closer in depth", "[init]") {
  const PlaneImage planes = landmark_planes(observing({1.0 * toward(80.5, 40.5), 9.0 * toward(84.5, 40.5)}), kWidth,
                                            kHeight, with_radius(6.0));
  CHECK(range_at(planes, 81, 40) == Approx(1.0).epsilon(0.05));
  CHECK(range_at(planes, 84, 40) == Approx(9.0).epsilon(0.05));
  CHECK(range_at(planes, 83, 40) == Approx(9.0).epsilon(0.05));
}
