// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "pmsp/image.h"
#include "pmsp/transform.h"

namespace pmsp {

/// How far from the origin cameras and landmarks may lie [scene units].
constexpr double kMaxPosition = 1e12;

/// A sparse point of the SLAM map, as one keyframe observes it.
struct Landmark {
  std::int64_t id = 0;                                       ///< the same in all keyframes that observe it
  Eigen::Vector3d position_world = Eigen::Vector3d::Zero();  ///< within kMaxPosition [scene units]
};

/// What a SLAM hands over for one keyframe: a full 360° x 180° equirectangular image, its pose, and the landmarks that
/// it observes.
///
/// Conventions: camera axes x right, y down, z forward. With u = column + 0.5, v = row + 0.5 the centre of a pixel lies
/// at longitude (u / width - 0.5) * 2 pi and latitude (0.5 - v / height) * pi, its bearing is (cos lat sin lon,
/// -sin lat, cos lat cos lon). stella_vslam and OpenVSLAM place centres at whole numbers instead: poses taken straight
/// from them go through `cam_from_slam_cam` (pmsp/camera.h) first; the map readers of pmsp_io have done so already.
struct Keyframe {
  std::int64_t id = 0;
  double timestamp = 0.0;         ///< [s]
  RigidTransform cam_from_world;  ///< a rotation, and a translation within kMaxPosition [scene units]
  std::vector<Landmark> landmarks;
  ImageView<const Rgb> image;          ///< even width from 16, even height from 8; only read during the call
                                       ///< that it is given to
  ImageView<const std::uint8_t> mask;  ///< 0 = ignore, any other = use; size of `image`; empty = use all
  /// Depth along each pixel's ray from elsewhere, such as a lidar or a network [scene units]; 0, or what is not finite
  /// = none. Of any size from 16 x 8; empty = there is none; only read during the call. It is proposed where there is
  /// little texture and nothing better is known, and believed where images or other keyframes agree; see
  /// pmsp/plane_priors.h, and pmsp/prior_depth.h for what is not in scene units.
  ImageView<const float> prior_depth;

  /// How exactly the pose is known, as an error of directions [rad], 0 to 1: the median angle between where landmarks
  /// are observed and where they lie, over the root of their number. It tells what neighbouring keyframes cannot, since
  /// they share it, and is part of each depth's expected error. 0 = exact, or not known.
  double pose_error = 0.0;

  /// The unit of all that is made of the keyframe (planes, depths, points) in scene units, 1 / kMaxScale to kMaxScale,
  /// see KeyframePose. What is given is in scene units all the same.
  double scale = 1.0;
  KeyframePose pose() const { return {cam_from_world, scale}; }  ///< pose and unit
};

}  // namespace pmsp
