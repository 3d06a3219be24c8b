// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bench_flight.h"
#include "pmsp/densifier.h"
#include "pmsp/stages.h"

namespace pmsp::bench {

/// Inputs of all stages for one preset: a short sequence and the results of previous stages. Constant while benchmarks
/// run.
struct Workload {
  std::string quality;
  DensifierOptions options;  ///< sizes filled in
  Flight flight;             ///< images are shared by presets with the same image size
  std::size_t current = 0;   ///< index of the middle keyframe, the one that stages process

  std::vector<Keyframe> keyframes;  ///< as many as the windows require
  std::vector<Panorama> panoramas;
  std::vector<PlaneMap> raw;             ///< after PatchMatch
  std::vector<PlaneMap> median;          ///< after the median filter
  std::vector<Image<float>> confidence;  ///< after the consistency filter
  PlaneMap sparse;
  PlaneMap warped;
  MatchInput match;

  Workload() = default;
  Workload(const Workload&) = delete;  // `match` points to members
  Workload& operator=(const Workload&) = delete;
};

struct WorkloadRequest {
  std::string quality;
  int width = 0;        ///< of the depth maps; 0 = of the preset
  int height = 0;       ///< of the depth maps; 0 = half the width
  int image_width = 0;  ///< 0 = 1920, or the width of the depth maps if larger
  std::optional<int> neighbours, iterations, refinements, geometric_passes;  ///< instead of those of the preset
};

/// Returns a workload with options and sizes only, for the names of benchmarks. Throws InvalidOption.
std::unique_ptr<Workload> outline(const WorkloadRequest& request);
int image_width_of(const WorkloadRequest& request);

/// Returns the number of keyframes required by the windows.
int flight_length(const DensifierOptions& options);

/// Adds missing members. `with_maps`: also depth maps, by a run of the Densifier.
void fill(Workload& workload, const Flight& flight, bool with_maps);

}  // namespace pmsp::bench
