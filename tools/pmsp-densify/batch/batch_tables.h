// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "batch_run.h"

namespace pmsp::tool {

using BatchMissions = std::vector<BatchMission>;

/// Number of missions in a state.
std::size_t count(const BatchMissions& missions, const char* state);

/// Returns "95 of 100 missions done, 5 failed".
std::string summary(const BatchMissions& missions);

/// Table for a terminal.
std::string table_text(const BatchMissions& missions);

/// Result of --dry-run: a line per mission, "hall: ok", "cellar: refused: ...", and totals.
std::string checks_text(const BatchMissions& missions);

/// Content of missions.csv: header and a row per mission.
std::string csv_text(const BatchMissions& missions);

/// Content of index.html in `folder`: table with links to the files of the missions. Self-contained, without scripts.
std::string page_text(const BatchMissions& missions, const std::string& manifest, const std::filesystem::path& folder);

}  // namespace pmsp::tool
