// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>

#include "pmsp/io/map.h"
#include "pmsp/types.h"

namespace pmsp::io {

/// Decodes an image file, turned as its EXIF orientation asks; `imread_flags` as cv::imread takes them. Throws IoError,
/// naming the path, also for a JPEG that ends too early, which OpenCV would fill with gray; InvalidInput for a JPEG
/// that says it is a part of a panorama, and for a wide image that is to be turned by a quarter.
cv::Mat decode_image_file(const std::filesystem::path& path, int imread_flags);

/// 8-bit BGR to RGB.
Image<Rgb> rgb_from_bgr(const cv::Mat& bgr);

/// Throws InvalidInput unless width x height is the camera's size times one factor, within one row. `what` names the
/// image.
void check_image_size(const std::string& what, int width, int height, const MapCamera& camera);

}  // namespace pmsp::io
