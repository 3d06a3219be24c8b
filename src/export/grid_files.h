// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>

#include "export/floor_grid.h"
#include "pmsp/api.h"
#include "pmsp/io/cloud.h"

namespace pmsp {

/// Returns generator and unit of lengths, as a line for the files.
PMSP_API std::string origin_of_map(const CloudHeader& header);

/// Writes a grid as map_server and Nav2 read it: PGM (occupied 0, free 254, unknown 205; first row = largest y) and
/// YAML of the same name, and elevation [unit of the file] and slope [deg] as 32-bit TIFF of the same rows, NaN =
/// unknown, with world files. Throws OutputError.
PMSP_API void write_grid(const std::filesystem::path& path, const CloudHeader& header, const FloorGrid& grid);

}  // namespace pmsp
