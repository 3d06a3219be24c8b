// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "arguments.h"
#include "export/cloud_frame.h"
#include "pmsp/io/cloud.h"
#include "pmsp/io/map.h"
#include "workspace/record.h"

namespace pmsp::tool {

/// Returns the provenance of results except the frame, as comments for files.
std::vector<std::string> how_made(const DensifierOptions& options);

/// Returns the workspace's record of its clouds.
workspace::RecordedCloud recorded_cloud(const DensifierOptions& options, const SlamMap& map);

/// Returns frame, unit and size of a cloud, for its files.
nlohmann::ordered_json frame_json(const Similarity& file_from_map, const CloudUnit& unit, const CloudAmount& amount);

/// Appends the same as comments.
void add_frame_comments(std::vector<std::string>& comments, const Similarity& file_from_map, const CloudUnit& unit,
                        const CloudAmount& amount);

/// Returns frame and dropped points of the cloud, for stats.json.
nlohmann::ordered_json cloud_json(const CloudArguments& arguments, const CloudFrame& frame);

/// Returns the folder of spilled data: --scratch, or that of the first cloud.
std::filesystem::path scratch_folder(const Arguments& arguments);
std::filesystem::path scratch_folder(const std::filesystem::path& given, const CloudArguments& cloud);

/// Reads the coordinate reference system from the file of --crs. Throws IoError.
std::string read_wkt(const std::filesystem::path& path);

/// Returns the metadata for cloud writers. Depends on inputs and options only, not on threads, paths or times, so that
/// equal inputs give equal bytes. Throws IoError if the file of --crs is unreadable.
CloudHeader cloud_header(const Arguments& arguments, const DensifierOptions& options, const SlamMap& map,
                         const CloudFrame& frame);

}  // namespace pmsp::tool
