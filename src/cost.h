// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>

#include "pmsp/api.h"
#include "pmsp/options.h"

// What a Densifier will take, before there is one. Sizes must be filled in (fill_in_size).
namespace pmsp {

/// Bytes on the host, at most.
struct HostMemory {
  double memory = 0.0;   ///< without the process itself and what is beside the Densifier
  double scratch = 0.0;  ///< of the scratch file; 0 = there is none
};

/// Width of images that are not known: memory is that for images as fine as options may ask for.
constexpr int kAnyImageWidth = 1 << 20;

/// What a Densifier on the CPU takes that makes points of `used` keyframes, without a mask.
PMSP_API HostMemory host_memory_needed(const DensifierOptions& options, std::int64_t used,
                                       int image_width = kAnyImageWidth);

/// Memory of each of its devices that a Densifier takes at most [bytes], beside CUDA's own (0.5 GiB), for
/// `options.advanced.expected_keyframes`; for a long flight where that is 0, and for sets (`unordered`), of which it is
/// no more than a guess. Builds without CUDA know it, too.
PMSP_API std::size_t device_memory_needed(const DensifierOptions& options, int image_width = kAnyImageWidth);

/// Planes that a pixel tries in all passes: what the time of PatchMatch grows with.
PMSP_API int planes_tried(const PatchMatchOptions& options);

}  // namespace pmsp
