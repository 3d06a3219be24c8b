// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "budget.h"

namespace pmsp::tool {

nlohmann::ordered_json to_json(const Budget& budget);

/// A few lines for people.
std::string budget_text(const Budget& budget);

}  // namespace pmsp::tool
