// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "arguments.h"
#include "pmsp/image.h"
#include "pmsp/io/depth_folder.h"
#include "pmsp/keyframe.h"
#include "pmsp/prior_depth.h"

namespace pmsp::tool {

/// The depth images of --prior-depth, aligned to their keyframes' landmarks.
class PriorDepths {
 public:
  /// Throws as DepthFolder.
  explicit PriorDepths(const Arguments& arguments);

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
nlohmann::ordered_json to_json(const DepthAlignment& alignment);

}  // namespace pmsp::tool
