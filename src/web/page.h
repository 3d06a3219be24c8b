// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "pmsp/api.h"

namespace pmsp::web {

/// Page of tools/viewer with a placeholder for the data; "" if built without it (PMSP_VIEWER).
extern const char* const kPageTemplate;

/// Whether the build contains the page (PMSP_VIEWER).
PMSP_API bool has_report_page();

/// Returns the parts of the page before and after its data, which are HTML. `connects`: whether its content security
/// policy allows requests and images of its own origin; others are never allowed.
PMSP_API std::pair<std::string, std::string> page_around_data(bool connects);

/// Returns JSON for a script element of a page: no string in it can end the element. Invalid UTF-8 is replaced.
PMSP_API std::string script_json(const nlohmann::ordered_json& json);

}  // namespace pmsp::web
