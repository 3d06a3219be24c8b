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
constexpr int kCoarser = 2;            ///< cells per axis of a square with one point per keyframe
constexpr double kSameSurface = 1.25;  ///< distance ratio to the nearest point around, beyond which a point is hidden

/// Point seen from a keyframe.
struct VisiblePoint {
  std::size_t landmark = 0;
  double distance = 0.0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
};

/// Selects observed points of keyframes, at most one per 4 degrees: among unhidden points the one that most previous
/// keyframes have taken, so that keyframes share landmarks, then the nearest.
class VisibilityFilter {
 public:
  explicit VisibilityFilter(SlamMap& map) : map_(map), taken_(map.landmarks.size(), 0) {}

  void look(MapKeyframe& keyframe) {
    const MapCamera& camera = map_.cameras[static_cast<std::size_t>(keyframe.camera)];
    std::vector<VisiblePoint> sights;
    std::vector<int> cells;
    std::vector<double> nearest(kColumns * kRows, std::numeric_limits<double>::infinity());
    for (std::size_t i = 0; i < map_.landmarks.size(); ++i) {
      const Eigen::Vector3d point = keyframe.cam_from_world * map_.landmarks[i].position_world;
      const double distance = point.norm();
      if (!(distance > 0.0)) continue;
      const Eigen::Vector2d pixel = pixel_from_bearing(point, camera.width, camera.height);
      const int column = std::min(static_cast<int>(pixel.x() * kColumns / camera.width), kColumns - 1);
      const int row = std::min(static_cast<int>(pixel.y() * kRows / camera.height), kRows - 1);
      sights.push_back({i, distance, pixel});
      cells.push_back(row * kColumns + column);
      double& here = nearest[static_cast<std::size_t>(cells.back())];
      here = std::min(here, distance);
    }
    std::vector<int> best(kColumns / kCoarser * (kRows / kCoarser), -1);
    for (std::size_t i = 0; i < sights.size(); ++i) {
      if (sights[i].distance > kSameSurface * nearest_around(nearest, cells[i])) continue;
      const int row = cells[i] / kColumns / kCoarser;
      const int column = cells[i] % kColumns / kCoarser;
      int& chosen = best[static_cast<std::size_t>(row * (kColumns / kCoarser) + column)];
      if (chosen < 0 || is_better(sights[i], sights[static_cast<std::size_t>(chosen)])) chosen = static_cast<int>(i);
    }
    for (const int i : best) {
      if (i < 0) continue;
      const VisiblePoint& sight = sights[static_cast<std::size_t>(i)];
      ++taken_[sight.landmark];
      keyframe.observations.push_back({map_.landmarks[sight.landmark].id, sight.pixel.cast<float>()});
    }
  }

 private:
  bool is_better(const VisiblePoint& a, const VisiblePoint& b) const {
    if (taken_[a.landmark] != taken_[b.landmark]) return taken_[a.landmark] > taken_[b.landmark];
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
  std::vector<int> taken_;  ///< per landmark: number of keyframes that observe it
};

}  // namespace

void observe_landmarks(SlamMap& map) {
  VisibilityFilter beholder(map);
  for (MapKeyframe& keyframe : map.keyframes) beholder.look(keyframe);
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
  map.observations_are_tested = false;
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
