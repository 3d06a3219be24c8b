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

/// Depth images from other sources, aligned to the landmarks of their keyframes.
class PMSP_API PriorDepths {
 public:
  PriorDepths() = default;  ///< none
  /// `folder`: of the depth images; "" = none. `images`: image folder. Throws as DepthFolder.
  PriorDepths(const std::filesystem::path& folder, const std::filesystem::path& images);

  bool wanted() const { return folder_.has_value(); }

  /// Sets `keyframe.prior_depth` if the image has a depth file that fits; valid until the next call. To be called after
  /// all other fields are set.
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
  Image<float> depth_;
  std::map<std::int64_t, Outcome> outcomes_;
};

/// For alignments that fit.
PMSP_API nlohmann::ordered_json to_json(const DepthAlignment& alignment);

}  // namespace pmsp::io
