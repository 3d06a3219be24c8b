// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "budget.h"

namespace pmsp::tool {

nlohmann::ordered_json to_json(const Budget& budget);

/// Returns "12 MiB", "1.5 GiB".
std::string bytes_text(double bytes);

/// Formats a budget as a few lines for people.
std::string budget_text(const Budget& budget);

/// Returns a line with the expected CPU time of a run, and with --quality online; "" for runs below half a minute.
/// `options`: of the run, `online`: of the alternative. Takes up to two seconds.
std::string cpu_time_text(const SlamMap& map, const ImageSource& source, const DensifierOptions& options,
                          const DensifierOptions& online);

}  // namespace pmsp::tool
