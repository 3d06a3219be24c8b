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

/// Estimates made by calibrate_camera.
struct CalibrationOptions {
  bool lenses = true;  ///< baseline between the camera's two lenses
  bool rig = true;     ///< mask of the rig: camera mount, vehicle, operator
};

/// Calibration of a mission's camera.
struct CameraCalibration {
  std::optional<LensDistance> lenses;  ///< nullopt = not estimated
  RigMask rig;
};

/// Estimates lens distance and rig from at most 24 images: of keyframes_for_lens_distance, or the first of a video.
/// `images`: of all keyframes; `next` must not have been called. `masks`: nullptr = all pixels are used. Returns
/// nullopt if one of the images or its mask cannot be read. The result does not depend on the executor.
PMSP_API std::optional<CameraCalibration> calibrate_camera(const SlamMap& map, const ImageSource& images,
                                                           MaskSource* masks, const CalibrationOptions& options,
                                                           const Executor& executor);

/// Optional arguments of densify().
struct DensifyExtras {
  /// nullptr = those of the map, alpha channels, and with `image_folder` files beside the images. The rig is hidden,
  /// too, during the call.
  MaskSource* masks = nullptr;
  /// Directory of depth images, named after the images in `image_folder`, see DepthFolder; "" = those of the map.
  std::filesystem::path prior_depth;
  std::filesystem::path image_folder;               ///< root of image names, for `prior_depth` and masks
  bool verify = true;                               ///< check conventions, poses, and pairing of images and keyframes
  std::function<void(const std::string&)> warning;  ///< receives warnings
  CalibrationOptions calibrate;                     ///< `lenses` applies if DensifierOptions::lens_distance is 0
  /// Called after each keyframe: processed and expected number. False cancels: densify returns the statistics so far.
  std::function<bool(std::size_t done, std::size_t all)> progress;
};

/// Computes the points of a mission, as `pmsp-densify run` does: triangulates landmarks from the images if the map has
/// none, estimates lens distance and rig mask, and passes all keyframes with mask and prior depth to a Densifier.
/// `images`: `next` must not have been called. Images that cannot be read are skipped with a warning. With
/// Quality::kPaper the tool estimates no lens distance; `calibrate.lenses` = false gives the same.
///
/// Throws InvalidInput if conventions, poses or pairing are wrong (`verify`), no landmarks exist and none can be
/// triangulated, or no image can be read; and the exceptions of Densifier.
PMSP_API DensifierStats densify(const SlamMap& map, ImageSource& images, const DensifierOptions& options,
                                const DensifierCallbacks& callbacks, const DensifyExtras& extras = {});

/// Adds the points, and depth maps for datasets, to `output`. The caller must commit it; without, no file appears. Also
/// throws OutputError.
PMSP_API DensifierStats densify(const SlamMap& map, ImageSource& images, const DensifierOptions& options,
                                CloudOutput& output, const DensifyExtras& extras = {});

}  // namespace pmsp
