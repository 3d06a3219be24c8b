// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <functional>

#include "pmsp/densifier.h"
#include "pmsp/io/cloud_output.h"
#include "pmsp/io/image_source.h"
#include "pmsp/io/map.h"
#include "pmsp/io/mask.h"

namespace pmsp {

/// What `densify` may be told besides.
struct DensifyExtras {
  MaskSource* masks = nullptr;  ///< what is to be ignored in the images; nullptr = nothing
  bool verify = true;           ///< check the map's conventions, and that the images belong to their keyframes
  /// Called after each keyframe: how many have come, of how many that are expected. Where it returns false, the work
  /// ends early, and what has been handed out stays.
  std::function<bool(std::size_t done, std::size_t all)> progress;
};

/// A mission from its map and images to points: opens a Densifier, gives it each keyframe of `images` with its pose,
/// landmarks and mask, and flushes it. `callbacks`: see DensifierCallbacks. Images that cannot be read are passed over.
///
/// Throws InvalidInput where the map has no landmarks (LandmarkSweep makes some), its conventions or its images
/// evidently are not what they should be (`verify`), or no image can be read; and what Densifier throws.
PMSP_API DensifierStats densify(const SlamMap& map, ImageSource& images, const DensifierOptions& options,
                                const DensifierCallbacks& callbacks, const DensifyExtras& extras = {});

/// The same into files: gives `output` the cloud of each keyframe. It is left to the caller to commit it. Throws
/// OutputError, too.
PMSP_API DensifierStats densify(const SlamMap& map, ImageSource& images, const DensifierOptions& options,
                                CloudOutput& output, const DensifyExtras& extras = {});

}  // namespace pmsp
