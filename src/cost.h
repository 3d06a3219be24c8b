// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>

#include "pmsp/api.h"
#include "pmsp/options.h"

// Estimates of memory and work, without a Densifier. Options must have sizes (fill_in_size).
namespace pmsp {

/// Maximum host memory [bytes].
struct HostMemory {
  double memory = 0.0;   ///< of the Densifier alone
  double scratch = 0.0;  ///< scratch file; 0 = none
};

/// Image width if unknown: estimates are for the finest images that the options allow.
constexpr int kAnyImageWidth = 1 << 20;

/// Returns the memory of a Densifier on the CPU that emits points of `used` keyframes, without masks.
PMSP_API HostMemory host_memory_needed(const DensifierOptions& options, std::int64_t used,
                                       int image_width = kAnyImageWidth);

/// Returns the memory of a keyframe on the CPU with all artefacts that others read, without a mask [bytes].
double keyframe_memory(const DensifierOptions& options, int image_width = kAnyImageWidth);

/// Returns the maximum memory of a Densifier on each of its devices [bytes], without that of CUDA itself (0.5 GiB), for
/// `options.advanced.expected_keyframes` (0 = a long sequence). Only a guess for unordered sets. Available in builds
/// without CUDA, too.
PMSP_API std::size_t device_memory_needed(const DensifierOptions& options, int image_width = kAnyImageWidth);

/// Returns the number of hypotheses per pixel in all passes, to which the time of PatchMatch is proportional.
PMSP_API int planes_tried(const PatchMatchOptions& options);

}  // namespace pmsp
