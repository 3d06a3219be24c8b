// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "export/provenance.h"
#include "option_table.h"
#include "pmsp/options.h"

// The library's options (option_table.h) as command-line flags, and as JSON: configuration files, statistics, workspace
// records.
namespace pmsp::tool {

struct Arguments;

/// Returns "fusion-window" for "fusion.window" and "fusion_window".
std::string with_hyphens(std::string name);

/// Returns "--patchmatch-iterations".
std::string flag_of(const OptionEntry& entry);
/// Returns "--no-view-filter-enabled", for switches.
std::string negative_flag_of(const OptionEntry& entry);
/// Returns all names: "--min-confidence,--fusion-min-confidence".
std::string flags_of(const OptionEntry& entry);

/// Returns help, expected values and default, with those of other presets if different.
std::string description_of(const OptionEntry& entry);

/// Returns "; did you mean --fps?" for the candidate nearest to `word`; "" if none is within two edits.
std::string suggestion(const std::string& word, const std::vector<std::string>& candidates);

/// Sets the options in `json`. Throws InvalidOption with `source` (the file) and key; for unknown keys, with the most
/// similar one.
void apply_json(DensifierOptions& options, const nlohmann::json& json, const std::string& source);

/// Returns the preset selected by flag or configuration file. Throws as effective_options.
Quality quality_of(const Arguments& arguments);

/// Returns the validated options: defaults, overridden by the preset, the configuration file and flags, in this order.
/// Throws InvalidOption, IoError.
DensifierOptions effective_options(const Arguments& arguments);

/// Returns a warning if --quality has no effect, because configuration file and flags set all of its options; else "".
std::string quality_warning(const Arguments& arguments);

}  // namespace pmsp::tool
