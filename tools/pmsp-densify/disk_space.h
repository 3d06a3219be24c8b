// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "arguments.h"
#include "budget.h"
#include "pmsp/io/images.h"
#include "workspace/step.h"

namespace pmsp::tool {

/// Space that a run is expected to take in a folder [bytes].
struct DiskNeed {
  std::filesystem::path folder;  ///< of an output; need not exist
  double fixed = 0.0;            ///< follows from numbers of keyframes and pixels
  double points = 0.0;           ///< follows from a number of points, which a mission that is hard falls short of
};

/// `images`: of the mission, which datasets copy. `in_workspace`: share of the workspace that is to be made.
std::vector<DiskNeed> disk_needs(const Arguments& arguments, const Budget& budget, const ImageSource& images,
                                 double in_workspace);

/// Compares with what is free: on each file system, all needs together. Returns a warning where the forecast does not
/// fit, "" where it does. Throws OutputError where not even a part of it does that is certain.
std::string check_disk_space(const std::vector<DiskNeed>& needs);

/// Of the part of the workspace that a step is to make, 0 to 1.
double share_to_make(const workspace::Step& step);

/// Returns whether the size of the depth maps is known before the first image. Sets the height where only the width is
/// given.
bool knows_size(DensifierOptions& options, const SlamMap& map);

/// check_disk_space() of a run with this plan; "" also where the size of the images, and so the forecast, is not known.
std::string disk_warning(const Arguments& arguments, const SlamMap& map, const ImageSource& images, const Plan& plan,
                         DensifierOptions options, double in_workspace);

/// The same for one file system of which `free` bytes are free.
std::string compare_disk_space(const DiskNeed& need, double free);

}  // namespace pmsp::tool
