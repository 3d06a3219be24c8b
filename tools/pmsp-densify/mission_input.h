// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <memory>

#include "arguments.h"
#include "export/cloud_frame.h"
#include "io/mission.h"
#include "mask_report.h"
#include "pmsp/io/images.h"
#include "progress.h"
#include "time_account.h"

namespace pmsp::tool {

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

  /// Opens --prior-depth. Throws as DepthFolder.
  void open_prior_depths();

  /// Returns the frame of the cloud. Throws as find_cloud_frame.
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
