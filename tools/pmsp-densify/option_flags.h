// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <vector>

#include "option_table.h"

// The library's options (pmsp/option_table.h) on a command line.
namespace pmsp::tool {

/// "--patchmatch-iterations"
std::string flag_of(const OptionEntry& entry);
/// "--no-view-filter-enabled", for switches
std::string negative_flag_of(const OptionEntry& entry);
/// All names, with commas between them: "--min-confidence,--fusion-min-confidence"
std::string flags_of(const OptionEntry& entry);

/// Help, expected values and default, with the defaults of other presets where they differ.
std::string description_of(const OptionEntry& entry);

/// "; did you mean --fps?" for the candidate nearest to `word`; "" where none is within two letters.
std::string suggestion(const std::string& word, const std::vector<std::string>& candidates);

}  // namespace pmsp::tool
