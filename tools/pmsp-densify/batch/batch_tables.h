// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "batch_run.h"

namespace pmsp::tool {

using BatchMissions = std::vector<BatchMission>;

/// Those in this state.
std::size_t count(const BatchMissions& missions, const char* state);

/// "95 of 100 missions done, 5 failed"
std::string summary(const BatchMissions& missions);

/// For a terminal.
std::string table_text(const BatchMissions& missions);

/// Of --dry-run: a line for each mission, "hall: ok", "cellar: refused: ...", and their numbers.
std::string checks_text(const BatchMissions& missions);

/// The file missions.csv: a row for each mission, below a row with the names of the columns.
std::string csv_text(const BatchMissions& missions);

/// The file index.html in `folder`: the table for a browser, with links to the files in the missions' folders. One
/// file without scripts, which needs no network.
std::string page_text(const BatchMissions& missions, const std::string& manifest, const std::filesystem::path& folder);

}  // namespace pmsp::tool
