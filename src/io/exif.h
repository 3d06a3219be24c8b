// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

namespace pmsp::io {

/// Position on earth (WGS 84).
struct GpsPosition {
  double latitude_deg = 0.0;   ///< north, -90 to 90
  double longitude_deg = 0.0;  ///< east, -180 to 180
  double altitude_m = 0.0;
};

/// Metadata of an image file (Exif 2.32, CIPA DC-008).
struct Exif {
  int orientation = 1;  ///< 1 to 8; 1 = upright
  std::optional<GpsPosition> gps;
};

/// Reads the EXIF data of a JPEG (APP1 segment), PNG (eXIf chunk) or TIFF file (orientation is left to OpenCV).
/// Missing, broken or out-of-range values give the defaults.
Exif read_exif(const std::vector<std::uint8_t>& bytes);

/// As above, from a file; reads at most the first 1 MiB, up to the pixels, and the tags of a TIFF file. Throws IoError.
Exif read_exif(const std::filesystem::path& path);

}  // namespace pmsp::io
