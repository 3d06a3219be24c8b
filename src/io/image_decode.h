// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/io/map.h"
#include "pmsp/types.h"

namespace pmsp::io {

/// Decodes an image file and applies its EXIF orientation; `imread_flags`: see cv::imread. Throws IoError with the
/// path, also for truncated JPEGs, which OpenCV would fill with gray; InvalidInput for partial panoramas (XMP) and for
/// wide images with a quarter turn.
cv::Mat decode_image_file(const std::filesystem::path& path, int imread_flags);

/// Returns an image in the format of a file extension; `parameters`: see cv::imwrite. Throws OutputError with `error`.
PMSP_API std::vector<unsigned char> encoded(const std::string& extension, const cv::Mat& image,
                                            const std::string& error, const std::vector<int>& parameters = {});

/// Converts 8-bit BGR to RGB.
Image<Rgb> rgb_from_bgr(const cv::Mat& bgr);

/// Throws InvalidInput unless width x height is the camera's size up to a common factor, within one row. `what`: name
/// of the image.
void check_image_size(const std::string& what, int width, int height, const MapCamera& camera);

}  // namespace pmsp::io
