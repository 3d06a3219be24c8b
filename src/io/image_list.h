// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>

#include "pmsp/io/map.h"

namespace pmsp::map_detail {

/// Gives keyframes the images that a list names: lines "timestamp name", matched by time, or "name" for each keyframe
/// in the order of ids; a first line may be a header. Poses without ids that no image belongs to are left out, with a
/// note. Throws IoError, InvalidInput.
void name_images(SlamMap& map, const std::filesystem::path& list);

}  // namespace pmsp::map_detail
