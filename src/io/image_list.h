// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>

#include "pmsp/io/map.h"

namespace pmsp::map_detail {

/// Assigns images from a list to keyframes: lines "timestamp name", matched by time, or "name" per keyframe in the
/// order of ids; the first line may be a header. Poses without ids and without an image are dropped, with a note.
/// Throws IoError, InvalidInput.
void name_images(SlamMap& map, const std::filesystem::path& list);

}  // namespace pmsp::map_detail
