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

/// Equirectangular camera of a SLAM map.
struct MapCamera {
  std::string name;
  int width = 0;     ///< size of the images of the SLAM [px]
  int height = 0;    ///< [px]
  double fps = 0.0;  ///< frame rate configured in the SLAM, not that of the video [1/s]
};

/// Observation of a landmark.
struct MapObservation {
  std::int64_t landmark_id = 0;
  /// Position of the keypoint [px], x right, y down; the centre of the first pixel is (0.5, 0.5). For dense maps of
  /// PatchMatch-Stereo-Panorama, whose keypoints are in depth map pixels: projection of the landmark.
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();
};

/// Keyframe of a SLAM map.
struct MapKeyframe {
  std::int64_t id = 0;
  double timestamp = 0.0;                    ///< timestamp of the image in the SLAM [s]; 0 if the file has none
  std::optional<std::int64_t> source_frame;  ///< index of the input frame; only before stella_vslam 0.3.6
  int camera = 0;                            ///< index into SlamMap::cameras
  RigidTransform cam_from_world;             ///< corrected for pixel centres at index + 0.5, see SlamMap
  std::string image;                         ///< name in the image directory, "left/0001.jpg"; "" = none
  std::filesystem::path mask;                ///< file of its mask (nerfstudio, ViPE); "" = none
  std::filesystem::path prior_depth{};       ///< file of depth from a network (ViPE); "" = none
  std::vector<MapObservation> observations;  ///< of existing landmarks, each once
};

/// Sparse point of a SLAM map.
struct MapLandmark {
  std::int64_t id = 0;
  Eigen::Vector3d position_world = Eigen::Vector3d::Zero();  ///< [map units]
};

/// Map of a SLAM or a reconstruction: cameras, keyframes and landmarks, without descriptors.
///
/// SLAM programs, openMVG and AliceVision place the centre of the first pixel at 0, this library at 0.5. In longitude
/// this is a rotation by half a pixel, contained in their poses and removed by the readers (cam_from_world = Ry(+pi /
/// width) * cam_from_world of the file). In latitude half a pixel remains in the landmarks.
struct PMSP_API SlamMap {
  std::filesystem::path path;
  std::string format;                     ///< description, e.g. "stella_vslam >= 0.3.6, MessagePack"
  std::vector<MapCamera> cameras;         ///< in natural order of their unique names
  std::vector<MapKeyframe> keyframes;     ///< ascending id, unique
  std::vector<MapLandmark> landmarks;     ///< ascending id, unique
  std::size_t observations_skipped = 0;   ///< observations of missing landmarks
  std::size_t observations_repeated = 0;  ///< repeated observations of a landmark in a keyframe; the first is kept
  std::filesystem::path images;           ///< directory of `MapKeyframe::image`, or video (ViPE); "" = unknown

  /// Number, from 0, of the component (chunk) that was read; components have no common frame.
  int component = 0;
  std::vector<std::size_t> component_keyframes{};  ///< number of keyframes of each component, at least one entry

  bool pixel_centers_at_integers = false;  ///< pixel centres are at whole numbers in the file
  bool observations_are_measured = true;   ///< false: projections of the landmarks, not keypoints of the file
  bool ids_are_row_numbers = false;        ///< the file has no ids; images are not paired by them
  bool masks_are_instances = false;        ///< masks contain ids of objects, 0 = used (ViPE)
  std::vector<std::string> notes{};        ///< messages on ignored or corrected content

  /// Return nullptr if the id does not exist.
  const MapLandmark* find_landmark(std::int64_t id) const;
  const MapKeyframe* find_keyframe(std::int64_t id) const;
};

/// Options of read_map().
struct ReadMapOptions {
  std::optional<int> component;  ///< component to read; nullopt = that with most keyframes
  std::filesystem::path points;  ///< PLY file of points used as landmarks if the map has none
  /// File with the names of images: lines "timestamp name", or "name" for each keyframe in the order of ids.
  std::filesystem::path image_list;
  /// Text or YAML file with the transform to the camera from the body (IMU, base) of a trajectory: 12 or 16 numbers,
  /// rows of a matrix; 7, tx ty tz qx qy qz qw; or T_cam_imu (Kalibr), T_BS (EuRoC), body_T_cam0 (VINS).
  std::filesystem::path camera_from_body{};
};

/// Reads the map of a SLAM or the reconstruction of another program, in a format detected by content:
/// - OpenVSLAM and stella_vslam: MessagePack of all versions up to 0.6, or SQLite;
/// - COLMAP: directory of a model, text or binary, or of directories, one per component;
/// - OpenSfM: reconstruction.json, with observations from tracks.csv beside it;
/// - openMVG: sfm_data.json; nerfstudio: transforms.json; Metashape: cameras as XML;
/// - AliceVision: cameras.sfm;
/// - ViPE: directory of the results for a panoramic video, or pose/NAME.npz of one of several videos, with prior depth
///   and masks of moving objects; files in its archives have paths such as mask/NAME.zip/00012.png;
/// - benchmarks: directory of a path of OB3D; scene.json of COLMAP's TartanAir set;
/// - a trajectory, world from camera: TUM, "timestamp tx ty tz qx qy qz qw"; EuRoC and VINS, nanoseconds and w first;
///   KITTI, 12 numbers without a time; a table whose first line names its columns.
///
/// Keyframes of other than equirectangular cameras, and keyframes and points with NaN, are ignored; quaternions are
/// normalised; a camera that deviates from 2:1 by one row gets the nearest such size; all with a note. Points without
/// observations are assigned to the keyframes in which no nearer point hides them. Memory is proportional to the size
/// of the file, of SLAM maps to keyframes and landmarks, since descriptors are not stored.
///
/// Throws IoError if a file cannot be read; InvalidInput, with file, position and expectation, if it is of no such
/// format, truncated or damaged, or contains no keyframe of an equirectangular camera; InvalidOption if the component
/// does not exist, or `camera_from_body` is given and the map is no trajectory.
PMSP_API SlamMap read_map(const std::filesystem::path& path, const ReadMapOptions& options = {});

/// Returns descriptions of the formats of maps, for messages.
PMSP_API std::vector<std::string> map_formats();

/// Converts a keyframe of a map. Sets pose_error from the reprojection angles of its landmarks; image and mask stay
/// empty.
PMSP_API Keyframe keyframe_of(const SlamMap& map, const MapKeyframe& in_map);

/// Returns the maximum over keyframes of the 98th percentile of distances of observed landmarks [map units]; 0 = none.
PMSP_API double farthest_landmarks(const SlamMap& map);

}  // namespace pmsp
