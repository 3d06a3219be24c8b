// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>

#include "pmsp-eval/calibration.h"

namespace pmsp::eval {

/// Writes a PNG of median and 90th percentile of the error per decile of confidence, logarithmic. Atomic. Throws
/// OutputError.
void write_calibration_plot(const std::filesystem::path& path, const Calibration& calibration);

}  // namespace pmsp::eval
