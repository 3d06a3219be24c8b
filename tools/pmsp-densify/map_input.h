// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <vector>

#include "arguments.h"
#include "pmsp/io/map.h"

namespace pmsp::tool {

/// The map that the arguments name. Throws as pmsp::read_map.
SlamMap read_map(const Arguments& arguments);

/// Where neither --images nor --video is given: the same with the folder that the map names, if that is there.
Arguments with_images(const Arguments& arguments, const SlamMap& map);

/// Where neither is given: the same with the folder that the map names. Throws UsageError where it names none.
Arguments with_needed_images(const Arguments& arguments);

/// Sentences about what was read, for people: components, what was left out, what is presumed.
std::vector<std::string> remarks(const SlamMap& map);

}  // namespace pmsp::tool
