// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "arguments.h"

namespace CLI {  // NOLINT(readability-identifier-naming)
class App;
}

namespace pmsp::tool {

/// Adds --report and related options.
void add_report_options(CLI::App& app, ReportArguments& arguments);

/// Throws UsageError for options that do not fit together, or if the build contains no page.
void check_report(const ReportArguments& arguments);

/// Throws UsageError if the build contains no page.
void require_report_page(const char* option);

}  // namespace pmsp::tool
