// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "pmsp/options.h"

// The library's options (pmsp/option_table.h) as JSON: configuration files, statistics, records of workspaces.
namespace pmsp::tool {

/// All options, nested by stage, in the order of the table.
nlohmann::ordered_json to_json(const DensifierOptions& options);

/// Without those that are a matter of the machine, and change no result but by the kind of processor.
nlohmann::ordered_json options_of_results(const DensifierOptions& options);

/// Sets what `json` holds. Throws InvalidOption naming `source` (the file) and the key; for an unknown one, the
/// nearest.
void apply_json(DensifierOptions& options, const nlohmann::json& json, const std::string& source);

}  // namespace pmsp::tool
