// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <optional>

#include <CLI/CLI.hpp>

#include "report_page.h"

namespace pmsp::tool {

/// Of the verb `report`.
struct ReportVerbArguments {
  std::filesystem::path from;  ///< cloud or workspace
  ReportArguments report;
};

/// nullopt when help was asked for, which is then on stdout. Throws UsageError, IoError, OutputError.
std::optional<ReportVerbArguments> parse_report_arguments(int argc, const char* const* argv);

/// --report and what belongs to it.
void add_report_options(CLI::App& app, ReportArguments& arguments);

/// Throws UsageError where this build has no page.
void require_report_page(const char* option);

}  // namespace pmsp::tool
