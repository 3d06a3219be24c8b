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

/// Cloud options of the command line.
struct CloudArguments {
  std::vector<std::filesystem::path> paths = {"cloud.ply"};
  std::vector<std::string> formats;  ///< parallel to `paths`; empty = by extension
  bool double_positions = false;
  double resolution = 0.0;    ///< see CloudHeader; 0 = default
  std::filesystem::path crs;  ///< WKT file
  int year = 0, day_of_year = 0;
  FrameOptions frame;
  CloudAmount amount;
  std::int64_t dataset_points = 1'000'000;

  /// Targets of CloudOutput.
  std::vector<CloudOutput::Target> targets() const;
};

/// Adds the cloud options; check_cloud_arguments must follow.
void add_cloud_options(CLI::App& app, CloudArguments& arguments);

/// Throws UsageError.
void check_cloud_arguments(const CloudArguments& arguments);

}  // namespace pmsp::tool
