// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "core/helpers.h"
#include "core/on_depth_maps.h"
#include "pmsp/error.h"
#include "pmsp/fusion.h"
#include "pmsp/sight_map.h"

using namespace pmsp;
using namespace pmsp::test;

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
std::vector<SightFrom> others_of(const std::vector<SightMap>& sights, std::size_t except) {
  std::vector<SightFrom> others;
  for (std::size_t k = 0; k < sights.size(); ++k) {
    if (k != except) others.push_back({&sights[k], {sights[k].cam_from_world}});
  }
  return others;
}

/// The points of a map's pixels, moved to `scale` times their distance.
SurfelMap points_of(DepthMap map, float scale = 1.0F) {
  for (float& depth : map.depth.pixels()) depth *= scale;
  for (float& confidence : map.confidence.pixels()) confidence = 0.8F;
  const Image<Rgb> color(map.depth.width(), map.depth.height());
  return fuse_pixels({{&map, &color, {map.cam_from_world}}}, 0, {}, Executor(2));
}

KeyframeCloud judged(const DepthMap& map, const std::vector<SightFrom>& others, float scale = 1.0F,
                     const FreeSpaceOptions& options = {}, const Executor& executor = Executor(2)) {
  SurfelMap points = points_of(map, scale);
  points.standings = judge(points, {map.cam_from_world}, others, options, executor);
  return owned_points({&points, &points.standings, {map.cam_from_world}});
}

double kept(const DepthMap& map, const std::vector<SightFrom>& others, float scale = 1.0F,
            const FreeSpaceOptions& options = {}) {
  return static_cast<double>(judged(map, others, scale, options).points.size()) /
         static_cast<double>(points_of(map, scale).surfels.size());
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
    CHECK(kept(maps[k], others_of(sights, k)) > 0.999);
  }
  const std::vector<DepthMap> furnished = truth_maps(synth::textured_room(small_recipe(kWidth, 5)));
  const std::vector<SightMap> furnished_sights = sights_of(furnished);
  CHECK(kept(furnished[2], others_of(furnished_sights, 2)) > 0.99);
}

TEST_CASE("points in the air go, points behind walls say nothing", "[free space]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  const std::vector<SightMap> sights = sights_of(maps);
  CHECK(kept(maps[2], others_of(sights, 2), 0.8F) < 0.01);
  CHECK(kept(maps[2], others_of(sights, 2), 1.2F) > 0.99);
  CHECK(kept(maps[2], others_of(sights, 2), 0.97F) > 0.95);  // nearer than the gap: no one says it is wrong
  FreeSpaceOptions strict;
  strict.min_relative_gap = 0.01;
  strict.max_relative_depth = 0.005;
  CHECK(kept(maps[2], others_of(sights, 2), 0.97F, strict) < 0.5);
}

TEST_CASE("one keyframe against many does not remove what they confirm", "[free space]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  std::vector<SightMap> sights = sights_of(maps);
  for (float& depth : sights[1].nearest.pixels()) depth *= 1.5F;  // this one has missed the walls
  for (float& depth : sights[1].farthest.pixels()) depth *= 1.5F;
  CHECK(kept(maps[2], others_of(sights, 2)) > 0.9);
  const std::vector<SightFrom> alone = {{&sights[1], {sights[1].cam_from_world}}};
  FreeSpaceOptions even;
  even.max_contradiction = 1.0;
  const double against_one = kept(maps[2], alone, 1.0F, even);  // the nearer of the two decides
  CHECK(against_one > 0.2);
  CHECK(against_one < 0.8);
  FreeSpaceOptions tolerant;
  tolerant.max_contradiction = 100.0;
  CHECK(kept(maps[2], alone, 1.0F, tolerant) > 0.999);
}

TEST_CASE("contradiction lowers the confidence of what stays", "[free space]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  std::vector<SightMap> sights = sights_of(maps);
  const KeyframeCloud confirmed = judged(maps[2], others_of(sights, 2));
  CHECK(confirmed.points[500].confidence == Approx(0.8F).margin(0.5 / 63));
  for (float& depth : sights[1].nearest.pixels()) depth *= 1.5F;
  for (float& depth : sights[1].farthest.pixels()) depth *= 1.5F;
  const KeyframeCloud doubted = judged(maps[2], others_of(sights, 2));
  const auto lowered = std::count_if(doubted.points.begin(), doubted.points.end(),
                                     [](const CloudPoint& p) { return p.confidence < 0.79F && p.confidence > 0.5F; });
  CHECK(static_cast<double>(lowered) > 0.9 * static_cast<double>(doubted.points.size()));
}

TEST_CASE("a free-space filter that is switched off changes nothing, bad options are refused", "[free space]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  const std::vector<SightMap> sights = sights_of(maps);
  FreeSpaceOptions options;
  options.enabled = false;
  CHECK(kept(maps[2], others_of(sights, 2), 0.8F, options) == 1.0);
  CHECK(kept(maps[2], {}, 0.8F) == 1.0);
  options.views = 0;
  CHECK_THROWS_AS(kept(maps[2], others_of(sights, 2), 1.0F, options), InvalidOption);
}

TEST_CASE("the free-space filter gives the same points for any threads and instruction set", "[free space]") {
  const std::vector<DepthMap> maps = truth_maps(synth::textured_room(small_recipe(kWidth, 5)));
  const std::vector<SightMap> sights = sights_of(maps);
  const KeyframeCloud one = judged(maps[2], others_of(sights, 2), 0.96F, {}, Executor(1));
  const KeyframeCloud five = judged(maps[2], others_of(sights, 2), 0.96F, {}, Executor(5));
  REQUIRE(one.points.size() == five.points.size());
  for (std::size_t i = 0; i < one.points.size(); ++i) REQUIRE(one.points[i].position == five.points[i].position);
  for (const Simd simd : available_simd()) {
    INFO(name_of(simd));
    const KeyframeCloud other = judged(maps[2], others_of(sights, 2), 0.96F, {}, Executor(2, simd));
    CHECK(static_cast<double>(other.points.size()) == Approx(static_cast<double>(one.points.size())).epsilon(0.003));
  }
}
