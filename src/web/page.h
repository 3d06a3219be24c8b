// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "pmsp/api.h"

namespace pmsp::web {

/// The page of tools/viewer, with a mark where the data go; "" where it was left out (PMSP_VIEWER).
extern const char* const kPageTemplate;

/// Whether this build has the page (PMSP_VIEWER).
PMSP_API bool has_report_page();

/// The page with its data, which are HTML. `asks`: whether it may ask where it came from for more; none ever asks
/// anybody else for anything.
PMSP_API std::pair<std::string, std::string> page_around_data(bool asks);

/// JSON that may stand in a script element of a page: nothing in it can end the element, whatever names it holds.
/// Bytes that are no UTF-8 are replaced.
PMSP_API std::string script_json(const nlohmann::ordered_json& json);

}  // namespace pmsp::web
