// SPDX-License-Identifier: BSD-2-Clause
#include "plan/missions.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include <Eigen/Geometry>

#include "elementary.h"

namespace pmsp::test {
namespace {

using Eigen::Vector3d;

double uniform(std::mt19937& random, double from, double to) {
  return from + (to - from) * (static_cast<double>(random()) / 4294967296.0);
}

/// Points on the walls, floor and ceiling along a path that runs through (x, z).
std::vector<Vector3d> points_along(const std::vector<Vector3d>& path, double length, const MissionRecipe& recipe,
                                   std::mt19937& random) {
  std::vector<Vector3d> points;
  const int count = static_cast<int>(length * recipe.density);
  for (int i = 0; i < count; ++i) {
    const Vector3d& at = path[random() % path.size()];
    const double around = uniform(random, 0.0, 2.0 * kernels::kPi);
    const double across = uniform(random, -1.0, 1.0);
    points.push_back(at +
                     Vector3d(uniform(random, -3.0, 3.0), 1.25 * std::sin(around), 1.6 * std::cos(around) + across));
  }
  return points;
}

struct Cell {
  int x, z;
  bool operator==(const Cell& other) const { return x == other.x && z == other.z; }
};
struct CellHash {
  std::size_t operator()(const Cell& cell) const {
    return static_cast<std::size_t>(cell.x) * 73856093U ^ static_cast<std::size_t>(cell.z) * 19349663U;
  }
};

/// Observations from each position: a share of the landmarks within range, by a hash of landmark and position.
std::vector<PlanKeyframe> see(const std::vector<Vector3d>& places, const std::vector<Vector3d>& points,
                              const MissionRecipe& recipe, std::mt19937& random) {
  std::unordered_map<Cell, std::vector<std::size_t>, CellHash> grid;
  const auto cell_of = [&](const Vector3d& p) {
    return Cell{static_cast<int>(std::floor(p.x() / recipe.sight)), static_cast<int>(std::floor(p.z() / recipe.sight))};
  };
  for (std::size_t i = 0; i < points.size(); ++i) grid[cell_of(points[i])].push_back(i);
  std::vector<PlanKeyframe> result;
  std::int64_t id = recipe.first_id;
  for (const Vector3d& place : places) {
    PlanKeyframe keyframe;
    while (uniform(random, 0.0, 1.0) < recipe.skipped_ids) ++id;
    keyframe.id = id++;
    const Eigen::Matrix3d rotation =
        Eigen::AngleAxisd(uniform(random, -kernels::kPi, kernels::kPi), Vector3d::UnitY()).toRotationMatrix();
    keyframe.cam_from_world = {rotation, -(rotation * place)};
    std::vector<std::pair<double, std::size_t>> seen;
    const Cell center = cell_of(place);
    for (int dx = -1; dx <= 1; ++dx) {
      for (int dz = -1; dz <= 1; ++dz) {
        const auto found = grid.find({center.x + dx, center.z + dz});
        if (found == grid.end()) continue;
        for (const std::size_t i : found->second) {
          const double distance = (points[i] - place).norm();
          if (distance < recipe.sight) seen.emplace_back(distance * (1.0 + 0.2 * static_cast<double>(i % 7)), i);
        }
      }
    }
    std::sort(seen.begin(), seen.end());
    seen.resize(std::min(seen.size(), static_cast<std::size_t>(recipe.landmarks_seen)));
    for (const auto& [distance, i] : seen) keyframe.landmarks.push_back({static_cast<std::int64_t>(i), points[i]});
    std::sort(keyframe.landmarks.begin(), keyframe.landmarks.end(),
              [](const Landmark& a, const Landmark& b) { return a.id < b.id; });
    result.push_back(std::move(keyframe));
  }
  return result;
}

}  // namespace

std::vector<PlanKeyframe> corridor(const MissionRecipe& recipe, int passes) {
  std::mt19937 random(recipe.seed);
  std::vector<Vector3d> places;
  const int each = recipe.keyframes / passes;
  for (int pass = 0; pass < passes; ++pass) {
    for (int i = 0; i < each; ++i) {
      const double x = recipe.step * (pass % 2 == 0 ? i : each - 1 - i);
      places.push_back(
          Vector3d{x + uniform(random, -0.05, 0.05), uniform(random, -0.05, 0.05), 0.15 * (pass - passes / 2)});
    }
  }
  std::vector<Vector3d> line;
  for (int i = 0; i < each; ++i) line.emplace_back(recipe.step * i, 0.0, 0.0);
  const auto points = points_along(line, recipe.step * each + 6.0, recipe, random);
  return see(places, points, recipe, random);
}

std::vector<PlanKeyframe> loop(const MissionRecipe& recipe) {
  std::mt19937 random(recipe.seed);
  std::vector<Vector3d> places;
  const double length = recipe.step * recipe.keyframes;
  const double radius = length / (2.0 * kernels::kPi * 1.1);  // the last tenth runs where the first one did
  for (int i = 0; i < recipe.keyframes; ++i) {
    const double angle = recipe.step * i / radius;
    places.emplace_back(radius * std::cos(angle), uniform(random, -0.05, 0.05), radius * std::sin(angle));
  }
  return see(places, points_along(places, length, recipe, random), recipe, random);
}

std::vector<PlanKeyframe> walk(const MissionRecipe& recipe) {
  std::mt19937 random(recipe.seed);
  std::vector<Vector3d> places;
  Vector3d at = Vector3d::Zero();
  double heading = 0.0;
  double speed = 1.0;
  for (int i = 0; i < recipe.keyframes; ++i) {
    places.push_back(at);
    heading += uniform(random, -0.3, 0.3);
    if (random() % 16 == 0) speed = uniform(random, 0.0, 1.0) < 0.3 ? 0.02 : uniform(random, 0.3, 2.0);
    at += speed * recipe.step * Vector3d(std::cos(heading), 0.0, std::sin(heading));
    at.y() = uniform(random, -0.1, 0.1);
  }
  return see(places, points_along(places, recipe.step * recipe.keyframes, recipe, random), recipe, random);
}

std::vector<PlanKeyframe> photos(const MissionRecipe& recipe) {
  std::mt19937 random(recipe.seed);
  const double side = 1.2 * std::sqrt(static_cast<double>(recipe.keyframes));
  std::vector<Vector3d> places;
  for (int i = 0; i < recipe.keyframes; ++i) {
    places.push_back(Vector3d{uniform(random, 0.0, side), uniform(random, -0.2, 0.2), uniform(random, 0.0, side)});
  }
  std::vector<Vector3d> points;
  for (int i = 0; i < 15 * recipe.keyframes; ++i) {
    points.push_back(
        Vector3d{uniform(random, -2.0, side + 2.0), uniform(random, -1.4, 1.4), uniform(random, -2.0, side + 2.0)});
  }
  return see(places, points, recipe, random);
}

SharpnessRecord sharpness(const PlanKeyframe& keyframe, float factor) {
  SharpnessRecord record;
  for (const Landmark& landmark : keyframe.landmarks) {
    const float own = 0.5F + 0.1F * static_cast<float>(landmark.id % 9);
    record.landmarks.push_back({landmark.id, own * factor, own * factor});
  }
  std::sort(record.landmarks.begin(), record.landmarks.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
  return record;
}

std::vector<PlanKeyframe> jittered(std::vector<PlanKeyframe> keyframes, double by, std::uint32_t seed) {
  std::mt19937 random(seed);
  for (PlanKeyframe& keyframe : keyframes) {
    Vector3d shift;
    for (int i = 0; i < 3; ++i) shift[i] = uniform(random, -by, by);
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(uniform(random, -by, by), Vector3d(1.0, 2.0, 3.0).normalized()).toRotationMatrix();
    keyframe.cam_from_world.rotation = turn * keyframe.cam_from_world.rotation;
    keyframe.cam_from_world.translation = turn * keyframe.cam_from_world.translation + shift;
  }
  return keyframes;
}

std::string difference(const Plan& a, const Plan& b) {
  if (a.entries.size() != b.entries.size()) return "another number of entries";
  std::string result;
  for (std::size_t i = 0; i < a.entries.size(); ++i) {
    const PlanEntry& x = a.entries[i];
    const PlanEntry& y = b.entries[i];
    if (x == y) continue;
    result += "keyframe " + std::to_string(x.id) + ":";
    if (x.use != y.use) result += std::string(" ") + name_of(x.use) + " / " + name_of(y.use);
    if (x.near != y.near) result += " near";
    if (x.first_planes != y.first_planes) result += " first_planes";
    if (x.range.min != y.range.min || x.range.max != y.range.max) result += " range";
    if (x.consistency != y.consistency) result += " consistency";
    if (x.fusion != y.fusion) result += " fusion";
    if (x.viewers != y.viewers) result += " viewers";
    if (x.duplicate_views != y.duplicate_views) result += " duplicate_views";
    result += "; ";
  }
  return result;
}

}  // namespace pmsp::test
