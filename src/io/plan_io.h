// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>

#include "plan/plan.h"
#include "pmsp/api.h"

namespace pmsp {

/// Returns a plan as JSON: {"format": "pmsp plan", "version": 1, "entries": [...]}, one entry per line with the names
/// of PlanEntry ("range": [min, max] in map units, "first_planes": id or null). Numbers round-trip exactly.
PMSP_API std::string plan_json(const Plan& plan);

/// Throws InvalidInput with entry, key and expectation; `where` (a path) begins the message.
PMSP_API Plan plan_from_json(const std::string& text, const std::string& where = "plan");

/// Writes a plan atomically. Throws OutputError.
PMSP_API void write_plan(const std::filesystem::path& path, const Plan& plan);

}  // namespace pmsp
