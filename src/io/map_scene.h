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

#include "pmsp/io/map.h"

/// What the readers of all formats share: checks of values, and what makes a SlamMap of what was read.
namespace pmsp::map_detail {

/// Throws InvalidInput: "PATH: WHERE: WHAT"; without `where`, "PATH: WHAT".
[[noreturn]] void fail(const std::filesystem::path& path, const std::string& where, const std::string& what);

/// Text of the file in quotes, cut short and without control characters, fit for a message.
std::string in_quotes(const std::string& text);

/// A number as messages show it.
std::string shown(double value);
std::string shown(const Eigen::Vector3d& p);

/// Within kMaxPosition of the origin; false for NaN.
bool is_position(const Eigen::Vector3d& p);

constexpr const char* kExpectedPosition = "expected finite numbers, at most 1e12 from the origin";
constexpr int kMaxImageWidth = 1 << 16;

/// One pose reaches us as a quaternion or as the matrix that it was made from; both must give the same bits, because
/// equal maps have to give equal clouds. So everything goes through a quaternion rounded to multiples of 2^-32
/// (2e-10 rad, a millionth of a pixel), which hides the last bits in which the two differ, and the matrix is made from
/// the rounded one. The sign of the quaternion makes no difference to it. `norm`: its length.
Eigen::Matrix3d canonical_rotation(const std::array<double, 4>& xyzw, double norm);

/// NaN: stands for a pose that was lost. finish_scene leaves its keyframe out.
inline Eigen::Matrix3d lost_rotation() { return Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN()); }

/// Whether a quaternion, or what else a pose is made of, was lost: not finite, or zero.
template <class Values>
bool is_lost(const Values& values) {
  double squares = 0.0;
  for (const double value : values) squares += value * value;
  return !std::isfinite(squares) || squares == 0.0;
}

/// The same of what a file holds; lost_rotation where that is not finite or zero. Throws InvalidInput unless the
/// quaternion is of length 0.5 to 2, or the matrix a rotation within 0.001. `unnormalised` counts quaternions whose
/// length is off by more than 0.001.
Eigen::Matrix3d rotation_from_quaternion(const std::array<double, 4>& xyzw, const std::filesystem::path& path,
                                         const std::string& where, std::size_t& unnormalised);
Eigen::Matrix3d rotation_from_matrix(const Eigen::Matrix3d& matrix, const std::filesystem::path& path,
                                     const std::string& where);
void note_unnormalised(SlamMap& map, std::size_t count);
void note_lost_poses(SlamMap& map, std::size_t count);
void note_lost_points(SlamMap& map, std::size_t count);

/// A name in a file as a path that stays in the image folder, "left/0001.jpg": with slashes for backslashes, without
/// a drive, leading separators and what ".." takes back. Throws InvalidInput when nothing is left of it.
std::string image_name(const std::string& name, const std::filesystem::path& path, const std::string& where);

/// Throws InvalidInput, naming `path`, where two keyframes have one image.
void check_images_once(const SlamMap& map, const std::filesystem::path& path);

/// The longest tail of a path, as image_name gives it, that is a file in the folder: for "a/b/c.jpg" a/b/c.jpg, else
/// b/c.jpg, else c.jpg; "" where there is none. `other_endings`: also with the endings of images instead of its own, or
/// behind a name that has none.
std::filesystem::path longest_tail(const std::filesystem::path& folder, const std::string& name,
                                   bool other_endings = false);

/// The folder of the images as a file names it, where that lies in the folder of the file; else "", with a note.
std::filesystem::path inner_folder(const std::string& name, SlamMap& map);

/// An equirectangular camera as a file names its size. Throws InvalidInput unless that is a full panorama, within one
/// row; finish_scene makes it one.
MapCamera panorama(const std::string& name, double width, double height, const std::filesystem::path& path,
                   const std::string& where);

/// For files that do not say how large the images are: any panorama is that size up to a common factor.
MapCamera panorama_of_any_size();

/// Gives the keyframes the ids 0, 1, ... in the order of their images' names, numbers in names by value.
void number_by_image(SlamMap& map);

/// Keeps the observations of landmarks that exist, each once in a keyframe, and counts the others.
class ObservationFilter {
 public:
  /// `map.landmarks` are sorted; `map` outlives the sieve.
  explicit ObservationFilter(SlamMap& map);

  void begin_keyframe() { ++keyframe_; }
  /// The landmark of an observation that is kept, else nullptr.
  const MapLandmark* pass(std::int64_t landmark_id);

 private:
  SlamMap& map_;
  std::vector<int> last_seen_;  // per landmark, the last keyframe that observed it
  int keyframe_ = -1;
};

/// Cameras that are off by a row, or of odd height, get the nearest size that is not; observations move with it.
void round_camera_sizes(SlamMap& map);

/// Takes a map of this library's conventions as its file has it, in any order, and sorts and checks it: ids, positions,
/// observations. Keyframes and points with NaN are left out with a note. Throws InvalidInput.
SlamMap finish_scene(SlamMap&& map);

/// The component of a file that `options` name, or that of most keyframes. `read_one(i)` reads component i of `count`.
/// Throws InvalidOption, and what `read_one` throws for the only or the chosen one.
SlamMap read_component(std::size_t count, const std::filesystem::path& path, const ReadMapOptions& options,
                       const std::function<SlamMap(std::size_t)>& read_one);

/// For maps whose file does not say who sees what: each keyframe observes the landmarks that nothing nearer hides.
void observe_landmarks(SlamMap& map);

/// The points of a PLY file as landmarks, a part of them where they are many. Throws IoError, InvalidInput.
std::vector<MapLandmark> landmarks_from_ply(const std::filesystem::path& path);

}  // namespace pmsp::map_detail
