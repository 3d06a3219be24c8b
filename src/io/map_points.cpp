// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "map_scene.h"
#include "pmsp/camera.h"
#include "pmsp/io/cloud.h"

namespace pmsp::map_detail {
namespace {

constexpr std::size_t kMostPoints = 200'000;
constexpr int kColumns = 180;  ///< resolution of the occlusion test: cells of 2 degrees
constexpr int kRows = kColumns / 2;
constexpr int kCoarser = 2;  ///< cells per side of a square in which one point is selected
constexpr double kSameSurface =
    1.25;  ///< occluded if farther than this times the nearest distance in the 3 x 3 cells around

/// Point seen from a keyframe.
struct VisiblePoint {
  std::size_t landmark = 0;
  double distance = 0.0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
};

/// Selects at most one unoccluded landmark per 4 x 4 degrees as observation: the one already observed by most
/// keyframes, then the nearest.
class VisiblePointSelector {
 public:
  explicit VisiblePointSelector(SlamMap& map) : map_(map), num_keyframes_(map.landmarks.size(), 0) {}

  void add_observations(MapKeyframe& keyframe) {
    const MapCamera& camera = map_.cameras[static_cast<std::size_t>(keyframe.camera)];
    std::vector<VisiblePoint> candidates;
    std::vector<int> cells;
    std::vector<double> nearest(kColumns * kRows, std::numeric_limits<double>::infinity());
    for (std::size_t i = 0; i < map_.landmarks.size(); ++i) {
      const Eigen::Vector3d point = keyframe.cam_from_world * map_.landmarks[i].position_world;
      const double distance = point.norm();
      if (!(distance > 0.0)) continue;
      const Eigen::Vector2d pixel = pixel_from_bearing(point, camera.width, camera.height);
      const int column = std::min(static_cast<int>(pixel.x() * kColumns / camera.width), kColumns - 1);
      const int row = std::min(static_cast<int>(pixel.y() * kRows / camera.height), kRows - 1);
      candidates.push_back({i, distance, pixel});
      cells.push_back(row * kColumns + column);
      double& here = nearest[static_cast<std::size_t>(cells.back())];
      here = std::min(here, distance);
    }
    std::vector<int> best(kColumns / kCoarser * (kRows / kCoarser), -1);
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      if (candidates[i].distance > kSameSurface * nearest_around(nearest, cells[i])) continue;
      const int row = cells[i] / kColumns / kCoarser;
      const int column = cells[i] % kColumns / kCoarser;
      int& chosen = best[static_cast<std::size_t>(row * (kColumns / kCoarser) + column)];
      if (chosen < 0 || is_better(candidates[i], candidates[static_cast<std::size_t>(chosen)]))
        chosen = static_cast<int>(i);
    }
    for (const int i : best) {
      if (i < 0) continue;
      const VisiblePoint& candidate = candidates[static_cast<std::size_t>(i)];
      ++num_keyframes_[candidate.landmark];
      keyframe.observations.push_back({map_.landmarks[candidate.landmark].id, candidate.pixel.cast<float>()});
    }
  }

 private:
  bool is_better(const VisiblePoint& a, const VisiblePoint& b) const {
    if (num_keyframes_[a.landmark] != num_keyframes_[b.landmark])
      return num_keyframes_[a.landmark] > num_keyframes_[b.landmark];
    return a.distance != b.distance ? a.distance < b.distance : a.landmark < b.landmark;
  }

  static double nearest_around(const std::vector<double>& nearest, int cell) {
    const int row = cell / kColumns;
    const int column = cell % kColumns;
    double result = std::numeric_limits<double>::infinity();
    for (int y = std::max(0, row - 1); y <= std::min(kRows - 1, row + 1); ++y) {
      for (int dx = -1; dx <= 1; ++dx) {
        const int x = (column + dx + kColumns) % kColumns;
        result = std::min(result, nearest[static_cast<std::size_t>(y * kColumns + x)]);
      }
    }
    return result;
  }

  SlamMap& map_;
  std::vector<int> num_keyframes_;  ///< per landmark: number of keyframes that observe it
};

}  // namespace

void observe_landmarks(SlamMap& map) {
  VisiblePointSelector selector(map);
  for (MapKeyframe& keyframe : map.keyframes) selector.add_observations(keyframe);
  // Unobserved landmarks are dropped.
  std::vector<char> is_seen(map.landmarks.size(), 0);
  for (const MapKeyframe& keyframe : map.keyframes) {
    for (const MapObservation& observation : keyframe.observations) {
      is_seen[static_cast<std::size_t>(map.find_landmark(observation.landmark_id) - map.landmarks.data())] = 1;
    }
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < map.landmarks.size(); ++i) {
    if (is_seen[i] != 0) map.landmarks[kept++] = map.landmarks[i];
  }
  map.landmarks.resize(kept);
  map.observations_are_measured = false;
}

std::vector<MapLandmark> landmarks_from_ply(const std::filesystem::path& path) {
  const PlyCloud cloud = read_ply(path);
  if (cloud.positions.empty()) fail(path, "", "contains no points, expected some for use as landmarks");
  const std::size_t stride = (cloud.positions.size() + kMostPoints - 1) / kMostPoints;
  std::vector<MapLandmark> landmarks;
  for (std::size_t i = 0; i < cloud.positions.size(); i += stride) {
    if (!is_position(cloud.positions[i])) {
      fail(path, "point " + std::to_string(i), std::string("is too far away, ") + kExpectedPosition);
    }
    landmarks.push_back({static_cast<std::int64_t>(i), cloud.positions[i]});
  }
  return landmarks;
}

}  // namespace pmsp::map_detail
