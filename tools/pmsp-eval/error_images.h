// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>

#include "pmsp/types.h"

namespace pmsp::eval {

/// Pictures for eyes, each with a legend below it. Written as PNG, beside the target first. Throw OutputError.

/// A view of the cloud: green = hit and right, red = hit and wrong, blue = hit where the truth is unknown, black = no
/// hit. Green darkens and red brightens with the error. `error` as from relative_error, or empty.
void write_view_image(const std::filesystem::path& path, const Image<float>& range, const Image<float>& error,
                      double max_relative_error);

/// Relative error of a depth map on a logarithmic scale from 0.1 % (blue) to 10 % (red); black = no estimate or no
/// truth. Shown with `width` x `width / 2` pixels.
void write_depth_error_image(const std::filesystem::path& path, const Image<float>& error, int width);

}  // namespace pmsp::eval
