// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "arguments.h"
#include "workspace/shards.h"

namespace pmsp::tool {

/// The command line of `batch`.
struct BatchArguments {
  std::string program;         ///< as it was called
  std::string manifest;        ///< "" = the recorded one
  std::filesystem::path scan;  ///< instead of a manifest
  std::filesystem::path output;
  int jobs = 1;
  std::optional<double> memory;             ///< of the host for all jobs together [GiB]
  std::optional<std::vector<int>> devices;  ///< nullopt = not given, {} = all
  std::optional<workspace::Shard> only;     ///< every count-th mission, from number index on
  bool summary = false;                     ///< no mission
  bool dry_run = false;                     ///< no mission, a check of each
  std::string slurm;                        ///< "", "print" or "submit"
  std::vector<std::string> sbatch;          ///< words for it
  std::vector<std::string> words;           ///< as it was called, without those two
  bool retry = false;
  bool force = false;
  std::vector<std::string> options;  ///< of all missions, see mission_options
  ProgressMode progress = ProgressMode::kAuto;
  bool quiet = false;
};

/// nullopt after help, which is then on stdout. Throws UsageError, InvalidOption, IoError.
std::optional<BatchArguments> parse_batch_arguments(int argc, const char* const* argv);

}  // namespace pmsp::tool
