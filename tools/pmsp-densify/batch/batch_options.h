// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "pmsp/io/cloud_writer.h"

namespace CLI {  // NOLINT(readability-identifier-naming)
class App;
}

namespace pmsp::tool {

/// Adds the options of `run` that missions may be given, but for those of names that are there. Each is put into
/// `result` in one spelling, "--name=value". The names of files to read are relative to `folder` ("" = where the
/// program is called).
void add_mission_options(CLI::App& app, const std::filesystem::path& folder, std::vector<std::string>& result);

/// Throws UsageError where words are left that are no option, or one that a batch sets itself.
void refuse_words_for_missions(const CLI::App& app);

/// Reads the options of missions, as above, one mission after the other.
class MissionOptions {
 public:
  explicit MissionOptions(const std::filesystem::path& folder);
  ~MissionOptions();
  MissionOptions(const MissionOptions&) = delete;
  MissionOptions& operator=(const MissionOptions&) = delete;

  /// The options that these words are. Throws UsageError.
  std::vector<std::string> read(std::vector<std::string> words);

 private:
  std::unique_ptr<CLI::App> app_;
  std::vector<std::string> result_;
};

/// Whether such an option is a matter of the machine, or of where files lie, and changes no result by its words.
bool is_of_machine(const std::string& option);

/// The value of such an option where it is the one of this name, else "".
std::string value_of(const std::string& option, const std::string& name);

/// The options for a mission whose results lie in `folder`: names of folders for results are names in there.
std::vector<std::string> options_in(const std::filesystem::path& folder, const std::vector<std::string>& options);

/// The formats of a mission's clouds: by the last --format among such options, which names them with commas between
/// them; PLY without one. Throws UsageError.
std::vector<const CloudFormat*> formats_in(const std::vector<std::string>& options);

/// The options without --format.
std::vector<std::string> without_formats(std::vector<std::string> options);

/// The words of one line, parted by blanks; quotes ("a b", 'a b') hold blanks together. Throws UsageError for an open
/// quote.
std::vector<std::string> split_words(const std::string& line);

}  // namespace pmsp::tool
