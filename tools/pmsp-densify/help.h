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

/// Whether --help shows an option; --help-all shows every one.
bool is_common(const CLI::Option& option);

/// The page of --help: verbs, and the common options of `run` in a line each; 40 lines of 100 columns.
std::string short_help();

/// Wraps descriptions of options and verbs at the width of the terminal.
void wrap_help(CLI::App& app, std::size_t column_width);

/// Verbs of the program.
const std::vector<std::string>& verbs();

}  // namespace pmsp::tool
