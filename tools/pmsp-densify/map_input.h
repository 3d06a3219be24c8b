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

/// What images say of a map's poses, each "" or a sentence.
struct PosesByImages {
  std::string about;    ///< landmarks that were made
  std::string warning;  ///< the poses may not fit, or nothing can be said
};

/// Whether check_by_images has something to do: the map says nothing of what its keyframes see.
bool needs_check_by_images(const SlamMap& map, const Arguments& arguments);

/// Gives a map without landmarks some of its own, from all images (see LandmarkSweep). Where it has points but not
/// which keyframe sees them, looks at some images, so that a fault of poses or points is not blamed on the images.
/// Throws InvalidInput where the images show that poses or points are wrong, unless --no-verify says not to look.
PosesByImages check_by_images(SlamMap& map, const Arguments& arguments, int threads);

/// Warning that the convention check (`proof` of read_map) could not decide; "" = it could, or there is none.
std::string undecided(const ConventionCheck& proof, const SlamMap& map, const Arguments& arguments);

/// Sentences about what was read, for people: components, what was left out, what is presumed.
std::vector<std::string> remarks(const SlamMap& map);

}  // namespace pmsp::tool
