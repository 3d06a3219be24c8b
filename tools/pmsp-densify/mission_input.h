// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "arguments.h"
#include "image_input.h"
#include "mask_report.h"
#include "pmsp/io/cloud_frame.h"
#include "pmsp/io/convention.h"
#include "pmsp/io/image_source.h"
#include "pmsp/io/map.h"
#include "pmsp/io/mask.h"
#include "pmsp/io/pairing.h"
#include "progress.h"
#include "time_account.h"

namespace pmsp::tool {

/// Inputs of a mission and their checks: what `run`, a shard, `fuse` and `info` do before the first depth map, in the
/// order of the functions. Warnings go to the progress.
class MissionInput {
 public:
  /// `arguments` and `progress` must outlive it. `time`: account of the calling thread; nullptr = none.
  MissionInput(const Arguments& arguments, Progress& progress, TimeAccount* time = nullptr)
      : arguments_(arguments), progress_(progress), time_(time) {}

  /// Reads the map and checks its conventions. Throws as pmsp::read_map and require_convention.
  void read_map();

  /// Opens --images or --video, and the masks. Throws as open_image_folder, open_video and MaskSource.
  void open_images();

  /// Compares the poses with the images where the map proves nothing of them, and makes landmarks from the images for a
  /// map without any. `threads`: 0 = all. Throws InvalidInput where poses or points do not fit the images.
  void check_poses(int threads);

  /// Returns the frame of the cloud. Throws as find_cloud_frame.
  CloudFrame find_frame() const;

  /// Emits the counts of map and images, remarks, and a line for each keyframe without an image.
  void announce() const;

  /// Result of check_images().
  struct ImageCheck {
    ImageSize size;                                   ///< of the first image
    std::optional<PairingVerifier::Verdict> pairing;  ///< none with --no-verify
    std::vector<SkippedKeyframe> skipped;             ///< without an image, or with one that cannot be decoded
  };
  /// Decodes images in order until the pairing check is clear, or all: what a run finds out on its way. Throws
  /// InvalidInput where the images belong to other keyframes, IoError where none can be decoded.
  ImageCheck check_images(int threads) const;

  SlamMap map;
  ConventionCheck convention;           ///< of the map; empty with --no-verify
  std::unique_ptr<ImageSource> images;  ///< nullptr before open_images(), and where neither option is given
  std::unique_ptr<MaskSource> masks;    ///< nullptr before open_images()
  MaskReport mask_report;
  std::vector<std::string> remarks;  ///< on the map, sentences for people

 private:
  const Arguments& arguments_;
  Progress& progress_;
  TimeAccount* const time_;
};

/// Warning of a verdict; "" = none. `saw_all`: no more images will come, so that an open verdict stays open.
std::string warning_of(const PairingVerifier::Verdict& pairing, bool saw_all);

}  // namespace pmsp::tool
