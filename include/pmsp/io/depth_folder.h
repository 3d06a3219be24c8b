// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>

#include <Eigen/Core>

#include "pmsp/api.h"
#include "pmsp/image.h"

namespace pmsp {

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
