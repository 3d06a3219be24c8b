// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "core/helpers.h"
#include "core/on_depth_maps.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

constexpr int kWidth = 160;

const synth::Mission& room() {
  static const synth::Mission kRoom = synth::empty_room(small_recipe(kWidth, 5));
  return kRoom;
}

std::vector<RangeMap> range_maps_of(const std::vector<DepthMap>& maps) {
  std::vector<RangeMap> range_maps;
  for (const DepthMap& map : maps) range_maps.push_back(range_map(map, Executor(2)));
  return range_maps;
}

/// All except one.
std::vector<PosedRangeMap> others_of(const std::vector<RangeMap>& range_maps, std::size_t except) {
  std::vector<PosedRangeMap> others;
  for (std::size_t k = 0; k < range_maps.size(); ++k) {
    if (k != except) others.push_back({&range_maps[k], {range_maps[k].cam_from_world}});
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

KeyframeCloud judged(const DepthMap& map, const std::vector<PosedRangeMap>& others, float scale = 1.0F,
                     const FreeSpaceOptions& options = {}, const Executor& executor = Executor(2)) {
  SurfelMap points = points_of(map, scale);
  points.statuses = free_space_filter(points, {map.cam_from_world}, others, options, executor);
  return extract_points({&points, &points.statuses, {map.cam_from_world}});
}

double kept(const DepthMap& map, const std::vector<PosedRangeMap>& others, float scale = 1.0F,
            const FreeSpaceOptions& options = {}) {
  return static_cast<double>(judged(map, others, scale, options).points.size()) /
         static_cast<double>(points_of(map, scale).surfels.size());
}

/// Shares of the pixels of a map that stay: of those named, and of the others.
struct VersionInterval {
  double named, others;
};
VersionInterval staying(const std::vector<DepthMap>& maps, std::size_t k, const std::vector<std::size_t>& named,
                        const FreeSpaceOptions& options = {}) {
  SurfelMap points = points_of(maps[k]);
  const Image<std::uint8_t> statuses =
      free_space_filter(points, {maps[k].cam_from_world}, others_of(range_maps_of(maps), k), options, Executor(2));
  std::size_t stay = 0;
  std::size_t named_stay = 0;
  for (const std::uint8_t status : statuses.pixels()) stay += status != 0 ? 1 : 0;
  for (const std::size_t pixel : named) named_stay += statuses.pixels()[pixel] != 0 ? 1 : 0;
  const auto share = [](std::size_t part, std::size_t all) {
    return static_cast<double>(part) / static_cast<double>(all);
  };
  return {share(named_stay, named.size()), share(stay - named_stay, statuses.size() - named.size())};
}

}  // namespace

TEST_CASE("a range map holds the nearest and farthest depth of each cell", "[free space]") {
  DepthMap map = truth_maps(room())[0];
  map.depth(0, 0) = 2.0F;
  map.depth(1, 0) = 0.0F;
  map.depth(0, 1) = 5.0F;
  map.depth(1, 1) = 3.0F;
  for (const int x : {2, 3}) map.depth(x, 0) = map.depth(x, 1) = 0.0F;
  const RangeMap ranges = range_map(map, Executor(2));
  CHECK(ranges.keyframe_id == map.keyframe_id);
  REQUIRE(ranges.nearest.width() == kWidth / 2);
  REQUIRE(ranges.nearest.height() == kWidth / 4);
  CHECK(ranges.nearest(0, 0) == 2.0F);
  CHECK(ranges.farthest(0, 0) == 5.0F);
  CHECK(ranges.nearest(1, 0) == 0.0F);
  CHECK(ranges.farthest(1, 0) == 0.0F);
}

TEST_CASE("points on the true surface stay for any set of viewers", "[free space]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  const std::vector<RangeMap> range_maps = range_maps_of(maps);
  for (std::size_t k = 0; k < maps.size(); ++k) {
    INFO(k);
    CHECK(kept(maps[k], others_of(range_maps, k)) > 0.999);
  }
  const std::vector<DepthMap> furnished = truth_maps(synth::textured_room(small_recipe(kWidth, 5)));
  const std::vector<RangeMap> furnished_ranges = range_maps_of(furnished);
  CHECK(kept(furnished[2], others_of(furnished_ranges, 2)) > 0.99);
}

TEST_CASE("floating points are removed and points behind walls have no effect", "[free space]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  const std::vector<RangeMap> range_maps = range_maps_of(maps);
  CHECK(kept(maps[2], others_of(range_maps, 2), 0.8F) < 0.01);
  CHECK(kept(maps[2], others_of(range_maps, 2), 1.2F) > 0.99);
  CHECK(kept(maps[2], others_of(range_maps, 2), 0.97F) > 0.95);  // within the gap: not contradicted
  CHECK(kept(maps[2], others_of(range_maps, 2), 0.92F) < 0.1);   // farther than the gap
  FreeSpaceOptions strict;
  strict.min_relative_gap = 0.01;
  strict.max_relative_depth = 0.005;
  CHECK(kept(maps[2], others_of(range_maps, 2), 0.97F, strict) < 0.5);
}

TEST_CASE("one keyframe against many does not remove what they confirm", "[free space]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  std::vector<RangeMap> range_maps = range_maps_of(maps);
  for (float& depth : range_maps[1].nearest.pixels()) depth *= 1.5F;  // this map misses the walls
  for (float& depth : range_maps[1].farthest.pixels()) depth *= 1.5F;
  CHECK(kept(maps[2], others_of(range_maps, 2)) > 0.9);
  const std::vector<PosedRangeMap> alone = {{&range_maps[1], {range_maps[1].cam_from_world}}};
  FreeSpaceOptions even;
  even.max_contradiction = 1.0;
  const double against_one = kept(maps[2], alone, 1.0F, even);  // the nearer of the two decides
  CHECK(against_one > 0.2);
  CHECK(against_one < 0.8);
  FreeSpaceOptions tolerant;
  tolerant.max_contradiction = 100.0;
  CHECK(kept(maps[2], alone, 1.0F, tolerant) > 0.999);
}

TEST_CASE("many far keyframes that miss a surface do not outvote a near one that sees it", "[free space]") {
  const DepthMap near = beside_at_depth(truth_maps(room())[2], 0.0, 1.0F);
  const auto kept_against = [&](double away) {  // from this far aside, each of them sees the wall behind
    const RangeMap ranges = range_map(beside_at_depth(near, away, 10.0F), Executor(2));
    return kept(near, std::vector<PosedRangeMap>(12, {&ranges, {ranges.cam_from_world}}));
  };
  CHECK(kept_against(3.0) == 1.0);
  CHECK(kept_against(0.1) == 0.0);
}

TEST_CASE("mirror images below a floor are removed where other views have the floor", "[free space]") {
  std::vector<DepthMap> maps = truth_maps(room());
  const std::vector<std::size_t> ghosts = look_through_floor(maps[2], room().scene, 0.3, 2.5);
  const VersionInterval stay = staying(maps, 2, ghosts);
  CHECK(stay.named < 0.02);
  CHECK(stay.others > 0.999);
  FreeSpaceOptions off;
  off.mirrors = false;
  CHECK(staying(maps, 2, ghosts, off).named > 0.9);  // no view sees through them
  // Where a camera has been there is no mirror.
  std::vector<RangeMap> range_maps = range_maps_of(maps);
  RangeMap below = range_maps[1];
  std::fill(below.nearest.pixels().begin(), below.nearest.pixels().end(), 0.0F);
  std::fill(below.farthest.pixels().begin(), below.farthest.pixels().end(), 0.0F);
  below.cam_from_world.translation -= below.cam_from_world.rotation * Eigen::Vector3d(0.0, 2.5, 0.0);
  std::vector<PosedRangeMap> viewers = others_of(range_maps, 2);
  const std::size_t without = judged(maps[2], viewers).points.size();
  viewers.push_back({&below, {below.cam_from_world}});
  CHECK(judged(maps[2], viewers).points.size() > without + ghosts.size() * 9 / 10);
  // Another keyframe that shows the floor's image in part of the same place is outvoted.
  look_through_floor(maps[1], room().scene, 1.2, 2.5);
  CHECK(staying(maps, 2, ghosts).named < 0.05);
}

TEST_CASE("mirror images are found in any map units", "[free space]") {
  std::vector<DepthMap> maps = truth_maps(room());
  const std::vector<std::size_t> ghosts = look_through_floor(maps[2], room().scene, 0.3, 2.5);
  const std::vector<RangeMap> range_maps = range_maps_of(maps);
  const KeyframeCloud plain = judged(maps[2], others_of(range_maps, 2));
  constexpr double kScales[] = {0.5, 4.0, 2.0, 0.25, 8.0};
  std::vector<RangeMap> scaled = range_maps;
  for (std::size_t k = 0; k < scaled.size(); ++k) {
    for (float& depth : scaled[k].nearest.pixels()) depth /= static_cast<float>(kScales[k]);
    for (float& depth : scaled[k].farthest.pixels()) depth /= static_cast<float>(kScales[k]);
  }
  std::vector<PosedRangeMap> viewers = others_of(scaled, 2);
  for (std::size_t i = 0; i < viewers.size(); ++i) viewers[i].pose.scale = kScales[i < 2 ? i : i + 1];
  const KeyframePose pose{maps[2].cam_from_world, kScales[2]};
  SurfelMap points = points_of(maps[2], 1.0F / static_cast<float>(kScales[2]));
  points.statuses = free_space_filter(points, pose, viewers, {}, Executor(2));
  CHECK(extract_points({&points, &points.statuses, pose}).points.size() == plain.points.size());
}

TEST_CASE("points behind an opening stay though they resemble the room", "[free space]") {
  std::vector<DepthMap> maps = truth_maps(room());
  std::vector<std::size_t> seen;
  for (std::size_t k = 0; k < maps.size(); ++k) {
    const std::vector<std::size_t> through = look_through_floor(maps[k], room().scene, 0.3, 2.5);
    if (k == 2) seen = through;
  }
  const VersionInterval stay = staying(maps, 2, seen);
  CHECK(stay.named > 0.98);
  CHECK(stay.others > 0.98);
}

TEST_CASE("points that as many keyframes confirm as contradict are no mirror images", "[free space]") {
  std::vector<DepthMap> maps = truth_maps(room());
  const std::vector<std::size_t> ghosts = look_through_floor(maps[2], room().scene, 0.3, 2.5);
  for (const std::size_t k : {1U, 3U}) {  // see through walls and ceiling, but have the floor
    for (std::size_t i = 0; i < maps[k].depth.size(); ++i) {
      const Eigen::Vector3f up = maps[k].cam_from_world.rotation.cast<float>() * -Eigen::Vector3f::UnitY();
      if (maps[k].normal.pixels()[i].dot(up) < 0.9F) maps[k].depth.pixels()[i] *= 1.5F;
    }
  }
  CHECK(staying(maps, 2, ghosts).named > 0.9);
}

TEST_CASE("a mirror image needs two witnesses", "[free space]") {
  std::vector<DepthMap> maps = truth_maps(room());
  const std::vector<std::size_t> ghosts = look_through_floor(maps[2], room().scene, 0.3, 2.5);
  for (const std::size_t k : {0U, 4U}) std::fill(maps[k].depth.pixels().begin(), maps[k].depth.pixels().end(), 0.0F);
  CHECK(staying(maps, 2, ghosts).named < 0.1);
  std::fill(maps[3].depth.pixels().begin(), maps[3].depth.pixels().end(), 0.0F);
  CHECK(staying(maps, 2, ghosts).named > 0.9);
}

TEST_CASE("points below a floor that are no mirror images stay", "[free space]") {
  std::vector<DepthMap> maps = truth_maps(room());
  const std::vector<std::size_t> deep = look_through_floor(maps[2], room().scene, 0.3, 2.5, 1.3);
  const VersionInterval stay = staying(maps, 2, deep);
  CHECK(stay.named > 0.98);
  CHECK(stay.others > 0.999);
}

TEST_CASE("floaters in front of walls remove no wall points", "[free space]") {
  std::vector<DepthMap> maps = truth_maps(room());
  for (const std::size_t k : {0U, 1U, 3U}) {
    for (int y = 10; y < 70; ++y) {
      for (int x = 0; x < kWidth; ++x) maps[k].depth(x, y) *= (x / 4 + y / 4) % 5 == 0 ? 0.6F : 1.0F;
    }
  }
  CHECK(staying(maps, 2, {0}).others > 0.999);
}

TEST_CASE("contradiction lowers the confidence of kept points", "[free space]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  std::vector<RangeMap> range_maps = range_maps_of(maps);
  const KeyframeCloud confirmed = judged(maps[2], others_of(range_maps, 2));
  CHECK(confirmed.points[500].confidence == Approx(0.8F).margin(0.5 / 63));
  for (float& depth : range_maps[1].nearest.pixels()) depth *= 1.5F;
  for (float& depth : range_maps[1].farthest.pixels()) depth *= 1.5F;
  const KeyframeCloud doubted = judged(maps[2], others_of(range_maps, 2));
  const auto lowered = std::count_if(doubted.points.begin(), doubted.points.end(),
                                     [](const CloudPoint& p) { return p.confidence < 0.79F && p.confidence > 0.5F; });
  CHECK(static_cast<double>(lowered) > 0.9 * static_cast<double>(doubted.points.size()));
}

TEST_CASE("a disabled free-space filter changes nothing and invalid options are refused", "[free space]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  const std::vector<RangeMap> range_maps = range_maps_of(maps);
  FreeSpaceOptions options;
  options.enabled = false;
  CHECK(kept(maps[2], others_of(range_maps, 2), 0.8F, options) == 1.0);
  CHECK(kept(maps[2], {}, 0.8F) == 1.0);
  options.views = 0;
  CHECK_THROWS_AS(kept(maps[2], others_of(range_maps, 2), 1.0F, options), InvalidOption);
}

TEST_CASE("the free-space filter gives the same points for any threads and instruction set", "[free space]") {
  std::vector<DepthMap> maps =
      truth_maps(GENERATE(true, false) ? room() : synth::textured_room(small_recipe(kWidth, 5)));
  look_through_floor(maps[2], room().scene, 0.3, 2.5);
  const std::vector<RangeMap> range_maps = range_maps_of(maps);
  const KeyframeCloud one = judged(maps[2], others_of(range_maps, 2), 0.96F, {}, Executor(1));
  const KeyframeCloud five = judged(maps[2], others_of(range_maps, 2), 0.96F, {}, Executor(5));
  REQUIRE(one.points.size() == five.points.size());
  for (std::size_t i = 0; i < one.points.size(); ++i) REQUIRE(one.points[i].position == five.points[i].position);
  for (const Simd simd : available_simd()) {
    INFO(name_of(simd));
    const KeyframeCloud other = judged(maps[2], others_of(range_maps, 2), 0.96F, {}, Executor(2, simd));
    CHECK(static_cast<double>(other.points.size()) == Approx(static_cast<double>(one.points.size())).epsilon(0.003));
  }
}
