// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <vector>

namespace CLI {  // NOLINT(readability-identifier-naming)
class App;
}

namespace pmsp::tool {

/// For a verb that has a command line of its own: the last of several wins, words that nobody takes are kept, and
/// `more` ends its help.
void set_up_verb(CLI::App& app, const char* more);

/// Gives words to `app`. false where they asked for help, which is on stdout then. Throws UsageError.
bool parse_words(CLI::App& app, std::vector<std::string> words);

/// Throws UsageError where words are left. It names the option that an unknown one is most like, of those of `app` and
/// of `more`.
void refuse_extra_words(const CLI::App& app, const std::vector<std::string>& more = {});

}  // namespace pmsp::tool
