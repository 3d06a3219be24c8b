// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "arguments.h"
#include "estimates.h"
#include "pmsp/io/images.h"
#include "workspace/step.h"

namespace pmsp::tool {

/// Expected size of output in a folder [bytes].
struct DiskNeed {
  std::filesystem::path folder;  ///< may not exist yet
  double fixed = 0.0;            ///< determined by the numbers of keyframes and pixels
  double points = 0.0;           ///< proportional to the number of points, which difficult missions do not reach
};

/// `images`: copied into datasets. `in_workspace`: share of the workspace to be computed.
std::vector<DiskNeed> disk_needs(const Arguments& arguments, const Budget& budget, const ImageSource& images,
                                 double in_workspace);

/// Compares the total need per file system with its free space. Returns a warning if the forecast does not fit, else
/// "". Throws OutputError if even its certain part does not fit.
std::string check_disk_space(const std::vector<DiskNeed>& needs);

/// Returns the share of the workspace that a step computes, 0 to 1.
double share_to_make(const workspace::Step& step);

/// Returns whether the size of the depth maps is known before the first image. Sets the height if only the width is
/// set.
bool knows_size(DensifierOptions& options, const SlamMap& map);

/// check_disk_space() for a run with this plan; "" also if the image size, hence the forecast, is unknown.
std::string disk_warning(const Arguments& arguments, const SlamMap& map, const ImageSource& images, const Plan& plan,
                         DensifierOptions options, double in_workspace);

/// The same for one file system with `free` bytes.
std::string compare_disk_space(const DiskNeed& need, double free);

}  // namespace pmsp::tool
