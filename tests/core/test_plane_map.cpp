// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>

#include "core/helpers.h"
#include "pmsp/error.h"
#include "pmsp/plane_map.h"

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

TEST_CASE("planes of a depth map give it back", "[planes]") {
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

TEST_CASE("confidences take the place of scores, and 0 leaves a pixel out", "[planes]") {
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

TEST_CASE("planes, depths and confidences of other sizes are refused", "[planes]") {
  const Executor executor(1);
  DepthMap map = room_map();
  const PlaneMap planes = plane_map_of(map, executor);
  const Image<float> small(32, 16, 1.0F);
  CHECK_THROWS_AS(depth_map_of(planes, &small, executor), InvalidInput);
  map.confidence = small;
  CHECK_THROWS_AS(plane_map_of(map, executor), InvalidInput);
}
