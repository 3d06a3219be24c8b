// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <vector>

namespace pmsp::io {

/// Ignored rectangle of an image [width and height, 0 to 1].
struct MaskRectangle {
  double x_min = 0.0, x_max = 0.0, y_min = 0.0, y_max = 0.0;
};

/// Reads `mask_rectangles` of a YAML configuration of stella_vslam (under Preprocessing) or OpenVSLAM (Feature): a list
/// of [x_min, x_max, y_min, y_max]. Throws IoError; InvalidInput if the list is missing or malformed.
std::vector<MaskRectangle> read_mask_rectangles(const std::filesystem::path& path);

}  // namespace pmsp::io
