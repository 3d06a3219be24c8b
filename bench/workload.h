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

/// What each stage of one quality is given: a short flight, and what the stages before have made of it. Nothing in here
/// changes while benchmarks run.
struct Workload {
  std::string quality;
  DensifierOptions options;  ///< sizes filled in
  Flight flight;             ///< its images are shared by the qualities that have images of one size
  std::size_t current = 0;   ///< the keyframe in the middle of the flight, which stages work on

  std::vector<Keyframe> keyframes;  ///< as many as the windows ask for
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
  int width = 0;        ///< of the depth maps; 0 = the quality's
  int height = 0;       ///< of the depth maps; 0 = half the width
  int image_width = 0;  ///< 0 = 1920, or the depth maps' if that is more
  std::optional<int> neighbours, iterations, refinements, geometric_passes;  ///< instead of the quality's
};

/// The options and sizes only: what is needed to name the benchmarks. Throws InvalidOption.
std::unique_ptr<Workload> outline(const WorkloadRequest& request);
int image_width_of(const WorkloadRequest& request);

/// Keyframes that the workload's windows ask for.
int flight_length(const DensifierOptions& options);

/// Fills in all that is missing. `with_maps`: depth maps as well, which takes a run of the Densifier.
void fill(Workload& workload, const Flight& flight, bool with_maps);

}  // namespace pmsp::bench
