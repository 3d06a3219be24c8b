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

/// What some images of a mission tell of its camera.
struct Calibration {
  double lens_distance = 0.0;          ///< in force (DensifierOptions::lens_distance) [map units]
  std::optional<LensDistance> lenses;  ///< estimate; none where the distance was given, recorded or not wanted
  RigMask rig;                         ///< in force; empty mask = none
  std::size_t images = 0;              ///< keyframes with an image when something was estimated; 0 = nothing was
};

/// Estimates the lens distance and the rig mask from at most 24 images, as far as `arguments` want them. `images`: of
/// all keyframes, before the first is read. `growing`: more will come. `recorded`: of a workspace, {} = none; what it
/// holds stays in force, and nothing is estimated again until there are other images, or twice as many while growing.
/// Estimates nothing where one of the images cannot be read.
Calibration calibrate(const Arguments& arguments, const DensifierOptions& options, const SlamMap& map,
                      const ImageSource& images, MaskSource& masks, bool growing, const workspace::Record& recorded);

/// The rig mask in a workspace's record; empty = none.
RigMask recorded_rig(const workspace::Record& record);

/// Run lengths of the mask's pixels in row order, of hidden ones first, for the options in a record; null = no mask.
nlohmann::ordered_json rig_json(const RigMask& rig);

/// CLOUD.rig-mask.png, beside the first cloud.
std::filesystem::path rig_mask_path(const Arguments& arguments);

/// Writes the mask there, for people to see and edit. Returns false where another mask lies there, which only --force
/// replaces.
bool write_rig_mask(const Arguments& arguments, const RigMask& rig);

/// Sentences for people.
std::vector<std::string> describe(const Calibration& calibration);

}  // namespace pmsp::tool
