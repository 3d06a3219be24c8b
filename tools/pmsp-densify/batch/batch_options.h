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

/// Adds the options of `run` that missions support, except those that `app` has. Each is appended to `result` as
/// "--name=value". Input files are relative to `folder` ("" = current one) and made absolute.
void add_mission_options(CLI::App& app, const std::filesystem::path& folder, std::vector<std::string>& result);

/// Throws UsageError for remaining words: no options, or options set by batch.
void refuse_words_for_missions(const CLI::App& app);

/// Parses a mission's options, normalised as above. Throws UsageError.
std::vector<std::string> mission_options(std::vector<std::string> words, const std::filesystem::path& folder);

/// Option of batch: keeps the missions' workspaces after completion.
constexpr const char* kKeepWorkspaces = "--keep-workspaces";

/// True for options that affect speed or location of the computation, but not the results.
bool is_machine_option(const std::string& option);
/// True if the value is an input file or folder.
bool is_file_to_read(const std::string& option);

/// Parts of "--name=value".
std::string name_of_option(const std::string& option);
std::string value_of(const std::string& option);
/// Returns the value of the last option of this name; "" = none.
std::string value_in(const std::vector<std::string>& options, const std::string& name);

/// Returns the options of `run` for a mission with results in `folder`: without options of batch, with output paths in
/// `folder`.
std::vector<std::string> run_options_in(const std::filesystem::path& folder, const std::vector<std::string>& options);

/// Returns the formats of a mission's clouds, from the last --format (comma-separated); default PLY. Throws UsageError.
std::vector<const CloudFormat*> formats_in(const std::vector<std::string>& options);

/// Returns "recorded --quality=normal, given --quality=high" for the first given option that differs and may change
/// results; "" = none.
std::string difference(const std::vector<std::string>& recorded, const std::vector<std::string>& given);

/// Returns the recorded options, overridden by the given ones.
std::vector<std::string> merged(std::vector<std::string> recorded, const std::vector<std::string>& given);

/// Quotes words for a shell.
std::string command_text(const std::vector<std::string>& words);

/// Splits a line at blanks outside of quotes ("a b", 'a b'). Throws UsageError for an open quote.
std::vector<std::string> split_words(const std::string& line);

}  // namespace pmsp::tool
