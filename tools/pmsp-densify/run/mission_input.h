// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "arguments.h"
#include "export/cloud_frame.h"
#include "io/mission.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"
#include "progress.h"
#include "workspace/workspace.h"

namespace pmsp::tool {

/// Reads the map of the arguments. Throws as pmsp::read_map.
SlamMap read_map(const Arguments& arguments);

/// Returns keyframes by timestamp, then id.
std::vector<const MapKeyframe*> in_time_order(const SlamMap& map);

/// Without --images and --video: adds the image folder or video named in the map, if it exists.
Arguments with_images(const Arguments& arguments, const SlamMap& map);

/// As above. Throws UsageError if the map names none.
Arguments with_needed_images(const Arguments& arguments);

/// Returns the frame of the cloud. Throws as find_cloud_frame.
CloudFrame find_frame(const Arguments& arguments, const SlamMap& map, const ImageSource& images);

/// Opens --images or --video; nullptr without either.
std::unique_ptr<ImageSource> open_images(const Arguments& arguments, const SlamMap& map);

/// Returns the options --mask, --mask-nadir, --mask-zenith and --no-masks, and the masks named in the map.
MaskOptions mask_options(const Arguments& arguments, const SlamMap& map, const ImageSource& source);

/// Returns the common masks of all images as text that changes with them. "" = none.
std::string masks_text(const Arguments& arguments, workspace::Workspace& workspace);

/// Sources and hidden share of a mission's masks.
struct MaskReport {                   // NOLINT(bugprone-exception-escape): a JSON value is assigned by value
  std::string text;                   ///< for messages; "" = no mask
  std::vector<std::string> warnings;  ///< probable mistakes
  nlohmann::ordered_json json;        ///< for --stats; null = no mask
};

/// Mission selected by the arguments. Warnings go to `progress`.
class MissionInput : public io::Mission {
 public:
  /// `arguments` and `progress` must outlive it. `threads`: 0 = one for each CPU. `time`: account of the calling
  /// thread; nullptr = none.
  MissionInput(const Arguments& arguments, Progress& progress, int threads, TimeAccount* time = nullptr);

  /// Reads the map and checks its conventions. Throws as pmsp::read_map and require_convention.
  void read_map();

  /// Opens --images or --video, and the masks. Throws as open_image_folder, open_video and MaskSource.
  void open_images();

  /// As Mission::check_poses; warns where no landmarks are found.
  void check_poses();

  /// Opens --prior-depth, or the depth that the map names. Throws as DepthFolder.
  void open_prior_depths();

  /// As above, of this mission.
  CloudFrame find_frame() const;

  /// Emits the counts of map and images, remarks, and a line for each keyframe without an image.
  void announce() const;

  MaskReport mask_report;

 private:
  const Arguments& arguments_;
  Progress& progress_;
  TimeAccount* const time_;
  std::unique_ptr<ImageSource> opened_images_;
  std::unique_ptr<MaskSource> opened_masks_;
};

}  // namespace pmsp::tool
