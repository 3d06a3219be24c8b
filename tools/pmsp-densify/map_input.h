// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <vector>

#include "arguments.h"
#include "pmsp/io/map.h"

namespace pmsp::tool {

/// Reads the map of the arguments. Throws as pmsp::read_map.
SlamMap read_map(const Arguments& arguments);

/// Without --images and --video: adds the image folder named in the map, if it exists.
Arguments with_images(const Arguments& arguments, const SlamMap& map);

/// As above. Throws UsageError if the map names no folder.
Arguments with_needed_images(const Arguments& arguments);

/// Returns sentences about the map for people: components, dropped parts, assumptions.
std::vector<std::string> remarks(const SlamMap& map);

}  // namespace pmsp::tool
