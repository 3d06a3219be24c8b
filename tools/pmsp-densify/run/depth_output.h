// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>

#include <nlohmann/json.hpp>

#include "arguments.h"
#include "export/atomic_folder.h"
#include "pmsp/io/map.h"
#include "pmsp/types.h"

namespace pmsp::tool {

/// Returns the step of gray levels in the 16-bit PNGs of a mission [map units]: common to all images for comparison,
/// and covering the maximum depth.
double png_depth_scale(const SlamMap& map, double range_margin);

/// Folder of depth maps: depth_, normal_, confidence_%06d.pfm or .png, depth_%06d.exr, numbered by keyframe id, and
/// index.json. Throws OutputError.
class DepthMapFolder {
 public:
  /// Common metadata of the index.
  struct About {
    std::string kind;              ///< "raw" or "filtered"
    double png_scale = 1.0;        ///< see png_depth_scale
    double lens_distance = 0.0;    ///< see DensifierOptions
    nlohmann::ordered_json cloud;  ///< frame of the cloud
  };
  DepthMapFolder(const std::filesystem::path& folder, const SlamMap& map, const DepthFormats& formats,
                 const About& about);

  void write(const DepthMap& map);

  /// To be called after the last map.
  void write_index() const;
  /// Moves the folder to its final name.
  void commit() { folder_.commit(); }

 private:
  AtomicFolder folder_;
  const SlamMap& slam_map_;
  double png_scale_;
  DepthFormats formats_;
  nlohmann::ordered_json index_;
};

/// True for file names of DepthMapFolder.
bool is_depth_map_file(const std::string& name);

}  // namespace pmsp::tool
