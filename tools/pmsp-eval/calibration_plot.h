// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>

#include "pmsp-eval/calibration.h"

namespace pmsp::eval {

/// Median and 90th percentile of the error for each decile of confidence, on a logarithmic scale. Written as PNG,
/// beside the target first. Throws OutputError.
void write_calibration_plot(const std::filesystem::path& path, const Calibration& calibration);

}  // namespace pmsp::eval
