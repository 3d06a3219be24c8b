// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace pmsp::tool {

/// True for options shown by --help; --help-all shows all.
bool is_common(const CLI::Option& option);

/// Returns the page of --help: verbs, and common options of `run`, one line each; 40 lines of 100 columns.
std::string short_help();

/// Wraps descriptions of options and verbs at the terminal's width.
void wrap_help(CLI::App& app, std::size_t column_width);

/// Verbs of the program.
const std::vector<std::string>& verbs();

}  // namespace pmsp::tool
