// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

#include "pmsp/types.h"

namespace pmsp::eval {

/// The number in a file name of the form prefix + digits + extension; nullopt for every other name.
std::optional<std::int64_t> number_in_name(const std::filesystem::path& path, std::string_view prefix,
                                           std::string_view extension);

struct DepthFile {
  std::int64_t keyframe_id = 0;
  std::filesystem::path path;
};

/// Depth maps of keyframes, ascending id. Folders are searched for depth_<id>.pfm, and for depth_<id>.png where
/// `png_scale` > 0; files are taken by the number in their name, or for `keyframe` (then it must be one file).
/// Throws IoError when something is not there, InvalidInput when nothing is found or a keyframe occurs twice.
std::vector<DepthFile> list_depth_files(const std::vector<std::filesystem::path>& inputs, double png_scale,
                                        std::optional<std::int64_t> keyframe);

/// Reads PFM, or 16-bit PNG times `png_scale`. Throws IoError, InvalidInput.
Image<float> load_depth(const std::filesystem::path& path, double png_scale);

/// confidence_<id>.pfm beside depth_<id>.*, as pmsp-densify names it, of the same size; empty where there is none.
/// Throws IoError, InvalidInput.
Image<float> load_confidence(const std::filesystem::path& depth_path, int width, int height);

}  // namespace pmsp::eval
