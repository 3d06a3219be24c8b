// SPDX-License-Identifier: BSD-2-Clause
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "core/helpers.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

struct Shares {
  double all = 0.0;
  double off_axis = 0.0;  ///< more than 15 degrees from the line of flight, both ends
  double seam = 0.0;      ///< columns at the left and right border
  double poles = 0.0;     ///< rows at the upper and lower border
  double normals = 0.0;   ///< within 15 degrees
};

/// Shares of pixels within 2 % of the truth.
Shares free_space_filter(const synth::Mission& mission, const DepthMap& map, std::size_t reference) {
  const synth::Frame& frame = mission.frames[reference];
  const int width = mission.width;
  const int height = mission.height;
  Shares shares;
  const auto off_axis = [&](int x, int y) { return degrees_from_motion(mission, reference, x, y) > 15.0; };
  shares.all = synth::share_within(map.depth, frame.depth, 0.02);
  shares.off_axis = synth::share_within(map.depth, frame.depth, 0.02, off_axis);
  shares.seam = synth::share_within(map.depth, frame.depth, 0.02,
                                    [&](int x, int y) { return (x < 4 || x >= width - 4) && off_axis(x, y); });
  shares.poles =
      synth::share_within(map.depth, frame.depth, 0.02, [&](int, int y) { return y < 6 || y >= height - 6; });
  shares.normals = normals_within(map, frame, 15.0);
  return shares;
}

void check_scene(const std::string& name, const synth::Mission& mission, const Shares& expected) {
  MatchStats stats;
  const DepthMap map = match(mission, 1, {}, &stats);
  const Shares found = free_space_filter(mission, map, 1);
  INFO(name);
  CAPTURE(found.all, found.off_axis, found.seam, found.poles, found.normals);
  CHECK(found.all >= expected.all);
  CHECK(found.off_axis >= expected.off_axis);
  CHECK(found.seam >= expected.seam);
  CHECK(found.poles >= expected.poles);
  CHECK(found.normals >= expected.normals);
  CHECK(map.keyframe_id == mission.frames[1].id);
  CHECK(map.cam_from_world.translation == mission.frames[1].cam_from_world.translation);
  CHECK(stats.pixels == static_cast<std::int64_t>(map.depth.size()));
  CHECK(stats.matched == static_cast<std::int64_t>(filled(map.depth) * static_cast<double>(map.depth.size()) + 0.5));
}

}  // namespace

// Normals come from fine patches here, which buy sharp depth edges and thin things with noisier normals.
TEST_CASE("PatchMatch finds a sphere from inside", "[patchmatch]" PMSP_ACCURACY) {
  check_scene("sphere_inside", synth::sphere_inside(small_recipe(320)), {0.94, 0.95, 0.94, 0.96, 0.58});
}

TEST_CASE("PatchMatch finds an empty room", "[patchmatch]" PMSP_ACCURACY) {
  check_scene("empty_room", synth::empty_room(small_recipe(320)), {0.84, 0.85, 0.85, 0.97, 0.56});
}

TEST_CASE("PatchMatch finds a slanted plane", "[patchmatch]" PMSP_ACCURACY) {
  check_scene("slanted_plane", synth::slanted_plane(small_recipe(320)), {0.89, 0.90, 0.93, 0.78, 0.50});
}

TEST_CASE("PatchMatch finds a wall across the seam", "[patchmatch]" PMSP_ACCURACY) {
  check_scene("corridor_across_seam", synth::corridor_across_seam(small_recipe(320)), {0.82, 0.84, 0.91, 0.96, 0.50});
}

TEST_CASE("PatchMatch finds the floor at the nadir", "[patchmatch]" PMSP_ACCURACY) {
  check_scene("floor_at_nadir", synth::floor_at_nadir(small_recipe(320)), {0.90, 0.91, 0.86, 0.94, 0.56});
}

TEST_CASE("normals and confidences of a raw depth map are as documented", "[patchmatch]") {
  const synth::Mission mission = synth::textured_room(small_recipe(width_of_any(160)));
  const DepthMap map = match(mission, 1);
  int wrong = 0;
  for (int y = 0; y < map.depth.height(); ++y) {
    for (int x = 0; x < map.depth.width(); ++x) {
      const Eigen::Vector3d normal = map.normal(x, y).cast<double>();
      const float confidence = map.confidence(x, y);
      if (map.depth(x, y) > 0.0F) {
        const bool unit = std::abs(normal.norm() - 1.0) < 1e-4;
        const bool facing = normal.dot(bearing_of(map.depth, x, y)) < 0.0;
        wrong += unit && facing && confidence >= 0.0F && confidence <= 1.0F ? 0 : 1;
      } else {
        wrong += normal.norm() == 0.0 && confidence == 0.0F ? 0 : 1;
      }
    }
  }
  CHECK(wrong == 0);
}

TEST_CASE("depths stay inside the requested range", "[patchmatch]") {
  const synth::Mission mission = synth::textured_room(small_recipe(width_of_any(160)));
  const DepthRange range = depth_range(synth::keyframe_of(mission, 1), InitOptions{});
  const DepthMap map = match(mission, 1);
  int outside = 0;
  for (const float depth : map.depth.pixels()) {
    const bool inside = depth >= range.min * 0.999 && depth <= range.max * 1.001;
    outside += depth > 0.0F && !inside ? 1 : 0;
  }
  CHECK(outside == 0);
}

TEST_CASE("confidence separates accurate from wrong pixels", "[patchmatch]" PMSP_ACCURACY) {
  const synth::Mission mission = synth::textured_room(small_recipe(256));
  const synth::Frame& frame = mission.frames[1];
  const DepthMap map = match(mission, 1);
  const auto share = [&](float from, float to) {
    return synth::share_within(map.depth, frame.depth, 0.02,
                               [&](int x, int y) { return map.confidence(x, y) >= from && map.confidence(x, y) < to; });
  };
  CAPTURE(share(0.95F, 1.1F), share(0.0F, 0.7F));
  CHECK(share(0.95F, 1.1F) > share(0.0F, 0.7F) + 0.2);
}

TEST_CASE("an unrelated source view has little effect beside a good one", "[patchmatch]" PMSP_ACCURACY) {
  synth::Mission mission = synth::sphere_inside(small_recipe(256));
  const synth::Frame& frame = mission.frames[1];
  const double both = synth::share_within(match(mission, 1).depth, frame.depth, 0.02);
  MatchSetup one;
  one.neighbours = {0};
  const double alone = synth::share_within(match(mission, 1, one).depth, frame.depth, 0.02);
  synth::Recipe other = small_recipe(256, 1);
  other.texture_seed = 99;
  mission.frames[2].image = synth::slanted_plane(other).frames[0].image;
  const double with_garbage = synth::share_within(match(mission, 1).depth, frame.depth, 0.02);
  CAPTURE(both, alone, with_garbage);
  CHECK(with_garbage > 0.7);
  CHECK(with_garbage > alone - 0.12);
}

TEST_CASE("four source views are at least as accurate as one", "[patchmatch]" PMSP_ACCURACY) {
  const synth::Mission mission = synth::textured_room(small_recipe(160, 5));
  const auto share = [&](const std::vector<std::size_t>& neighbours) {
    MatchSetup setup;
    setup.neighbours = neighbours;
    setup.options.neighbours = static_cast<int>(neighbours.size());
    return synth::share_within(match(mission, 2, setup).depth, mission.frames[2].depth, 0.02);
  };
  const double one = share({1});
  const double four = share({0, 1, 3, 4});
  CAPTURE(one, four);
  CHECK(four > one);
}

TEST_CASE("any even size works as well as a round one", "[patchmatch]" PMSP_ACCURACY) {
  const auto share = [](int width, int height) {
    synth::Recipe recipe = small_recipe(width);
    recipe.height = height;
    const synth::Mission mission = synth::sphere_inside(recipe);
    const DepthMap map = match(mission, 1);
    CHECK(map.depth.width() == width);
    CHECK(map.depth.height() == height);
    return synth::share_within(map.depth, mission.frames[1].depth, 0.02);
  };
  const std::vector<std::array<int, 4>> sizes = {
      {130, 66, 128, 64}, {226, 162, 224, 160}, {326, 162, 320, 160}, {190, 62, 192, 64}};
  for (const auto& [width, height, round_width, round_height] : sizes) {
    INFO(width << " x " << height);
    const double odd = share(width, height);
    const double round = share(round_width, round_height);
    CAPTURE(odd, round);
    CHECK(odd > round - 0.06);
  }
}

TEST_CASE("invalid input is refused", "[patchmatch]") {
  const Executor executor(1);
  const Image<Rgb> pixels(64, 32);
  const Panorama panorama(pixels.view(), {}, 64, 32, executor);
  const Panorama smaller(pixels.view(), {}, 32, 16, executor);
  const RigidTransform moved{Eigen::Matrix3d::Identity(), Eigen::Vector3d(1.0, 0.0, 0.0)};
  const MatchInput good{7, {&panorama, {}}, {{&panorama, moved}}, {0.5, 2.0}};
  const auto run = [&](const MatchInput& input, const PatchMatchOptions& options = {}) {
    return patchmatch(input, options, 1, executor);
  };
  CHECK_NOTHROW(run(good));
  MatchInput bad = good;
  bad.reference.panorama = nullptr;
  CHECK_THROWS_AS(run(bad), InvalidInput);
  bad = good;
  bad.neighbours.clear();
  CHECK_THROWS_WITH(run(bad), Catch::Contains("0 neighbours"));
  bad.neighbours.assign(9, {&panorama, moved});
  CHECK_THROWS_WITH(run(bad), Catch::Contains("9 neighbours"));
  bad.neighbours = {{&smaller, moved}};
  CHECK_THROWS_AS(run(bad), InvalidInput);
  bad.neighbours = {{nullptr, moved}};
  CHECK_THROWS_AS(run(bad), InvalidInput);
  const PlaneMap wrong_size(32, 16);
  for (const PlaneMap* MatchInput::*planes : {&MatchInput::landmarks, &MatchInput::warped, &MatchInput::start}) {
    bad = good;
    bad.*planes = &wrong_size;
    CHECK_THROWS_AS(run(bad), InvalidInput);
  }
  for (const DepthRange& range :
       {DepthRange{0.0, 1.0}, {2.0, 1.0}, {1.0, 1.0}, {-1.0, 1.0}, {NAN, 1.0}, {1.0, NAN}, {1.0, INFINITY}}) {
    bad = good;
    bad.range = range;
    CHECK_THROWS_WITH(run(bad), Catch::Contains("range"));
  }
  PatchMatchOptions options;
  options.iterations = 0;
  CHECK_THROWS_AS(run(good, options), InvalidOption);
}

TEST_CASE("panoramas refuse odd sizes and masks of another size", "[patchmatch]") {
  const Executor executor(1);
  const Image<Rgb> even(64, 32);
  const Image<Rgb> odd(63, 32);
  const Image<std::uint8_t> mask(62, 32, 255);
  CHECK_THROWS_AS(Panorama(odd.view(), {}, 64, 32, executor), InvalidInput);
  CHECK_THROWS_AS(Panorama(even.view(), {}, 63, 32, executor), InvalidInput);
  CHECK_THROWS_AS(Panorama(even.view(), {}, 64, 31, executor), InvalidInput);
  CHECK_THROWS_AS(Panorama(ImageView<const Rgb>{}, {}, 64, 32, executor), InvalidInput);
  CHECK_THROWS_WITH(Panorama(even.view(), mask.view(), 64, 32, executor), Catch::Contains("62 x 32"));
}

TEST_CASE("a geometric pass leaves fewer wrong depths", "[patchmatch]" PMSP_ACCURACY) {
  const synth::Mission mission = synth::empty_room(small_recipe(256, 5));
  MatchSetup first;
  first.options.iterations = 2;
  std::vector<DepthMap> maps;
  for (const std::size_t i : {std::size_t{1}, std::size_t{2}, std::size_t{3}}) maps.push_back(match(mission, i, first));
  const auto share = [&](const DepthMap& map) { return synth::share_within(map.depth, mission.frames[2].depth, 0.02); };
  MatchSetup again;
  again.options.iterations = 1;
  again.first_iteration = 2;
  again.start = &maps[1];
  const double alone = share(match(mission, 2, again));
  again.neighbour_maps = {&maps[0], &maps[2]};
  const double checked = share(match(mission, 2, again));
  CAPTURE(share(maps[1]), alone, checked);
  CHECK(alone >= share(maps[1]));
  CHECK(checked > alone + 0.02);
}

TEST_CASE("depth maps of source views must match the input", "[patchmatch]") {
  const synth::Mission mission = synth::empty_room(small_recipe(64));
  const DepthMap map = match(mission, 1);
  const DepthMap small = match(synth::empty_room(small_recipe(48)), 1);
  const DepthMap empty;
  MatchSetup setup;
  setup.neighbour_maps = {&map};
  CHECK_THROWS_AS(match(mission, 1, setup), InvalidInput);
  setup.neighbour_maps = {&map, &small};
  CHECK_THROWS_AS(match(mission, 1, setup), InvalidInput);
  setup.neighbour_maps = {nullptr, &empty};  // not known yet: as without
  CHECK(same(match(mission, 1, setup), map));
  setup.start = &small;
  CHECK_THROWS_AS(match(mission, 1, setup), InvalidInput);
}
