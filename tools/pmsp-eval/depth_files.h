// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "pmsp/types.h"

namespace pmsp::eval {

/// Returns the number in a file name prefix + digits + extension; nullopt for other names.
std::optional<std::int64_t> number_in_name(const std::filesystem::path& path, const std::string& prefix,
                                           const std::string& extension);

struct DepthFile {
  std::int64_t keyframe_id = 0;
  std::filesystem::path path;
};

/// Returns depth maps of keyframes, ascending by id. Folders are searched for depth_<id>.pfm, and for depth_<id>.png if
/// `png_scale` > 0; files have the number in their name, or `keyframe` (for a single file). Throws IoError for missing
/// paths, InvalidInput if nothing is found or a keyframe occurs twice.
std::vector<DepthFile> list_depth_files(const std::vector<std::filesystem::path>& inputs, double png_scale,
                                        std::optional<std::int64_t> keyframe);

/// Reads PFM, or 16-bit PNG times `png_scale`. Throws IoError, InvalidInput.
Image<float> load_depth(const std::filesystem::path& path, double png_scale);

/// Reads confidence_<id>.pfm beside depth_<id>.*, of the same size; empty = missing. Throws IoError, InvalidInput.
Image<float> load_confidence(const std::filesystem::path& depth_path, int width, int height);

/// Reads normal_<id>.pfm beside depth_<id>.*; empty = missing. Throws IoError, InvalidInput.
Image<Eigen::Vector3f> load_normals(const std::filesystem::path& depth_path);

}  // namespace pmsp::eval
