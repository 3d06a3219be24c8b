// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <optional>

#include "pmsp/api.h"
#include "pmsp/executor.h"
#include "pmsp/io/image_source.h"
#include "pmsp/io/map.h"
#include "pmsp/io/mask.h"
#include "pmsp/lens_distance.h"
#include "pmsp/rig_mask.h"

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

}  // namespace pmsp
