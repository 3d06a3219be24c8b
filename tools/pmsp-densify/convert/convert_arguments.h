// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <optional>

#include <Eigen/Core>

#include "cloud_arguments.h"

namespace pmsp::tool {

/// Known distance between two points.
struct KnownLength {
  Eigen::Vector3d from, to;  ///< in the frame and unit of the input
  double metres = 0.0;
};

/// Command line of `convert`.
struct ConvertArguments {
  std::filesystem::path from;  ///< cloud or workspace
  CloudArguments cloud;
  std::optional<KnownLength> length;
  std::filesystem::path map;      ///< for --up and --align; "" = none
  std::filesystem::path scratch;  ///< "" = folder of the first output
  bool force = false;
  bool quiet = false;
};

/// Returns nullopt if help was printed to stdout. Throws UsageError, IoError, OutputError.
std::optional<ConvertArguments> parse_convert_arguments(int argc, const char* const* argv);

}  // namespace pmsp::tool
