// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "budget.h"

namespace pmsp::tool {

nlohmann::ordered_json to_json(const Budget& budget);

/// "12 MiB", "1.5 GiB"
std::string bytes_text(double bytes);

/// A few lines for people.
std::string budget_text(const Budget& budget);

/// Expected time of a run on the CPU, and of the same with --quality online: a line for people; "" for a run below half
/// a minute. `options`: of the run, `online`: of the other. Takes up to two seconds.
std::string cpu_time_text(const SlamMap& map, const ImageSource& source, const DensifierOptions& options,
                          const DensifierOptions& online);

}  // namespace pmsp::tool
