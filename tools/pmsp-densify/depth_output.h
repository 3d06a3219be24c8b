// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>

#include <nlohmann/json.hpp>

#include "export/atomic_folder.h"
#include "pmsp/io/map.h"
#include "pmsp/types.h"

namespace pmsp::tool {

/// Length of one gray level in the 16-bit PNGs of a mission [scene units]: one for all, so that its pictures compare,
/// and large enough for the farthest depth that is kept.
double png_depth_scale(const SlamMap& map, double range_margin);

/// In which formats depth, normals and confidence are written.
struct DepthFormats {
  bool pfm = true, exr = false, png = false;
  bool depth_png = true;  ///< of depth alone
};

/// "pfm,exr,png" or some of them. Throws UsageError.
DepthFormats depth_formats_from(const std::string& list);

/// Writes depth maps as files into a folder: depth_, normal_, confidence_%06d.pfm or .png, depth_%06d.exr, numbered by
/// keyframe id, and index.json. Throws OutputError.
class DepthMapFolder {
 public:
  /// What the index says of all maps.
  struct About {
    std::string kind;              ///< "raw" or "filtered"
    double png_scale = 1.0;        ///< see png_depth_scale
    double lens_distance = 0.0;    ///< see DensifierOptions
    nlohmann::ordered_json cloud;  ///< frame of the cloud
  };
  DepthMapFolder(const std::filesystem::path& folder, const SlamMap& map, const DepthFormats& formats,
                 const About& about);

  void write(const DepthMap& map);

  /// After the last map.
  void write_index() const;
  /// Puts the folder in its place.
  void commit() { folder_.commit(); }

 private:
  AtomicFolder folder_;
  const SlamMap& slam_map_;
  double png_scale_;
  DepthFormats formats_;
  nlohmann::ordered_json index_;
};

/// Whether DepthMapFolder writes files of that name.
bool is_depth_map_file(const std::string& name);

/// `json`, indented, for people as well.
std::string json_text(const nlohmann::ordered_json& json);

}  // namespace pmsp::tool
