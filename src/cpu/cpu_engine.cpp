// SPDX-License-Identifier: BSD-2-Clause
#include "cpu/cpu_engine.h"

#include <algorithm>
#include <cstdint>
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
  PlaneMap raws[2];         ///< after the last even and the last odd pass of PatchMatch
  PlaneMap median;          ///< after the last pass and the median filter
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
  PlaneMap& raw = reference.raws[task.pass % 2];
  raw = run_pass(task);
  reference.matched = !context_.cancel.load(std::memory_order_relaxed);
  if (reference.matched && task.last) finish_match(reference, std::exchange(raw, {}));
}

PlaneMap CpuEngine::run_pass(const MatchTask& task) {
  const DensifierOptions& options = context_.options;
  const CpuFrame& reference = own(*task.reference);
  const Iterations iterations = iterations_of(options.patchmatch, task.pass);
  MatchInput input;
  input.keyframe_id = reference.id;
  input.reference = {&reference.panorama, reference.cam_from_world};
  input.range = task.range;
  input.first_iteration = iterations.first;
  std::vector<Panorama> unpacked;
  unpacked.reserve(task.neighbours.size());  // the input points into it
  PlaneMap landmarks;
  PlaneMap warped;
  PlaneMap prior;
  {
    const Stopwatch watch(context_.stats.seconds_init);
    for (const Frame* neighbour : task.neighbours) {
      const Panorama* panorama = &own(*neighbour).panorama;
      if (panorama->packed()) panorama = &unpacked.emplace_back(panorama->unpacked(executor_));
      input.neighbours.push_back({panorama, neighbour->cam_from_world});
      if (task.pass == 0) continue;
      const bool near = input.neighbour_maps.size() < task.near;
      input.neighbour_maps.push_back(near ? &own(*neighbour).raws[(task.pass - 1) % 2] : nullptr);
    }
    const int width = options.width;
    const int height = options.height;
    if (task.pass == 0 && options.init.sparse_points) {
      landmarks = planes_from_landmarks(*task.keyframe, width, height, options.init);
      input.landmarks = &landmarks;
    }
    if (task.previous != nullptr) {
      warped = warped_planes(own(*task.previous), reference.cam_from_world);
      input.warped = &warped;
    }
    if (task.pass > 0) input.start = &reference.raws[(task.pass - 1) % 2];
    if (task.pass > 0 && options.patchmatch.plane_priors) {
      prior = plane_priors(*input.start, reference.panorama, task.range, options.patchmatch, executor_);
      input.prior = &prior;
    }
  }
  PatchMatchOptions how = options.patchmatch;
  how.iterations = iterations.count;
  const Stopwatch watch(context_.stats.seconds_patchmatch);
  return patchmatch(input, how, options.seed, executor_, &context_.cancel);
}

/// The previous keyframe's planes, median filtered, those of the first pass while later ones are to come.
PlaneMap CpuEngine::warped_planes(const CpuFrame& previous, const RigidTransform& cam_from_world) {
  const DensifierOptions& options = context_.options;
  PlaneMap filtered;
  if (previous.median.empty()) filtered = median_filter(previous.raws[0], options.median, executor_);
  return warp_planes(previous.median.empty() ? filtered : previous.median, cam_from_world, options.width,
                     options.height, executor_);
}

/// Nobody else asks for the planes of the last pass.
void CpuEngine::finish_match(CpuFrame& reference, const PlaneMap& raw) {
  DensifierStats& stats = context_.stats;
  if (context_.results.raw_depth) context_.results.raw_depth(depth_map_of(raw, nullptr, executor_));
  FilterStats filtered;
  {
    const Stopwatch watch(stats.seconds_median);
    reference.median = median_filter(raw, context_.options.median, executor_, &filtered);
  }
  const std::vector<std::uint8_t>& usable = reference.panorama.usable().pixels();
  const std::int64_t pixels = static_cast<std::int64_t>(raw.x.size());
  ++stats.depth_maps;
  stats.pixels += usable.empty() ? pixels : pixels - std::count(usable.begin(), usable.end(), 0);
  stats.pixels_matched += filtered.before;
  stats.pixels_after_median += filtered.after;
}

void CpuEngine::filter(Frame& frame, const std::vector<const Frame*>& others) {
  CpuFrame& reference = own(frame);
  std::vector<const PlaneMap*> maps;
  maps.reserve(others.size());
  for (const Frame* other : others) maps.push_back(&own(*other).median);
  FilterStats filtered;
  {
    const Stopwatch watch(context_.stats.seconds_consistency);
    reference.confidence =
        consistency_filter(reference.median, maps, context_.options.consistency, executor_, &filtered);
  }
  context_.stats.pixels_after_consistency += filtered.after;
  if (context_.results.cloud && context_.options.free_space.enabled) {
    const Stopwatch watch(context_.stats.seconds_free_space);
    reference.shelf.put(sight_map(reference.median, reference.confidence, executor_));
  }
  if (context_.results.filtered_depth) {
    context_.results.filtered_depth(depth_map_of(reference.median, &reference.confidence, executor_));
  }
}

void CpuEngine::fuse(Frame& frame, const std::vector<const Frame*>& window, std::size_t current) {
  const Stopwatch watch(context_.stats.seconds_fusion);
  std::vector<FusionMap> maps;
  maps.reserve(window.size());
  for (const Frame* joined : window) {
    const CpuFrame& member = own(*joined);
    maps.push_back({&member.median, &member.confidence, &member.panorama.color(), member.pose()});
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
      if (context_.options.patchmatch.revisits > 0) done.panorama.pack_gray();
      break;
    case Artefact::kFarImage:
      done.panorama.release_gray();
      break;
    case Artefact::kColor:
      done.panorama.release_color();
      break;
    case Artefact::kLandmarks:
      break;
    case Artefact::kPlanes:
      for (PlaneMap& raw : done.raws) raw = {};
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
