// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>

#include "pmsp-synth/slam_map.h"
#include "synth/mission.h"

namespace pmsp::synth_tool {

struct MissionFilesOptions {
  std::filesystem::path folder;
  bool overwrite = false;       ///< allows writing into a non-empty folder
  std::int64_t frame_step = 1;  ///< keyframe i is frame i x frame_step of the "video"
  int jpeg_quality = 0;         ///< 1 to 100; 0 = PNG
  double mask_nadir_deg = 0.0;  ///< radius of the rig below the camera in images and mask.png; 0 = none
  SlamMapOptions map;
};

/// Writes a PNG, or for `jpeg_quality` 1 to 100 a JPEG. Throws OutputError.
void write_image(const std::filesystem::path& path, const Image<Rgb>& image, int jpeg_quality = 0);

/// Draws the rig into images, truth and Mission::mask: dark, of unknown range.
void add_rig(synth::Mission& mission, double radius_deg);

/// Throws OutputError if the path is not a folder, or a non-empty one without `overwrite`. Read-only.
void check_folder(const MissionFilesOptions& options);

/// Creates the folder, removes frames of an earlier mission and writes images/, map.msg, gt/traj_tum.txt, gt/range_mm/
/// and, if any, gt/label/ and mask.png. One unit of the scene is one metre. Throws OutputError.
void write_mission(synth::Mission& mission, const MissionFilesOptions& options);

}  // namespace pmsp::synth_tool
