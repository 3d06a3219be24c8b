// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "pmsp/io/images.h"
#include "pmsp/io/map.h"
#include "pmsp/types.h"
#include "support/temp_dir.h"

namespace pmsp::test {

using pmsp_test::TempDir;

/// A keyframe of a hand-made map: its id, its timestamp and the frame of the flight that the camera saw there.
struct Shot {
  std::int64_t id = 0;
  double timestamp = 0.0;
  int frame = 0;
};

/// A map without landmarks: pairing has nothing but the names. The camera is 64x32 at 10 fps.
SlamMap bare_map(const std::vector<Shot>& shots);

/// One gray level per frame, so that a test can identify the frame.
void write_gray_frame(const std::filesystem::path& path, int frame);
int gray_frame(const Image<Rgb>& image);

constexpr int kRoomWidth = 320;

/// Panorama at a frame of a flight through a textured room, `width` x `width` / 2. `tile`: period of the texture in
/// each direction [map units]; 0 = not periodic.
Image<Rgb> render_room(int frame, int width = kRoomWidth, double tile = 0.0);
cv::Mat bgr_of(const Image<Rgb>& image);
void write_image(const std::filesystem::path& path, const Image<Rgb>& image);

/// Inserts XMP data into a JPEG.
void add_xmp(const std::filesystem::path& path, const std::string& xmp);

/// The map of that flight, landmarks on the walls observed where they project to. The camera is 320x160 at 10 fps.
SlamMap room_map(const std::vector<Shot>& shots);

/// Reads all images; the keyframe ids in the order in which they came, and for write_gray_frame's images the frames.
struct Drained {
  std::vector<std::int64_t> ids;
  std::vector<int> frames;
};
Drained drain(ImageSource& source);

/// Reason for which a keyframe was skipped; "" when it was not.
std::string skip_reason(const ImageSource& source, std::int64_t id);

}  // namespace pmsp::test
