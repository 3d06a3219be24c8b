// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "pmsp/api.h"
#include "pmsp/types.h"

namespace pmsp {

/// PFM: ASCII header "Pf" (one channel) or "PF" (three), size, scale -1 (little endian), then float32 rows from bottom
/// to top. Both byte orders can be read; the magnitude of the scale is ignored. Files of this header are written under
/// a temporary name and renamed. Throw OutputError or IoError, InvalidInput.
PMSP_API void write_pfm(const std::filesystem::path& path, const Image<float>& image);
PMSP_API void write_pfm(const std::filesystem::path& path, const Image<Eigen::Vector3f>& image);
PMSP_API Image<float> read_pfm(const std::filesystem::path& path);
PMSP_API Image<Eigen::Vector3f> read_pfm3(const std::filesystem::path& path);

/// Writes a 16-bit gray PNG of `image * scale`, rounded; 0 for 0 and values out of range.
PMSP_API void write_png16(const std::filesystem::path& path, const Image<float>& image, double scale);

/// Writes a 16-bit RGB PNG of unit vectors: round(((x, y, z) + 1) / 2 * 65535); (0, 0, 0) for the zero vector.
PMSP_API void write_png16(const std::filesystem::path& path, const Image<Eigen::Vector3f>& normals);

/// Channel of an EXR.
struct ImageChannel {
  std::string name;  ///< 1 to 31 letters
  Image<float> values;
};

/// Writes an uncompressed OpenEXR with float32 channels, rows from top to bottom.
PMSP_API void write_exr(const std::filesystem::path& path, std::vector<ImageChannel> channels);

/// Writes depth, normals and confidence as channels Z, N.X, N.Y, N.Z and confidence.
PMSP_API void write_depth_exr(const std::filesystem::path& path, const DepthMap& map);

/// Reads the existing ones of `names`, half or float, from an OpenEXR of scan lines, uncompressed or ZIP. Throws
/// IoError, InvalidInput.
PMSP_API std::vector<ImageChannel> read_exr(const std::filesystem::path& path, const std::vector<std::string>& names);

/// Reads three channels of an OpenEXR as vectors; empty unless all exist. Throws as read_exr.
PMSP_API Image<Eigen::Vector3f> read_exr_vectors(const std::filesystem::path& path,
                                                 const std::array<std::string, 3>& names);

/// Reads the only channel of an OpenEXR, the first named Z, depth, Y or V (Blender) in this order, or R, G and B if
/// they are equal. Throws IoError, InvalidInput.
PMSP_API Image<float> read_exr_depth(const std::filesystem::path& path);

/// Reads a two-dimensional NumPy array of little-endian float16, float32 or float64. Throws IoError, InvalidInput.
PMSP_API Image<float> read_npy(const std::filesystem::path& path);

/// Returns the values of a 16-bit or 8-bit gray PNG times `scale`. Throws IoError, InvalidInput.
PMSP_API Image<float> read_png16(const std::filesystem::path& path, double scale);

/// Reads the unit vectors of write_png16. Throws IoError, InvalidInput.
PMSP_API Image<Eigen::Vector3f> read_png16_normals(const std::filesystem::path& path);

/// Directory of depth images, found by keyframe id in the index.json of --depth-maps, else by the name of the image:
/// "a/7.pfm", "a/7.exr", "a/7.npy" or "a/7.png" for "a/7.jpg".
class PMSP_API DepthFolder {
 public:
  /// `images`: directory of the images. Throws IoError if `folder` does not exist; InvalidInput if its index is damaged
  /// or refers to files outside of it.
  DepthFolder(const std::filesystem::path& folder, const std::filesystem::path& images);

  bool is_indexed() const { return indexed_; }  ///< whether there is an index.json

  /// Returns the depth image of a keyframe, "" if none.
  std::filesystem::path file_for(std::int64_t keyframe_id, const std::filesystem::path& image) const;

  /// Returns depths or other values, 0 = none; of PNGs without index gray levels. Throws IoError, InvalidInput.
  Image<float> read(const std::filesystem::path& file) const;

  /// Return normals and confidence from the index, see DepthMap; empty = none. Throw IoError, InvalidInput.
  Image<Eigen::Vector3f> read_normals(std::int64_t keyframe_id) const;
  Image<float> read_confidence(std::int64_t keyframe_id) const;

  // Of the index.
  double png_scale() const { return png_scale_; }          ///< depth of a gray level
  const std::string& kind() const { return kind_; }        ///< stage of the depth maps: "raw", "filtered", "" = unknown
  double lens_distance() const { return lens_distance_; }  ///< see DensifierOptions

 private:
  /// Files of a keyframe in the index; empty = none. An EXR contains all three.
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
