// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include <Eigen/Core>

#include "pmsp/api.h"

namespace pmsp {

/// One 8-bit colour. Memory order is red, green, blue, without padding (3 bytes).
struct Rgb {
  std::uint8_t r = 0;
  std::uint8_t g = 0;
  std::uint8_t b = 0;
};
static_assert(sizeof(Rgb) == 3, "Rgb is read from and written to packed image rows");

inline bool operator==(const Rgb& a, const Rgb& b) { return a.r == b.r && a.g == b.g && a.b == b.b; }
inline bool operator!=(const Rgb& a, const Rgb& b) { return !(a == b); }

/// A rectangle of pixels that someone else owns: row-major, `height` rows of `width` elements, row y starts at
/// `data + y * stride`. An empty view (`data == nullptr`) means "not given".
template <class T>
struct ImageView {
  T* data = nullptr;
  int width = 0;              ///< [px]
  int height = 0;             ///< [px]
  std::ptrdiff_t stride = 0;  ///< elements from one row to the next, >= width

  ImageView() = default;
  ImageView(T* pixels, int w, int h) : ImageView(pixels, w, h, w) {}
  ImageView(T* pixels, int w, int h, std::ptrdiff_t row_stride)
      : data(pixels), width(w), height(h), stride(row_stride) {}

  /// A view of mutable pixels converts to a view of const ones.
  operator ImageView<const T>() const { return {data, width, height, stride}; }  // NOLINT(google-explicit-constructor)

  bool empty() const { return data == nullptr || width <= 0 || height <= 0; }
  T* row(int y) const { return data + y * stride; }
  T& operator()(int x, int y) const { return data[y * stride + x]; }
};

/// Owns a row-major image without row padding; element (x, y) is `pixels()[y * width() + x]`.
template <class T>
class Image {
 public:
  Image() = default;
  /// Elements are copies of `fill`. Fixed-size Eigen vectors have no initial value of their own: give them one.
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

/// A rotation and a translation, named `target_from_source` wherever it is used: x_target = rotation * x_source +
/// translation. Plain 3x3 matrix and 3-vector on purpose: their alignment does not depend on the compiler flags of the
/// program that links the library, as that of Eigen's quaternions and 4x4 matrices does.
struct RigidTransform {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< orthonormal, determinant +1
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();   ///< [scene units]

  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const { return rotation * x + translation; }

  /// target_from_middle * middle_from_source = target_from_source.
  RigidTransform operator*(const RigidTransform& other) const {
    return {rotation * other.rotation, rotation * other.translation + translation};
  }

  RigidTransform inverse() const { return {rotation.transpose(), -(rotation.transpose() * translation)}; }

  /// Origin of the target frame seen from the source frame; for `cam_from_world` the camera centre in the world.
  Eigen::Vector3d center() const { return -(rotation.transpose() * translation); }
};

/// Whether all numbers are the same, without tolerance.
inline bool operator==(const RigidTransform& a, const RigidTransform& b) {
  return a.rotation == b.rotation && a.translation == b.translation;
}
inline bool operator!=(const RigidTransform& a, const RigidTransform& b) { return !(a == b); }

/// How far a keyframe's unit of length may be from that of the world, either way.
constexpr double kMaxScale = 1e3;

/// Where a keyframe is, and how long its unit of length is in the unit of the world: a point X of its camera frame is
/// at world_from_cam * (scale * X). A loop closure of a monocular SLAM changes both.
struct KeyframePose {
  RigidTransform cam_from_world;  ///< translation in the world's unit
  double scale = 1.0;             ///< 1 / kMaxScale to kMaxScale
};

/// Whether all numbers are the same, without tolerance.
inline bool operator==(const KeyframePose& a, const KeyframePose& b) {
  return a.cam_from_world == b.cam_from_world && a.scale == b.scale;
}
inline bool operator!=(const KeyframePose& a, const KeyframePose& b) { return !(a == b); }

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
  /// little texture and nothing better is known, and believed where images or other keyframes agree (plane_priors);
  /// align_prior_depth (pmsp/calibration.h) brings other units into scene units.
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

/// Dense geometry of one keyframe. The three images have one size, cover the whole sphere (pixel centres as in
/// pmsp::Keyframe) and are indexed (column, row).
struct DepthMap {
  std::int64_t keyframe_id = 0;
  RigidTransform cam_from_world;  ///< as it was when the keyframe was added
  /// Euclidean distance along the bearing [keyframe's unit] from the camera's centre, or from the lens where it has two
  /// (DensifierOptions::lens_distance); 0 = no estimate.
  Image<float> depth;
  Image<Eigen::Vector3f> normal;  ///< unit, camera frame, facing the camera; (0, 0, 0) where depth is 0
  /// 0 (none) to 1; 0 where depth is 0. Straight from PatchMatch it is the photometric score (NCC), and it stays that
  /// where the consistency filter is off or has no other map to look at. After that filter it says how far the depth
  /// may be off: a confidence c stands for an expected relative error (median) of 0.5 % * (1 - c) / c, so 0.5 for 0.5
  /// %, 0.8 for 0.13 % and 0.1 for 4.5 %.
  Image<float> confidence;
  double scale = 1.0;  ///< the keyframe's unit in scene units
};

/// One point of a dense cloud.
struct CloudPoint {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  ///< frame and unit as the owner says
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();    ///< unit, facing the camera, same frame as `position`
  Rgb color;
  std::uint8_t views = 0;   ///< number of keyframes whose depth maps agree on the point, saturating at 255
  float confidence = 0.0F;  ///< 0 to 1
};

/// The points that one keyframe contributes, in that keyframe's camera frame. Because they stay attached to their
/// keyframe, a loop closure or a bundle adjustment moves them without matching anything again: transform with the new
/// pose (`transform_points`).
struct KeyframeCloud {
  std::int64_t keyframe_id = 0;
  RigidTransform cam_from_world;  ///< as it was when the keyframe was added; translation in the world's unit
  std::vector<CloudPoint> points;
  double scale = 1.0;  ///< the unit of `points` in the world's unit, see KeyframePose
  KeyframePose pose() const { return {cam_from_world, scale}; }

  /// Of each point the pixel of the keyframe's depth map that it stands for, row x width + column, ascending. With the
  /// keyframe's id a key that stays the same whatever happens to other points. Empty where nobody knows.
  std::vector<std::uint32_t> pixels;
  /// Of each point: bit k is set where the depth map of keyframe `window_ids[k]` agrees. Empty where nobody knows.
  std::vector<std::uint32_t> agree;
  std::vector<std::int64_t> window_ids;  ///< the other keyframes that the points were joined with, 32 at most
};

/// The cloud's points in world coordinates with the keyframe at `pose`: the cloud's own one, or a newer one from a loop
/// closure or a bundle adjustment. Positions are rounded to single precision.
PMSP_API std::vector<CloudPoint> transform_points(const KeyframeCloud& cloud, const KeyframePose& pose);

}  // namespace pmsp
