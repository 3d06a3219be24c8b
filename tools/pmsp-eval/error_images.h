// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>

#include "pmsp/types.h"

namespace pmsp::eval {

/// Images for visual inspection, with a legend. Written as PNG, atomically. Throw OutputError.

/// View of the cloud: green = correct hit, red = wrong hit, blue = hit with unknown truth, black = no hit. Green
/// darkens and red brightens with the error. `error`: of relative_error, or empty.
void write_view_image(const std::filesystem::path& path, const Image<float>& range, const Image<float>& error,
                      double max_relative_error);

/// Relative error of a depth map, logarithmic from 0.1 % (blue) to 10 % (red); black = no estimate or no truth. Size
/// `width` x `width / 2`.
void write_depth_error_image(const std::filesystem::path& path, const Image<float>& error, int width);

}  // namespace pmsp::eval
