// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "core/helpers.h"
#include "pmsp/error.h"
#include "pmsp/free_space.h"

using namespace pmsp;
using namespace pmsp::test;
using Eigen::Vector3d;
using Eigen::Vector3f;

namespace {

constexpr int kWidth = 160;

const synth::Mission& room() {
  static const synth::Mission kRoom = synth::empty_room(small_recipe(kWidth, 5));
  return kRoom;
}

std::vector<SightMap> sights_of(const std::vector<DepthMap>& maps) {
  std::vector<SightMap> sights;
  for (const DepthMap& map : maps) sights.push_back(sight_map(map, Executor(2)));
  return sights;
}

/// All but one.
std::vector<const SightMap*> others_of(const std::vector<SightMap>& sights, std::size_t except) {
  std::vector<const SightMap*> others;
  for (std::size_t k = 0; k < sights.size(); ++k) {
    if (k != except) others.push_back(&sights[k]);
  }
  return others;
}

/// The depths of a map as points, moved to `scale` times their distance.
KeyframeCloud cloud_of(const DepthMap& map, float scale = 1.0F) {
  KeyframeCloud cloud{map.keyframe_id, map.cam_from_world, {}};
  for (int y = 0; y < map.depth.height(); ++y) {
    for (int x = 0; x < map.depth.width(); ++x) {
      CloudPoint point;
      point.position = scale * map.depth(x, y) * bearing_of(map.depth, x, y).cast<float>();
      point.normal = map.normal(x, y);
      point.confidence = 0.8F;
      point.views = 3;
      cloud.points.push_back(point);
    }
  }
  return cloud;
}

double kept(KeyframeCloud cloud, const std::vector<const SightMap*>& others, const FreeSpaceOptions& options = {}) {
  const auto before = static_cast<double>(cloud.points.size());
  free_space_filter(cloud, others, options, Executor(2));
  return static_cast<double>(cloud.points.size()) / before;
}

}  // namespace

TEST_CASE("a sight map holds the nearest and farthest depth of each cell", "[free space]") {
  DepthMap map = truth_maps(room())[0];
  map.depth(0, 0) = 2.0F;
  map.depth(1, 0) = 0.0F;
  map.depth(0, 1) = 5.0F;
  map.depth(1, 1) = 3.0F;
  for (const int x : {2, 3}) map.depth(x, 0) = map.depth(x, 1) = 0.0F;
  const SightMap sight = sight_map(map, Executor(2));
  CHECK(sight.keyframe_id == map.keyframe_id);
  REQUIRE(sight.nearest.width() == kWidth / 2);
  REQUIRE(sight.nearest.height() == kWidth / 4);
  CHECK(sight.nearest(0, 0) == 2.0F);
  CHECK(sight.farthest(0, 0) == 5.0F);
  CHECK(sight.nearest(1, 0) == 0.0F);
  CHECK(sight.farthest(1, 0) == 0.0F);
}

TEST_CASE("points on the true surface stay, whoever looks", "[free space]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  const std::vector<SightMap> sights = sights_of(maps);
  for (std::size_t k = 0; k < maps.size(); ++k) {
    INFO(k);
    CHECK(kept(cloud_of(maps[k]), others_of(sights, k)) > 0.999);
  }
  const std::vector<DepthMap> furnished = truth_maps(synth::textured_room(small_recipe(kWidth, 5)));
  CHECK(kept(cloud_of(furnished[2]), others_of(sights_of(furnished), 2)) > 0.99);
}

TEST_CASE("points in the air go, points behind walls say nothing", "[free space]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  const std::vector<SightMap> sights = sights_of(maps);
  CHECK(kept(cloud_of(maps[2], 0.8F), others_of(sights, 2)) < 0.01);
  CHECK(kept(cloud_of(maps[2], 1.2F), others_of(sights, 2)) > 0.99);
  CHECK(kept(cloud_of(maps[2], 0.97F), others_of(sights, 2)) > 0.95);  // nearer than the gap: no one says it is wrong
  FreeSpaceOptions strict;
  strict.min_relative_gap = 0.01;
  strict.max_relative_depth = 0.005;
  CHECK(kept(cloud_of(maps[2], 0.97F), others_of(sights, 2), strict) < 0.5);
}

TEST_CASE("one keyframe against many does not remove what they confirm", "[free space]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  std::vector<SightMap> sights = sights_of(maps);
  for (float& depth : sights[1].nearest.pixels()) depth *= 1.5F;  // this one has missed the walls
  for (float& depth : sights[1].farthest.pixels()) depth *= 1.5F;
  CHECK(kept(cloud_of(maps[2]), others_of(sights, 2)) > 0.9);
  const std::vector<const SightMap*> alone = {&sights[1]};
  FreeSpaceOptions even;
  even.max_contradiction = 1.0;
  const double against_one = kept(cloud_of(maps[2]), alone, even);  // the nearer of the two decides
  CHECK(against_one > 0.2);
  CHECK(against_one < 0.8);
  FreeSpaceOptions tolerant;
  tolerant.max_contradiction = 100.0;
  CHECK(kept(cloud_of(maps[2]), alone, tolerant) > 0.999);
}

TEST_CASE("contradiction lowers the confidence of what stays", "[free space]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  std::vector<SightMap> sights = sights_of(maps);
  KeyframeCloud confirmed = cloud_of(maps[2]);
  free_space_filter(confirmed, others_of(sights, 2), {}, Executor(2));
  CHECK(confirmed.points[500].confidence == Approx(0.8F));
  for (float& depth : sights[1].nearest.pixels()) depth *= 1.5F;
  for (float& depth : sights[1].farthest.pixels()) depth *= 1.5F;
  KeyframeCloud doubted = cloud_of(maps[2]);
  free_space_filter(doubted, others_of(sights, 2), {}, Executor(2));
  const auto lowered = std::count_if(doubted.points.begin(), doubted.points.end(),
                                     [](const CloudPoint& p) { return p.confidence < 0.79F && p.confidence > 0.5F; });
  CHECK(static_cast<double>(lowered) > 0.9 * static_cast<double>(doubted.points.size()));
}

TEST_CASE("of many keyframes some are asked, those out of reach are not", "[free space]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  const std::vector<SightMap> sights = sights_of(maps);
  std::vector<SightMap> far = sights;
  for (SightMap& sight : far) sight.cam_from_world.translation += Vector3d(0.0, 0.0, 1000.0);
  std::vector<const SightMap*> others = others_of(sights, 2);
  for (int i = 0; i < 40; ++i) {
    for (const SightMap& sight : far) others.push_back(&sight);
  }
  FreeSpaceOptions few;
  few.views = 2;
  CHECK(kept(cloud_of(maps[2], 0.8F), others, few) < 0.01);
}

TEST_CASE("a free-space filter that is switched off changes nothing, bad options are refused", "[free space]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  const std::vector<SightMap> sights = sights_of(maps);
  FreeSpaceOptions options;
  options.enabled = false;
  CHECK(kept(cloud_of(maps[2], 0.8F), others_of(sights, 2), options) == 1.0);
  CHECK(kept(cloud_of(maps[2], 0.8F), {}) == 1.0);
  options.views = 0;
  CHECK_THROWS_AS(kept(cloud_of(maps[2]), others_of(sights, 2), options), InvalidOption);
}

TEST_CASE("the free-space filter gives the same points for any threads and instruction set", "[free space]") {
  const std::vector<DepthMap> maps = truth_maps(synth::textured_room(small_recipe(kWidth, 5)));
  const std::vector<SightMap> sights = sights_of(maps);
  KeyframeCloud one = cloud_of(maps[2], 0.96F);
  free_space_filter(one, others_of(sights, 2), {}, Executor(1));
  KeyframeCloud five = cloud_of(maps[2], 0.96F);
  free_space_filter(five, others_of(sights, 2), {}, Executor(5));
  REQUIRE(one.points.size() == five.points.size());
  for (std::size_t i = 0; i < one.points.size(); ++i) REQUIRE(one.points[i].position == five.points[i].position);
  for (const Simd simd : available_simd()) {
    INFO(name_of(simd));
    KeyframeCloud other = cloud_of(maps[2], 0.96F);
    free_space_filter(other, others_of(sights, 2), {}, Executor(2, simd));
    CHECK(static_cast<double>(other.points.size()) == Approx(static_cast<double>(one.points.size())).epsilon(0.003));
  }
}
