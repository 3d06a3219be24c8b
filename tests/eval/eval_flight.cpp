// SPDX-License-Identifier: BSD-2-Clause
#include "eval/eval_flight.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>

#include "elementary.h"
#include "pmsp/camera.h"
#include "pmsp/io/depth.h"
#include "util/numbered_name.h"

namespace pmsp_test {
namespace {}  // namespace

Shape box(const Eigen::Vector3d& half_size) {
  return [half_size](const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
    double nearest = 1e9;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      if (direction[axis] == 0.0) continue;
      const double wall = std::copysign(half_size[axis], direction[axis]);
      nearest = std::min(nearest, (wall - from[axis]) / direction[axis]);
    }
    return nearest;
  };
}

Shape sphere(double radius) {
  return [radius](const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
    const double along = from.dot(direction);
    return -along + std::sqrt(along * along - from.squaredNorm() + radius * radius);
  };
}

Flight::Flight(Shape shape, int keyframes, double reach) : shape_(std::move(shape)) {
  for (int i = 0; i < keyframes; ++i) {
    const double t = keyframes > 1 ? 2.0 * i / (keyframes - 1) - 1.0 : 0.0;
    const Eigen::Vector3d position = reach * Eigen::Vector3d(0.2 * t * t, 0.1 * std::sin(3.0 * t), t);
    const Eigen::AngleAxisd turn(0.4 * t, Eigen::Vector3d(0.1, 1.0, 0.05).normalized());
    truth_.push_back({i, i / 10.0, {turn.toRotationMatrix(), position}});
  }
  truth_from_map_ = {
      1.7, Eigen::AngleAxisd(0.8, Eigen::Vector3d(1.0, 2.0, -1.0).normalized()).toRotationMatrix(), {0.4, -0.3, 0.9}};
}

Eigen::Vector3d Flight::to_map(const Eigen::Vector3d& point) const {
  return truth_from_map_.rotation.transpose() * (point - truth_from_map_.translation) / truth_from_map_.scale;
}

std::vector<pmsp::eval::TimedPose> Flight::keyframes() const {
  std::vector<pmsp::eval::TimedPose> result = truth_;
  for (auto& pose : result) {
    pose.world_from_cam = {truth_from_map_.rotation.transpose() * pose.world_from_cam.rotation,
                           to_map(pose.world_from_cam.translation)};
  }
  return result;
}

pmsp::Image<float> Flight::range(std::size_t keyframe, int height) const {
  pmsp::Image<float> image(2 * height, height);
  const pmsp::RigidTransform& pose = truth_[keyframe].world_from_cam;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < 2 * height; ++x) {
      const Eigen::Vector3d bearing = pmsp::bearing_from_pixel({x + 0.5, y + 0.5}, 2 * height, height);
      image(x, y) = static_cast<float>(shape_(pose.translation, pose.rotation * bearing));
    }
  }
  return image;
}

std::vector<Eigen::Vector3d> Flight::points(int height, double factor) const {
  std::vector<Eigen::Vector3d> result;
  for (const auto& pose : truth_) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < 2 * height; ++x) {
        const Eigen::Vector3d direction =
            pose.world_from_cam.rotation * pmsp::bearing_from_pixel({x + 0.5, y + 0.5}, 2 * height, height);
        const double distance = shape_(pose.world_from_cam.translation, direction);
        result.push_back(to_map(pose.world_from_cam.translation + factor * distance * direction));
      }
    }
  }
  return result;
}

void Flight::write_truth(const std::filesystem::path& folder, int height) const {
  std::filesystem::create_directories(folder / "range_mm");
  pmsp::eval::write_tum(folder / "traj_tum.txt", truth_);
  for (std::size_t i = 0; i < truth_.size(); ++i) {
    pmsp::write_png16(folder / "range_mm" / pmsp::numbered_name("", static_cast<std::int64_t>(i), ".png"),
                      range(i, height), 1000.0);
  }
}

std::vector<Eigen::Vector3d> sphere_points(double radius, double spacing) {
  std::vector<Eigen::Vector3d> points;
  const int rings = static_cast<int>(std::ceil(pmsp::kernels::kPi * radius / spacing));
  for (int i = 0; i < rings; ++i) {
    const double polar = (i + 0.5) * pmsp::kernels::kPi / rings;
    const int count =
        std::max(1, static_cast<int>(std::ceil(2.0 * pmsp::kernels::kPi * radius * std::sin(polar) / spacing)));
    for (int j = 0; j < count; ++j) {
      const double angle = 2.0 * pmsp::kernels::kPi * j / count;
      points.push_back(radius * Eigen::Vector3d(std::sin(polar) * std::cos(angle), std::cos(polar),
                                                std::sin(polar) * std::sin(angle)));
    }
  }
  return points;
}

}  // namespace pmsp_test
