// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace CLI {  // NOLINT(readability-identifier-naming)
class App;
class Option;
}  // namespace CLI

namespace pmsp::tool {

/// Configures a verb with its own command line: the last of repeated options wins, unknown words are kept, and `more`
/// is appended to the help.
void set_up_verb(CLI::App& app, const char* more);

/// Parses words. Returns false after printing help to stdout. Throws UsageError.
bool parse_words(CLI::App& app, std::vector<std::string> words);

/// Throws UsageError for remaining words, with the most similar option of `app` or `more`.
void refuse_extra_words(const CLI::App& app, const std::vector<std::string>& more = {});

/// True for options shown by --help; --help-all shows all.
bool is_common(const CLI::Option& option);

/// Returns the page of --help: verbs, and common options of `run`, one line each; 40 lines of 100 columns.
std::string short_help();

/// Wraps descriptions of options and verbs at the terminal's width.
void wrap_help(CLI::App& app, std::size_t column_width);

/// Verbs of the program.
const std::vector<std::string>& verbs();

}  // namespace pmsp::tool
