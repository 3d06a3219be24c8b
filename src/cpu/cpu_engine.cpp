// SPDX-License-Identifier: BSD-2-Clause
#include "cpu/cpu_engine.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "fusion/surfel_shelf.h"
#include "patchmatch/match_setup.h"
#include "plan/reach.h"
#include "pmsp/filters.h"
#include "pmsp/fusion.h"
#include "pmsp/initialiser.h"
#include "pmsp/panorama.h"
#include "pmsp/patchmatch.h"
#include "pmsp/plane_priors.h"
#include "pmsp/sight_map.h"
#include "surfel.h"
#include "util/stopwatch.h"

namespace pmsp {

struct CpuFrame : Engine::Frame {
  CpuFrame(const Keyframe& keyframe, Panorama image, ScratchFile* scratch)
      : Frame(keyframe), panorama(std::move(image)), shelf(scratch) {}

  Panorama panorama;        ///< of the depth maps' size
  DepthMap raws[2];         ///< after the last even and the last odd pass of PatchMatch
  DepthMap median;          ///< after the last pass and the median filter
  Image<float> confidence;  ///< after the consistency filter; 0 = no depth
  SurfelShelf shelf;
  std::int64_t eligible = 0;  ///< points that are left when ownership is decided
};

namespace {

std::int64_t count_points(const Image<std::uint8_t>& standings) {
  return std::count_if(standings.pixels().begin(), standings.pixels().end(), kernels::makes_point);
}

CpuFrame& own(Engine::Frame& frame) { return static_cast<CpuFrame&>(frame); }
const CpuFrame& own(const Engine::Frame& frame) { return static_cast<const CpuFrame&>(frame); }

}  // namespace

std::unique_ptr<Engine::Frame> CpuEngine::prepare(const Keyframe& keyframe) {
  const Stopwatch watch(context_.stats.seconds_prepare);
  const DensifierOptions& options = context_.options;
  if (!scratch_ && !options.scratch_folder.empty()) scratch_ = std::make_unique<ScratchFile>(options.scratch_folder);
  return std::make_unique<CpuFrame>(
      keyframe, Panorama(keyframe.image, keyframe.mask, options.width, options.height, executor_), scratch_.get());
}

void CpuEngine::match(const MatchTask& task) {
  CpuFrame& reference = own(*task.reference);
  PatchMatchStats matched;
  DepthMap filtered;
  const DepthMap* const to_warp = map_to_warp(task, filtered);
  DepthMap& raw = reference.raws[task.pass % 2];
  raw = run_pass(task, to_warp, matched);
  reference.matched = !context_.cancel.load(std::memory_order_relaxed);
  if (reference.matched && task.last) finish_match(reference, std::move(raw), matched);
}

/// The previous keyframe's map of the first pass, median filtered; into `scratch` while later passes are to come.
const DepthMap* CpuEngine::map_to_warp(const MatchTask& task, DepthMap& scratch) {
  if (task.previous == nullptr) return nullptr;
  const CpuFrame& previous = own(*task.previous);
  if (!previous.median.depth.empty()) return &previous.median;
  const Stopwatch watch(context_.stats.seconds_init);
  scratch = previous.raws[0];
  median_filter(scratch, context_.options.median, executor_);
  return &scratch;
}

DepthMap CpuEngine::run_pass(const MatchTask& task, const DepthMap* to_warp, PatchMatchStats& matched) {
  const DensifierOptions& options = context_.options;
  const CpuFrame& reference = own(*task.reference);
  const Iterations iterations = iterations_of(options.patchmatch, task.pass);
  MatchInput input;
  input.keyframe_id = reference.id;
  input.reference = {&reference.panorama, reference.cam_from_world};
  input.range = task.range;
  input.first_iteration = iterations.first;
  for (const Frame* neighbour : task.neighbours) {
    input.neighbours.push_back({&own(*neighbour).panorama, neighbour->cam_from_world});
    if (task.pass == 0) continue;
    const bool near = input.neighbour_maps.size() < task.near;
    input.neighbour_maps.push_back(near ? &own(*neighbour).raws[(task.pass - 1) % 2] : nullptr);
  }
  std::vector<PlaneImage> candidates;
  PlaneImage prior;
  if (task.pass == 0) {
    candidates = first_planes(task, to_warp, *input.reference.panorama);
    for (const PlaneImage& planes : candidates) input.candidates.push_back(&planes);
  } else {
    const DepthMap& before = reference.raws[(task.pass - 1) % 2];
    input.start = &before;
    if (options.patchmatch.plane_priors) {
      const Stopwatch watch(context_.stats.seconds_init);
      prior = plane_priors(before, *input.reference.panorama, task.range, options.patchmatch, executor_);
      input.prior = &prior;
    }
  }
  PatchMatchOptions how = options.patchmatch;
  how.iterations = iterations.count;
  const Stopwatch watch(context_.stats.seconds_patchmatch);
  return patchmatch(input, how, options.seed, executor_, &matched, &context_.cancel);
}

/// What the landmarks and the previous keyframe propose.
std::vector<PlaneImage> CpuEngine::first_planes(const MatchTask& task, const DepthMap* to_warp,
                                                const Panorama& panorama) {
  const Stopwatch watch(context_.stats.seconds_init);
  const DensifierOptions& options = context_.options;
  const int width = panorama.width();
  const int height = panorama.height();
  std::vector<PlaneImage> planes;
  if (options.init.sparse_points) {
    planes.push_back(planes_from_landmarks(*task.keyframe, width, height, options.init));
  }
  if (to_warp != nullptr) {
    planes.push_back(warp_planes(*to_warp, task.reference->cam_from_world, width, height, executor_));
  }
  return planes;
}

/// Nobody else asks for the planes of the last pass.
void CpuEngine::finish_match(CpuFrame& reference, DepthMap raw, const PatchMatchStats& matched) {
  DensifierStats& stats = context_.stats;
  if (context_.results.raw_depth) context_.results.raw_depth(raw);
  FilterStats filtered;
  {
    const Stopwatch watch(stats.seconds_median);
    reference.median = std::move(raw);
    median_filter(reference.median, context_.options.median, executor_, &filtered);
  }
  ++stats.depth_maps;
  stats.pixels += matched.pixels;
  stats.pixels_matched += matched.matched;
  stats.pixels_after_median += filtered.after;
}

void CpuEngine::filter(Frame& frame, const std::vector<const Frame*>& others) {
  CpuFrame& reference = own(frame);
  DepthMap map = reference.median;
  std::vector<const DepthMap*> maps;
  maps.reserve(others.size());
  for (const Frame* other : others) maps.push_back(&own(*other).median);
  FilterStats filtered;
  {
    const Stopwatch watch(context_.stats.seconds_consistency);
    consistency_filter(map, maps, context_.options.consistency, executor_, &filtered);
  }
  context_.stats.pixels_after_consistency += filtered.after;
  if (context_.results.cloud && context_.options.free_space.enabled) {
    const Stopwatch watch(context_.stats.seconds_free_space);
    reference.shelf.put(sight_map(map, executor_));
  }
  if (context_.results.filtered_depth) context_.results.filtered_depth(map);
  reference.confidence = std::move(map.confidence);
}

void CpuEngine::fuse(Frame& frame, const std::vector<const Frame*>& window, std::size_t current) {
  const Stopwatch watch(context_.stats.seconds_fusion);
  std::vector<FusionMap> maps;
  maps.reserve(window.size());
  for (const Frame* joined : window) {
    const CpuFrame& member = own(*joined);
    maps.push_back({&member.median, &member.panorama.color(), member.pose(), &member.confidence});
  }
  CpuFrame& reference = own(frame);
  SurfelMap points = fuse_pixels(maps, current, context_.options.fusion, executor_);
  reference.eligible = count_points(points.standings);
  context_.stats.points_fused += reference.eligible;
  reference.shelf.put(std::move(points));
}

void CpuEngine::judge(Frame& frame, const std::vector<const Frame*>& viewers) {
  const Stopwatch watch(context_.stats.seconds_free_space);
  CpuFrame& reference = own(frame);
  SurfelMap copy;
  std::vector<SightMap> copies(viewers.size());
  std::vector<SightFrom> asked;
  for (std::size_t k = 0; k < viewers.size(); ++k) {
    const CpuFrame& viewer = own(*viewers[k]);
    asked.push_back({&viewer.shelf.sight(copies[k]), viewer.pose()});
  }
  Image<std::uint8_t> standings =
      pmsp::judge(reference.shelf.points(true, copy), reference.pose(), asked, context_.options.free_space, executor_);
  reference.eligible = count_points(standings);
  reference.shelf.put(std::move(standings), 0);
}

void CpuEngine::round(Frame& frame, const std::vector<const Frame*>& others, int round) {
  const Stopwatch watch(context_.stats.seconds_ownership);
  CpuFrame& reference = own(frame);
  struct Copy {
    SurfelMap points;
    Image<std::uint8_t> standings;
  };
  std::vector<Copy> copies(others.size() + 1);
  const auto points_of = [&](const CpuFrame& asked, Copy& copy) {
    return SurfelsFrom{&asked.shelf.points(false, copy.points), &asked.shelf.standings(round - 1, copy.standings),
                       asked.pose()};
  };
  std::vector<SurfelsFrom> asked;
  for (std::size_t k = 0; k < others.size(); ++k) asked.push_back(points_of(own(*others[k]), copies[k]));
  std::vector<std::uint32_t> still = reference.shelf.take_asked();
  Image<std::uint8_t> after =
      ownership_round(points_of(reference, copies.back()), still, asked, context_.options.fusion, executor_);
  reference.shelf.put(std::move(after), round);
  reference.shelf.put_asked(std::move(still));
}

void CpuEngine::hand_out(Frame& frame) {
  const CpuFrame& reference = own(frame);
  KeyframeCloud cloud;
  {
    const Stopwatch watch(context_.stats.seconds_ownership);
    SurfelMap points;
    Image<std::uint8_t> standings;
    cloud = owned_points({&reference.shelf.points(true, points),
                          &reference.shelf.standings(ownership_rounds(context_.options), standings), reference.pose()});
  }
  context_.stats.points_repeated += reference.eligible - static_cast<std::int64_t>(cloud.points.size());
  context_.results.cloud(cloud);
}

void CpuEngine::release(Frame& frame, Artefact artefact) {
  CpuFrame& done = own(frame);
  switch (artefact) {
    case Artefact::kImage:
      done.panorama.release_gray();
      break;
    case Artefact::kColor:
      done.panorama.release_color();
      break;
    case Artefact::kLandmarks:
      break;
    case Artefact::kPlanes:
      for (DepthMap& raw : done.raws) raw = {};
      break;
    case Artefact::kMedian:
      done.median = {};
      break;
    case Artefact::kFiltered:
      done.confidence = {};
      break;
    case Artefact::kSight:
      done.shelf.release_sight();
      break;
    case Artefact::kSurfels:
      done.shelf.release_points();
      break;
  }
}

}  // namespace pmsp
