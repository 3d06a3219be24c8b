// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "pmsp/api.h"
#include "pmsp/calibration.h"
#include "pmsp/io/depth.h"
#include "pmsp/io/map.h"
#include "pmsp/types.h"

namespace pmsp::io {

/// Depth images from other sources, aligned to the landmarks of their keyframes.
class PMSP_API PriorDepths {
 public:
  PriorDepths() = default;  ///< none
  /// `folder`: of the depth images; "" = those of the map. `images`: image folder. Throws as DepthFolder.
  PriorDepths(const std::filesystem::path& folder, const std::filesystem::path& images, const SlamMap& map);

  bool wanted() const { return folder_ || !of_map_.empty(); }

  /// Sets `keyframe.prior_depth` if the image (ImageSource::Origin::name) has a depth file that fits; valid until the
  /// next call. To be called after all other fields are set.
  void attach(Keyframe& keyframe, const std::filesystem::path& image);

  /// Depth file of an image ("" = none), and other inputs of its values.
  std::filesystem::path file_for(std::int64_t keyframe_id, const std::filesystem::path& image) const;
  std::string unit_text() const;

  /// Numbers of used, missing and rejected files: a line for messages and --stats.
  std::string summary() const;
  nlohmann::ordered_json report() const;

 private:
  struct Outcome {
    std::filesystem::path file;  ///< "" = none
    DepthAlignment alignment;
  };

  std::optional<DepthFolder> folder_;
  std::map<std::int64_t, std::filesystem::path> of_map_;  ///< MapKeyframe::prior_depth, without a folder
  Image<float> depth_;
  std::map<std::int64_t, Outcome> outcomes_;
};

/// Throws InvalidInput unless a depth image is at least 16 x 8 and has, to 1 %, the shape of its image.
PMSP_API void require_shape(const Image<float>& depth, const std::filesystem::path& file, int width, int height);

/// For alignments that fit.
PMSP_API nlohmann::ordered_json to_json(const DepthAlignment& alignment);

}  // namespace pmsp::io
