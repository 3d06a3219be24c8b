// SPDX-License-Identifier: BSD-2-Clause
#include "synth/mission.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Geometry>

#include "elementary.h"
#include "pmsp/camera.h"
#include "synth/rng.h"

namespace pmsp::synth {
namespace {

Eigen::Matrix3d turn_about_y(double angle) {
  return Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()).toRotationMatrix();
}

bool observes(const Scene& scene, const RigidTransform& cam_from_world, const Eigen::Vector3d& position,
              const LandmarkOptions& options) {
  const Eigen::Vector3d in_camera = cam_from_world * position;
  const double sine = std::abs(in_camera.y()) / in_camera.norm();
  return sine <= std::sin(options.max_latitude_deg * kernels::kDegree) &&
         scene.visible(cam_from_world.center(), position);
}

/// Returns the surface point at a random pixel of a random keyframe.
std::optional<Eigen::Vector3d> random_surface_point(const Mission& mission, const LandmarkOptions& options,
                                                    std::uint64_t draw) {
  const auto index =
      static_cast<std::size_t>(uniform(options.seed, 3 * draw) * static_cast<double>(mission.frames.size()));
  const RigidTransform& cam_from_world = mission.frames[index].cam_from_world;
  const Eigen::Vector2d pixel(uniform(options.seed, 3 * draw + 1) * mission.width,
                              uniform(options.seed, 3 * draw + 2) * mission.height);
  const Eigen::Vector3d bearing = bearing_from_pixel(pixel, mission.width, mission.height);
  const std::optional<Hit> hit =
      mission.scene.intersect(cam_from_world.center(), cam_from_world.rotation.transpose() * bearing);
  if (!hit || mission.scene.contrast(*hit) < options.min_contrast) {
    return std::nullopt;
  }
  return hit->position;
}

void add_landmark(Mission& mission, const Eigen::Vector3d& position, const std::vector<std::size_t>& observers,
                  const LandmarkOptions& options) {
  const auto id = static_cast<std::int64_t>(mission.points.size());
  const double distance = (position - mission.frames[observers.front()].cam_from_world.center()).norm();
  Eigen::Vector3d noisy = position;
  for (int c = 0; c < 3; ++c) {
    const std::uint64_t counter = 3 * static_cast<std::uint64_t>(id) + static_cast<std::uint64_t>(c);
    noisy[c] += options.noise * distance * gaussian(mix(options.seed, 1), counter);
  }
  mission.points.push_back({id, position});
  for (const std::size_t observer : observers) {
    mission.frames[observer].landmarks.push_back({id, noisy});
  }
}

void add_landmarks(Mission& mission, const LandmarkOptions& options) {
  const auto min_views = std::min(static_cast<std::size_t>(std::max(options.min_views, 1)), mission.frames.size());
  // Bounds the search in mostly hidden or open scenes.
  const std::uint64_t max_draws = 20 * static_cast<std::uint64_t>(options.count);
  for (std::uint64_t draw = 0; draw < max_draws; ++draw) {
    if (mission.points.size() >= static_cast<std::size_t>(options.count)) {
      break;
    }
    const std::optional<Eigen::Vector3d> position = random_surface_point(mission, options, draw);
    if (!position) {
      continue;
    }
    std::vector<std::size_t> observers;
    for (std::size_t i = 0; i < mission.frames.size(); ++i) {
      if (observes(mission.scene, mission.frames[i].cam_from_world, *position, options)) {
        observers.push_back(i);
      }
    }
    if (observers.size() >= min_views) {
      add_landmark(mission, *position, observers, options);
    }
  }
}

template <class T>
Image<T> rolled_left(const Image<T>& image, int columns) {
  Image<T> result = image;
  for (int y = 0; y < image.height(); ++y) {
    std::rotate(result.row(y), result.row(y) + columns, result.row(y) + image.width());
  }
  return result;
}

}  // namespace

std::vector<RigidTransform> fly(const Flight& flight) {
  const Eigen::Vector3d along = flight.direction.normalized();
  const Eigen::Vector3d right = Eigen::Vector3d::UnitY().cross(along).normalized();
  Eigen::Matrix3d level;
  level << right, Eigen::Vector3d::UnitY(), right.cross(Eigen::Vector3d::UnitY());
  std::vector<RigidTransform> poses;
  for (int i = 0; i < flight.keyframes; ++i) {
    const double phase = 1.3 * i;
    const Eigen::Vector3d center =
        flight.start + i * flight.step * along +
        flight.sway * (std::sin(phase) * right + 0.7 * std::sin(1.7 * phase + 1.0) * Eigen::Vector3d::UnitY());
    const double wobble = flight.wobble_deg * kernels::kDegree;
    const Eigen::Matrix3d turn =
        turn_about_y(wobble * std::sin(0.9 * phase + 0.4)) *
        Eigen::AngleAxisd(0.7 * wobble * std::sin(1.1 * phase + 2.0), Eigen::Vector3d::UnitX()).toRotationMatrix() *
        Eigen::AngleAxisd(0.5 * wobble * std::sin(1.4 * phase), Eigen::Vector3d::UnitZ()).toRotationMatrix();
    const RigidTransform world_from_cam{level * turn, center};
    poses.push_back(yawed(world_from_cam.inverse(), flight.yaw_deg));
  }
  return poses;
}

RigidTransform yawed(const RigidTransform& cam_from_world, double yaw_deg) {
  return RigidTransform{turn_about_y(-yaw_deg * kernels::kDegree), Eigen::Vector3d::Zero()} * cam_from_world;
}

Mission make_mission(const Scene& scene, const std::vector<RigidTransform>& poses, int width, int height,
                     const MissionOptions& options) {
  Mission mission{scene, width, height, {}, {}, {}};
  for (std::size_t i = 0; i < poses.size(); ++i) {
    RenderOptions render_options = options.render;
    render_options.gain *= 1.0 + options.gain_drift * std::sin(1.9 * static_cast<double>(i) + 0.5);
    render_options.seed = mix(options.render.seed, i);
    Scene scene_then = scene;
    if (options.movers) {
      options.movers(scene_then, i);
    }
    RenderedView view = render(scene_then, poses[i], width, height, render_options);
    Frame frame;
    frame.id = options.first_id + static_cast<std::int64_t>(i);
    frame.timestamp = static_cast<double>(i) / options.fps;
    frame.cam_from_world = poses[i];
    frame.image = std::move(view.image);
    frame.depth = std::move(view.depth);
    frame.normal = std::move(view.normal);
    frame.surface = std::move(view.surface);
    frame.label = std::move(view.label);
    mission.frames.push_back(std::move(frame));
  }
  if (!mission.frames.empty()) {
    add_landmarks(mission, options.landmarks);
  }
  return mission;
}

Keyframe keyframe_of(const Mission& mission, std::size_t index) {
  const Frame& frame = mission.frames.at(index);
  Keyframe keyframe;
  keyframe.id = frame.id;
  keyframe.timestamp = frame.timestamp;
  keyframe.cam_from_world = frame.cam_from_world;
  keyframe.landmarks = frame.landmarks;
  keyframe.image = frame.image.view();
  if (!mission.mask.empty()) {
    keyframe.mask = mission.mask.view();
  }
  return keyframe;
}

Mission scaled(const Mission& mission, double factor) {
  Mission result = mission;
  result.scene = mission.scene.scaled(factor);
  for (Frame& frame : result.frames) {
    frame.cam_from_world.translation *= factor;
    for (float& depth : frame.depth.pixels()) {
      depth = static_cast<float>(depth * factor);
    }
    for (Landmark& landmark : frame.landmarks) {
      landmark.position_world *= factor;
    }
  }
  for (SurfacePoint& point : result.points) {
    point.position_world *= factor;
  }
  return result;
}

Mission turned(const Mission& mission, int columns) {
  Mission result = mission;
  const int shift = ((columns % mission.width) + mission.width) % mission.width;
  const double yaw_deg = 360.0 * shift / mission.width;
  const Eigen::Matrix3f turn = turn_about_y(-yaw_deg * kernels::kDegree).cast<float>();
  for (Frame& frame : result.frames) {
    frame.cam_from_world = yawed(frame.cam_from_world, yaw_deg);
    frame.image = rolled_left(frame.image, shift);
    frame.depth = rolled_left(frame.depth, shift);
    frame.normal = rolled_left(frame.normal, shift);
    frame.surface = rolled_left(frame.surface, shift);
    frame.label = rolled_left(frame.label, shift);
    for (Eigen::Vector3f& normal : frame.normal.pixels()) {
      normal = turn * normal;
    }
  }
  if (!mission.mask.empty()) {
    result.mask = rolled_left(mission.mask, shift);
  }
  return result;
}

double share_within(const Image<float>& depth, const Image<float>& truth, double relative,
                    const std::function<bool(int, int)>& counts) {
  std::int64_t total = 0;
  std::int64_t good = 0;
  for (int y = 0; y < truth.height(); ++y) {
    for (int x = 0; x < truth.width(); ++x) {
      const double expected = truth(x, y);
      if (expected <= 0.0 || (counts && !counts(x, y))) {
        continue;
      }
      ++total;
      const double found = depth(x, y);
      good += found > 0.0 && std::abs(found - expected) <= relative * expected ? 1 : 0;
    }
  }
  return total > 0 ? static_cast<double>(good) / static_cast<double>(total) : 0.0;
}

}  // namespace pmsp::synth
