// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <vector>

#include "agreement.h"
#include "confidence.h"
#include "kernels/kernel_helpers.h"

using namespace pmsp;
using pmsp::kernels::Vec3;
using pmsp::test::cast;
using pmsp::test::Draws;
using pmsp::test::frame_at;
namespace k = pmsp::kernels;

namespace {

constexpr int kWidth = 320;
constexpr int kHeight = 160;

/// The planes of a map, given as a function of the pixel's bearing.
struct PlaneMap {
  explicit PlaneMap(const std::function<Vec3<double>(const Vec3<double>&)>& plane_at)
      : x(kWidth * kHeight), y(x.size()), z(x.size()) {
    for (int row = 0; row < kHeight; ++row) {
      for (int column = 0; column < kWidth; ++column) {
        const std::size_t at = static_cast<std::size_t>(row * kWidth + column);
        const Vec3<float> plane = cast<float>(plane_at(frame_at(column + 0.5, row + 0.5, kWidth, kHeight).bearing));
        x[at] = plane.x;
        y[at] = plane.y;
        z[at] = plane.z;
      }
    }
  }
  k::PlaneMapView view() const { return {x.data(), y.data(), z.data(), kWidth, kHeight, nullptr}; }

  std::vector<float> x, y, z;
};

Vec3<double> apply(const RigidTransform& transform, const Vec3<double>& p) {
  const Eigen::Vector3d q = transform * Eigen::Vector3d(p.x, p.y, p.z);
  return {q.x(), q.y(), q.z()};
}

const Vec3<double> kWall{0.1, -0.2, 0.45};  // a plane of the other camera, at about 2

PlaneMap wall_map() {
  return PlaneMap([](const Vec3<double>& bearing) {
    return k::dot(kWall, bearing) > 0.05 ? kWall : Vec3<double>{0.0, 0.0, 0.0};
  });
}

const k::Rigid kIdentity{{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0}, {}, 0};

}  // namespace

TEST_CASE("depth behind a surface is the relative difference of the ranges and -1 where the map is empty") {
  const PlaneMap map = wall_map();
  const PlaneMap empty([](const Vec3<double>&) { return Vec3<double>{0.0, 0.0, 0.0}; });
  Draws draws(5);
  for (int i = 0; i < 5000; ++i) {
    const RigidTransform other_from_first = draws.transform(kernels::kPi, 0.5);
    const Vec3<double> seen_from_other = draws.direction();
    const double height = k::dot(kWall, seen_from_other);
    if (height < 0.15) continue;
    const double ratio = draws.uniform(0.7, 1.4);
    const Vec3<double> point = apply(other_from_first.inverse(), (ratio / height) * seen_from_other);
    const double depth = test::length(point);
    const Vec3<float> bearing = cast<float>((1.0 / depth) * point);
    const auto off = [&](const PlaneMap& other) {
      return k::beyond_surface(bearing, static_cast<float>(1.0 / depth), other.view(), to_rigid(other_from_first));
    };
    REQUIRE(off(map) == Approx(ratio - 1.0).margin(2e-4));
    REQUIRE(off(empty) == Approx(-1.0));
  }
}

TEST_CASE("agreement with a plane: depth_ratio is the ratio of the ranges and the implied depth is exact") {
  const PlaneMap map = wall_map();
  Draws draws(1);
  int tested = 0;
  for (int i = 0; i < 20000; ++i) {
    const RigidTransform other_from_first = draws.transform(kernels::kPi, 0.5);
    const Vec3<double> seen_from_other = draws.direction();
    const double height = k::dot(kWall, seen_from_other);
    if (height < 0.15) continue;
    const double ratio = draws.uniform(0.7, 1.4);
    const Vec3<double> point = apply(other_from_first.inverse(), (ratio / height) * seen_from_other);
    const double depth = test::length(point);
    const Vec3<double> bearing = (1.0 / depth) * point;
    const auto seen =
        k::agreement(cast<float>(bearing), static_cast<float>(depth), map.view(), to_rigid(other_from_first));
    REQUIRE(seen.depth_ratio == Approx(ratio).epsilon(1e-4));
    // where the first camera's ray meets the plane
    const Eigen::Vector3d turned = other_from_first.rotation * Eigen::Vector3d(bearing.x, bearing.y, bearing.z);
    const double along = k::dot(kWall, {turned.x(), turned.y(), turned.z()});
    const Vec3<double> origin = apply(other_from_first, {0.0, 0.0, 0.0});
    if (along < 0.05) continue;
    REQUIRE(seen.implied_depth == Approx((1.0 - k::dot(kWall, origin)) / along).epsilon(1e-3));
    const k::Pixel<double> at = k::project_exactly(seen_from_other, kWidth, kHeight);
    const double dx = at.x - std::floor(at.x) - 0.5;
    const double dy = at.y - std::floor(at.y) - 0.5;
    const double margin = 0.5 - std::max(std::fabs(dx), std::fabs(dy));
    if (margin < 1e-3) continue;
    REQUIRE(seen.index == static_cast<int>(at.y) * kWidth + static_cast<int>(at.x));
    ++tested;
  }
  CHECK(tested > 2000);
}

TEST_CASE("agreement: the same surface seen from elsewhere is 1, on a sphere up to its curvature within a pixel") {
  // both cameras inside a sphere of radius 3
  const Eigen::Vector3d center(0.3, -0.2, 0.4);  // in the other camera's frame
  const auto range = [&](const Vec3<double>& bearing) {
    const double b = bearing.x * center.x() + bearing.y * center.y() + bearing.z * center.z();
    return b + std::sqrt(b * b - center.squaredNorm() + 9.0);
  };
  const PlaneMap map([&](const Vec3<double>& bearing) {
    const double depth = range(bearing);
    const Vec3<double> outward = depth * bearing - Vec3<double>{center.x(), center.y(), center.z()};
    return k::plane_from(1.0 / depth, -1.0 * outward, bearing);
  });
  Draws draws(2);
  double worst = 0.0;
  double worst_implied = 0.0;
  for (int i = 0; i < 10000; ++i) {
    const RigidTransform other_from_first = draws.transform(kernels::kPi, 0.5);
    const Vec3<double> direction = draws.direction();
    const Vec3<double> point = apply(other_from_first.inverse(), range(direction) * direction);
    const double depth = test::length(point);
    const auto seen = k::agreement(cast<float>((1.0 / depth) * point), static_cast<float>(depth), map.view(),
                                   to_rigid(other_from_first));
    worst = std::max(worst, std::fabs(seen.depth_ratio - 1.0));
    worst_implied = std::max(worst_implied, std::fabs(seen.implied_depth / depth - 1.0));
  }
  INFO(worst << " " << worst_implied);
  CHECK(worst < 3e-4);
  CHECK(worst_implied < 3e-4);
}

TEST_CASE("agreement: the parallax gain is the turn of the direction over the relative change of depth") {
  const PlaneMap map = wall_map();
  Draws draws(3);
  for (int i = 0; i < 1000; ++i) {
    const RigidTransform other_from_first = draws.transform(kernels::kPi, 0.5);
    const Vec3<double> bearing = draws.direction();
    const double depth = draws.uniform(1.5, 4.0);
    constexpr double kStep = 1e-5;
    const double turn = k::angle_between(apply(other_from_first, depth * bearing),
                                         apply(other_from_first, (1.0 + kStep) * depth * bearing));
    const auto seen = k::agreement(bearing, depth, map.view(), to_rigid(other_from_first));
    REQUIRE(seen.parallax_gain == Approx(turn / kStep).epsilon(1e-3).margin(1e-5));
  }
}

TEST_CASE("agreement: a vote is weighted by the inverse fourth power of distance in any unit of length") {
  const PlaneMap map = wall_map();
  Draws draws(4);
  for (int i = 0; i < 1000; ++i) {
    const RigidTransform other_from_first = draws.transform(kernels::kPi, 0.5);
    const Vec3<double> bearing = draws.direction();
    const double depth = draws.uniform(1.5, 4.0);
    const double away = test::length(apply(other_from_first, depth * bearing));
    k::Rigid transform = to_rigid(other_from_first);
    const double weight = k::agreement(bearing, depth, map.view(), transform).weight;
    REQUIRE(weight == Approx(std::pow(depth / away, 4.0)).epsilon(1e-4));
    for (float& r : transform.r) r *= 2.0F;  // the other's unit is half as long
    for (float& t : transform.t) t *= 2.0F;
    REQUIRE(k::agreement(bearing, depth, map.view(), transform).weight == Approx(weight).epsilon(1e-9));
  }
  CHECK(k::evidence_weight(1.0, 0.0) <= 1e12);  // the other one stands where the point is
}

TEST_CASE("expected error: grows with spread, roughness and missing maps, falls with parallax and score") {
  const auto error = [](double spread, double gain, double roughness, double agree, double score = 1.0) {
    const k::Evidence<double> evidence{agree * spread * spread, agree * gain * gain, roughness, agree, 4.0, score};
    return k::expected_error(evidence, 1.0F);
  };
  const double usual = error(0.001, 0.3, 0.003, 4.0);
  CHECK(usual > 0.0003);
  CHECK(usual < 0.003);
  CHECK(error(0.002, 0.3, 0.003, 4.0) > 1.1 * usual);
  CHECK(error(0.001, 0.3, 0.006, 4.0) > 1.1 * usual);
  CHECK(error(0.001, 0.1, 0.003, 4.0) > 1.05 * usual);
  CHECK(error(0.001, 0.3, 0.003, 2.0) > 1.3 * usual);
  CHECK(error(0.001, 0.3, 0.003, 4.0, 0.95) > usual);
  CHECK(error(0.001, 0.3, 0.003, 4.0, 0.95) < 1.1 * usual);
  CHECK(error(0.001, 0.3, 0.003, 4.0, 0.6) > 1.1 * usual);
  CHECK(error(0.001, 0.3, 0.003, 4.0, -1.0) > 1.3 * usual);
  CHECK(error(0.001, 0.3, 0.003, 4.0, 0.4) > 1.1 * error(0.001, 0.3, 0.003, 4.0, 0.6));
  CHECK(error(0.001, 0.3, 0.003, 4.0, -1.0) ==
        Approx(error(0.001, 0.3, 0.003, 4.0, 0.3)));  // no lower score than by chance
  const auto of_low_score = [&](double gain) {
    return error(0.001, gain, 0.003, 4.0, 0.5) / error(0.001, gain, 0.003, 4.0);
  };
  CHECK(of_low_score(0.02) > 1.3 * of_low_score(0.3));  // noise in the images counts the more, the less the parallax
  CHECK(error(0.003, 0.3, 0.003, 4.0) > 0.6 * 0.003);   // maps that differ so much are off by about as much
  CHECK(std::isfinite(error(0.0, 0.0, 0.0, 0.0)));
  CHECK(error(0.0, 0.0, 0.0, 0.0) > usual);
  CHECK(k::add_pose_error(usual, 4.0 * 0.25, 4.0, 0.0F) == Approx(usual));
  CHECK(k::add_pose_error(0.003, 4.0 * 0.5, 4.0, 0.002F) == Approx(0.005));  // of two keyframes: 0.004
  CHECK(k::add_pose_error(usual, 0.0, 0.0, 1.0F) == Approx(usual));          // no view agrees
  CHECK(std::isfinite(k::add_pose_error(usual, 0.0, 4.0, 1.0F)));
  CHECK(k::confidence_of_error(0.0) == Approx(1.0));
  CHECK(k::confidence_of_error(0.005) == Approx(0.5));
}

TEST_CASE("agreement: an empty pixel or a point behind the surface or behind the camera gives 0") {
  const PlaneMap map = wall_map();
  const auto depth_ratio = [&](const Vec3<double>& point, const k::Rigid& other_from_first) {
    const double depth = test::length(point);
    const auto seen =
        k::agreement(cast<float>((1.0 / depth) * point), static_cast<float>(depth), map.view(), other_from_first);
    CHECK(std::isfinite(seen.implied_depth));
    return seen.depth_ratio;
  };
  CHECK(depth_ratio({0.0, 0.0, 2.0}, kIdentity) == Approx(0.9));
  CHECK(depth_ratio({0.0, 0.0, -2.0}, kIdentity) == 0.0F);  // the map has no plane there
  // the first camera stands behind the other one's wall
  const k::Rigid behind{{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 5}, {}, 0};
  CHECK(depth_ratio({0.0, 0.0, 1.0}, behind) == 0.0F);
}

TEST_CASE("agreement: index and offset at pixel centres, corners, seam and poles") {
  const PlaneMap map([](const Vec3<double>& bearing) { return 0.5 * bearing; });
  const auto at = [&](double x, double y) {
    const Vec3<double> bearing = frame_at(x, y, kWidth, kHeight).bearing;
    return k::agreement(cast<float>(bearing), 2.0F, map.view(), kIdentity);
  };
  for (const int x : {0, 1, 160, 318, 319}) {
    for (const int y : {0, 1, 80, 158, 159}) {
      const auto seen = at(x + 0.5, y + 0.5);
      CHECK(seen.index == y * kWidth + x);
      CHECK(seen.depth_ratio == Approx(1.0).epsilon(1e-5));
      CHECK(seen.implied_depth == Approx(2.0).epsilon(1e-5));
    }
  }
  CHECK(at(319.9, 80.5).index == 80 * kWidth + 319);
  CHECK(at(0.1, 80.5).index == 80 * kWidth);
}
