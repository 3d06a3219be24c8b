// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "pmsp/io/cloud.h"

namespace pmsp {

/// Depth images of a dataset, in its folders depths, normals and confidences: 16-bit PNGs, and EXRs with all three in
/// depths. Named as the images; until these are known, by keyframe id.
class DatasetDepthFiles {
 public:
  /// `scale`: of the map unit [unit of the file].
  DatasetDepthFiles(const std::filesystem::path& folder, const DatasetDepth& options, double scale);

  /// Whether an entry of a dataset belongs to this.
  static bool is_name(const std::string& name) {
    return name == "depths" || name == "normals" || name == "confidences" || name == "depths.json";
  }

  /// Writes the files of a keyframe. Throws OutputError.
  void add(const DepthMap& map);
  /// Names the files as the images. Images without depth map get empty files: nerfstudio requires a file for all.
  void finish(const std::vector<OutputView>& views);
  /// Whether there are files.
  bool is_there() const { return !stems_.empty(); }

  /// Paths of a view's files, relative to the dataset.
  nlohmann::ordered_json files_of(const OutputView& view) const;
  /// Meaning of the values.
  nlohmann::ordered_json description() const;

  /// Removes files of earlier runs beside those of `files` (nullptr = none).
  static void remove_stale(const std::filesystem::path& folder, const std::vector<OutputView>& views,
                           const DatasetDepthFiles* files);

 private:
  struct Size {
    int width = 0, height = 0;
  };
  void write(const std::string& stem, const DepthMap& map) const;
  std::vector<std::string> names_of(const std::string& stem) const;
  DepthMap from_centre(const DepthMap& map) const;

  std::filesystem::path folder_;
  DatasetDepth options_;
  double scale_;
  Size size_;                                  ///< of the last depth map
  std::set<std::int64_t> written_;             ///< keyframes with files
  std::map<std::int64_t, std::string> stems_;  ///< names of the views' files without extension
};

}  // namespace pmsp
