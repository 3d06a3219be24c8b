// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pmsp/io/cloud.h"

namespace CLI {  // NOLINT(readability-identifier-naming)
class App;
}

namespace pmsp::tool {

/// Adds the options of `run` that missions may be given, except those that `app` has. Each is put into `result` in one
/// spelling, "--name=value". Files to read are relative to `folder` ("" = the current one) and become absolute.
void add_mission_options(CLI::App& app, const std::filesystem::path& folder, std::vector<std::string>& result);

/// Throws UsageError where words are left: no options, or options that a batch sets itself.
void refuse_words_for_missions(const CLI::App& app);

/// The options of a mission that these words are, as above. Throws UsageError.
std::vector<std::string> mission_options(std::vector<std::string> words, const std::filesystem::path& folder);

/// Among such options: keeps the missions' workspaces when they are done. Of batch alone.
constexpr const char* kKeepWorkspaces = "--keep-workspaces";

/// Whether such an option changes no result, but where or how fast it is computed.
bool is_of_machine(const std::string& option);
/// Whether its value is a file or folder that the run reads.
bool is_file_to_read(const std::string& option);

/// The two sides of "--name=value".
std::string name_of_option(const std::string& option);
std::string value_of(const std::string& option);
/// The value of the last option of this name; "" without one.
std::string value_in(const std::vector<std::string>& options, const std::string& name);

/// The options for the run of a mission whose results lie in `folder`: without those of batch alone, with paths in
/// `folder` for results.
std::vector<std::string> run_options_in(const std::filesystem::path& folder, const std::vector<std::string>& options);

/// The formats of a mission's clouds: by the last --format among such options, which names them with commas between
/// them; PLY without one. Throws UsageError.
std::vector<const CloudFormat*> formats_in(const std::vector<std::string>& options);

/// "recorded --quality=normal, given --quality=high" of the first given option that is not recorded and may change
/// results; "" without one.
std::string difference(const std::vector<std::string>& recorded, const std::vector<std::string>& given);

/// The recorded options, with the given ones instead of those of the same names.
std::vector<std::string> merged(std::vector<std::string> recorded, const std::vector<std::string>& given);

/// As a shell reads it.
std::string command_text(const std::vector<std::string>& words);

/// The words of one line, parted by blanks; quotes ("a b", 'a b') hold blanks together. Throws UsageError for an open
/// quote.
std::vector<std::string> split_words(const std::string& line);

}  // namespace pmsp::tool
