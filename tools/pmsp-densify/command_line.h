// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <vector>

namespace CLI {  // NOLINT(readability-identifier-naming)
class App;
}

namespace pmsp::tool {

/// Configures a verb with its own command line: the last of repeated options wins, unknown words are kept, and `more`
/// is appended to the help.
void set_up_verb(CLI::App& app, const char* more);

/// Parses words. Returns false after printing help to stdout. Throws UsageError.
bool parse_words(CLI::App& app, std::vector<std::string> words);

/// Throws UsageError for remaining words, with the most similar option of `app` or `more`.
void refuse_extra_words(const CLI::App& app, const std::vector<std::string>& more = {});

}  // namespace pmsp::tool
