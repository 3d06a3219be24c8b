// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>
#include <utility>

#include <Eigen/Geometry>

#include "export/cloud_frame.h"
#include "export/number_table.h"
#include "io/map_file.h"
#include "io/trajectory.h"
#include "pmsp/error.h"
#include "util/text.h"

namespace pmsp {
namespace {

std::string where(const std::filesystem::path& path, const NumberRow& row) {
  return path.string() + ": line " + std::to_string(row.line) + ": ";
}

Anchor control_point(const NumberRow& row) {
  const std::vector<double>& v = row.numbers;
  const std::string name = row.name.empty() ? "line " + std::to_string(row.line) : row.name;
  return {name, {v[0], v[1], v[2]}, {v[3], v[4], v[5]}, std::nullopt};
}

Anchor camera_place(const std::filesystem::path& path, const NumberRow& row, const SlamMap& map) {
  const std::vector<double>& v = row.numbers;
  const bool is_whole = std::floor(v[0]) == v[0] && std::abs(v[0]) < 9e15;
  if (map.keyframes.empty()) {
    throw InvalidInput(where(path, row) + "names a keyframe, but none are known; give --map MAP, or lines x y z X Y Z");
  }
  const MapKeyframe* keyframe = is_whole ? map.find_keyframe(static_cast<std::int64_t>(v[0])) : nullptr;
  if (keyframe == nullptr) {
    throw InvalidInput(where(path, row) + "the map has no keyframe with this id; expected ID X Y Z");
  }
  return {
      "keyframe " + std::to_string(keyframe->id), keyframe->cam_from_world.center(), {v[1], v[2], v[3]}, std::nullopt};
}

/// Lookup of keyframes by image name, without folders and extension.
class Images {
 public:
  Images(const SlamMap& map, const ImageFiles& files) {
    for (const MapKeyframe& keyframe : map.keyframes) {
      const auto file = files.find(keyframe.id);
      std::filesystem::path image = keyframe.image;
      if (image.empty() && file != files.end()) image = file->second;
      if (!image.empty()) by_stem_[image.stem().string()].push_back({image, &keyframe});
    }
  }

  /// Returns the keyframe of an image name: if several match, the one with the same trailing folders, as far as both
  /// names have them; leading folders of absolute paths may differ (other machine). nullptr = none. Throws InvalidInput
  /// if ambiguous.
  const MapKeyframe* find(const std::filesystem::path& table, const NumberRow& row) const {
    std::string text = row.name;
    std::replace(text.begin(), text.end(), '\\', '/');
    if (text.size() > 1 && text[1] == ':') text.erase(0, 2);  // drive letter
    const std::filesystem::path name(text);
    auto found = by_stem_.find(name.stem().string());
    if (found == by_stem_.end()) found = by_stem_.find(name.filename().string());  // without extension: "1600000000.25"
    if (found == by_stem_.end()) return nullptr;
    const MapKeyframe* best = nullptr;
    std::ptrdiff_t best_folders = -1;
    bool is_one = true;
    for (const auto& [image, keyframe] : found->second) {
      const std::filesystem::path own = image.parent_path();
      const std::filesystem::path its = name.parent_path();
      const std::ptrdiff_t folders = common_tail(own, its);
      const bool are_all =
          folders == std::min(std::distance(own.begin(), own.end()), std::distance(its.begin(), its.end()));
      if (folders < best_folders || (!are_all && !image.is_absolute() && !name.is_absolute())) continue;
      is_one = folders > best_folders;
      best_folders = folders;
      best = keyframe;
    }
    if (is_one) return best;
    throw InvalidInput(where(table, row) + "several keyframes have an image named \"" + row.name +
                       "\"; expected its path with directories");
  }

 private:
  static std::ptrdiff_t common_tail(const std::filesystem::path& a, const std::filesystem::path& b) {
    std::ptrdiff_t count = 0;
    for (auto of_a = a.end(), of_b = b.end(); of_a != a.begin() && of_b != b.begin(); ++count) {
      if (*--of_a != *--of_b) break;
    }
    return count;
  }

  std::map<std::string, std::vector<std::pair<std::filesystem::path, const MapKeyframe*>>> by_stem_;
};

/// Anchors of rows "NAME X Y Z". Rows without a keyframe are skipped.
std::vector<Anchor> places_of_images(const std::filesystem::path& path, const std::vector<NumberRow>& rows,
                                     const SlamMap& map, const ImageFiles& files) {
  constexpr std::size_t kFewestAnchors = 3;
  const Images images(map, files);
  std::vector<Anchor> anchors;
  std::string missing;
  for (const NumberRow& row : rows) {
    const MapKeyframe* const keyframe = images.find(path, row);
    if (keyframe == nullptr) {
      if (missing.empty()) missing = row.name;
      continue;
    }
    anchors.push_back(
        {row.name, keyframe->cam_from_world.center(), {row.numbers[0], row.numbers[1], row.numbers[2]}, std::nullopt});
  }
  if (anchors.size() < kFewestAnchors && !missing.empty()) {
    throw InvalidInput(path.string() + ": names images of " + std::to_string(anchors.size()) +
                       " keyframes, expected at least 3; no keyframe has \"" + missing + "\"");
  }
  return anchors;
}

/// Throws InvalidInput if columns are geographic: degrees read as metres give a cloud 1e5 times too small.
void refuse_degrees(const std::filesystem::path& path, const std::string& names) {
  std::istringstream words(lower_case(names));
  for (std::string word; words >> word;) {
    if (word.rfind("lat", 0) != 0 && word.rfind("lon", 0) != 0 && word != "lng") continue;
    throw InvalidInput(path.string() +
                       ": columns are latitude and longitude, expected metres along three axes, such as UTM; "
                       "convert them, or use the positions in the images' EXIF data (--align exif)");
  }
}

struct Pose {
  double time;
  Eigen::Vector3d position;
  Eigen::Quaterniond rotation;
};

std::vector<Pose> poses_of(const std::filesystem::path& path) {
  const map_detail::Trajectory trajectory = map_detail::read_trajectory(path);
  if (!trajectory.has_times) {
    throw InvalidInput(path.string() + ": poses have no timestamps (KITTI), expected a trajectory with timestamps");
  }
  std::vector<Pose> poses;
  for (const map_detail::TrajectoryPose& pose : trajectory.poses) {
    const RigidTransform& body_from_world = pose.body_from_world;
    if (!body_from_world.rotation.allFinite() || !body_from_world.translation.allFinite()) continue;
    poses.push_back({pose.timestamp, body_from_world.center(),
                     Eigen::Quaterniond(Eigen::Matrix3d(body_from_world.rotation.transpose()))});
  }
  if (poses.empty()) throw InvalidInput(path.string() + ": no valid pose, expected at least one");
  return poses;
}

/// Anchors of keyframes whose position at their timestamp can be interpolated.
std::vector<Anchor> along_trajectory(std::vector<Pose> poses, const std::filesystem::path& path, const SlamMap& map,
                                     double time_offset) {
  if (std::none_of(map.keyframes.begin(), map.keyframes.end(),
                   [](const MapKeyframe& keyframe) { return std::isfinite(keyframe.timestamp); })) {
    throw InvalidInput(path.string() + ": is a trajectory, but no timestamps of keyframes are known; give --map MAP");
  }
  constexpr double kMostApart = 1.0;  // [s]
  constexpr double kAtOnce = 0.02;    // [s]
  std::stable_sort(poses.begin(), poses.end(), [](const Pose& a, const Pose& b) { return a.time < b.time; });
  std::vector<Anchor> anchors;
  for (const MapKeyframe& keyframe : map.keyframes) {
    const double time = keyframe.timestamp + time_offset;
    auto after = std::lower_bound(poses.begin(), poses.end(), time, [](const Pose& p, double t) { return p.time < t; });
    auto before = after;
    if (after == poses.end() || (after->time > time && after != poses.begin())) --before;
    if (after == poses.end()) --after;
    const bool is_inside = before->time <= time && time <= after->time && after->time - before->time <= kMostApart;
    if (!is_inside && std::min(std::abs(before->time - time), std::abs(after->time - time)) > kAtOnce) continue;
    const double length = after->time - before->time;
    const double share = is_inside && length > 0.0 ? (time - before->time) / length
                         : std::abs(before->time - time) <= std::abs(after->time - time) ? 0.0
                                                                                         : 1.0;
    const Eigen::Matrix3d rotation = before->rotation.slerp(share, after->rotation).toRotationMatrix();
    anchors.push_back({"keyframe " + std::to_string(keyframe.id), keyframe.cam_from_world.center(),
                       (1.0 - share) * before->position + share * after->position,
                       rotation * keyframe.cam_from_world.rotation});
  }
  if (anchors.size() >= 3) return anchors;
  const auto [first, last] =
      std::minmax_element(map.keyframes.begin(), map.keyframes.end(),
                          [](const MapKeyframe& a, const MapKeyframe& b) { return a.timestamp < b.timestamp; });
  throw InvalidInput(path.string() + ": positions of " + std::to_string(anchors.size()) + " of " +
                     std::to_string(map.keyframes.size()) + " keyframes, expected at least 3; trajectory from " +
                     std::to_string(poses.front().time) + " to " + std::to_string(poses.back().time) +
                     " s, keyframes from " + std::to_string(first->timestamp) + " to " +
                     std::to_string(last->timestamp) + " s; shift the keyframes with --align-time-offset");
}

}  // namespace

std::vector<Anchor> read_anchors(const std::filesystem::path& path, const SlamMap& map, double time_offset,
                                 const ImageFiles& images) {
  const map_detail::MapFile file(path);
  if (file.is_text() && map_detail::is_trajectory(file.head())) {
    return along_trajectory(poses_of(path), path, map, time_offset);
  }
  std::string names;
  const std::vector<NumberRow> rows = read_number_table(path, &names);
  refuse_degrees(path, names);
  if (rows.empty())
    throw InvalidInput(path.string() + ": contains no line of numbers; expected a table (see --help-all)");
  const std::size_t columns = rows.front().numbers.size();
  const bool is_named = columns == 3 && !rows.front().name.empty();
  std::vector<Anchor> anchors;
  for (const NumberRow& row : rows) {
    const bool has_right_name = row.name.empty() ? !is_named : is_named || columns == 6;
    if ((!is_named && columns != 4 && columns != 6) || row.numbers.size() != columns || !has_right_name) {
      throw InvalidInput(where(path, row) +
                         "expected lines of one kind: [NAME] x y z X Y Z (point in the map, point in "
                         "the frame of the file), ID X Y Z or IMAGE X Y Z (keyframe, position of its camera), or "
                         "timestamp tx ty tz qx qy qz qw (TUM trajectory)");
    }
    if (columns == 6) anchors.push_back(control_point(row));
    if (columns == 4) anchors.push_back(camera_place(path, row, map));
  }
  return is_named ? places_of_images(path, rows, map, images) : anchors;
}

}  // namespace pmsp
