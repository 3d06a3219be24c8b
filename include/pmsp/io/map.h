// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "pmsp/api.h"
#include "pmsp/types.h"

namespace pmsp {

/// An equirectangular camera of a SLAM map.
struct MapCamera {
  std::string name;
  int width = 0;     ///< size of the images that the SLAM saw [px]
  int height = 0;    ///< [px]
  double fps = 0.0;  ///< as configured in the SLAM, not read from the video [1/s]
};

/// One sighting of a landmark.
struct MapObservation {
  std::int64_t landmark_id = 0;
  /// Where the keypoint lies in the image [px], x right, y down, origin at the upper left corner of the image, so that
  /// the centre of the first pixel is (0.5, 0.5) (the half pixel is added to what the file holds). In
  /// PatchMatch-Stereo-Panorama's files of dense points, whose keypoints count pixels of its depth maps, it is where
  /// the landmark projects to.
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();
};

/// A keyframe as the file has it.
struct MapKeyframe {
  std::int64_t id = 0;
  double timestamp = 0.0;  ///< what the SLAM was fed [s]
  std::optional<std::int64_t>
      source_frame;               ///< index of the frame among those fed; only in maps before stella_vslam 0.3.6
  int camera = 0;                 ///< index into SlamMap::cameras
  RigidTransform cam_from_world;  ///< for pixel centres at index + 0.5, see SlamMap
  std::string image;              ///< its image in the image folder, "left/0001.jpg"; "" = the file names none
  std::filesystem::path mask;     ///< file of its mask, as nerfstudio names it; "" = the file names none
  std::vector<MapObservation> observations;  ///< of landmarks that exist in the map, each once
};

/// A sparse point of the map.
struct MapLandmark {
  std::int64_t id = 0;
  Eigen::Vector3d position_world = Eigen::Vector3d::Zero();  ///< [scene units]
};

/// What a SLAM or a reconstruction left: cameras, keyframes and landmarks, without descriptors.
///
/// The SLAM programs and openMVG put the centre of the first pixel at 0 where this library puts it at 0.5. In longitude
/// that is a constant turn of the camera by half a pixel, which their poses have absorbed; the readers turn it back
/// (cam_from_world = Ry(+pi / width) * cam_from_world of the file). In latitude half a pixel remains in the landmarks.
/// Nothing outside the readers knows of the offset.
struct PMSP_API SlamMap {
  std::filesystem::path path;
  std::string format;                     ///< for people, e.g. "stella_vslam >= 0.3.6, MessagePack"
  std::vector<MapCamera> cameras;         ///< ascending name, unique
  std::vector<MapKeyframe> keyframes;     ///< ascending id, unique
  std::vector<MapLandmark> landmarks;     ///< ascending id, unique
  std::size_t observations_skipped = 0;   ///< they name landmarks that are not in the map
  std::size_t observations_repeated = 0;  ///< the same landmark more than once in one keyframe; the first one is kept
  std::filesystem::path images;           ///< folder that `MapKeyframe::image` counts from; "" = the file does not say

  /// A file may hold several components (chunks) that have no common frame. One is read; its number counts from 0.
  int component = 0;
  std::vector<std::size_t> component_keyframes{};  ///< keyframes of each component, at least one entry

  bool half_row_may_remain = false;     ///< pixel centres are at whole numbers in the file, see above
  bool observations_are_tested = true;  ///< false: the file does not say who sees what; observations are projections
  bool ids_are_row_numbers = false;     ///< the file has no ids; images are never paired by them
  std::vector<std::string> notes{};     ///< what was left out, and why; sentences for people

  /// nullptr when there is no such id.
  const MapLandmark* find_landmark(std::int64_t id) const;
  const MapKeyframe* find_keyframe(std::int64_t id) const;
};

/// What read_map may be told besides the path.
struct ReadMapOptions {
  std::optional<int> component;  ///< the one to read; nullopt = that of most keyframes
  std::filesystem::path points;  ///< PLY file whose points stand in for landmarks where the map has none
  /// Names the keyframes' images: lines "timestamp name", or "name" for each keyframe in the order of ids.
  std::filesystem::path image_list;
  /// Text or YAML file with the transform from the body (an IMU, a base) whose poses a trajectory holds to the camera:
  /// 12 or 16 numbers, rows of a matrix; 7, tx ty tz qx qy qz qw; or T_cam_imu of Kalibr, T_BS of EuRoC, body_T_cam0 of
  /// VINS. Other maps hold poses of cameras.
  std::filesystem::path camera_from_body{};
};

/// Reads the map of a SLAM or the reconstruction of another program. The format is told by content, never by the name:
/// - OpenVSLAM and stella_vslam: MessagePack of every version up to 0.6, or SQLite;
/// - COLMAP: the folder of a model, text or binary, or the folder of such folders, one a component;
/// - OpenSfM: reconstruction.json, with observations where tracks.csv lies beside it;
/// - openMVG: sfm_data.json; nerfstudio: transforms.json; Metashape: cameras as XML;
/// - AliceVision: cameras.sfm;
/// - a trajectory, world from camera: TUM, "timestamp tx ty tz qx qy qz qw"; EuRoC and VINS, nanoseconds and w first;
///   KITTI, 12 numbers without a time; a table whose first line names its columns.
///
/// Cameras that are not equirectangular, and keyframes and points with NaN, are left out with a note. Quaternions are
/// normalised, cameras that are 2 : 1 but for a row get the nearest size that is, both with a note. Where a file has
/// points but not who sees them, each keyframe is given those that nothing nearer hides. Memory stays in proportion to
/// the file's size; of maps of a SLAM to keyframes and landmarks, since descriptors are skipped as they stream by.
///
/// Throws IoError when a file cannot be read, InvalidInput (naming file, place and what was expected) when it is of no
/// such format, is truncated or broken, or holds no keyframe with an equirectangular camera; InvalidOption when there
/// is no such component, or `camera_from_body` is given for another map than a trajectory.
PMSP_API SlamMap read_map(const std::filesystem::path& path, const ReadMapOptions& options = {});

/// What can be given as a map, for people: "the folder of a model of COLMAP", ...
PMSP_API std::vector<std::string> map_formats();

/// A keyframe of the map as the library takes it, with the landmarks that it observes and what they tell of its pose's
/// error; image and mask are left out.
PMSP_API Keyframe keyframe_of(const SlamMap& map, const MapKeyframe& in_map);

/// How far landmarks lie from the keyframe that looks farthest: the largest 98th percentile of a keyframe's distances
/// from those that it observes [scene units]; 0 without landmarks.
PMSP_API double farthest_landmarks(const SlamMap& map);

}  // namespace pmsp
