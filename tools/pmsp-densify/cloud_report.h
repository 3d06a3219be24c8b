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

/// How results were made, but for the frame of the cloud: comments of its files.
std::vector<std::string> how_made(const DensifierOptions& options);

/// What a workspace records of the clouds that are made from it.
workspace::RecordedCloud recorded_cloud(const DensifierOptions& options, const SlamMap& map);

/// Frame, unit and amount of a cloud, for its files.
nlohmann::ordered_json frame_json(const Similarity& file_from_map, const CloudUnit& unit, const CloudAmount& amount);

/// The comments that say so, at the end of `comments`.
void add_frame_comments(std::vector<std::string>& comments, const Similarity& file_from_map, const CloudUnit& unit,
                        const CloudAmount& amount);

/// The frame of the cloud and what was left out of it, for stats.json.
nlohmann::ordered_json cloud_json(const CloudArguments& arguments, const CloudFrame& frame);

/// The folder for what memory should not hold: --scratch, or that of the first cloud.
std::filesystem::path scratch_folder(const Arguments& arguments);
std::filesystem::path scratch_folder(const std::filesystem::path& given, const CloudArguments& cloud);

/// The coordinate reference system in the file of --crs. Throws IoError.
std::string read_wkt(const std::filesystem::path& path);

/// What the writers are told: of inputs and options alone, no threads, paths or times, so that the same input gives the
/// same bytes. Throws IoError where the file of --crs cannot be read.
CloudHeader cloud_header(const Arguments& arguments, const DensifierOptions& options, const SlamMap& map,
                         const CloudFrame& frame);

}  // namespace pmsp::tool
