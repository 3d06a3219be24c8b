// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>

#include <opencv2/core.hpp>

namespace pmsp::eval {

/// Writes a PNG atomically. Throws OutputError.
void write_png(const std::filesystem::path& path, const cv::Mat& image);

/// Returns "5 %" for 0.05.
std::string percent(double share);

}  // namespace pmsp::eval
