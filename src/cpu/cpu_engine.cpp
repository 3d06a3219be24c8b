// SPDX-License-Identifier: BSD-2-Clause
#include "cpu/cpu_engine.h"

#include <cstdlib>
#include <utility>

#include "patchmatch/match_setup.h"
#include "pmsp/filters.h"
#include "pmsp/fusion.h"
#include "pmsp/initialiser.h"
#include "pmsp/panorama.h"
#include "pmsp/patchmatch.h"
#include "pmsp/plane_priors.h"
#include "util/stopwatch.h"

namespace pmsp {
namespace {

struct CpuFrame : Engine::Frame {
  CpuFrame(const Keyframe& keyframe, Panorama prepared) : Frame(keyframe), panorama(std::move(prepared)) {}

  Panorama panorama;
  DepthMap raw;     ///< after the passes of PatchMatch so far
  DepthMap median;  ///< after the last pass and the median filter
  DepthMap map;     ///< after the consistency filter
  std::vector<std::uint8_t> covered;
};

CpuFrame& own(Engine::Frame& frame) { return static_cast<CpuFrame&>(frame); }
const CpuFrame& own(const Engine::Frame& frame) { return static_cast<const CpuFrame&>(frame); }

}  // namespace

std::unique_ptr<Engine::Frame> CpuEngine::prepare(const Keyframe& keyframe) {
  const Stopwatch watch(context_.stats.seconds_prepare);
  return std::make_unique<CpuFrame>(
      keyframe, Panorama(keyframe.image, keyframe.mask, context_.options.width, context_.options.height, executor_));
}

void CpuEngine::match(const MatchTask& task) {
  const DensifierOptions& options = context_.options;
  DensifierStats& stats = context_.stats;
  CpuFrame& reference = own(*task.reference);
  MatchInput input;
  input.keyframe_id = reference.id;
  input.reference = {&reference.panorama, reference.cam_from_world};
  input.range = task.range;
  for (const Frame* neighbour : task.neighbours) {
    input.neighbours.push_back({&own(*neighbour).panorama, neighbour->cam_from_world});
    if (task.pass > 0) input.neighbour_maps.push_back(&own(*neighbour).raw);
  }
  PlaneImage prior;
  PlaneImage sparse;
  PlaneImage warped;
  if (task.pass == 0) {
    const Stopwatch watch(stats.seconds_init);
    if (options.init.sparse_points) {
      sparse = planes_from_landmarks(*task.keyframe, options.width, options.height, options.init);
      input.candidates.push_back(&sparse);
    }
    if (task.previous != nullptr) {
      const CpuFrame& previous = own(*task.previous);
      if (previous.median.depth.empty()) {  // its later passes are still to come
        DepthMap filtered = previous.raw;
        median_filter(filtered, options.median, executor_);
        warped = warp_planes(filtered, reference.cam_from_world, executor_);
      } else {
        warped = warp_planes(previous.median, reference.cam_from_world, executor_);
      }
      input.candidates.push_back(&warped);
    }
  } else {
    input.start = &reference.raw;
    if (std::getenv("PRIOR") != nullptr) {
      const Stopwatch watch(stats.seconds_init);
      prior = plane_priors(reference.raw, reference.panorama, options.patchmatch, task.range, executor_);
      input.prior = &prior;
    }
  }
  const PassPlan plan = pass_plan(options.patchmatch, task.pass);
  input.first_iteration = plan.first_iteration;
  PatchMatchOptions how = options.patchmatch;
  how.iterations = plan.iterations;
  PatchMatchStats matched;
  {
    const Stopwatch watch(stats.seconds_patchmatch);
    reference.raw = patchmatch(input, how, options.seed, executor_, &matched, &context_.cancel);
  }
  reference.matched = !context_.cancel.load(std::memory_order_relaxed);
  if (!reference.matched || !task.last) return;
  if (context_.results.raw_depth) context_.results.raw_depth(reference.raw);
  FilterStats filtered;
  {
    const Stopwatch watch(stats.seconds_median);
    reference.median = reference.raw;
    median_filter(reference.median, options.median, executor_, &filtered);
  }
  ++stats.depth_maps;
  stats.pixels += matched.pixels;
  stats.pixels_matched += matched.matched;
  stats.pixels_after_median += filtered.after;
}

void CpuEngine::filter(Frame& frame, const std::vector<const Frame*>& others) {
  CpuFrame& reference = own(frame);
  reference.map = reference.median;
  std::vector<const DepthMap*> maps;
  maps.reserve(others.size());
  for (const Frame* other : others) maps.push_back(&own(*other).median);
  FilterStats filtered;
  {
    const Stopwatch watch(context_.stats.seconds_consistency);
    consistency_filter(reference.map, maps, context_.options.consistency, executor_, &filtered);
  }
  context_.stats.pixels_after_consistency += filtered.after;
  reference.covered.assign(reference.map.depth.size(), 0);
  if (context_.results.filtered_depth) context_.results.filtered_depth(reference.map);
}

void CpuEngine::fuse(const std::vector<Frame*>& window, std::size_t current) {
  std::vector<FusionInput> inputs;
  inputs.reserve(window.size());
  for (Frame* frame : window) {
    CpuFrame& member = own(*frame);
    inputs.push_back({&member.map, &member.panorama.color(), &member.covered});
  }
  KeyframeCloud cloud;
  {
    const Stopwatch watch(context_.stats.seconds_fusion);
    cloud = pmsp::fuse(inputs, current, context_.options.fusion, executor_);
  }
  context_.results.cloud(std::move(cloud));
}

}  // namespace pmsp
