// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "pmsp/api.h"
#include "pmsp/io/cloud.h"
#include "pmsp/options.h"
#include "pmsp/version.h"

// Options, frame and unit of a cloud, as JSON and as comments of files.
namespace pmsp {

/// CloudHeader::generator.
constexpr const char* kGenerator = "pmsp-densify " PMSP_VERSION_STRING;

/// Returns all options, nested by stage, in the order of the table.
PMSP_API nlohmann::ordered_json to_json(const DensifierOptions& options);

/// Returns the options without those of the machine, which do not affect results except through the processor type.
PMSP_API nlohmann::ordered_json options_of_results(const DensifierOptions& options);

/// Returns the provenance of results except the frame, as comments for files.
PMSP_API std::vector<std::string> how_made(const DensifierOptions& options);

/// Returns frame, unit and size of a cloud, for its files.
PMSP_API nlohmann::ordered_json frame_json(const Similarity& file_from_map, const CloudUnit& unit,
                                           const CloudSelection& amount);

/// Appends the same as comments.
PMSP_API void add_frame_comments(std::vector<std::string>& comments, const Similarity& file_from_map,
                                 const CloudUnit& unit, const CloudSelection& amount);

}  // namespace pmsp
