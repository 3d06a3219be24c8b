// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>

#include "pmsp-synth/slam_map.h"
#include "synth/mission.h"

namespace pmsp::synth_tool {

struct MissionFilesOptions {
  std::filesystem::path folder;
  bool overwrite = false;       ///< write into a folder that holds files already
  std::int64_t frame_step = 1;  ///< keyframe i is frame i x frame_step of the "video"
  int jpeg_quality = 0;         ///< 1 to 100; 0 = PNG
  double mask_nadir_deg = 0.0;  ///< radius of the rig below the camera that images show and mask.png hides; 0 = none
  SlamMapOptions map;
};

/// Paints the rig into images, truth and Mission::mask: dark, without a known range.
void add_rig(synth::Mission& mission, double radius_deg);

/// Throws OutputError when the folder's name is taken, or it holds files and must not be written to. Changes nothing.
void check_folder(const MissionFilesOptions& options);

/// Makes the folder, removes the frames of an earlier mission and writes images/, map.msg, gt/traj_tum.txt,
/// gt/range_mm/ and, where there are any, gt/label/ and mask.png. One unit of the scene is one metre of the truth.
/// Throws OutputError.
void write_mission(synth::Mission& mission, const MissionFilesOptions& options);

}  // namespace pmsp::synth_tool
