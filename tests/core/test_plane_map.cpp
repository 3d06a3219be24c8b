// SPDX-License-Identifier: BSD-2-Clause
#include <cmath>

#include <catch2/catch.hpp>

#include "core/helpers.h"
#include "elementary.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

DepthMap room_map() {
  DepthMap map = truth_map(synth::empty_room(small_recipe(64)).frames[0], 0.7F);
  map.depth(3, 5) = 0.0F;
  map.normal(3, 5).setZero();
  map.confidence(3, 5) = 0.0F;
  return map;
}

}  // namespace

TEST_CASE("planes of a depth map reproduce its depths", "[planes]") {
  const Executor executor(2);
  const DepthMap map = room_map();
  const PlaneMap planes = plane_map_of(map, executor);
  CHECK((planes.x(3, 5) == 0.0F && planes.y(3, 5) == 0.0F && planes.z(3, 5) == 0.0F));
  const DepthMap again = depth_map_of(planes, nullptr, executor);
  CHECK(again.keyframe_id == map.keyframe_id);
  CHECK(again.cam_from_world.translation == map.cam_from_world.translation);
  for (std::size_t i = 0; i < map.depth.size(); ++i) {
    REQUIRE(again.depth.pixels()[i] == Approx(map.depth.pixels()[i]).epsilon(1e-5));
    REQUIRE((again.normal.pixels()[i] - map.normal.pixels()[i]).norm() < 1e-5F);
    REQUIRE(again.confidence.pixels()[i] == map.confidence.pixels()[i]);
  }
}

TEST_CASE("confidences are used as scores and 0 leaves a pixel out", "[planes]") {
  const Executor executor(1);
  PlaneMap planes = plane_map_of(room_map(), executor);
  planes.score(10, 10) = 1.5F;  // what a prior adds
  CHECK(depth_map_of(planes, nullptr, executor).confidence(10, 10) == 1.0F);
  Image<float> confidence(planes.width(), planes.height(), 0.25F);
  confidence(20, 10) = 0.0F;
  const DepthMap map = depth_map_of(planes, &confidence, executor);
  CHECK(map.confidence(10, 10) == 0.25F);
  CHECK(map.depth(20, 10) == 0.0F);
  CHECK(map.normal(20, 10).isZero());
  CHECK(map.depth(3, 5) == 0.0F);
  CHECK(map.confidence(3, 5) == 0.0F);
}

TEST_CASE("planes and depths and confidences of different sizes are refused", "[planes]") {
  const Executor executor(1);
  DepthMap map = room_map();
  const PlaneMap planes = plane_map_of(map, executor);
  const Image<float> small(32, 16, 1.0F);
  CHECK_THROWS_AS(depth_map_of(planes, &small, executor), InvalidInput);
  map.confidence = small;
  CHECK_THROWS_AS(plane_map_of(map, executor), InvalidInput);
}

TEST_CASE("normals are estimated from depths alone and edges are not smoothed", "[planes]") {
  const Executor executor(2);
  const synth::Frame frame = synth::textured_room(small_recipe(256)).frames[0];
  const DepthMap truth = truth_map(frame, 0.7F);
  Image<float> depth = truth.depth;
  depth(7, 9) = 0.0F;
  depth(8, 9) = std::nanf("");
  const Image<Eigen::Vector3f> normals = estimate_normals(depth, executor);
  CHECK(normals(7, 9).isZero());
  CHECK(normals(8, 9).isZero());
  std::size_t right = 0, unit = 0, facing = 0;
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      const Eigen::Vector3f& normal = normals(x, y);
      unit += std::abs(normal.norm() - 1.0F) < 1e-5F;
      facing += normal.cast<double>().dot(bearing_of(depth, x, y)) < -0.16;
      right += normal.dot(truth.normal(x, y)) > std::cos(5.0F * static_cast<float>(kernels::kPi) / 180.0F);
    }
  }
  const std::size_t pixels = depth.size();
  CHECK(unit == pixels - 2);
  CHECK(facing == pixels - 2);
  CHECK(static_cast<double>(right) > 0.9 * static_cast<double>(pixels));
  CHECK(estimate_normals(Image<float>(), executor).empty());
  CHECK((estimate_normals(depth, Executor(1)).pixels() == normals.pixels()));
}
