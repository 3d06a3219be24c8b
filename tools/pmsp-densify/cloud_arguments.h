// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "export/cloud_frame.h"
#include "pmsp/io/cloud.h"

namespace CLI {
class App;
}

namespace pmsp::tool {

/// What the command line says of the cloud that is written.
struct CloudArguments {
  std::vector<std::filesystem::path> paths = {"cloud.ply"};
  std::vector<std::string> formats;  ///< of the paths, in their order; empty = as their extensions say
  bool double_positions = false;
  double resolution = 0.0;    ///< 0 = see CloudHeader
  std::filesystem::path crs;  ///< file with WKT
  int year = 0, day_of_year = 0;
  FrameOptions frame;
  CloudAmount amount;
  std::int64_t dataset_points = 1'000'000;

  /// Targets of CloudOutput.
  std::vector<CloudOutput::Target> targets() const;
};

/// The options of the cloud; to be followed by check_cloud_arguments.
void add_cloud_options(CLI::App& app, CloudArguments& arguments);

/// Throws UsageError.
void check_cloud_arguments(const CloudArguments& arguments);

}  // namespace pmsp::tool
