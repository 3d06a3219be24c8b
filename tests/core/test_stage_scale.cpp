// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <vector>

#include "core/helpers.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

constexpr int kWidth = 64;

const synth::Mission& room() {
  static const synth::Mission kRoom = synth::empty_room(small_recipe(kWidth, 3));
  return kRoom;
}

/// True planes at another scale, a power of two to avoid rounding.
PlaneMap planes_of(std::size_t frame, double scale) {
  DepthMap map = truth_map(room().frames[frame], 0.9F);
  for (float& depth : map.depth.pixels()) depth /= static_cast<float>(scale);
  map.scale = scale;
  return plane_map_of(map, Executor(1));
}

/// Planes converted to another unit.
bool same_planes(const PlaneMap& a, const PlaneMap& b) {
  const float ratio = static_cast<float>(a.scale / b.scale);
  const auto same = [&](const Image<float>& x, const Image<float>& y) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (x.pixels()[i] != ratio * y.pixels()[i]) return false;
    }
    return true;
  };
  return same(a.x, b.x) && same(a.y, b.y) && same(a.z, b.z) && a.score.pixels() == b.score.pixels();
}

}  // namespace

TEST_CASE("depth maps and planes keep their unit", "[scale]") {
  const Executor executor(1);
  const PlaneMap planes = planes_of(0, 4.0);
  CHECK(planes.scale == 4.0);
  CHECK(depth_map_of(planes, nullptr, executor).scale == 4.0);
  CHECK(depth_map_of(PlaneMap(), nullptr, executor).scale == 1.0);
  CHECK(median_filter(planes, median_on(), executor).scale == 4.0);
  const Image<float> sure(kWidth, kWidth / 2, 1.0F);
  const RangeMap ranges = range_map(planes, sure, executor);
  CHECK(ranges.scale == 4.0);
  CHECK(ranges.nearest(5, 5) == 0.25F * range_map(planes_of(0, 1.0), sure, executor).nearest(5, 5));
}

TEST_CASE("depth maps of different units agree like those of one unit", "[scale]") {
  const Executor executor(1);
  const PlaneMap before = planes_of(0, 1.0);
  const PlaneMap after = planes_of(2, 1.0);
  const PlaneMap near = planes_of(0, 4.0);
  const PlaneMap far = planes_of(2, 0.5);
  const Image<float> plain = consistency_filter(planes_of(1, 1.0), {&before, &after}, {}, executor);
  const Image<float> scaled = consistency_filter(planes_of(1, 2.0), {&near, &far}, {}, executor);
  CHECK(plain.pixels() == scaled.pixels());
  CHECK(std::count_if(plain.pixels().begin(), plain.pixels().end(), [](float c) { return c > 0.0F; }) > kWidth);
}

TEST_CASE("planes are converted from one unit to another", "[scale]") {
  const Executor executor(1);
  const KeyframePose pose{room().frames[1].cam_from_world, 0.25};
  const PlaneMap plain = warp_planes(planes_of(0, 1.0), {pose.cam_from_world}, kWidth, kWidth / 2, executor);
  const PlaneMap scaled = warp_planes(planes_of(0, 4.0), pose, kWidth, kWidth / 2, executor);
  CHECK(scaled.scale == 0.25);
  CHECK(same_planes(scaled, plain));
  Keyframe keyframe = synth::keyframe_of(room(), 0);
  const PlaneMap landmarks = planes_from_landmarks(keyframe, kWidth, kWidth / 2, {}, executor);
  const DepthRange range = depth_range(keyframe, {});
  keyframe.scale = 8.0;
  CHECK(same_planes(planes_from_landmarks(keyframe, kWidth, kWidth / 2, {}, executor), landmarks));
  CHECK(depth_range(keyframe, {}).min == range.min / 8.0);
  CHECK(depth_range(keyframe, {}).max == range.max / 8.0);
}

TEST_CASE("PatchMatch finds the same planes in any unit", "[scale]") {
  const Executor executor(1);
  std::vector<Panorama> panoramas;
  for (std::size_t i = 0; i < 3; ++i) {
    panoramas.emplace_back(room().frames[i].image.view(), ImageView<const std::uint8_t>(), kWidth, kWidth / 2,
                           executor);
  }
  PatchMatchOptions options;
  options.iterations = 2;
  const auto match = [&](const std::vector<double>& scales) {
    Keyframe reference = synth::keyframe_of(room(), 1);
    reference.scale = scales[1];
    MatchInput input;
    input.reference = {&panoramas[1], reference.pose()};
    input.range = depth_range(reference, {});
    const PlaneMap before = planes_of(0, scales[0]);
    const PlaneMap own = planes_of(1, scales[1]);
    input.neighbours = {{&panoramas[0], {room().frames[0].cam_from_world, scales[0]}},
                        {&panoramas[2], {room().frames[2].cam_from_world, scales[2]}}};
    input.neighbour_maps = {&before, nullptr};
    input.start = &own;
    return patchmatch(input, options, 1, executor);
  };
  const PlaneMap plain = match({1.0, 1.0, 1.0});
  const PlaneMap scaled = match({4.0, 0.5, 2.0});
  CHECK(scaled.scale == 0.5);
  CHECK(same_planes(scaled, plain));
}

TEST_CASE("stages refuse scales not representable in single precision", "[scale]") {
  const Executor executor(1);
  PlaneMap bad = planes_of(0, 1.0);
  const PlaneMap good = planes_of(1, 1.0);
  for (const double scale : {0.0, 1e-4, 1e4}) {
    bad.scale = scale;
    CHECK_THROWS_AS(consistency_filter(bad, {&good}, {}, executor), InvalidInput);
    CHECK_THROWS_AS(consistency_filter(good, {&bad}, {}, executor), InvalidInput);
    CHECK_THROWS_AS(warp_planes(bad, good.pose(), kWidth, kWidth / 2, executor), InvalidInput);
    CHECK_THROWS_WITH(warp_planes(good, bad.pose(), kWidth, kWidth / 2, executor),
                      Catch::Contains("scale") && Catch::Contains("expected 0.001 to 1000"));
  }
}
