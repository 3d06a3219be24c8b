// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <optional>

#include <Eigen/Geometry>

#include "elementary.h"
#include "synth/rng.h"
#include "synth/scene.h"

using Eigen::Vector3d;
using namespace pmsp::synth;

namespace {

Vector3d random_direction(std::uint64_t draw) {
  return Vector3d(gaussian(5, 3 * draw), gaussian(5, 3 * draw + 1), gaussian(5, 3 * draw + 2)).normalized();
}

Scene scene_of(const Primitive& primitive) {
  Scene scene;
  scene.add(primitive, textured(1));
  return scene;
}

}  // namespace

TEST_CASE("a sphere is hit at the closed-form depth from inside and from outside") {
  const Scene scene = scene_of(Sphere{{1.0, 2.0, 3.0}, 2.0});
  for (std::uint64_t i = 0; i < 200; ++i) {
    const Vector3d ray = random_direction(i);
    const std::optional<Hit> from_center = scene.intersect({1.0, 2.0, 3.0}, 7.0 * ray);
    REQUIRE(from_center);
    CHECK(from_center->distance == Approx(2.0).epsilon(1e-12));
    CHECK((from_center->normal + ray).norm() < 1e-12);
    const std::optional<Hit> from_outside = scene.intersect(Vector3d(1.0, 2.0, 3.0) - 5.0 * ray, ray);
    REQUIRE(from_outside);
    CHECK(from_outside->distance == Approx(3.0).epsilon(1e-12));
    CHECK((from_outside->normal + ray).norm() < 1e-12);
  }
  CHECK_FALSE(scene.intersect({1.0, 2.0, 8.0}, Vector3d::UnitZ()));
  CHECK_FALSE(scene.intersect({1.0, 4.1, 0.0}, Vector3d::UnitZ()));
}

TEST_CASE("a box room is hit on the right wall") {
  const Scene scene = scene_of(Box{Vector3d::Zero(), {1.0, 2.0, 3.0}, Eigen::Matrix3d::Identity()});
  const Vector3d origin(0.25, -0.5, 1.0);
  const double distance_of[6] = {1.25, 0.75, 1.5, 2.5, 4.0, 2.0};
  for (int face = 0; face < 6; ++face) {
    const Vector3d axis = Vector3d::Unit(face / 2) * (face % 2 == 1 ? 1.0 : -1.0);
    const std::optional<Hit> hit = scene.intersect(origin, axis);
    REQUIRE(hit);
    CHECK(hit->distance == Approx(distance_of[face]).epsilon(1e-14));
    CHECK(hit->surface == face);
    CHECK(hit->normal == Vector3d(-axis));
  }
  for (std::uint64_t i = 0; i < 500; ++i) {
    const std::optional<Hit> hit = scene.intersect(origin, random_direction(i));
    REQUIRE(hit);
    const double outermost = hit->position.cwiseQuotient(Vector3d(1.0, 2.0, 3.0)).cwiseAbs().maxCoeff();
    CHECK(outermost == Approx(1.0).epsilon(1e-12));
    CHECK(hit->normal.dot(hit->position - origin) < 0.0);
  }
}

TEST_CASE("a turned box inside a room occludes the wall behind it") {
  Scene scene;
  scene.add(Box{Vector3d::Zero(), {4.0, 4.0, 4.0}, Eigen::Matrix3d::Identity()}, textured(1));
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(pmsp::kernels::kPi / 4.0, Vector3d::UnitY()).toRotationMatrix();
  scene.add(Box{{0.0, 0.0, 2.0}, {0.5, 0.5, 0.5}, turn}, textured(2));

  // Turned by 45 degrees, an edge faces the camera; a little to its right the face recedes at 45 degrees.
  const std::optional<Hit> hit = scene.intersect({0.1, 0.0, 0.0}, Vector3d::UnitZ());
  REQUIRE(hit);
  CHECK(hit->surface / 8 == 1);
  CHECK(hit->distance == Approx(2.0 - std::sqrt(0.5) + 0.1).epsilon(1e-12));
  CHECK((hit->normal - Vector3d(std::sqrt(0.5), 0.0, -std::sqrt(0.5))).norm() < 1e-12);

  CHECK_FALSE(scene.visible(Vector3d::Zero(), {0.0, 0.0, 4.0}));
  CHECK(scene.visible(Vector3d::Zero(), {0.0, 0.0, -4.0}));
  CHECK(scene.visible({0.1, 0.0, 0.0}, hit->position));
}

TEST_CASE("an infinite plane is seen from both sides and only ahead") {
  const Vector3d normal = Vector3d(1.0, 2.0, -2.0) / 3.0;
  const Scene scene = scene_of(Plane{{0.0, 0.0, 3.0}, normal});
  for (std::uint64_t i = 0; i < 200; ++i) {
    const Vector3d ray = random_direction(i);
    const double expected = normal.dot(Vector3d(0.0, 0.0, 3.0)) / normal.dot(ray);
    const std::optional<Hit> hit = scene.intersect(Vector3d::Zero(), ray);
    REQUIRE(hit.has_value() == (expected > 0.0));
    if (hit) {
      CHECK(hit->distance == Approx(expected).epsilon(1e-12));
      CHECK(hit->normal.dot(ray) < 0.0);
    }
  }
  const std::optional<Hit> from_behind = scene.intersect({0.0, 0.0, 10.0}, -Vector3d::UnitZ());
  REQUIRE(from_behind);
  CHECK(from_behind->distance == Approx(7.0).epsilon(1e-12));
  CHECK(from_behind->normal.z() > 0.0);
}

TEST_CASE("a scaled scene looks the same from the scaled position") {
  Scene scene;
  scene.add(Box{{0.1, 0.2, 0.3}, {2.0, 1.5, 3.0}, Eigen::Matrix3d::Identity()}, textured(3));
  scene.add(Sphere{{1.0, 0.0, 1.0}, 0.3}, textured(4));
  scene.add(Plane{{0.0, 1.0, 0.0}, -Vector3d::UnitY()}, textured(5));
  const Scene large = scene.scaled(100.0);
  for (std::uint64_t i = 0; i < 300; ++i) {
    const Vector3d ray = random_direction(i);
    const std::optional<Hit> hit = scene.intersect({0.0, 0.1, -0.2}, ray);
    const std::optional<Hit> large_hit = large.intersect({0.0, 10.0, -20.0}, ray);
    REQUIRE(hit);
    REQUIRE(large_hit);
    CHECK(large_hit->distance == Approx(100.0 * hit->distance).epsilon(1e-12));
    CHECK(large_hit->surface == hit->surface);
    CHECK((large.color(*large_hit) - scene.color(*hit)).norm() < 1e-6);
  }
}

TEST_CASE("textures have the requested contrast and none if zero is requested") {
  const auto deviation = [](const TextureOptions& options) {
    const Texture texture(options);
    double sum = 0.0;
    double squares = 0.0;
    constexpr int kCount = 4000;
    for (int i = 0; i < kCount; ++i) {
      const auto draw = static_cast<std::uint64_t>(3 * i);
      const Vector3d p = 20.0 * Vector3d(uniform(9, draw), uniform(9, draw + 1), uniform(9, draw + 2));
      const double gray = texture.color(p, Vector3d::UnitX()).mean();
      sum += gray;
      squares += gray * gray;
    }
    return std::sqrt(std::max(0.0, squares / kCount - (sum / kCount) * (sum / kCount)));
  };
  CHECK(deviation(textured(11)) == Approx(40.0).epsilon(0.2));
  CHECK(deviation(weak(11)) == Approx(3.0).epsilon(0.2));
  TextureOptions plain = textured(11);
  plain.contrast = 0.0;
  CHECK(deviation(plain) < 1e-4);
}

TEST_CASE("the texture has detail at its finest octave and is smooth below it") {
  const TextureOptions options = textured(21);
  const Texture texture(options);
  const double finest = options.coarsest / std::pow(2.0, options.octaves - 1);
  const auto mean_change = [&](double step) {
    double sum = 0.0;
    for (std::uint64_t i = 0; i < 1000; ++i) {
      const Vector3d p = 20.0 * Vector3d(uniform(3, 3 * i), uniform(3, 3 * i + 1), uniform(3, 3 * i + 2));
      const Vector3d q = p + step * random_direction(i);
      sum += std::abs(texture.color(p, Vector3d::UnitX()).mean() - texture.color(q, Vector3d::UnitX()).mean());
    }
    return sum / 1000.0;
  };
  CHECK(mean_change(finest) > 10.0);
  CHECK(mean_change(0.02 * finest) < 1.5);
}

TEST_CASE("foliage is hit on its leaves and transparent between them") {
  const Foliage leaves = foliage({0.0, 0.0, 5.0}, 1.0, 60, 0.1, 3);
  const Scene scene = scene_of(leaves);
  REQUIRE(leaves.leaves.size() == 60);
  int hits = 0;
  for (int i = 0; i < 400; ++i) {
    const Vector3d target(-1.0 + 0.1 * (i % 20), -1.0 + 0.1 * (i / 20), 5.0);
    const std::optional<Hit> hit = scene.intersect(Vector3d::Zero(), target);
    if (!hit) continue;
    ++hits;
    CHECK(std::any_of(leaves.leaves.begin(), leaves.leaves.end(), [&](const Foliage::Leaf& leaf) {
      return (hit->position - leaf.center).norm() <= 0.1 + 1e-9 &&
             std::abs((hit->position - leaf.center).dot(leaf.normal)) < 1e-9;
    }));
    CHECK(hit->normal.dot(target) < 0.0);
  }
  CHECK(hits > 20);
  CHECK(hits < 300);
  CHECK_FALSE(scene.intersect(Vector3d::Zero(), {1.2, 0.0, 5.0}));
  const std::optional<Hit> half = scene.scaled(0.5).intersect(Vector3d::Zero(), leaves.leaves[0].center);
  const std::optional<Hit> whole = scene.intersect(Vector3d::Zero(), leaves.leaves[0].center);
  REQUIRE((half && whole));
  CHECK(2.0 * half->distance == Approx(whole->distance));
}

TEST_CASE("truth lies behind movers unlike the visible surface and rays without a hit are sky") {
  Scene scene;
  scene.add(Box{{0.0, 0.0, 8.0}, {2.0, 2.0, 1.0}, Eigen::Matrix3d::Identity()}, plain({10.0, 20.0, 30.0}));
  scene.add(Sphere{{0.0, 0.0, 4.0}, 0.5}, plain({200.0, 0.0, 0.0}), {}, Label::kMover);
  Sky sky;
  sky.horizon = sky.zenith = {1.0, 2.0, 3.0};
  sky.sun = -Vector3d::UnitY();
  sky.sun_radius_deg = 2.0;
  scene.set_sky(sky);
  const Vector3d ahead = Vector3d::UnitZ();
  const std::optional<Hit> hit = scene.intersect(Vector3d::Zero(), ahead);
  REQUIRE(hit);
  CHECK(hit->distance == Approx(7.0));
  CHECK(hit->label == Label::kMover);
  CHECK(scene.radiance(Vector3d::Zero(), ahead)[0] > 100.0);
  CHECK(scene.radiance(Vector3d::Zero(), Vector3d(0.2, 0.0, 1.0))[0] < 20.0);
  CHECK(scene.label_of_sky(Vector3d(0.0, 0.0, 2.0), {0.0, 0.2, -1.0}) == Label::kSky);
  CHECK(scene.label_of_sky(Vector3d(0.0, 0.0, 6.0), -ahead) == Label::kMover);
  CHECK(scene.radiance(Vector3d::Zero(), -ahead) == sky.horizon);
  CHECK(scene.radiance(Vector3d::Zero(), sky.sun)[0] > 255.0);
  CHECK(scene.scaled(2.0).radiance(Vector3d::Zero(), -ahead) == sky.horizon);
}
