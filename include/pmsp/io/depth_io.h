// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "pmsp/api.h"
#include "pmsp/depth_map.h"
#include "pmsp/image.h"

namespace pmsp {

/// PFM: ASCII header "Pf" (one channel) or "PF" (three), size, scale -1 (little endian), then float32 rows from the
/// bottom row of the image to the top one. Reading takes either byte order; the size of the scale is not applied. All
/// files are written beside their target and renamed. Throw OutputError / IoError / InvalidInput.
PMSP_API void write_pfm(const std::filesystem::path& path, const Image<float>& image);
PMSP_API void write_pfm(const std::filesystem::path& path, const Image<Eigen::Vector3f>& image);
PMSP_API Image<float> read_pfm(const std::filesystem::path& path);
PMSP_API Image<Eigen::Vector3f> read_pfm3(const std::filesystem::path& path);

/// 16-bit gray PNG of `image * scale`, rounded, 0 for 0 and for what does not fit.
PMSP_API void write_png16(const std::filesystem::path& path, const Image<float>& image, double scale);

/// 16-bit RGB PNG of unit vectors: red, green and blue are round(((x, y, z) + 1) / 2 * 65535), all 0 for a vector of 0.
PMSP_API void write_png16(const std::filesystem::path& path, const Image<Eigen::Vector3f>& normals);

/// One of the channels of an EXR.
struct ImageChannel {
  std::string name;  ///< 1 to 31 letters
  Image<float> values;
};

/// OpenEXR with float32 channels, not compressed, rows from the top to the bottom.
PMSP_API void write_exr(const std::filesystem::path& path, std::vector<ImageChannel> channels);

/// The channels of an OpenEXR file that have one of these names, half or float; scan lines, not compressed or ZIP.
/// Throws IoError, InvalidInput.
PMSP_API std::vector<ImageChannel> read_exr(const std::filesystem::path& path, const std::vector<std::string>& names);

/// Its depth: the only channel, or the one named Z, depth or Y, likewise.
PMSP_API Image<float> read_exr_depth(const std::filesystem::path& path);

/// An array of NumPy with rows and columns of little-endian float16, float32 or float64. Throws IoError, InvalidInput.
PMSP_API Image<float> read_npy(const std::filesystem::path& path);

/// Raw values of a 16-bit (or 8-bit) gray PNG times `scale`.
PMSP_API Image<float> read_png16(const std::filesystem::path& path, double scale);

/// Unit vectors as write_png16 puts them. Throws IoError, InvalidInput.
PMSP_API Image<Eigen::Vector3f> read_png16_normals(const std::filesystem::path& path);

}  // namespace pmsp
