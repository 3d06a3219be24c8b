// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "export/voxel_map.h"
#include "pmsp/api.h"

namespace pmsp {

/// Throws InvalidInput unless an OctoMap can hold the cell: 32768 cells in each direction from the origin.
PMSP_API void require_octomap_range(const VoxelMap& map, const CellIndex& cell);

/// Writes occupied and free cells as an OctoMap (Hornung et al. 2013). `binary`: .bt, occupied or free; else .ot, with
/// log-odds: of a free cell those of its rays as misses, of an occupied one those of its points, within OctoMap's
/// bounds. `comments`: single lines for the header. Takes about 50 bytes of memory per node. Throws InvalidInput as
/// require_octomap_range; OutputError.
PMSP_API void write_octomap(const std::filesystem::path& path, const VoxelMap& map, bool binary,
                            const std::vector<std::string>& comments);

}  // namespace pmsp
