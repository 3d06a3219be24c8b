// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

namespace pmsp::io {

/// A place on earth, WGS 84.
struct GpsPosition {
  double latitude_deg = 0.0;   ///< north, -90 to 90
  double longitude_deg = 0.0;  ///< east, -180 to 180
  double altitude_m = 0.0;
};

/// What an image file says of itself (Exif 2.32, CIPA DC-008).
struct Exif {
  int orientation = 1;  ///< 1 to 8; 1 = as it is
  std::optional<GpsPosition> gps;
};

/// Of the bytes of a JPEG (its APP1 segment), a PNG (its eXIf chunk) or a TIFF file, of which OpenCV applies the
/// orientation itself. What is missing, broken or out of range is taken as not said.
Exif read_exif(const std::vector<std::uint8_t>& bytes);

/// The same of a file, of which only what lies before the pixels is read, 1 MiB at most, and of a TIFF file its tags.
/// Throws IoError.
Exif read_exif(const std::filesystem::path& path);

}  // namespace pmsp::io
