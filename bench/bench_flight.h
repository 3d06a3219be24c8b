// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "pmsp/types.h"

namespace pmsp::bench {

/// Keyframes, and what their images point to.
struct Flight {
  std::vector<Keyframe> keyframes;
  int image_width = 0;
  int image_height = 0;
  std::shared_ptr<const void> images;
};

/// A flight through a textured room, rendered with one ray a pixel: times do not depend on how well edges look.
Flight render_flight(int image_width, int keyframes);

/// The first keyframes of a map whose images are found, one after the other as the view filter accepts them.
/// Throws IoError, and InvalidInput when there are fewer than `keyframes`.
Flight read_flight(const std::filesystem::path& map, const std::filesystem::path& images, int keyframes);

}  // namespace pmsp::bench
