// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "kernels/kernel_helpers.h"

using namespace pmsp;
using pmsp::kernels::Vec3;
using pmsp::test::cast;
using pmsp::test::Draws;
namespace k = pmsp::kernels;

namespace {

/// A unit normal that faces a camera looking along `bearing`, at most `max_slant` from the ray.
Vec3<double> facing_normal(Draws& draws, const Vec3<double>& bearing, double max_slant) {
  for (;;) {
    const Vec3<double> normal = draws.direction();
    if (k::dot(normal, bearing) < -std::cos(max_slant)) return normal;
  }
}

k::PlaneLimits limits_of(double min_depth, double max_depth, double max_slant) {
  return {static_cast<float>(1.0 / max_depth), static_cast<float>(1.0 / min_depth),
          static_cast<float>(std::cos(max_slant) * std::cos(max_slant))};
}

constexpr double kSlant = 80.0 * kernels::kPi / 180.0;

}  // namespace

TEST_CASE("a plane keeps the depth and the normal it was made from") {
  Draws draws(1);
  for (int i = 0; i < 20000; ++i) {
    const Vec3<double> bearing = draws.direction();
    const Vec3<double> normal = facing_normal(draws, bearing, kSlant);
    const double depth = std::exp(draws.uniform(-6.0, 6.0));
    const double length = std::exp(draws.uniform(-3.0, 3.0));
    const Vec3<float> plane =
        k::plane_from(static_cast<float>(1.0 / depth), cast<float>(length * normal), cast<float>(bearing));
    REQUIRE(1.0 / k::dot(cast<double>(plane), bearing) == Approx(depth).epsilon(1e-5));
    const Vec3<double> back = -1.0 * k::normalized(cast<double>(plane));
    REQUIRE(test::length(back - normal) < 1e-5);
    // the point of any other ray lies on the plane through the first point
    const Vec3<double> other = k::normalized(bearing + 0.1 * draws.direction());
    const double along = k::dot(cast<double>(plane), other);
    if (along > 0.05 / depth) {
      REQUIRE(std::fabs(k::dot((1.0 / along) * other - depth * bearing, normal)) < 1e-4 * depth);
    }
  }
}

TEST_CASE("is_allowed: depth and slant at their bounds") {
  Draws draws(2);
  const k::PlaneLimits limits = limits_of(0.5, 20.0, kSlant);
  const auto allowed = [&](double depth, double slant) {
    const Vec3<double> bearing = draws.direction();
    Vec3<double> side = draws.direction();
    side = k::normalized(side - k::dot(side, bearing) * bearing);
    const Vec3<double> normal = -std::cos(slant) * bearing + std::sin(slant) * side;
    const Vec3<float> plane = k::plane_from(static_cast<float>(1.0 / depth), cast<float>(normal), cast<float>(bearing));
    return k::is_allowed(plane, cast<float>(bearing), limits);
  };
  for (int i = 0; i < 1000; ++i) {
    CHECK(allowed(0.5001, 0.3));
    CHECK_FALSE(allowed(0.4999, 0.3));
    CHECK(allowed(19.99, 0.3));
    CHECK_FALSE(allowed(20.01, 0.3));
    CHECK(allowed(3.0, kSlant - 0.001));
    CHECK_FALSE(allowed(3.0, kSlant + 0.001));
  }
  const Vec3<float> bearing{0.0F, 0.6F, 0.8F};
  CHECK_FALSE(k::is_allowed({0.0F, 0.0F, 0.0F}, bearing, limits));  // no plane
  CHECK_FALSE(k::is_allowed(-1.0F * bearing, bearing, limits));     // behind
  const float nan = std::nanf("");
  CHECK_FALSE(k::is_allowed({nan, nan, nan}, bearing, limits));
}

TEST_CASE("is_allowed: far planes at any limits but no plane between them and the largest depth") {
  Draws draws(12);
  for (const double largest : {1.0, 1e3, 1e6}) {
    const k::PlaneLimits limits = limits_of(1e-3 * largest, largest, kSlant);
    const Vec3<float> bearing = cast<float>(draws.direction());
    const Vec3<float> far = k::kFarInverseDepth * bearing;
    CHECK(k::is_far(k::dot(far, bearing)));
    CHECK(k::is_allowed(far, bearing, limits));
    CHECK_FALSE(k::is_allowed((0.9F / static_cast<float>(largest)) * bearing, bearing, limits));
    CHECK_FALSE(k::is_far(1.0F / static_cast<float>(largest)));
  }
  CHECK_FALSE(k::is_far(0.0F));  // no plane
}

TEST_CASE("a transformed plane contains the same points") {
  Draws draws(3);
  int moved = 0;
  for (int i = 0; i < 20000; ++i) {
    const RigidTransform other_from_here = draws.transform(kernels::kPi, 2.0);
    const Vec3<double> bearing = draws.direction();
    const Vec3<double> normal = facing_normal(draws, bearing, 1.2);
    const double depth = draws.uniform(0.5, 5.0);
    const Vec3<double> plane = (1.0 / depth / k::dot(normal, bearing)) * normal;  // in the other camera's frame
    const Vec3<float> here = k::moved_plane(cast<float>(plane), to_rigid(other_from_here));
    const Eigen::Vector3d own_center_there = other_from_here.translation;
    const double side =
        1.0 - (plane.x * own_center_there.x() + plane.y * own_center_there.y() + plane.z * own_center_there.z());
    if (side < -1e-3) {
      REQUIRE(here.x == 0.0F);
      REQUIRE(here.y == 0.0F);
      REQUIRE(here.z == 0.0F);
    }
    if (side < 0.05) continue;
    ++moved;
    for (int n = 0; n < 3; ++n) {
      Vec3<double> along = draws.direction();
      along = along - k::dot(along, normal) * normal;
      const Vec3<double> point = depth * bearing + along;
      const Eigen::Vector3d p = other_from_here.inverse() * Eigen::Vector3d(point.x, point.y, point.z);
      REQUIRE(k::dot(cast<double>(here), {p.x(), p.y(), p.z()}) == Approx(1.0).epsilon(1e-4).margin(1e-4));
    }
  }
  CHECK(moved > 10000);
}

TEST_CASE("a plane through the camera or behind it is transformed to none and not to infinity") {
  const Vec3<float> plane{0.0F, 0.0F, 0.5F};  // z = 2
  k::Rigid other_from_here{{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 2}, {}, 0};
  for (const float z : {2.0F, 2.0000002F, 3.0F, 1e20F}) {
    other_from_here.t[2] = z;
    const Vec3<float> moved = k::moved_plane(plane, other_from_here);
    CHECK(moved.x == 0.0F);
    CHECK(moved.y == 0.0F);
    CHECK(moved.z == 0.0F);
  }
  other_from_here.t[2] = 1.0F;
  CHECK(k::moved_plane(plane, other_from_here).z == 1.0F);  // one unit nearer
}

TEST_CASE("random planes: within the limits and log-uniform in depth and slanted to all sides") {
  const double min_depth = 0.3;
  const double max_depth = 40.0;
  const k::PlaneLimits limits = limits_of(min_depth, max_depth, kSlant);
  const float span = static_cast<float>(std::log(max_depth / min_depth));
  const k::RandomKey key = k::random_key(1, 5, 1);
  constexpr int kPlanes = 50000;
  Draws draws(4);
  std::vector<double> logs;
  Vec3<double> mean_normal{0.0, 0.0, 0.0};
  double steepest = 0.0;
  int allowed = 0;
  int beyond_45_degrees = 0;
  for (int i = 0; i < kPlanes; ++i) {
    const kernels::PatchFrame<double> frame =
        test::frame_at(draws.uniform(0.0, 640.0), draws.uniform(5.0, 315.0), 640, 320);
    const Vec3<float> bearing = cast<float>(frame.bearing);
    const Vec3<float> plane = k::random_plane<float>(key, static_cast<std::uint32_t>(i), 0, bearing, limits, span);
    const double inverse_depth = k::dot(cast<double>(plane), frame.bearing);
    REQUIRE(1.0 / inverse_depth > min_depth * (1.0 - 1e-5));
    REQUIRE(1.0 / inverse_depth < max_depth * (1.0 + 1e-5));
    if (k::is_allowed(plane, bearing, limits)) ++allowed;
    logs.push_back(std::log(1.0 / inverse_depth / min_depth) / std::log(max_depth / min_depth));
    const Vec3<double> normal = -1.0 * k::normalized(cast<double>(plane));
    const double slant = k::angle_between(normal, -1.0 * frame.bearing);
    steepest = std::max(steepest, slant);
    if (slant > kernels::kPi / 4.0) ++beyond_45_degrees;
    const Vec3<double> local{k::dot(normal, frame.right), k::dot(normal, frame.down), 0.0};
    mean_normal = mean_normal + (1.0 / kPlanes) * local;
  }
  CHECK(allowed > 0.99 * kPlanes);
  CHECK(steepest < kSlant);
  CHECK(beyond_45_degrees > 0.03 * kPlanes);
  CHECK(test::length(mean_normal) < 0.02);  // no side is preferred
  // Kolmogorov-Smirnov: 1.95 / sqrt(n) is exceeded by chance once in a thousand
  std::sort(logs.begin(), logs.end());
  double distance = 0.0;
  for (int i = 0; i < kPlanes; ++i) {
    distance = std::max(distance, std::fabs(logs[static_cast<std::size_t>(i)] - (i + 0.5) / kPlanes));
  }
  CHECK(distance < 1.95 / std::sqrt(kPlanes));
}

TEST_CASE("perturbed planes: bounded steps to both sides, facing the camera") {
  const k::RandomKey key = k::random_key(2, 5, 1);
  const double depth_step = 0.1;
  const double normal_step = 0.3;
  Draws draws(5);
  double nearest = 1.0;
  double farthest = 1.0;
  double turned = 0.0;
  for (std::uint32_t i = 0; i < 20000; ++i) {
    const Vec3<double> bearing = draws.direction();
    const Vec3<double> normal = facing_normal(draws, bearing, 1.3);
    const double inverse_depth = std::exp(draws.uniform(-3.0, 3.0));
    const Vec3<float> plane =
        k::plane_from(static_cast<float>(inverse_depth), cast<float>(normal), cast<float>(bearing));
    const Vec3<float> next = k::perturbed(plane, key, i, 8, cast<float>(bearing), static_cast<float>(depth_step),
                                          static_cast<float>(normal_step));
    const double ratio = k::dot(cast<double>(next), bearing) / inverse_depth;
    REQUIRE(ratio > 1.0 - depth_step - 1e-5);
    REQUIRE(ratio < 1.0 + depth_step + 1e-5);
    nearest = std::max(nearest, ratio);
    farthest = std::min(farthest, ratio);
    const Vec3<double> next_normal = -1.0 * k::normalized(cast<double>(next));
    const double angle = k::angle_between(next_normal, normal);
    turned = std::max(turned, angle);
    REQUIRE(k::dot(next_normal, bearing) < 0.0);
    // the normal's end moves within a cube of half side 0.3 before it is made unit again
    const bool replaced = test::length(next_normal + bearing) < 1e-5;
    if (!replaced) REQUIRE(std::sin(std::min(angle, kernels::kPi / 2.0)) <= normal_step * std::sqrt(3.0) + 1e-5);
  }
  CHECK(nearest > 1.0 + 0.95 * depth_step);
  CHECK(farthest < 1.0 - 0.95 * depth_step);
  CHECK(turned > 0.3);
}

TEST_CASE("random steps do not depend on the unit of length: planes of a scaled scene are the scaled planes") {
  const k::RandomKey key = k::random_key(3, 5, 1);
  Draws draws(6);
  const k::PlaneLimits limits = limits_of(0.5, 20.0, kSlant);
  const float span = static_cast<float>(std::log(40.0));
  for (const float factor : {100.0F, 0.01F, 3.7F}) {
    const k::PlaneLimits scaled_limits{factor * limits.min_inverse_depth, factor * limits.max_inverse_depth,
                                       limits.min_cos2_slant};
    double worst = 0.0;
    for (std::uint32_t i = 0; i < 5000; ++i) {
      const Vec3<float> bearing = cast<float>(draws.direction());
      const Vec3<float> plane = k::random_plane<float>(key, i, 0, bearing, limits, span);
      const Vec3<float> scaled = k::random_plane<float>(key, i, 0, bearing, scaled_limits, span);
      const Vec3<float> next = k::perturbed(plane, key, i, 4, bearing, 0.1F, 0.5F);
      const Vec3<float> scaled_next = k::perturbed(scaled, key, i, 4, bearing, 0.1F, 0.5F);
      const auto difference = [&](const Vec3<float>& a, const Vec3<float>& b) {
        const Vec3<double> expected = static_cast<double>(factor) * cast<double>(a);
        return test::length(cast<double>(b) - expected) / test::length(expected);
      };
      worst = std::max({worst, difference(plane, scaled), difference(next, scaled_next)});
    }
    INFO("factor " << factor << ": worst " << worst);
    CHECK(worst < 1e-4);
  }
}

TEST_CASE("planes in float and in double are the same planes") {
  const k::RandomKey key = k::random_key(4, 5, 1);
  const k::PlaneLimits limits = limits_of(0.5, 20.0, kSlant);
  const float span = static_cast<float>(std::log(40.0));
  Draws draws(7);
  double worst = 0.0;
  for (std::uint32_t i = 0; i < 10000; ++i) {
    const Vec3<double> bearing = cast<double>(cast<float>(draws.direction()));
    const auto random_f = k::random_plane<float>(key, i, 0, cast<float>(bearing), limits, span);
    const auto random_d = k::random_plane<double>(key, i, 0, bearing, limits, span);
    const auto next_f = k::perturbed(random_f, key, i, 4, cast<float>(bearing), 0.1F, 0.5F);
    const auto next_d = k::perturbed(cast<double>(random_f), key, i, 4, bearing, 0.1, 0.5);
    // a normal that is barely facing the camera may be replaced in one and kept in the other
    if (k::dot(k::normalized(next_d), bearing) < 0.1) continue;
    worst = std::max(worst, test::length(cast<double>(random_f) - random_d) / test::length(random_d));
    worst = std::max(worst, test::length(cast<double>(next_f) - next_d) / test::length(next_d));
  }
  INFO("worst " << worst);
  CHECK(worst < 2e-5);
}
