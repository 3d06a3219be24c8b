// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace pmsp::tool {

/// Missions found in a folder tree, as manifest lines; rules: see `batch --help`.
struct Scan {
  std::vector<nlohmann::ordered_json> missions;
  std::vector<std::filesystem::path> without_images;  ///< maps without images
};

/// Throws IoError.
Scan scan_for_missions(const std::filesystem::path& folder);

}  // namespace pmsp::tool
