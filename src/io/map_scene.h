// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "binary_input.h"
#include "pmsp/io/map.h"

/// Common part of all map readers: checks of values, and conversion to SlamMap.
namespace pmsp::map_detail {

using pmsp::to_message;
std::string to_message(const Eigen::Vector3d& p);

/// True within kMaxPosition of the origin; false for NaN.
bool is_position(const Eigen::Vector3d& p);

constexpr const char* kExpectedPosition = "expected finite numbers, at most 1e12 from the origin";
constexpr int kMaxImageWidth = 1 << 16;

/// Returns the matrix of a quaternion whose normalised components are rounded to multiples of 2^-32 (2e-10 rad), so
/// that a rotation has the same bits whether it is read as quaternion or as matrix. Independent of the sign. `norm`:
/// length of `xyzw`.
Eigen::Matrix3d canonical_rotation(const std::array<double, 4>& xyzw, double norm);

/// Returns a matrix of NaN, which marks an invalid pose; finalize_map drops the keyframe.
inline Eigen::Matrix3d invalid_rotation() {
  return Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN());
}

/// True if the values of a pose are not finite or all zero.
template <class Values>
bool is_invalid_pose(const Values& values) {
  double squares = 0.0;
  for (const double value : values) squares += value * value;
  return !std::isfinite(squares) || squares == 0.0;
}

/// Return the canonical_rotation of a quaternion or matrix, or invalid_rotation if is_invalid_pose. Throw InvalidInput
/// unless the quaternion has norm 0.5 to 2, or the matrix is a rotation within 0.001. `unnormalised`: counts
/// quaternions whose norm deviates from 1 by more than 0.001.
Eigen::Matrix3d rotation_from_quaternion(const std::array<double, 4>& xyzw, const std::filesystem::path& path,
                                         const std::string& where, std::size_t& unnormalised);
Eigen::Matrix3d rotation_from_matrix(const Eigen::Matrix3d& matrix, const std::filesystem::path& path,
                                     const std::string& where);
void note_unnormalised(SlamMap& map, std::size_t count);
void note_invalid_poses(SlamMap& map, std::size_t count);
void note_invalid_points(SlamMap& map, std::size_t count);
void note_others(SlamMap& map, const std::string& what, std::size_t count);  ///< of other cameras than panoramas

/// Returns a file's image name as a path inside the image folder, "left/0001.jpg": slashes for backslashes, without
/// drive, leading separators and "..". Throws InvalidInput if nothing remains.
std::string image_name(const std::string& name, const std::filesystem::path& path, const std::string& where);

/// Throws InvalidInput with `path` if two keyframes have the same image.
void check_images_once(const SlamMap& map, const std::filesystem::path& path);

/// Sorts by id. Throws InvalidInput for equal ids and positions out of range. `at`: verb of the message;
/// `where`: name of a landmark's field.
void sort_landmarks(std::vector<MapLandmark>& landmarks, const std::filesystem::path& path, const char* at,
                    const std::function<std::string(std::int64_t id, const char* field)>& where);

/// Returns the longest tail of an image_name that is a file in the folder: for "a/b/c.jpg" a/b/c.jpg, else b/c.jpg,
/// else c.jpg; "" = none. `other_endings`: also with other image extensions, replaced or appended if there is none.
std::filesystem::path longest_tail(const std::filesystem::path& folder, const std::string& name,
                                   bool other_endings = false);

/// Returns the image folder named in a file if it is inside the file's folder; else "", with a note.
std::filesystem::path inner_folder(const std::string& name, SlamMap& map);

/// Returns an equirectangular camera of the given size. Throws InvalidInput unless it is a full panorama within one
/// row, which finalize_map rounds.
MapCamera equirectangular_camera(const std::string& name, double width, double height,
                                 const std::filesystem::path& path, const std::string& where);

/// Returns a camera for files without image size; only the ratio 2:1 is meaningful.
MapCamera equirectangular_camera_of_unknown_size();

/// Numbers keyframes 0, 1, ... in natural order of their image names.
void number_by_image(SlamMap& map);

/// Keeps observations of existing landmarks, each landmark once per keyframe, and counts the others.
class LandmarkFilter {
 public:
  /// `map`: with sorted landmarks, must outlive the filter.
  explicit LandmarkFilter(SlamMap& map);

  void begin_keyframe() { ++keyframe_; }
  /// Returns the landmark if the observation is kept, else nullptr.
  const MapLandmark* pass(std::int64_t landmark_id);

 private:
  SlamMap& map_;
  std::vector<int> last_seen_;  // per landmark: last keyframe that observes it
  int keyframe_ = -1;
};

/// Rounds cameras that are off by a row, or of odd height, to the nearest valid size; scales their observations.
void round_camera_sizes(SlamMap& map);

/// Sorts and checks a map in the conventions of libpmsp: ids, positions, observations. Keyframes and points with NaN
/// are dropped, with a note. Throws InvalidInput.
SlamMap finalize_map(SlamMap&& map);

/// Returns the component selected by `options`, or the one with most keyframes. `read_one(i)` reads component i of
/// `count`. Throws InvalidOption, and exceptions of `read_one` for the only or the selected component.
SlamMap read_component(std::size_t count, const std::filesystem::path& path, const ReadMapOptions& options,
                       const std::function<SlamMap(std::size_t)>& read_one);

/// For maps without observations: adds to each keyframe the unoccluded landmarks, at most one per 4 x 4 degrees, and
/// removes unobserved ones.
void observe_landmarks(SlamMap& map);

/// Reads the points of a PLY file as landmarks, subsampled if numerous. Throws IoError, InvalidInput.
std::vector<MapLandmark> landmarks_from_ply(const std::filesystem::path& path);

}  // namespace pmsp::map_detail
