// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "pmsp/types.h"

namespace pmsp::bench {

/// Keyframes with the owner of their images.
struct Flight {
  std::vector<Keyframe> keyframes;
  int image_width = 0;
  int image_height = 0;
  std::shared_ptr<const void> images;
};

/// Renders a sequence in a textured room with one ray per pixel: times do not depend on antialiasing.
Flight render_flight(int image_width, int keyframes);

/// Reads the first keyframes of a map with images, as accepted by the view filter. Throws IoError; InvalidInput if
/// there are fewer than `keyframes`.
Flight read_flight(const std::filesystem::path& map, const std::filesystem::path& images, int keyframes);

}  // namespace pmsp::bench
