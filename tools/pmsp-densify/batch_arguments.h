// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "arguments.h"

namespace pmsp::tool {

/// The command line of `batch`.
struct BatchArguments {
  std::string program;  ///< as it was called
  std::string manifest;
  std::filesystem::path scan;  ///< instead of a manifest
  std::filesystem::path output;
  int jobs = 1;
  bool retry = false;
  bool keep_workspaces = false;
  std::vector<int> devices;
  std::vector<std::string> options;  ///< of all missions, see mission_options()
  ProgressMode progress = ProgressMode::kAuto;
  bool quiet = false;
};

/// nullopt when it asked for help, which is then on stdout. Throws UsageError, InvalidOption, IoError.
std::optional<BatchArguments> parse_batch_arguments(int argc, const char* const* argv);

}  // namespace pmsp::tool
