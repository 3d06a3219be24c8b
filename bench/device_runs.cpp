// SPDX-License-Identifier: BSD-2-Clause
#include "device_runs.h"

#include <algorithm>
#include <chrono>

#include "cuda/cuda_engine.h"
#include "match.h"
#include "patch.h"
#include "patchmatch/match_setup.h"
#include "pmsp/error.h"

namespace pmsp::bench {
namespace {

double seconds_now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Index in a sequence to and fro, so that few images suffice: 0 1 2 3 2 1 0 1 ...
std::size_t to_and_fro(int i, std::size_t count) {
  const std::size_t period = 2 * (count - 1);
  const std::size_t at = static_cast<std::size_t>(i) % period;
  return std::min(at, period - at);
}

/// Densifier of one configuration, for several sequences.
class Runner {
 public:
  Runner(const Workload& workload, const DeviceRequest& request, bool pipelined, bool cloud)
      : workload_(workload), request_(request), densifier_(options_for(pipelined), callbacks(cloud)) {}

  /// Returns seconds per keyframe, from the first image to the last result.
  double fly() {
    const std::int64_t before = densifier_.stats().depth_maps;
    const double start = seconds_now();
    for (int i = 0; i < request_.keyframes; ++i) {
      Keyframe keyframe = workload_.keyframes[to_and_fro(i, workload_.keyframes.size())];
      keyframe.id = next_id_++;
      densifier_.add(keyframe);
    }
    densifier_.flush();
    const double seconds = seconds_now() - start;
    if (densifier_.stats().depth_maps - before != request_.keyframes) {
      throw InvalidInput("only " + std::to_string(densifier_.stats().depth_maps - before) + " of the flight's " +
                         std::to_string(request_.keyframes) + " keyframes gave a depth map; expected all to do so");
    }
    return seconds / request_.keyframes;
  }

  const DensifierStats& stats() const { return densifier_.stats(); }

 private:
  DensifierOptions options_for(bool pipelined) const {
    DensifierOptions options = workload_.options;
    options.backend = Backend::kCuda;
    options.devices = {request_.device};
    options.advanced.pipelined = pipelined;
    return options;
  }

  DensifierCallbacks callbacks(bool cloud) {
    DensifierCallbacks result;
    if (cloud) {
      result.cloud = [this](const KeyframeCloud& part) { received_ += part.points.size(); };
    } else {
      result.filtered_depth = [this](const DepthMap& map) { received_ += map.depth.size(); };
    }
    return result;
  }

  const Workload& workload_;
  const DeviceRequest& request_;
  std::size_t received_ = 0;
  std::int64_t next_id_ = 0;
  Densifier densifier_;
};

struct TimedStage {
  const char* name;
  double DensifierStats::*seconds;
};
constexpr TimedStage kTimed[] = {
    {"prepare", &DensifierStats::seconds_prepare},         {"init", &DensifierStats::seconds_init},
    {"patchmatch", &DensifierStats::seconds_patchmatch},   {"median", &DensifierStats::seconds_median},
    {"consistency", &DensifierStats::seconds_consistency}, {"fuse", &DensifierStats::seconds_fusion}};

/// Configuration of sequences: timed as whole keyframes, and for stages that no other one measures.
struct Errand {
  const char* whole;
  bool pipelined;
  bool cloud;
  bool tells_stages;
};
constexpr Errand kErrands[] = {
    {"keyframe", false, false, true}, {"pipelined", true, false, false}, {"cloud", true, true, false}};

/// Whether the configuration measures a stage; fusion is measured by `cloud` only.
bool tells(const Errand& errand, const TimedStage& stage) {
  return std::string(stage.name) == "fuse" ? errand.cloud : errand.tells_stages;
}

bool is_wanted(const DeviceRequest& request, const std::string& name) {
  return std::find(request.stages.begin(), request.stages.end(), name) != request.stages.end();
}

std::string case_name(const Workload& workload, const char* stage) {
  Case one;
  one.workload = &workload;
  one.stage = stage;
  one.cuda = true;
  return one.name();
}

/// Returns the number of bilinear samples of source views per keyframe if no hypothesis is rejected early: the random
/// plane and the candidates, or the current plane; then in each iteration the planes of neighbouring pixels and the
/// random steps.
double nominal_samples(const DensifierOptions& options) {
  const int candidates = (options.advanced.init.sparse_points ? 1 : 0) + (options.advanced.init.warp_previous ? 1 : 0);
  const PatchMatchOptions& patchmatch = options.advanced.patchmatch;
  int hypotheses = 0;  // per pixel
  for (int pass = 0; pass <= patchmatch.geometric_passes; ++pass) {
    const int starts = pass == 0 ? 1 + candidates : 1;
    hypotheses +=
        starts + iterations_of(patchmatch, pass).count * (kernels::kPropagatedPlanes + patchmatch.refinements);
  }
  const double pixels = static_cast<double>(options.width) * options.height;
  return pixels * hypotheses * patchmatch.neighbours * kernels::kPatchSamples;
}

void run_errand(const Errand& errand, const Workload& workload, const DeviceRequest& request, std::size_t free_before,
                Results& results, DeviceFigures& figures) {
  Runner runner(workload, request, errand.pipelined, errand.cloud);
  runner.fly();
  for (int i = 0; i < request.repetitions; ++i) {
    const DensifierStats before = runner.stats();
    const double seconds = runner.fly();
    if (is_wanted(request, errand.whole)) results[case_name(workload, errand.whole)].wall_ms.push_back(1e3 * seconds);
    for (const TimedStage& stage : kTimed) {
      const double spent = (runner.stats().*stage.seconds - before.*stage.seconds) / request.keyframes;
      if (!tells(errand, stage) || !is_wanted(request, stage.name) || !(spent > 0.0)) continue;
      results[case_name(workload, stage.name)].wall_ms.push_back(1e3 * spent);
    }
  }
  const std::size_t free_now = cuda::find_device(request.device).free_bytes;
  figures.peak_bytes[errand.whole] = free_before > free_now ? free_before - free_now : 0;
}

}  // namespace

void run_on_device(const Workload& workload, const DeviceRequest& request, Results& results, DeviceFigures& figures) {
  const cuda::Device device = cuda::find_device(request.device);
  figures.name = device.name;
  figures.number = request.device;
  figures.keyframes = request.keyframes;
  figures.texture_rate = device.texture_rate;
  figures.samples = nominal_samples(workload.options);
  for (const Errand& errand : kErrands) {
    const bool wanted = is_wanted(request, errand.whole) ||
                        std::any_of(std::begin(kTimed), std::end(kTimed), [&](const TimedStage& stage) {
                          return tells(errand, stage) && is_wanted(request, stage.name);
                        });
    if (wanted) run_errand(errand, workload, request, device.free_bytes, results, figures);
  }
}

}  // namespace pmsp::bench
