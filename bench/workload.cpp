// SPDX-License-Identifier: BSD-2-Clause
#include "workload.h"

#include <algorithm>
#include <utility>

#include "pmsp/error.h"
#include "pmsp/stages.h"

namespace pmsp::bench {
namespace {

/// Returns as many as the preset requires, alternating before and after the current keyframe.
std::vector<std::size_t> neighbours_of(std::size_t current, std::size_t keyframes, int count) {
  std::vector<std::size_t> chosen;
  for (std::size_t away = 1; away < keyframes; ++away) {
    if (away <= current) chosen.push_back(current - away);
    if (current + away < keyframes) chosen.push_back(current + away);
  }
  chosen.resize(std::min(chosen.size(), static_cast<std::size_t>(count)));
  return chosen;
}

void make_maps(Workload& workload, const Executor& executor) {
  DensifierCallbacks callbacks;
  std::vector<DepthMap> filtered;
  callbacks.raw_depth = [&](const DepthMap& map) { workload.raw.push_back(plane_map_of(map, executor)); };
  callbacks.filtered_depth = [&](const DepthMap& map) { filtered.push_back(map); };
  DensifierOptions options = workload.options;
  options.backend = Backend::kCpu;
  Densifier densifier(options, callbacks);
  for (const Keyframe& keyframe : workload.keyframes) densifier.add(keyframe);
  densifier.flush();
  if (workload.raw.size() != workload.keyframes.size() || filtered.size() != workload.keyframes.size()) {
    throw InvalidInput("the synthetic flight has " + std::to_string(workload.keyframes.size()) +
                       " keyframes, but only " + std::to_string(filtered.size()) +
                       " gave a depth map; expected all of them to do so");
  }
  for (const PlaneMap& map : workload.raw) {
    workload.median.push_back(median_filter(map, workload.options.advanced.median, executor));
  }
  for (DepthMap& map : filtered) workload.confidence.push_back(std::move(map.confidence));
}

void make_match_input(Workload& workload, const Executor& executor) {
  const std::size_t current = workload.current;
  const auto posed = [&](std::size_t i) { return PosedPanorama{&workload.panoramas[i], workload.keyframes[i].pose()}; };
  workload.match.keyframe_id = workload.keyframes[current].id;
  workload.match.reference = posed(current);
  const int count = workload.options.advanced.patchmatch.neighbours;
  for (const std::size_t i : neighbours_of(current, workload.keyframes.size(), count)) {
    workload.match.neighbours.push_back(posed(i));
  }
  workload.match.range = depth_range(workload.keyframes[current], workload.options.advanced.init);
  workload.sparse = planes_from_landmarks(workload.keyframes[current], workload.options.width, workload.options.height,
                                          workload.options.advanced.init, executor);
  workload.warped = warp_planes(workload.median[current - 1], workload.keyframes[current].pose(),
                                workload.options.width, workload.options.height, executor);
  workload.match.landmarks = &workload.sparse;
  workload.match.warped = &workload.warped;
}

}  // namespace

int image_width_of(const WorkloadRequest& request) {
  if (request.image_width != 0) return request.image_width;
  const int width = request.width != 0 ? request.width : preset(quality_from_name(request.quality)).width;
  return std::max(width, 1920);
}

int flight_length(const DensifierOptions& options) {
  return std::max({options.advanced.consistency.window, options.advanced.fusion.window,
                   options.advanced.patchmatch.neighbours + 1});
}

std::unique_ptr<Workload> outline(const WorkloadRequest& request) {
  auto workload = std::make_unique<Workload>();
  workload->quality = request.quality;
  workload->options = preset(quality_from_name(request.quality));
  if (request.width != 0) workload->options.width = request.width;
  if (workload->options.width == 0) workload->options.width = image_width_of(request);
  workload->options.height = request.height != 0 ? request.height : workload->options.width / 2;
  PatchMatchOptions& patchmatch = workload->options.advanced.patchmatch;
  patchmatch.neighbours = request.neighbours.value_or(patchmatch.neighbours);
  patchmatch.iterations = request.iterations.value_or(patchmatch.iterations);
  patchmatch.refinements = request.refinements.value_or(patchmatch.refinements);
  patchmatch.geometric_passes = request.geometric_passes.value_or(patchmatch.geometric_passes);
  workload->options.validate();
  return workload;
}

void fill(Workload& workload, const Flight& flight, bool with_maps) {
  const Executor executor;
  workload.flight = flight;
  workload.keyframes = flight.keyframes;
  workload.keyframes.resize(static_cast<std::size_t>(flight_length(workload.options)));
  workload.current = workload.keyframes.size() / 2;
  if (!with_maps) return;
  for (const Keyframe& keyframe : workload.keyframes) {
    workload.panoramas.emplace_back(keyframe.image, keyframe.mask, workload.options.width, workload.options.height,
                                    executor);
  }
  make_maps(workload, executor);
  make_match_input(workload, executor);
}

}  // namespace pmsp::bench
