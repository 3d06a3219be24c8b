// SPDX-License-Identifier: BSD-2-Clause
#include "map_scene.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <exception>
#include <numeric>
#include <utility>

#include <Eigen/Geometry>

#include "export/files.h"
#include "panorama_size.h"
#include "pmsp/error.h"
#include "pmsp/types.h"
#include "util/text.h"

namespace pmsp::map_detail {
namespace {

constexpr int kWidthIfUnknown_px = 2048;  ///< [px]

std::string name_of(const MapKeyframe& keyframe) {
  return "keyframe " + std::to_string(keyframe.id) + (keyframe.image.empty() ? "" : " " + in_quotes(keyframe.image));
}

/// Natural order: "frame_9.jpg" before "frame_10.jpg".
bool before(const std::string& a, const std::string& b) {
  std::size_t i = 0;
  std::size_t k = 0;
  while (i < a.size() && k < b.size()) {
    if (!is_digit(a[i]) || !is_digit(b[k])) {
      if (a[i] != b[k]) return a[i] < b[k];
      ++i;
      ++k;
      continue;
    }
    const auto number = [](const std::string& text, std::size_t& at) {
      while (at < text.size() && text[at] == '0') ++at;
      const std::size_t begin = at;
      while (at < text.size() && is_digit(text[at])) ++at;
      return text.substr(begin, at - begin);
    };
    const std::string of_a = number(a, i);
    const std::string of_b = number(b, k);
    if (of_a.size() != of_b.size()) return of_a.size() < of_b.size();
    if (of_a != of_b) return of_a < of_b;
  }
  if (a.size() - i != b.size() - k) return a.size() - i < b.size() - k;
  return a < b;
}

void sort_cameras(SlamMap& map) {
  std::vector<int> order(map.cameras.size());
  std::iota(order.begin(), order.end(), 0);
  const auto camera = [&](int i) -> const MapCamera& { return map.cameras[static_cast<std::size_t>(i)]; };
  std::sort(order.begin(), order.end(), [&](int a, int b) { return before(camera(a).name, camera(b).name); });
  std::vector<int> place(order.size());
  std::vector<MapCamera> sorted;
  for (std::size_t i = 0; i < order.size(); ++i) {
    place[static_cast<std::size_t>(order[i])] = static_cast<int>(i);
    sorted.push_back(camera(order[i]));
    if (i > 0 && sorted[i - 1].name == sorted[i].name) {
      fail(map.path, "cameras", "two cameras are named " + in_quotes(sorted[i].name) + ", expected unique names");
    }
  }
  map.cameras = std::move(sorted);
  for (MapKeyframe& keyframe : map.keyframes) keyframe.camera = place[static_cast<std::size_t>(keyframe.camera)];
}

/// Drops keyframes with invalid poses and landmarks with non-finite positions.
void drop_non_finite(SlamMap& map) {
  const auto poses = std::remove_if(map.keyframes.begin(), map.keyframes.end(), [](const MapKeyframe& k) {
    return !k.cam_from_world.rotation.allFinite() || !k.cam_from_world.translation.allFinite();
  });
  note_invalid_poses(map, static_cast<std::size_t>(map.keyframes.end() - poses));
  map.keyframes.erase(poses, map.keyframes.end());
  const auto points = std::remove_if(map.landmarks.begin(), map.landmarks.end(),
                                     [](const MapLandmark& l) { return !l.position_world.allFinite(); });
  if (points == map.landmarks.begin() && !map.landmarks.empty()) {
    fail(map.path, "", "none of its " + std::to_string(map.landmarks.size()) + " points is at a finite position");
  }
  note_invalid_points(map, static_cast<std::size_t>(map.landmarks.end() - points));
  map.landmarks.erase(points, map.landmarks.end());
}

void sort_keyframes(SlamMap& map) {
  std::vector<MapKeyframe>& keyframes = map.keyframes;
  if (keyframes.empty()) {
    std::string why;
    for (const std::string& note : map.notes) why += "; " + note;
    fail(map.path, "", "holds no image with a pose and an equirectangular camera, expected at least one" + why);
  }
  std::sort(keyframes.begin(), keyframes.end(), [](const MapKeyframe& a, const MapKeyframe& b) { return a.id < b.id; });
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    if (i > 0 && keyframes[i - 1].id == keyframes[i].id) {
      fail(map.path, name_of(keyframes[i]), "this id appears more than once, expected unique ids");
    }
    if (!std::isfinite(keyframes[i].timestamp)) {
      fail(map.path, name_of(keyframes[i]), "the time is " + to_message(keyframes[i].timestamp) + ", expected seconds");
    }
    if (!is_position(keyframes[i].cam_from_world.translation) || !is_position(keyframes[i].cam_from_world.center())) {
      fail(map.path, name_of(keyframes[i]),
           "the camera is at " + to_message(keyframes[i].cam_from_world.center()) + ", " + kExpectedPosition);
    }
  }
  check_images_once(map, map.path);
}

void filter_observations(SlamMap& map) {
  LandmarkFilter filter(map);
  for (MapKeyframe& keyframe : map.keyframes) {
    filter.begin_keyframe();
    const MapCamera& camera = map.cameras[static_cast<std::size_t>(keyframe.camera)];
    std::size_t kept = 0;
    for (const MapObservation& observation : keyframe.observations) {
      if (filter.pass(observation.landmark_id) == nullptr) continue;
      const float x = observation.pixel.x();
      const float y = observation.pixel.y();
      const auto width = static_cast<float>(camera.width);
      const auto height = static_cast<float>(camera.height);
      if (!(x >= -1.0F && x <= width + 1.0F && y >= -1.0F && y <= height + 1.0F)) {  // true for NaN
        fail(map.path, name_of(keyframe),
             "the observation of point " + std::to_string(observation.landmark_id) + " lies at (" +
                 to_message(static_cast<double>(x)) + ", " + to_message(static_cast<double>(y)) +
                 "), expected a position in the image of " + std::to_string(camera.width) + " x " +
                 std::to_string(camera.height) + " pixels");
      }
      keyframe.observations[kept++] = observation;
    }
    keyframe.observations.resize(kept);
  }
}

}  // namespace

std::string to_message(const Eigen::Vector3d& p) {
  return "(" + to_message(p.x()) + ", " + to_message(p.y()) + ", " + to_message(p.z()) + ")";
}

bool is_position(const Eigen::Vector3d& p) { return p.norm() <= kMaxPosition; }

Eigen::Matrix3d canonical_rotation(const std::array<double, 4>& xyzw, double norm) {
  constexpr double kGrid = 4294967296.0;
  const auto rounded = [&](double component) { return std::round(component / norm * kGrid) / kGrid; };
  return Eigen::Quaterniond(rounded(xyzw[3]), rounded(xyzw[0]), rounded(xyzw[1]), rounded(xyzw[2]))
      .normalized()
      .toRotationMatrix();
}

Eigen::Matrix3d rotation_from_quaternion(const std::array<double, 4>& q, const std::filesystem::path& path,
                                         const std::string& where, std::size_t& unnormalised) {
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (is_invalid_pose(q)) return invalid_rotation();
  if (norm < 0.5 || norm > 2.0) {
    fail(path, where,
         "the quaternion (x, y, z, w) = (" + to_message(q[0]) + ", " + to_message(q[1]) + ", " + to_message(q[2]) +
             ", " + to_message(q[3]) + ") has length " + to_message(norm) + ", expected a rotation: length 1");
  }
  unnormalised += std::abs(norm - 1.0) > 1e-3 ? 1 : 0;
  return canonical_rotation(q, norm);
}

Eigen::Matrix3d rotation_from_matrix(const Eigen::Matrix3d& matrix, const std::filesystem::path& path,
                                     const std::string& where) {
  if (!matrix.allFinite() || matrix.isZero(0.0)) return invalid_rotation();
  const double error = (matrix.transpose() * matrix - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(error <= 1e-3)) {  // true for NaN
    fail(path, where,
         "is no rotation: its columns are not perpendicular and of length 1 (off by " + to_message(error) +
             ", expected at most 0.001)");
  }
  if (matrix.determinant() < 0.0) {
    fail(path, where, "mirrors (its determinant is -1), expected a rotation; axes may have been swapped or negated");
  }
  const Eigen::Quaterniond q(matrix);
  return canonical_rotation({q.x(), q.y(), q.z(), q.w()}, q.norm());
}

void note_unnormalised(SlamMap& map, std::size_t count) {
  if (count > 0) map.notes.push_back("quaternions that were not of length 1, normalised: " + std::to_string(count));
}

void note_invalid_poses(SlamMap& map, std::size_t count) {
  if (count == 0) return;
  map.notes.push_back("keyframes left out, whose poses are lost (not finite, or a quaternion of length 0): " +
                      std::to_string(count));
}

void note_invalid_points(SlamMap& map, std::size_t count) {
  if (count > 0) map.notes.push_back("points left out, whose positions are not finite: " + std::to_string(count));
}

void note_others(SlamMap& map, const std::string& what, std::size_t count) {
  if (count > 0) map.notes.push_back(what + ": " + std::to_string(count) + "; only panoramas can be used");
}

std::string image_name(const std::string& name, const std::filesystem::path& path, const std::string& where) {
  constexpr std::size_t kLongest = 4096;
  const bool has_controls =
      std::any_of(name.begin(), name.end(), [](char c) { return static_cast<unsigned char>(c) < 0x20U || c == 0x7F; });
  std::string text = name.size() <= kLongest && !has_controls ? name : "";
  std::replace(text.begin(), text.end(), '\\', '/');
  if (text.size() > 1 && text[1] == ':' && std::isalpha(static_cast<unsigned char>(text[0])) != 0) text.erase(0, 2);
  std::filesystem::path image;
  for (const std::filesystem::path& part : std::filesystem::path(text).relative_path()) {
    if (part == "..") image = image.parent_path();
    if (part != ".." && part != ".") image /= part;  // a trailing separator gives an empty part
  }
  if (!image.has_filename() || text.back() == '.') {
    fail(path, where,
         "names the image " + in_quotes(name) + ", expected a file in the image directory, by its path there");
  }
  return image.generic_string();
}

void check_images_once(const SlamMap& map, const std::filesystem::path& path) {
  std::vector<const std::string*> images;
  for (const MapKeyframe& keyframe : map.keyframes) {
    if (!keyframe.image.empty()) images.push_back(&keyframe.image);
  }
  std::sort(images.begin(), images.end(), [](const auto* a, const auto* b) { return *a < *b; });
  const auto twice =
      std::adjacent_find(images.begin(), images.end(), [](const auto* a, const auto* b) { return *a == *b; });
  if (twice != images.end()) {
    fail(path, "", "the image " + in_quotes(**twice) + " appears more than once, expected one pose for each");
  }
}

void sort_landmarks(std::vector<MapLandmark>& landmarks, const std::filesystem::path& path, const char* at,
                    const std::function<std::string(std::int64_t id, const char* field)>& where) {
  std::sort(landmarks.begin(), landmarks.end(), [](const MapLandmark& a, const MapLandmark& b) { return a.id < b.id; });
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    if (i > 0 && landmarks[i - 1].id == landmarks[i].id) {
      fail(path, where(landmarks[i].id, ""), "this id appears more than once, expected unique ids");
    }
    if (!is_position(landmarks[i].position_world)) {
      fail(path, where(landmarks[i].id, "pos_w"),
           at + to_message(landmarks[i].position_world) + ", " + kExpectedPosition);
    }
  }
}

std::filesystem::path longest_tail(const std::filesystem::path& folder, const std::string& name, bool other_endings) {
  constexpr std::array<const char*, 10> kEndings{".jpg", ".JPG", ".jpeg", ".JPEG", ".png",
                                                 ".PNG", ".tif", ".TIF",  ".tiff", ".TIFF"};
  // "1.jpg.png" may be the mask of "1.jpg", and "IMG.0001" has no extension.
  const std::string own = std::filesystem::path(name).extension().string();
  const bool has_ending =
      own.size() > 1 && std::all_of(own.begin() + 1, own.end(), [](unsigned char c) { return std::isalpha(c) != 0; });
  for (std::size_t at = 0; at != std::string::npos;) {
    const std::filesystem::path path = folder / name.substr(at);
    if (is_file(path)) return path;
    for (std::size_t i = 0; other_endings && i < kEndings.size(); ++i) {
      std::filesystem::path other = path;
      if (has_ending) other.replace_extension();
      other += kEndings[i];
      if (is_file(other)) return other;
    }
    const std::size_t slash = name.find('/', at);
    at = slash == std::string::npos ? slash : slash + 1;
  }
  return {};
}

std::filesystem::path inner_folder(const std::string& name, SlamMap& map) {
  namespace fs = std::filesystem;
  if (name.empty()) return {};
  std::error_code error;
  const fs::path home = fs::absolute(map.path, error).parent_path().lexically_normal();
  const fs::path folder = (home / name).lexically_normal();
  const fs::path inside = folder.lexically_relative(home);
  if (!inside.empty() && *inside.begin() != "..") return map.path.parent_path() / inside;
  map.notes.push_back("images in " + in_quotes(name) +
                      ", outside the directory of the file, are not read; give --images");
  return {};
}

MapCamera equirectangular_camera(const std::string& name, double width, double height,
                                 const std::filesystem::path& path, const std::string& where) {
  const bool is_size = width >= 2.0 && width <= kMaxImageWidth && height >= 1.0 && height <= kMaxImageWidth &&
                       width == std::floor(width) && height == std::floor(height);
  if (!is_size || !io::is_panorama_size(static_cast<std::int64_t>(width), static_cast<std::int64_t>(height))) {
    fail(path, where,
         "the images are " + to_message(width) + " x " + to_message(height) +
             " pixels, expected full panoramas: twice as wide as high within one row, at most " +
             std::to_string(kMaxImageWidth) + " wide");
  }
  return {name, static_cast<int>(width), static_cast<int>(height), 0.0};
}

MapCamera equirectangular_camera_of_unknown_size() {
  return {"panorama of any size", kWidthIfUnknown_px, kWidthIfUnknown_px / 2, 0.0};
}

void number_by_image(SlamMap& map) {
  std::sort(map.keyframes.begin(), map.keyframes.end(),
            [](const MapKeyframe& a, const MapKeyframe& b) { return before(a.image, b.image); });
  for (std::size_t i = 0; i < map.keyframes.size(); ++i) map.keyframes[i].id = static_cast<std::int64_t>(i);
}

LandmarkFilter::LandmarkFilter(SlamMap& map) : map_(map), last_seen_(map.landmarks.size(), -1) {}

const MapLandmark* LandmarkFilter::pass(std::int64_t landmark_id) {
  const MapLandmark* const landmark = map_.find_landmark(landmark_id);
  if (landmark == nullptr) {
    ++map_.observations_skipped;
    return nullptr;
  }
  int& last_seen = last_seen_[static_cast<std::size_t>(landmark - map_.landmarks.data())];
  if (last_seen == keyframe_) {
    ++map_.observations_repeated;
    return nullptr;
  }
  last_seen = keyframe_;
  return landmark;
}

void round_camera_sizes(SlamMap& map) {
  for (std::size_t i = 0; i < map.cameras.size(); ++i) {
    MapCamera& camera = map.cameras[i];
    const int height = io::panorama_height(camera.width, camera.height);
    const int width = 2 * height;
    if (width == camera.width && height == camera.height) continue;
    const Eigen::Vector2f factor(static_cast<float>(width) / static_cast<float>(camera.width),
                                 static_cast<float>(height) / static_cast<float>(camera.height));
    for (MapKeyframe& keyframe : map.keyframes) {
      if (static_cast<std::size_t>(keyframe.camera) != i) continue;
      for (MapObservation& observation : keyframe.observations) {
        observation.pixel = observation.pixel.cwiseProduct(factor);
      }
    }
    map.notes.push_back("images of " + std::to_string(camera.width) + " x " + std::to_string(camera.height) +
                        " pixels are resized to " + std::to_string(width) + " x " + std::to_string(height));
    camera.width = width;
    camera.height = height;
  }
}

SlamMap finalize_map(SlamMap&& map) {
  drop_non_finite(map);
  sort_keyframes(map);
  sort_cameras(map);
  sort_landmarks(map.landmarks, map.path, "is at ",
                 [](std::int64_t id, const char* /*field*/) { return "point " + std::to_string(id); });
  filter_observations(map);
  round_camera_sizes(map);
  if (map.component_keyframes.empty()) map.component_keyframes = {map.keyframes.size()};
  return std::move(map);
}

SlamMap read_component(std::size_t count, const std::filesystem::path& path, const ReadMapOptions& options,
                       const std::function<SlamMap(std::size_t)>& read_one) {
  if (count == 0) fail(path, "", "holds no reconstruction, expected at least one");
  if (options.component && (*options.component < 0 || static_cast<std::size_t>(*options.component) >= count)) {
    throw InvalidOption("component is " + std::to_string(*options.component) + ": " + path.string() + " has " +
                        std::to_string(count) + ", expected 0 to " + std::to_string(count - 1));
  }
  SlamMap chosen;
  std::vector<std::size_t> keyframes(count, 0);
  std::exception_ptr error;
  bool is_chosen = false;
  for (std::size_t i = 0; i < count; ++i) {
    const bool is_asked_for = options.component && static_cast<std::size_t>(*options.component) == i;
    try {
      SlamMap map = read_one(i);
      keyframes[i] = map.keyframes.size();
      if (options.component ? !is_asked_for : is_chosen && keyframes[i] <= chosen.keyframes.size()) continue;
      map.component = static_cast<int>(i);
      chosen = std::move(map);
      is_chosen = true;
    } catch (const InvalidInput&) {  // another component may be the wanted one
      if (is_asked_for) throw;
      if (!error) error = std::current_exception();
    }
  }
  if (!is_chosen) std::rethrow_exception(error);
  if (error) {
    try {
      std::rethrow_exception(error);
    } catch (const InvalidInput& refused) {
      chosen.notes.push_back(std::string("a component cannot be used: ") + refused.what());
    }
  }
  chosen.component_keyframes = std::move(keyframes);
  return chosen;
}

}  // namespace pmsp::map_detail
