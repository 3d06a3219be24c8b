// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include <Eigen/Core>

#include "pmsp/api.h"

namespace pmsp {

/// 8-bit colour; in memory red, green, blue without padding (3 bytes).
struct Rgb {
  std::uint8_t r = 0;
  std::uint8_t g = 0;
  std::uint8_t b = 0;
};
static_assert(sizeof(Rgb) == 3, "Rgb is read from and written to packed image rows");

inline bool operator==(const Rgb& a, const Rgb& b) { return a.r == b.r && a.g == b.g && a.b == b.b; }
inline bool operator!=(const Rgb& a, const Rgb& b) { return !(a == b); }

/// Non-owning view of a row-major image; row y starts at `data + y * stride`. Empty = not given.
template <class T>
struct ImageView {
  T* data = nullptr;
  int width = 0;              ///< [px]
  int height = 0;             ///< [px]
  std::ptrdiff_t stride = 0;  ///< elements between the starts of rows, >= width

  ImageView() = default;
  ImageView(T* pixels, int w, int h) : ImageView(pixels, w, h, w) {}
  ImageView(T* pixels, int w, int h, std::ptrdiff_t row_stride)
      : data(pixels), width(w), height(h), stride(row_stride) {}

  operator ImageView<const T>() const { return {data, width, height, stride}; }  // NOLINT(google-explicit-constructor)

  bool empty() const { return data == nullptr || width <= 0 || height <= 0; }
  T* row(int y) const { return data + y * stride; }
  T& operator()(int x, int y) const { return data[y * stride + x]; }
};

/// Row-major image without padding; element (x, y) is `pixels()[y * width() + x]`.
template <class T>
class Image {
 public:
  Image() = default;
  /// Elements are copies of `fill`, to be given for Eigen vectors, which have no initial value.
  Image(int width, int height, const T& fill = T())
      : width_(width),
        height_(height),
        pixels_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), fill) {}

  int width() const { return width_; }
  int height() const { return height_; }
  bool empty() const { return pixels_.empty(); }
  std::size_t size() const { return pixels_.size(); }

  T& operator()(int x, int y) { return pixels_[index(x, y)]; }
  const T& operator()(int x, int y) const { return pixels_[index(x, y)]; }
  T* row(int y) { return pixels_.data() + index(0, y); }
  const T* row(int y) const { return pixels_.data() + index(0, y); }

  std::vector<T>& pixels() { return pixels_; }
  const std::vector<T>& pixels() const { return pixels_; }

  ImageView<T> view() { return {pixels_.data(), width_, height_}; }
  ImageView<const T> view() const { return {pixels_.data(), width_, height_}; }

 private:
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
  }

  int width_ = 0;
  int height_ = 0;
  std::vector<T> pixels_;
};

/// Rigid transform, named `target_from_source`: x_target = rotation * x_source + translation. A 3x3 matrix, since the
/// alignment of Eigen's quaternions and 4x4 matrices depends on compiler flags.
struct RigidTransform {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< orthonormal, determinant +1
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();   ///< [map units]

  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const { return rotation * x + translation; }

  /// target_from_middle * middle_from_source = target_from_source.
  RigidTransform operator*(const RigidTransform& other) const {
    return {rotation * other.rotation, rotation * other.translation + translation};
  }

  RigidTransform inverse() const { return {rotation.transpose(), -(rotation.transpose() * translation)}; }

  /// Origin of the target frame in the source frame; of `cam_from_world` the camera centre in the world.
  Eigen::Vector3d center() const { return -(rotation.transpose() * translation); }
};

/// Exact equality.
inline bool operator==(const RigidTransform& a, const RigidTransform& b) {
  return a.rotation == b.rotation && a.translation == b.translation;
}
inline bool operator!=(const RigidTransform& a, const RigidTransform& b) { return !(a == b); }

/// Maximum of KeyframePose::scale; the minimum is its inverse.
constexpr double kMaxScale = 1e3;

/// Pose and unit of a keyframe: a point X of its frame is at world_from_cam * (scale * X). Loop closures change both.
struct KeyframePose {
  RigidTransform cam_from_world;  ///< translation [map units]
  double scale = 1.0;             ///< keyframe's unit in map units, 1 / kMaxScale to kMaxScale
};

/// Exact equality.
inline bool operator==(const KeyframePose& a, const KeyframePose& b) {
  return a.cam_from_world == b.cam_from_world && a.scale == b.scale;
}
inline bool operator!=(const KeyframePose& a, const KeyframePose& b) { return !(a == b); }

/// Maximum distance of cameras and landmarks from the origin [map units].
constexpr double kMaxPosition = 1e12;

/// Sparse point of the SLAM map.
struct Landmark {
  std::int64_t id = 0;                                       ///< common to all keyframes that observe it
  Eigen::Vector3d position_world = Eigen::Vector3d::Zero();  ///< within kMaxPosition [map units]
};

/// Keyframe of a SLAM: full 360° x 180° equirectangular image, pose, observed landmarks.
///
/// Camera axes: x right, y down, z forward. With u = column + 0.5, v = row + 0.5 the centre of a pixel has longitude
/// (u / width - 0.5) * 2 pi, latitude (0.5 - v / height) * pi and bearing (cos lat sin lon, -sin lat, cos lat cos lon).
/// Poses of stella_vslam and OpenVSLAM, which place centres at whole numbers, must be corrected by `cam_from_slam_cam`
/// (pmsp/camera.h), except those of the map readers of pmsp_io.
struct Keyframe {
  std::int64_t id = 0;
  double timestamp = 0.0;              ///< [s]
  RigidTransform cam_from_world;       ///< translation within kMaxPosition [map units]
  std::vector<Landmark> landmarks;     ///< observed; empty = no depth map
  ImageView<const Rgb> image;          ///< even width >= 16, even height >= 8; read only during the call
  ImageView<const std::uint8_t> mask;  ///< 0 = ignored, else used; size of `image`; empty = all used
  /// Depth along the rays from a lidar, a network or another reconstruction [map units]; 0 or not finite = none. At
  /// least 16 x 8; empty = none; read only during the call. Gives prior planes to pixels with little texture, which
  /// images or other keyframes must confirm (plane_priors). For other units see align_prior_depth (pmsp/calibration.h).
  ImageView<const float> prior_depth;

  /// Expected error of directions due to the pose [rad], 0 to 1: median reprojection angle of the landmarks over the
  /// root of their number. Added to the expected error of depths. 0 = exact or unknown.
  double pose_error = 0.0;

  /// Unit of the results (planes, depths, points) in map units, see KeyframePose. Inputs are in map units.
  double scale = 1.0;
  KeyframePose pose() const { return {cam_from_world, scale}; }
};

/// Depth, normals and confidence of a keyframe: full-sphere images of one size, see Keyframe, indexed (column, row).
struct DepthMap {
  std::int64_t keyframe_id = 0;
  RigidTransform cam_from_world;  ///< pose when the keyframe was added
  /// Distance along the ray from the centre, or lens (DensifierOptions::lens_distance) [keyframe's unit]; 0 = none.
  Image<float> depth;
  Image<Eigen::Vector3f> normal;  ///< unit, camera frame, facing the camera; (0, 0, 0) where depth is 0
  /// 0 to 1; 0 where depth is 0. After the consistency filter, a confidence c corresponds to an expected (median)
  /// relative error of 0.5 % * (1 - c) / c: 4.5 % at 0.1, 0.5 % at 0.5, 0.13 % at 0.8. Before it, if it is disabled or
  /// without other depth maps, the photometric score (NCC).
  Image<float> confidence;
  double scale = 1.0;  ///< the keyframe's unit in map units
};

/// Point of a dense cloud.
struct CloudPoint {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  ///< in frame and unit of the container
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();    ///< unit, facing the camera, same frame as `position`
  Rgb color;
  std::uint8_t views = 0;   ///< number of keyframes with agreeing depth maps, saturating at 255
  float confidence = 0.0F;  ///< 0 to 1, see DepthMap
};

/// Points of a keyframe in its camera frame: after pose updates only `transform_points` is needed, no matching.
struct KeyframeCloud {
  std::int64_t keyframe_id = 0;
  RigidTransform cam_from_world;  ///< pose when the points were computed; of a Densifier, when the keyframe was added
  std::vector<CloudPoint> points;
  double scale = 1.0;  ///< unit of `points` in map units, see KeyframePose
  KeyframePose pose() const { return {cam_from_world, scale}; }

  /// Pixels of the points, row x width + column, ascending; with the keyframe id a persistent key. Empty = unknown.
  std::vector<std::uint32_t> pixels;
  /// For each point bit k: the depth map of keyframe `window_ids[k]` agrees. Empty = unknown.
  std::vector<std::uint32_t> agree;
  std::vector<std::int64_t> window_ids;  ///< other keyframes of the fusion window, at most 32
};

/// Returns the points in world coordinates, in single precision, with the keyframe at the current `pose`.
PMSP_API std::vector<CloudPoint> transform_points(const KeyframeCloud& cloud, const KeyframePose& pose);

}  // namespace pmsp
