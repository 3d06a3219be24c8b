// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace pmsp::tool {

/// What the page says of a run: pairs of name and value. `stats`: as --stats writes them; whatever else is in there
/// counts as missing.
nlohmann::ordered_json report_facts(const nlohmann::ordered_json& stats);

/// Pairs of what the time went into and seconds.
nlohmann::ordered_json report_times(const nlohmann::ordered_json& stats);

/// Problems that show in the counts alone, in plain words.
std::vector<std::string> report_problems(const nlohmann::ordered_json& stats);

/// "3", "3 and 4", "3 to 5 and 9": runs of neighbours in `order`.
std::string list_of_keyframes(const std::vector<std::int64_t>& ids, const std::vector<std::int64_t>& order);

}  // namespace pmsp::tool
