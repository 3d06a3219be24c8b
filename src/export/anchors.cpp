// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "export/number_table.h"
#include "pmsp/error.h"
#include "pmsp/io/cloud_frame.h"

namespace pmsp {
namespace {

using Row = NumberRow;

std::string where(const std::filesystem::path& path, const Row& row) {
  return path.string() + ": line " + std::to_string(row.line) + ": ";
}

Anchor control_point(const Row& row) {
  const std::vector<double>& v = row.numbers;
  const std::string name = row.name.empty() ? "line " + std::to_string(row.line) : row.name;
  return {name, {v[0], v[1], v[2]}, {v[3], v[4], v[5]}, std::nullopt};
}

Anchor camera_place(const std::filesystem::path& path, const Row& row, const SlamMap& map) {
  const std::vector<double>& v = row.numbers;
  const bool is_whole = std::floor(v[0]) == v[0] && std::abs(v[0]) < 9e15;
  const MapKeyframe* keyframe = is_whole ? map.find_keyframe(static_cast<std::int64_t>(v[0])) : nullptr;
  if (keyframe == nullptr) {
    throw InvalidInput(where(path, row) + "the map has no keyframe of that id; expected ID X Y Z");
  }
  return {
      "keyframe " + std::to_string(keyframe->id), keyframe->cam_from_world.center(), {v[1], v[2], v[3]}, std::nullopt};
}

struct Pose {
  double time;
  Eigen::Vector3d position;
  Eigen::Quaterniond rotation;
};

Pose pose_of(const std::filesystem::path& path, const Row& row) {
  const std::vector<double>& v = row.numbers;
  const Eigen::Quaterniond rotation(v[7], v[4], v[5], v[6]);
  if (std::abs(rotation.norm() - 1.0) > 0.01) {
    throw InvalidInput(where(path, row) + "the quaternion has length " + std::to_string(rotation.norm()) +
                       ", expected 1: timestamp tx ty tz qx qy qz qw");
  }
  return {v[0], {v[1], v[2], v[3]}, rotation.normalized()};
}

/// Of the keyframes at whose time the trajectory tells where the camera was.
std::vector<Anchor> along_trajectory(std::vector<Pose> poses, const std::filesystem::path& path, const SlamMap& map,
                                     double time_offset) {
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
  throw InvalidInput(path.string() + ": tells the place of " + std::to_string(anchors.size()) + " of " +
                     std::to_string(map.keyframes.size()) + " keyframes, at least 3 are needed. It runs from " +
                     std::to_string(poses.front().time) + " to " + std::to_string(poses.back().time) +
                     " s, the keyframes from " + std::to_string(first->timestamp) + " to " +
                     std::to_string(last->timestamp) + " s; shift these with --align-time-offset");
}

}  // namespace

std::vector<Anchor> read_anchors(const std::filesystem::path& path, const SlamMap& map, double time_offset) {
  const std::vector<Row> rows = read_number_table(path);
  if (rows.empty()) throw InvalidInput(path.string() + ": holds no line of numbers; expected a table (see --help)");
  const std::size_t columns = rows.front().numbers.size();
  std::vector<Anchor> anchors;
  std::vector<Pose> poses;
  for (const Row& row : rows) {
    const bool may_have_name = columns == 6;
    const bool is_known = columns == 4 || columns == 6 || columns == 8;
    if (!is_known || row.numbers.size() != columns || (!row.name.empty() && !may_have_name)) {
      throw InvalidInput(
          where(path, row) +
          "expected lines of one kind: [NAME] x y z X Y Z (point in the map, point in "
          "the frame of the file), ID X Y Z (keyframe, place of its camera), or timestamp tx ty tz qx qy "
          "qz qw (TUM trajectory)");
    }
    if (columns == 6) anchors.push_back(control_point(row));
    if (columns == 4) anchors.push_back(camera_place(path, row, map));
    if (columns == 8) poses.push_back(pose_of(path, row));
  }
  return poses.empty() ? anchors : along_trajectory(std::move(poses), path, map, time_offset);
}

}  // namespace pmsp
