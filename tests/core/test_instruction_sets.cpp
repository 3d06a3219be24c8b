// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <vector>

#include "core/helpers.h"
#include "cpu/executor_impl.h"
#include "cpu/rows.h"
#include "pmsp/filters.h"
#include "pmsp/fusion.h"
#include "pmsp/panorama.h"
#include "pmsp/plane_priors.h"
#include "pmsp/range_map.h"
#include "support/fused_float.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

constexpr int kWidth = 100;  // rows of 50 pixels of a colour: a multiple of no number of lanes

/// Walls of one colour, so that planes have priors, and furniture; parts of it are masked.
const synth::Mission& masked_room() {
  static const synth::Mission kRoom = [] {
    synth::Mission mission = synth::painted_room(small_recipe(kWidth));
    mission.mask = Image<std::uint8_t>(kWidth, kWidth / 2, 255);
    for (int y = kWidth / 5; y < kWidth / 3; ++y) {
      for (int x = kWidth / 4; x < kWidth / 2; ++x) mission.mask(x, y) = 0;
    }
    return mission;
  }();
  return kRoom;
}

/// What every stage leaves, as in the Densifier.
struct Results {
  std::vector<PlaneMap> maps;
  PlaneMap priors;
  Image<float> confidence;
  std::vector<Image<std::uint8_t>> standings;  ///< after fusion, free space and each round of ownership
  KeyframeCloud cloud;
};

PlaneMap second_pass(const std::vector<PlaneMap>& first, const std::vector<Panorama>& panoramas, const PlaneMap& priors,
                     const DepthRange& range, const Executor& executor) {
  MatchInput input;
  input.keyframe_id = first[1].keyframe_id;
  input.reference = {&panoramas[1], first[1].cam_from_world};
  input.neighbours = {{&panoramas[0], first[0].cam_from_world}, {&panoramas[2], first[2].cam_from_world}};
  input.neighbour_maps = {&first[0], &first[2]};
  input.range = range;
  input.start = &first[1];
  input.prior = &priors;
  input.first_iteration = 2;
  PatchMatchOptions options;
  options.iterations = 1;
  return patchmatch(input, options, 1, executor);
}

Results run_all(const Executor& executor) {
  const synth::Mission& mission = masked_room();
  const DepthRange range{0.3, 30.0};
  Results results;
  std::vector<Panorama> panoramas;
  std::vector<MatchInput> inputs(3);
  for (std::size_t i = 0; i < 3; ++i) {
    const Keyframe keyframe = synth::keyframe_of(mission, i);
    panoramas.emplace_back(keyframe.image, keyframe.mask, kWidth, kWidth / 2, executor);
    inputs[i].keyframe_id = keyframe.id;
    inputs[i].range = range;
  }
  PatchMatchOptions options;
  options.iterations = 2;
  for (std::size_t i = 0; i < 3; ++i) {
    inputs[i].reference = {&panoramas[i], mission.frames[i].cam_from_world};
    for (std::size_t j = 0; j < 3; ++j) {
      if (j != i) inputs[i].neighbours.push_back({&panoramas[j], mission.frames[j].cam_from_world});
    }
    results.maps.push_back(patchmatch(inputs[i], options, 1, executor));
  }
  std::vector<PlaneMap>& maps = results.maps;
  results.priors = plane_priors(maps[1], panoramas[1], range, options, executor);
  maps.push_back(second_pass(maps, panoramas, results.priors, range, executor));
  maps.push_back(median_filter(maps[3], MedianFilterOptions{}, executor));
  ConsistencyFilterOptions consistency;
  results.confidence = consistency_filter(maps[4], {&maps[0], &maps[2]}, consistency, executor);
  const PlaneMap* const filtered[3] = {&maps[0], &maps[4], &maps[2]};
  const Image<float>* const confidences[3] = {&maps[0].score, &results.confidence, &maps[2].score};
  std::vector<FusionMap> window;
  std::vector<RangeMap> range_maps;
  std::vector<SurfelMap> surfels;
  for (std::size_t i = 0; i < 3; ++i) {
    window.push_back({filtered[i], confidences[i], &panoramas[i].color(), {filtered[i]->cam_from_world}});
    range_maps.push_back(range_map(*filtered[i], *confidences[i], executor));
  }
  for (std::size_t i = 0; i < 3; ++i) {
    surfels.push_back(fuse_pixels(window, i, FusionOptions{}, executor));
    results.standings.push_back(surfels[i].standings);
    std::vector<RangeMapFrom> viewers;
    for (std::size_t j = 0; j < 3; ++j) {
      if (j != i) viewers.push_back({&range_maps[j], window[j].pose});
    }
    surfels[i].standings = judge(surfels[i], window[i].pose, viewers, FreeSpaceOptions{}, executor);
    results.standings.push_back(surfels[i].standings);
  }
  std::vector<std::uint32_t> still[3];
  for (int round = 0; round < 2; ++round) {
    std::vector<Image<std::uint8_t>> next;
    for (std::size_t i = 0; i < 3; ++i) {
      std::vector<SurfelsFrom> viewers;
      for (std::size_t j = 0; j < 3; ++j) {
        if (j != i) viewers.push_back({&surfels[j], &surfels[j].standings, window[j].pose});
      }
      next.push_back(ownership_round({&surfels[i], &surfels[i].standings, window[i].pose}, still[i], viewers,
                                     FusionOptions{}, executor));
    }
    for (std::size_t i = 0; i < 3; ++i) surfels[i].standings = next[i];
    results.standings.insert(results.standings.end(), next.begin(), next.end());
  }
  results.cloud = owned_points({&surfels[1], &surfels[1].standings, window[1].pose});
  return results;
}

bool same(const PlaneMap& a, const PlaneMap& b) {
  return test::same(a.x, b.x) && test::same(a.y, b.y) && test::same(a.z, b.z) && test::same(a.score, b.score);
}

bool same(const Results& a, const Results& b) {
  for (std::size_t i = 0; i < a.maps.size(); ++i) {
    if (!same(a.maps[i], b.maps[i])) return false;
  }
  for (std::size_t i = 0; i < a.standings.size(); ++i) {
    if (a.standings[i].pixels() != b.standings[i].pixels()) return false;
  }
  if (!same(a.priors, b.priors) || !test::same(a.confidence, b.confidence)) return false;
  if (a.cloud.points.size() != b.cloud.points.size()) return false;
  for (std::size_t i = 0; i < a.cloud.points.size(); ++i) {
    const CloudPoint& p = a.cloud.points[i];
    const CloudPoint& q = b.cloud.points[i];
    if (p.position != q.position || p.confidence != q.confidence) return false;
  }
  return true;
}

/// Scalar rows with fused multiply-adds, on any machine.
const Results& fused_scalar() {
  static const Results kResults = [] {
    const Executor executor(1, Simd::kScalar);
    executor.impl().rows = cpu::row_kernels<fused::Float>();
    return run_all(executor);
  }();
  return kResults;
}

}  // namespace

TEST_CASE("AVX2 and AVX-512 give the bytes of scalar code with fused multiply-adds, in every stage", "[simd]") {
  for (const Simd simd : {Simd::kAvx2, Simd::kAvx512}) {
    const std::vector<Simd> sets = available_simd();
    if (std::find(sets.begin(), sets.end(), simd) == sets.end()) {
      WARN("not compared, since this machine lacks it: " << name_of(simd));
      continue;
    }
    INFO(name_of(simd));
    CHECK(same(run_all(Executor(1, simd)), fused_scalar()));
  }
}

TEST_CASE("what the instruction sets are compared by is not empty", "[simd]") {
  const Results& results = fused_scalar();
  for (const PlaneMap& map : results.maps) CHECK(filled(depth_map_of(map, nullptr, Executor(1)).depth) > 0.3);
  CHECK_FALSE(same(results.maps[3], results.maps[1]));
  CHECK_FALSE(same(results.maps[4], results.maps[3]));
  CHECK_FALSE(test::same(results.confidence, results.maps[4].score));
  CHECK(filled(depth_map_of(results.priors, nullptr, Executor(1)).depth) > 0.0);
  for (std::size_t i = 1; i < results.standings.size(); ++i) {
    CHECK(results.standings[i].pixels() != results.standings[i - 1].pixels());
  }
  CHECK(results.cloud.points.size() > 100);
}
