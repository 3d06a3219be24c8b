// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "pmsp/api.h"
#include "pmsp/calibration.h"
#include "pmsp/densifier.h"
#include "pmsp/io/cloud.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"
#include "pmsp/stages.h"

namespace pmsp {

/// What `calibrate_camera` estimates.
struct CalibrationOptions {
  bool lenses = true;  ///< the distance of the camera's two lenses
  bool rig = true;     ///< what the camera carries along
};

/// Properties of a mission's camera.
struct CameraCalibration {
  std::optional<LensDistance> lenses;  ///< nullopt = not estimated
  RigMask rig;
};

/// Estimates them from at most 24 images (keyframes_for_lens_distance; of a video its beginning). `images`: of all
/// keyframes, before the first `next`. `masks`: nullptr = use all pixels. Returns nullopt where one of the images, or
/// its mask, cannot be read. The result does not depend on the executor.
PMSP_API std::optional<CameraCalibration> calibrate_camera(const SlamMap& map, const ImageSource& images,
                                                           MaskSource* masks, const CalibrationOptions& options,
                                                           const Executor& executor);

/// What `densify` may be told besides.
struct DensifyExtras {
  MaskSource* masks = nullptr;  ///< pixels to ignore; nullptr = those of alpha channels. The rig is added
  /// Folder of depth images, named as those of the images in `image_folder`; "" = none. See Keyframe::prior_depth.
  std::filesystem::path prior_depth;
  std::filesystem::path image_folder;
  bool verify = true;  ///< check the map's conventions and poses, and that the images belong to their keyframes
  std::function<void(const std::string&)> warning;  ///< of what may be wrong with the result
  CalibrationOptions calibrate;                     ///< `lenses` only where DensifierOptions::lens_distance is 0
  /// Called after each keyframe: how many have come, of how many that are expected. Where it returns false, the work
  /// ends early, and what has been handed out stays.
  std::function<bool(std::size_t done, std::size_t all)> progress;
};

/// A mission from its map and images to points, the same as `pmsp-densify run` makes: landmarks from the images where
/// the map has none, lens distance and rig mask from some of them, then a Densifier that is given each keyframe with
/// its pose, landmarks, mask and prior depth (with Quality::kPaper the tool leaves `calibrate.lenses` out). `images`:
/// before the first `next`. `callbacks`: see DensifierCallbacks. Skips images that cannot be read, with a warning.
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
