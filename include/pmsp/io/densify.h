// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <functional>

#include "pmsp/densifier.h"
#include "pmsp/io/calibration.h"
#include "pmsp/io/cloud_output.h"
#include "pmsp/io/image_source.h"
#include "pmsp/io/map.h"
#include "pmsp/io/mask.h"

namespace pmsp {

/// What `densify` may be told besides.
struct DensifyExtras {
  MaskSource* masks = nullptr;   ///< pixels to ignore; nullptr = those of alpha channels. The rig is added
  bool verify = true;            ///< check the map's conventions, and that the images belong to their keyframes
  CalibrationOptions calibrate;  ///< `lenses` only where DensifierOptions::lens_distance is 0
  /// Called after each keyframe: how many have come, of how many that are expected. Where it returns false, the work
  /// ends early, and what has been handed out stays.
  std::function<bool(std::size_t done, std::size_t all)> progress;
};

/// A mission from its map and images to points, the same as `pmsp-densify run` makes: landmarks from the images where
/// the map has none, lens distance and rig mask from some of them, then a Densifier that is given each keyframe with
/// its pose, landmarks and mask (with Quality::kPaper the tool leaves `calibrate.lenses` out). `images`: before the
/// first `next`. `callbacks`: see DensifierCallbacks. Skips images that cannot be read.
///
/// Throws InvalidInput where the map's conventions, poses or images evidently are not what they should be (`verify`),
/// landmarks can neither be read nor made, or no image can be read; and what Densifier throws.
PMSP_API DensifierStats densify(const SlamMap& map, ImageSource& images, const DensifierOptions& options,
                                const DensifierCallbacks& callbacks, const DensifyExtras& extras = {});

/// The same into files: gives `output` the cloud of each keyframe. It is left to the caller to commit it. Throws
/// OutputError, too.
PMSP_API DensifierStats densify(const SlamMap& map, ImageSource& images, const DensifierOptions& options,
                                CloudOutput& output, const DensifyExtras& extras = {});

}  // namespace pmsp
