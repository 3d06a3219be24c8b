// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <optional>

#include <CLI/CLI.hpp>

#include "report_page.h"

namespace pmsp::tool {

/// Command line of `report`.
struct ReportVerbArguments {
  std::filesystem::path from;  ///< cloud or workspace
  ReportArguments report;
};

/// Returns nullopt after printing help to stdout. Throws UsageError, IoError, OutputError.
std::optional<ReportVerbArguments> parse_report_arguments(int argc, const char* const* argv);

/// Adds --report and related options.
void add_report_options(CLI::App& app, ReportArguments& arguments);

/// Throws UsageError if the build contains no page.
void require_report_page(const char* option);

}  // namespace pmsp::tool
