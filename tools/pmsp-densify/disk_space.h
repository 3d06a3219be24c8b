// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "arguments.h"
#include "budget.h"
#include "pmsp/io/image_source.h"

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

/// The same for one file system of which `free` bytes are free.
std::string compare_disk_space(const DiskNeed& need, double free);

}  // namespace pmsp::tool
