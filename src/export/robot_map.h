// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/io/cloud.h"
#include "pmsp/io/map.h"

namespace pmsp {

/// Writer of all maps of free and occupied space of a run (CloudFormat::is_map), from one set of cells. Takes points
/// before crop and thinning. A cell is occupied by the confidences of its points; the rays from the keyframes that see
/// these points make cells free. Points more than 1000 cells from their keyframe are left out. `box`: bounds of the
/// maps, cameras and points outside count.
///
/// Memory: 2 bytes per cell of the space near points or rays, at most 2 GiB; see write_octomap and FloorGrid for what
/// is added in `finish`. Rays are spilled to the header's scratch folder, 16 bytes for each keyframe and cell.
///
/// Throws InvalidInput if the cells have no size, lengths are in map units without `map_units`, there are no cameras or
/// they are out of range, or for a grid z is not upwards or the robot's step is less than a cell; OutputError. Other
/// reasons for which a map cannot be made are thrown by `finish`, after the other maps are written.
PMSP_API std::unique_ptr<CloudWriter> open_robot_map(const std::vector<CloudOutput::Target>& targets,
                                                     const CloudHeader& header, const std::optional<Box>& box);

/// Files that the format ".pgm" writes besides: YAML, and elevation and slope as TIFF with world files.
PMSP_API std::vector<std::filesystem::path> files_beside_grid(const std::filesystem::path& path);

/// Returns a size of cells for the points of a mission: at least 1.5 times the spacing of adjacent pixels at the
/// median distance of `ranges`, as 1, 2 or 5 times a power of ten. 0 without ranges. `width`: of the depth maps [px].
PMSP_API double default_cell_size(std::vector<double> ranges, int width);

/// Distances of the observed landmarks from the keyframes [map units].
PMSP_API std::vector<double> landmark_ranges(const SlamMap& map);

/// Returns the expected memory of the maps' cells [bytes]: of the space around up to 100 keyframes as far as the
/// landmark nearest to each direction, within the box of most landmarks.
PMSP_API double expected_map_bytes(const SlamMap& map, const CloudHeader& header, const std::optional<Box>& box);

/// Maximum memory of the maps' cells [bytes].
constexpr std::size_t kMostMapBytes = std::size_t{2} << 30;

}  // namespace pmsp
