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
#include "pmsp/types.h"

namespace pmsp::io {

/// Depth images from elsewhere, aligned to their keyframes' landmarks.
class PMSP_API PriorDepths {
 public:
  PriorDepths() = default;  ///< none
  /// `folder`: of the depth images; "" = there are none. `images`: the folder of the images. Throws as DepthFolder.
  PriorDepths(const std::filesystem::path& folder, const std::filesystem::path& images);

  bool wanted() const { return folder_.has_value(); }

  /// Sets `keyframe.prior_depth`, if the image's depth is there and fits; it stays until the next call. To be called
  /// when all else of the keyframe is set.
  void give(Keyframe& keyframe, const std::filesystem::path& image);

  /// The file of an image, and what else its values depend on; "" = there is none.
  std::filesystem::path file_for(std::int64_t keyframe_id, const std::filesystem::path& image) const;
  std::string unit_text() const;

  /// What became of those that were asked for: a line for people, and for --stats.
  std::string summary() const;
  nlohmann::ordered_json report() const;

 private:
  struct Outcome {
    std::filesystem::path file;  ///< empty = none
    DepthAlignment alignment;
  };

  std::optional<DepthFolder> folder_;
  Image<float> depth_;
  std::map<std::int64_t, Outcome> outcomes_;
};

/// Of one that fits.
PMSP_API nlohmann::ordered_json to_json(const DepthAlignment& alignment);

}  // namespace pmsp::io
