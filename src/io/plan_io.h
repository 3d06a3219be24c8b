// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>

#include "plan/plan.h"
#include "pmsp/api.h"

namespace pmsp {

/// A plan as JSON: {"format": "pmsp plan", "version": 1, "entries": [...]}, an entry a line with the names of PlanEntry
/// ("range": [min, max] in scene units, "first_planes": an id or null). Numbers read back as the same numbers.
PMSP_API std::string plan_json(const Plan& plan);

/// Throws InvalidInput, naming the entry, the key and what was expected; `where` (a path) begins the message.
PMSP_API Plan plan_from_json(const std::string& text, const std::string& where = "plan");

/// Throws OutputError; nothing half-written is left behind.
PMSP_API void write_plan(const std::filesystem::path& path, const Plan& plan);

/// Throws IoError, InvalidInput.
PMSP_API Plan read_plan(const std::filesystem::path& path);

}  // namespace pmsp
