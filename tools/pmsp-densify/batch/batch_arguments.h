// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "arguments.h"
#include "pmsp/io/cloud.h"
#include "workspace/shards.h"

namespace pmsp::tool {

/// Command line of `batch`.
struct BatchArguments {
  std::string program;         ///< argv[0]
  std::string manifest;        ///< "" = recorded one
  std::filesystem::path scan;  ///< used instead of a manifest
  std::filesystem::path output;
  int jobs = 1;
  std::optional<double> memory;             ///< host memory of all jobs together [GiB]
  std::optional<std::vector<int>> devices;  ///< nullopt = not set, {} = all
  std::optional<workspace::Shard> only;     ///< share of the missions: every count-th one from number index on
  bool summary = false;                     ///< reports states, runs nothing
  bool dry_run = false;                     ///< checks the missions, runs nothing
  std::string slurm;                        ///< "", "print" or "submit"
  std::vector<std::string> sbatch;          ///< arguments of sbatch
  std::vector<std::string> words;           ///< command line without `slurm` and `sbatch`
  bool retry = false;
  bool force = false;
  std::vector<std::string> options;  ///< of all missions, see mission_options
  ProgressMode progress = ProgressMode::kAuto;
  bool quiet = false;
};

/// Returns nullopt after printing help to stdout. Throws UsageError, InvalidOption, IoError.
std::optional<BatchArguments> parse_batch_arguments(int argc, const char* const* argv);

/// Parses a mission's options of `run`, each normalised as "--name=value". Input files are relative to `folder` ("" =
/// current one) and made absolute. Throws UsageError.
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

/// Returns a bash script that submits tools/slurm/batch.sbatch as an array over `missions`, and for the table after it.
std::string slurm_script(const BatchArguments& batch, std::size_t missions);

/// Runs the script. Throws OutputError if it fails.
void submit(const std::string& script);

}  // namespace pmsp::tool
