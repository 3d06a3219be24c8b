// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <map>
#include <vector>

#include "core/recording.h"
#include "cpu/executor_impl.h"
#include "cpu/rows.h"
#include "pmsp/stages.h"
#include "support/fused_float.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

/// Rows of 50 and 18 pixels of a colour, a multiple of no number of lanes, and of 8, half of the lanes of AVX-512.
constexpr int kWidth = 100;
constexpr int kWidths[] = {kWidth, 36, 16};

/// Walls of one colour, so that planes have priors, and furniture; parts of it are masked.
synth::Mission masked_room(int width) {
  synth::Mission mission = synth::painted_room(small_recipe(width));
  mission.mask = Image<std::uint8_t>(width, width / 2, 255);
  for (int y = width / 5; y < width / 3; ++y) {
    for (int x = width / 4; x < width / 2; ++x) mission.mask(x, y) = 0;
  }
  return mission;
}

/// Results of every stage, as in the Densifier.
struct Results {
  std::vector<PlaneMap> maps;
  PlaneMap priors;
  Image<float> confidence;
  std::vector<Image<std::uint8_t>> statuses;  ///< after fusion, free-space test and each round of duplicate removal
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

Results run_all(const synth::Mission& mission, const Executor& executor) {
  const DepthRange range{0.3, 30.0};
  Results results;
  std::vector<Panorama> panoramas;
  std::vector<MatchInput> inputs(3);
  for (std::size_t i = 0; i < 3; ++i) {
    const Keyframe keyframe = synth::keyframe_of(mission, i);
    panoramas.emplace_back(keyframe.image, keyframe.mask, mission.width, mission.height, executor);
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
  const std::vector<KeyframePose> around = {{mission.frames[0].cam_from_world}, {mission.frames[2].cam_from_world}};
  results.priors = plane_priors(maps[1], panoramas[1], around, range, executor);
  maps.push_back(second_pass(maps, panoramas, results.priors, range, executor));
  maps.push_back(weighted_median_filter(median_filter(maps[3], median_on(), executor), panoramas[1], executor));
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
  FusionOptions fusion;
  fusion.suppression = 1.5;
  for (std::size_t i = 0; i < 3; ++i) {
    surfels.push_back(fuse_pixels(window, i, fusion, executor));
    results.statuses.push_back(surfels[i].statuses);
    std::vector<PosedRangeMap> viewers;
    for (std::size_t j = 0; j < 3; ++j) {
      if (j != i) viewers.push_back({&range_maps[j], window[j].pose});
    }
    surfels[i].statuses = free_space_filter(surfels[i], window[i].pose, viewers, FreeSpaceOptions{}, executor);
    results.statuses.push_back(surfels[i].statuses);
  }
  std::vector<std::uint32_t> still[3];
  for (int round = 0; round < 2; ++round) {
    std::vector<Image<std::uint8_t>> next;
    for (std::size_t i = 0; i < 3; ++i) {
      std::vector<PosedSurfels> viewers;
      for (std::size_t j = 0; j < 3; ++j) {
        if (j != i) viewers.push_back({&surfels[j], &surfels[j].statuses, window[j].pose});
      }
      next.push_back(duplicate_round({&surfels[i], &surfels[i].statuses, window[i].pose}, still[i], viewers,
                                     FusionOptions{}, executor));
    }
    for (std::size_t i = 0; i < 3; ++i) surfels[i].statuses = next[i];
    results.statuses.insert(results.statuses.end(), next.begin(), next.end());
  }
  results.cloud = extract_points({&surfels[1], &surfels[1].statuses, window[1].pose});
  return results;
}

bool same(const PlaneMap& a, const PlaneMap& b) {
  return test::same(a.x, b.x) && test::same(a.y, b.y) && test::same(a.z, b.z) && test::same(a.score, b.score);
}

bool same(const Results& a, const Results& b) {
  for (std::size_t i = 0; i < a.maps.size(); ++i) {
    if (!same(a.maps[i], b.maps[i])) return false;
  }
  for (std::size_t i = 0; i < a.statuses.size(); ++i) {
    if (a.statuses[i].pixels() != b.statuses[i].pixels()) return false;
  }
  if (!same(a.priors, b.priors) || !test::same(a.confidence, b.confidence)) return false;
  return test::same(a.cloud, b.cloud);
}

/// Scalar rows with fused multiply-adds, on any machine.
Results fused_scalar(const synth::Mission& mission) {
  const Executor executor(1, Simd::kScalar);
  impl_of(executor).rows = cpu::row_kernels<fused::Float>();
  return run_all(mission, executor);
}

}  // namespace

TEST_CASE("AVX2 and AVX-512 give the bytes of scalar code with fused multiply-adds, in every stage", "[simd]") {
  const std::vector<Simd> sets = available_simd();
  for (const int width : kWidths) {
    const synth::Mission mission = masked_room(width);
    const Results expected = fused_scalar(mission);
    for (const Simd simd : {Simd::kAvx2, Simd::kAvx512}) {
      if (std::find(sets.begin(), sets.end(), simd) == sets.end()) {
        WARN("not compared, since this machine lacks it: " << name_of(simd));
        continue;
      }
      INFO(name_of(simd) << ", width " << width);
      CHECK(same(run_all(mission, Executor(1, simd)), expected));
    }
  }
}

TEST_CASE("the results compared across instruction sets are not empty", "[simd]") {
  const Results results = fused_scalar(masked_room(kWidth));
  for (const PlaneMap& map : results.maps) CHECK(filled(depth_map_of(map, nullptr, Executor(1)).depth) > 0.3);
  CHECK_FALSE(same(results.maps[3], results.maps[1]));
  CHECK_FALSE(same(results.maps[4], results.maps[3]));
  CHECK_FALSE(test::same(results.confidence, results.maps[4].score));
  CHECK(filled(depth_map_of(results.priors, nullptr, Executor(1)).depth) > 0.0);
  for (std::size_t i = 1; i < results.statuses.size(); ++i) {
    CHECK(results.statuses[i].pixels() != results.statuses[i - 1].pixels());
  }
  CHECK(results.cloud.points.size() > 100);
}
