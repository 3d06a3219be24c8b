// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "arguments.h"
#include "pmsp/io/densify.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"
#include "pmsp/options.h"
#include "workspace/record.h"

namespace pmsp::tool {

/// Camera calibration from some images of a mission.
struct Calibration {
  double lens_distance = 0.0;          ///< effective DensifierOptions::lens_distance [map units]
  std::optional<LensDistance> lenses;  ///< estimate; nullopt if the distance was set, recorded or disabled
  RigMask rig;                         ///< effective; empty mask = none
  std::size_t images = 0;              ///< number of keyframes with an image at the estimate; 0 = nothing was estimated
};

/// Estimates lens distance and rig mask from at most 24 images, as enabled by `arguments`. `images`: of all keyframes,
/// before the first is read. `growing`: more will follow. `recorded`: of a workspace, {} = none; its values are reused
/// until images have changed, or doubled while growing. Estimates nothing if one of the images is unreadable.
Calibration calibrate(const Arguments& arguments, const DensifierOptions& options, const SlamMap& map,
                      const ImageSource& images, MaskSource& masks, bool growing, const workspace::Record& recorded);

/// Returns the rig mask of a workspace's record; empty = none.
RigMask recorded_rig(const workspace::Record& record);

/// Returns the run lengths of the mask's pixels in row order, beginning with hidden ones, for a record's options; null
/// = no mask.
nlohmann::ordered_json rig_json(const RigMask& rig);

/// Returns CLOUD.rig-mask.png, beside the first cloud.
std::filesystem::path rig_mask_path(const Arguments& arguments);

/// Writes the mask for inspection and editing. Returns false if another mask exists and --force is not set.
bool write_rig_mask(const Arguments& arguments, const RigMask& rig);

/// Returns sentences for people.
std::vector<std::string> describe(const Calibration& calibration);

}  // namespace pmsp::tool
