// SPDX-License-Identifier: BSD-2-Clause
#include "pose_convention.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>

namespace pmsp::map_detail {
namespace {

Eigen::Matrix3d axes(double x, double y, double z) { return Eigen::Vector3d(x, y, z).asDiagonal(); }

Eigen::Matrix3d quarter_turn(double sign) {
  Eigen::Matrix3d turn;
  turn << 0.0, 0.0, -sign, 0.0, 1.0, 0.0, sign, 0.0, 0.0;
  return turn;
}

Eigen::Matrix3d w_first(const Eigen::Matrix3d& world_from_cam) {
  const Eigen::Quaterniond as_read(world_from_cam);
  return Eigen::Quaterniond(as_read.x(), as_read.y(), as_read.z(), as_read.w()).toRotationMatrix();
}

/// Returns "x forward, y left, z up".
std::string body_axes(const Eigen::Matrix3d& cam_from_body) {
  constexpr std::array<const char*, 3> kAlong{"right", "down", "forward"};
  constexpr std::array<const char*, 3> kAgainst{"left", "up", "backward"};
  std::string text;
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::Index camera_axis = 0;
    const Eigen::Vector3d direction = cam_from_body.col(axis);
    direction.cwiseAbs().maxCoeff(&camera_axis);
    const auto at = static_cast<std::size_t>(camera_axis);
    text += std::string(axis > 0 ? ", " : "") + "xyz"[axis] + " " +
            (direction[camera_axis] > 0.0 ? kAlong[at] : kAgainst[at]);
  }
  return text;
}

/// Returns a 3 x 4 matrix without translation: "0 -1 0 0 0 0 -1 0 1 0 0 0".
std::string rows(const Eigen::Matrix3d& turn) {
  std::string text;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) text += std::to_string(std::lround(turn(row, column))) + " ";
    text += row < 2 ? "0 " : "0";
  }
  return text;
}

/// The 24 rotations that map axes to axes.
std::vector<Eigen::Matrix3d> axis_rotations() {
  std::vector<Eigen::Matrix3d> rotations;
  for (int x = 0; x < 6; ++x) {
    for (int y = 0; y < 6; ++y) {
      if (x / 2 == y / 2) continue;
      Eigen::Matrix3d turn = Eigen::Matrix3d::Zero();
      turn(x / 2, 0) = x % 2 == 0 ? 1.0 : -1.0;
      turn(y / 2, 1) = y % 2 == 0 ? 1.0 : -1.0;
      turn.col(2) = turn.col(0).cross(turn.col(1));
      rotations.push_back(turn);
    }
  }
  return rotations;
}

}  // namespace

RigidTransform PoseConvention::of(const RigidTransform& cam_from_world) const {
  RigidTransform pose = cam_from_world;
  if (w_first) {
    const Eigen::Matrix3d turn = map_detail::w_first(pose.rotation.transpose()).transpose();
    pose = {turn, -(turn * pose.center())};
  }
  if (inverted) pose = pose.inverse();
  return {camera * pose.rotation, camera * pose.translation};
}

std::vector<PoseConvention> other_conventions() {
  struct Camera {
    const char* as_they_are;
    const char* inverted;
    Eigen::Matrix3d axes;
  };
  const std::array<Camera, 7> cameras{{
      {"", "inverted poses (world_from_cam where cam_from_world is expected, or the other way round)", axes(1, 1, 1)},
      {"mirrored images or poses (left and right swapped)", "inverted poses of mirrored images", axes(-1, 1, 1)},
      {"flipped images or poses (latitude upside down)", "inverted poses of flipped images", axes(1, -1, 1)},
      {"camera axes of OpenGL where those of OpenCV are expected, or the other way round (y and z negated)",
       "inverted poses with camera axes of OpenGL", axes(1, -1, -1)},
      {"cameras that look backward (the image turned by half its width)",
       "inverted poses of cameras that look backward", axes(-1, 1, -1)},
      {"images turned by a quarter of their width to the left", "inverted poses of turned images", quarter_turn(1.0)},
      {"images turned by a quarter of their width to the right", "inverted poses of turned images", quarter_turn(-1.0)},
  }};
  std::vector<PoseConvention> conventions;
  for (const Camera& camera : cameras) {
    if (*camera.as_they_are != '\0') conventions.push_back({camera.as_they_are, false, camera.axes});
    conventions.push_back({camera.inverted, true, camera.axes});
  }
  const char* const kQuaternion = "quaternions with w first (qw qx qy qz where qx qy qz qw is expected)";
  const char* const kReorder = "write the poses with qw last; a cloud of this map would be wrong";
  conventions.push_back({kQuaternion, false, axes(1, 1, 1), true, kReorder});
  conventions.push_back({std::string(kQuaternion) + " of inverted poses", true, axes(1, 1, 1), true, kReorder});
  for (const Eigen::Matrix3d& turn : axis_rotations()) {
    const auto is_listed = [&](const Camera& camera) { return camera.axes == turn; };
    if (std::any_of(cameras.begin(), cameras.end(), is_listed)) continue;
    conventions.push_back({"poses of a body, an IMU's or a base's, with " + body_axes(turn), false, turn, false,
                           "give --camera-from-body FILE with these 12 numbers: " + rows(turn) +
                               " (every fourth: position of the body in the camera frame)"});
  }
  return conventions;
}

std::string remedy_of(const PoseConvention& convention) {
  return convention.remedy.empty() ? "correct the export, a cloud of this map would be wrong" : convention.remedy;
}

}  // namespace pmsp::map_detail
