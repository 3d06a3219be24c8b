// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "arguments.h"
#include "pmsp/io/convention.h"
#include "pmsp/io/map.h"

namespace pmsp::tool {

/// The map that was asked for. Its conventions are proven unless --no-verify says not to; `proof`: what was found then.
/// Throws as read_map and require_convention.
SlamMap read_map(const Arguments& arguments, ConventionCheck* proof = nullptr);

/// Where neither --images nor --video is given: the same with the folder that the map names, if that is there.
Arguments with_images(const Arguments& arguments, const SlamMap& map);

/// Where neither is given: the same with the folder that the map names. Throws UsageError where it names none.
Arguments with_needed_images(const Arguments& arguments);

/// Gives a map without landmarks some of its own, from all images (see LandmarkSweep). Returns a sentence about it, ""
/// where the map has landmarks. Throws InvalidInput where the images show that the poses are of another convention,
/// unless --no-verify says not to look.
std::string sweep_landmarks(SlamMap& map, const Arguments& arguments, int threads);

/// Sentences about what was read, for people: components, what was left out, what is presumed.
std::vector<std::string> remarks(const SlamMap& map);

}  // namespace pmsp::tool
