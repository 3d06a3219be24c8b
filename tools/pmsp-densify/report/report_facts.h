// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace pmsp::tool {

/// Returns the facts about a run for the page: pairs of name and value. `stats`: as written by --stats; values of wrong
/// type count as missing.
nlohmann::ordered_json report_facts(const nlohmann::ordered_json& stats);

/// Returns pairs of activity and seconds.
nlohmann::ordered_json report_times(const nlohmann::ordered_json& stats);

/// Returns problems that follow from the counts, in plain words.
std::vector<std::string> report_problems(const nlohmann::ordered_json& stats);

/// Returns "3", "3 and 4", "3 to 5 and 9": runs of adjacent ids in `order`.
std::string list_of_keyframes(const std::vector<std::int64_t>& ids, const std::vector<std::int64_t>& order);

}  // namespace pmsp::tool
