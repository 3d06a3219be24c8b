// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "pmsp/api.h"
#include "pmsp/types.h"

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

/// A folder of depth images. Those that --depth-maps has written are found by keyframe id, as its index.json tells;
/// others by the name of the keyframe's image: "a/7.jpg" has "a/7.pfm", "a/7.exr", "a/7.npy" or "a/7.png".
class PMSP_API DepthFolder {
 public:
  /// `images`: the folder that images lie in. Throws IoError where there is no such folder; InvalidInput where its
  /// index is broken, or names files that lie elsewhere.
  DepthFolder(const std::filesystem::path& folder, const std::filesystem::path& images);

  /// Whether there is an index.
  bool is_indexed() const { return indexed_; }

  /// Empty where there is none.
  std::filesystem::path file_for(std::int64_t keyframe_id, const std::filesystem::path& image) const;

  /// Depths, or other values; 0 = none. PNGs count in the unit that the index tells, others' in gray levels. Throws
  /// IoError, InvalidInput.
  Image<float> read(const std::filesystem::path& file) const;

  /// What the index tells of a keyframe besides, see DepthMap; empty where it tells nothing. Throws IoError,
  /// InvalidInput.
  Image<Eigen::Vector3f> read_normals(std::int64_t keyframe_id) const;
  Image<float> read_confidence(std::int64_t keyframe_id) const;

  double png_scale() const { return png_scale_; }
  /// The stage that the index says they are of: "raw", "filtered"; "" where it does not say.
  const std::string& kind() const { return kind_; }
  /// DensifierOptions::lens_distance, as the index tells.
  double lens_distance() const { return lens_distance_; }

 private:
  /// Of a keyframe, in the index; empty = not there. An EXR holds all three.
  struct Files {
    std::filesystem::path depth, normal, confidence;
  };
  const Files* files_of(std::int64_t keyframe_id) const;

  std::filesystem::path folder_, images_;
  bool indexed_ = false;
  double png_scale_ = 1.0;
  std::string kind_;
  double lens_distance_ = 0.0;
  std::map<std::int64_t, Files> files_;
};

}  // namespace pmsp
