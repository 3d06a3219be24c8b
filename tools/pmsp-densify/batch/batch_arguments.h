// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "arguments.h"
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

}  // namespace pmsp::tool
