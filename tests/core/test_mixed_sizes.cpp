// SPDX-License-Identifier: BSD-2-Clause
// Images of two cameras in one mission.
#include <catch2/catch.hpp>
#include <cmath>

#include "core/recording.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

/// White except for the columns of a share of the width.
Image<std::uint8_t> mask_of(const synth::Frame& frame, double from, double to) {
  const int width = frame.image.width();
  Image<std::uint8_t> mask(width, frame.image.height(), 255);
  for (int y = 0; y < mask.height(); ++y) {
    for (int x = 0; x < width; ++x) {
      const double at = (x + 0.5) / width;
      if (at >= from && at < to) mask(x, y) = 0;
    }
  }
  return mask;
}

}  // namespace

TEST_CASE("Images of two sizes with separate masks make one cloud", "[densifier]") {
  const synth::Mission& small = test_flight();
  const synth::Mission large = synth::empty_room(small_recipe(2 * kFlightWidth, 7));
  REQUIRE(small.frames.size() == large.frames.size());
  const auto fly = [&](const synth::Mission& even, const synth::Mission& odd) {
    Recording recording;
    Densifier densifier(fast_options(), recording.callbacks());
    for (std::size_t i = 0; i < small.frames.size(); ++i) {
      const synth::Mission& mission = i % 2 == 0 ? even : odd;
      Keyframe keyframe = synth::keyframe_of(mission, i);
      keyframe.id = small.frames[i].id;
      keyframe.landmarks = small.frames[i].landmarks;
      const Image<std::uint8_t> mask =
          i % 2 == 0 ? mask_of(mission.frames[i], 0.0, 0.125) : mask_of(mission.frames[i], 0.75, 0.875);
      keyframe.mask = mask.view();
      densifier.add(keyframe);
    }
    densifier.flush();
    return recording;
  };
  const Recording mixed = fly(small, large);
  const Recording of_one = fly(small, small);
  REQUIRE(mixed.raw.size() == of_one.raw.size());
  REQUIRE(mixed.raw.size() == small.frames.size());
  for (const DepthMap& map : mixed.raw) {
    CAPTURE(map.keyframe_id);
    REQUIRE(map.depth.width() == kFlightWidth);
    const bool is_small = map.keyframe_id % 2 == small.frames[0].id % 2;
    const int from = is_small ? 0 : 3 * kFlightWidth / 4;
    int masked = 0, wrapped_pixel = 0;
    for (int y = 0; y < kFlightHeight; ++y) {
      for (int x = 0; x < kFlightWidth / 8; ++x) {
        masked += map.depth(from + x, y) > 0.0F;
        wrapped_pixel += map.depth(from + kFlightWidth / 8 + x, y) > 0.0F;
      }
    }
    CHECK(masked == 0);
    CHECK(wrapped_pixel > kFlightWidth / 8 * kFlightHeight / 2);
  }
  // As many and as accurate points as with one size.
  CHECK(static_cast<double>(mixed.points()) > 0.9 * static_cast<double>(of_one.points()));
  if (kSanitized) return;  // a tiny mission has a few hundred points, too few to measure accuracy
  CHECK(points_on_surface(small.scene, mixed.clouds, 0.05) >
        points_on_surface(small.scene, of_one.clouds, 0.05) - 0.02);
}
