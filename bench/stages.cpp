// SPDX-License-Identifier: BSD-2-Clause
#include "stages.h"

#include "pmsp/error.h"
#include "pmsp/stages.h"

namespace pmsp::bench {
namespace {

void prepare(benchmark::State& state, const Workload& workload, const Executor& executor) {
  const Keyframe& keyframe = workload.keyframes[workload.current];
  while (state.KeepRunning()) {
    const Panorama panorama(keyframe.image, keyframe.mask, workload.options.width, workload.options.height, executor);
    benchmark::DoNotOptimize(panorama.color().pixels().data());
  }
}

void sparse(benchmark::State& state, const Workload& workload, const Executor& executor) {
  const DensifierOptions& options = workload.options;
  while (state.KeepRunning()) {
    const PlaneMap planes = planes_from_landmarks(workload.keyframes[workload.current], options.width, options.height,
                                                  options.advanced.init, executor);
    benchmark::DoNotOptimize(planes.x.pixels().data());
  }
}

void warp(benchmark::State& state, const Workload& workload, const Executor& executor) {
  const PlaneMap& previous = workload.median[workload.current - 1];
  while (state.KeepRunning()) {
    const PlaneMap planes = warp_planes(previous, workload.keyframes[workload.current].pose(), previous.width(),
                                        previous.height(), executor);
    benchmark::DoNotOptimize(planes.x.pixels().data());
  }
}

void match(benchmark::State& state, const Workload& workload, const Executor& executor) {
  while (state.KeepRunning()) {
    const PlaneMap map =
        patchmatch(workload.match, workload.options.advanced.patchmatch, workload.options.seed, executor);
    benchmark::DoNotOptimize(map.x.pixels().data());
  }
}

void median(benchmark::State& state, const Workload& workload, const Executor& executor) {
  while (state.KeepRunning()) {
    const PlaneMap map = median_filter(workload.raw[workload.current], workload.options.advanced.median, executor);
    benchmark::DoNotOptimize(map.x.pixels().data());
  }
}

void consistency(benchmark::State& state, const Workload& workload, const Executor& executor) {
  const std::size_t reach = static_cast<std::size_t>(workload.options.advanced.consistency.window - 1) / 2;
  std::vector<const PlaneMap*> others;
  for (std::size_t i = workload.current - reach; i <= workload.current + reach; ++i) {
    if (i != workload.current) others.push_back(&workload.median[i]);
  }
  while (state.KeepRunning()) {
    const Image<float> confidence =
        consistency_filter(workload.median[workload.current], others, workload.options.advanced.consistency, executor);
    benchmark::DoNotOptimize(confidence.pixels().data());
  }
}

void fuse_current(benchmark::State& state, const Workload& workload, const Executor& executor) {
  const std::size_t reach = static_cast<std::size_t>(workload.options.advanced.fusion.window - 1) / 2;
  std::vector<FusionMap> window;
  for (std::size_t i = workload.current - reach; i <= workload.current + reach; ++i) {
    window.push_back({&workload.median[i],
                      &workload.confidence[i],
                      &workload.panoramas[i].color(),
                      {workload.median[i].cam_from_world}});
  }
  while (state.KeepRunning()) {
    const SurfelMap points = fuse_pixels(window, reach, workload.options.advanced.fusion, executor);
    benchmark::DoNotOptimize(points.surfels.pixels().data());
  }
}

/// Runs a Densifier over the whole sequence; one iteration is the work of one keyframe.
void fly(benchmark::State& state, const Workload& workload, const Executor& executor, bool with_cloud) {
  DensifierOptions options = workload.options;
  options.backend = Backend::kCpu;
  options.simd = executor.simd();
  options.threads = executor.threads();
  const benchmark::IterationCount keyframes = static_cast<benchmark::IterationCount>(workload.keyframes.size());
  while (state.KeepRunningBatch(keyframes)) {
    std::size_t received = 0;
    DensifierCallbacks callbacks;
    if (with_cloud) callbacks.cloud = [&](const KeyframeCloud& cloud) { received += cloud.points.size(); };
    if (!with_cloud) callbacks.filtered_depth = [&](const DepthMap& map) { received += map.depth.size(); };
    Densifier densifier(options, callbacks);
    for (const Keyframe& next : workload.keyframes) densifier.add(next);
    densifier.flush();
    benchmark::DoNotOptimize(received);
    if (densifier.stats().depth_maps != keyframes) {
      throw InvalidInput("only " + std::to_string(densifier.stats().depth_maps) + " of the flight's " +
                         std::to_string(keyframes) + " keyframes gave a depth map; expected all of them to do so");
    }
  }
}

void keyframe(benchmark::State& state, const Workload& workload, const Executor& executor) {
  fly(state, workload, executor, false);
}

void cloud(benchmark::State& state, const Workload& workload, const Executor& executor) {
  fly(state, workload, executor, true);
}

}  // namespace

const std::vector<Stage>& all_stages() {
  static const std::vector<Stage> kStages = {
      {"prepare", "resizing, gray values and cube map of one image (Panorama)", false, true, prepare},
      {"sparse", "planes from landmarks (planes_from_landmarks; plain code)", false, false, sparse},
      {"warp", "planes of the previous depth map, moved (warp_planes)", true, false, warp},
      {"init", "sparse and warp on the device", false, true, nullptr},
      {"patchmatch", "one depth map, all iterations (patchmatch)", true, true, match},
      {"median", "median filter of one depth map", true, true, median},
      {"consistency", "consistency filter of one depth map in its window", true, true, consistency},
      {"fuse", "the points of one depth map's pixels, joined with those of its window", true, true, fuse_current},
      {"keyframe", "Densifier from decoded image to consistent depth map, both in the host's memory", false, true,
       keyframe},
      {"pipelined", "the same on the device with successive keyframes overlapping", false, true, nullptr},
      {"cloud", "Densifier from image to points, on the device with keyframes overlapping", false, true, cloud}};
  return kStages;
}

const Stage& stage_named(const std::string& name) {
  for (const Stage& stage : all_stages()) {
    if (name == stage.name) return stage;
  }
  throw InvalidOption("stage is '" + name + "'; pmsp-bench --help lists the stages");
}

}  // namespace pmsp::bench
