// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>

#include <opencv2/core.hpp>

namespace pmsp::eval {

/// Writes a whole PNG, beside the target first. Throws OutputError.
void write_png(const std::filesystem::path& path, const cv::Mat& image);

/// 0.05 as "5 %".
std::string percent(double share);

}  // namespace pmsp::eval
