// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <vector>

#include "option_table.h"

// Command-line flags of the library's options (option_table.h).
namespace pmsp::tool {

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

}  // namespace pmsp::tool
