// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "arguments.h"
#include "pmsp/io/map.h"

namespace pmsp::tool {

/// The map that was asked for. Its conventions are proven unless --no-verify says not to. Throws as read_map and
/// require_convention.
SlamMap read_map(const Arguments& arguments);

/// Where neither --images nor --video is given: the same with the folder that the map names. Throws UsageError where it
/// names none and `needed`.
Arguments with_images(const Arguments& arguments, bool needed);

/// Gives a map without landmarks some of its own, from all images (see LandmarkSweep). Returns a sentence about it, ""
/// where the map has landmarks. Throws InvalidInput where the images show that the poses are of another convention,
/// unless
/// --no-verify says not to look.
std::string sweep_landmarks(SlamMap& map, const Arguments& arguments, int threads);

/// Sentences about what was read, for people: components, what was left out, what is presumed.
std::vector<std::string> remarks(const SlamMap& map);

}  // namespace pmsp::tool
