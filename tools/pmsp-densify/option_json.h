// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "pmsp/options.h"

// The library's options (option_table.h) as JSON: configuration files, statistics, workspace records.
namespace pmsp::tool {

/// Returns all options, nested by stage, in the order of the table.
nlohmann::ordered_json to_json(const DensifierOptions& options);

/// Returns the options without those of the machine, which do not affect results except through the processor type.
nlohmann::ordered_json options_of_results(const DensifierOptions& options);

/// Sets the options in `json`. Throws InvalidOption with `source` (the file) and key; for unknown keys, with the most
/// similar one.
void apply_json(DensifierOptions& options, const nlohmann::json& json, const std::string& source);

}  // namespace pmsp::tool
