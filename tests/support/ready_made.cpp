// SPDX-License-Identifier: BSD-2-Clause
#include <optional>
#include <string>

#include <Eigen/Geometry>

#include "pmsp/error.h"
#include "support/mission.h"

namespace pmsp::synth {
namespace {

/// Kept between the last camera and what lies ahead [scene units].
constexpr double kClearance = 0.6;

/// Hands out the textures of one mission.
class Textures {
 public:
  explicit Textures(const Recipe& recipe) : recipe_(recipe) {}

  /// Blobs of about 2 to 12 pixels of a 640 x 320 image when seen from `distance`.
  TextureOptions at(double distance) {
    const std::uint64_t seed = 1000 * recipe_.texture_seed + next_++;
    TextureOptions options = recipe_.weak_texture ? weak(seed) : textured(seed);
    options.coarsest = 0.12 * distance;
    return options;
  }

 private:
  const Recipe& recipe_;
  std::uint64_t next_ = 0;
};

Mission make(const Recipe& recipe, const Scene& scene, Flight flight) {
  flight.keyframes = recipe.keyframes;
  flight.yaw_deg += recipe.yaw_deg;
  const double length = flight.step * (recipe.keyframes - 1);
  const std::optional<Hit> ahead = scene.intersect(flight.start, flight.direction);
  if (ahead && ahead->distance < length + kClearance) {
    const int most = 1 + static_cast<int>((ahead->distance - kClearance) / flight.step);
    throw InvalidOption("keyframes = " + std::to_string(recipe.keyframes) + ": the flight would meet a wall; at most " +
                        std::to_string(most) + " keyframes fit into this scene.");
  }
  return make_mission(scene, fly(flight), recipe.width, recipe.height, recipe.mission);
}

/// A box that stands on the floor of the room.
Box furniture(double x, double z, const Eigen::Vector3d& size, double turned_deg) {
  constexpr double kFloor = 1.5;
  Box box;
  box.half_size = 0.5 * size;
  box.center = Eigen::Vector3d(x, kFloor - box.half_size.y(), z);
  box.world_from_box =
      Eigen::AngleAxisd(turned_deg * 3.14159265358979323846 / 180.0, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return box;
}

Flight through_room() {
  Flight flight;
  flight.start = Eigen::Vector3d(0.2, 0.1, -1.6);
  flight.step = 0.36;
  return flight;
}

}  // namespace

Mission empty_room(const Recipe& recipe) {
  Textures textures(recipe);
  Scene scene;
  scene.add(Box{Eigen::Vector3d::Zero(), {3.0, 1.5, 4.0}, Eigen::Matrix3d::Identity()}, textures.at(2.6));
  return make(recipe, scene, through_room());
}

Mission textured_room(const Recipe& recipe) {
  Textures textures(recipe);
  Scene scene;
  scene.add(Box{Eigen::Vector3d::Zero(), {3.0, 1.5, 4.0}, Eigen::Matrix3d::Identity()}, textures.at(2.6));
  scene.add(furniture(-2.5, -1.0, {0.8, 2.0, 1.6}, 0.0), textures.at(2.0));   // cupboard at the left wall
  scene.add(furniture(2.2, 1.2, {1.2, 0.8, 1.8}, 20.0), textures.at(2.0));    // desk on the right
  scene.add(furniture(-1.2, 2.6, {1.0, 1.1, 0.8}, -35.0), textures.at(2.0));  // crate ahead
  scene.add(furniture(1.3, -3.0, {0.9, 1.7, 0.7}, 10.0), textures.at(2.0));   // shelf behind
  scene.add(furniture(-0.9, 0.6, {0.5, 0.5, 0.5}, 45.0), textures.at(1.5));   // stool beside the line of flight
  return make(recipe, scene, through_room());
}

Mission painted_room(const Recipe& recipe) {
  constexpr double kThin = 0.02;  // what hangs on a wall is as thick
  Textures textures(recipe);
  Scene scene;
  const auto upright = [&](double x, double y, double z, const Eigen::Vector3d& size, const TextureOptions& texture) {
    scene.add(Box{{x, y, z}, 0.5 * size, Eigen::Matrix3d::Identity()}, texture);
  };
  const auto plain = [&](std::uint64_t seed, const Eigen::Vector3d& base) {
    TextureOptions texture = painted(1000 * recipe.texture_seed + 100 + seed);
    texture.base = base;
    return texture;
  };
  const Eigen::Vector3d white(225.0, 222.0, 215.0);
  scene.add(Box{Eigen::Vector3d::Zero(), {3.0, 1.5, 4.0}, Eigen::Matrix3d::Identity()},
            plain(0, {200.0, 195.0, 180.0}));                          // walls and ceiling
  upright(0.0, 1.5, 0.0, {6.0, 2.0 * kThin, 8.0}, textures.at(2.0));   // floor
  upright(-3.0, 1.42, 0.0, {2.0 * kThin, 0.1, 8.0}, plain(1, white));  // skirting boards
  upright(3.0, 1.42, 0.0, {2.0 * kThin, 0.1, 8.0}, plain(2, white));
  upright(0.0, 1.42, 4.0, {6.0, 0.1, 2.0 * kThin}, plain(3, white));
  upright(0.0, 1.42, -4.0, {6.0, 0.1, 2.0 * kThin}, plain(4, white));
  upright(3.0, 0.48, -0.8, {2.0 * kThin, 2.04, 0.9}, plain(5, {130.0, 95.0, 70.0}));  // door on the right
  upright(-3.0, -0.3, 1.2, {2.0 * kThin, 0.8, 1.1}, textures.at(2.0));                // pictures
  upright(3.0, -0.3, 1.6, {2.0 * kThin, 0.6, 0.6}, textures.at(2.0));
  upright(0.9, -0.4, 4.0, {1.2, 0.9, 2.0 * kThin}, textures.at(2.5));
  upright(-0.8, -0.2, -4.0, {0.8, 0.6, 2.0 * kThin}, textures.at(2.5));
  upright(0.3, -1.45, 0.9, {0.3, 0.1, 0.3}, textures.at(1.5));               // lamp
  scene.add(furniture(-2.5, -1.0, {0.8, 2.0, 1.6}, 0.0), plain(6, white));   // white cupboard
  scene.add(furniture(2.2, 1.2, {1.2, 0.8, 1.8}, 20.0), textures.at(2.0));   // bed on the right
  scene.add(furniture(1.3, -3.0, {0.9, 1.7, 0.7}, 10.0), textures.at(2.0));  // shelf behind
  scene.add(furniture(-0.9, 0.6, {0.5, 0.5, 0.5}, 45.0), textures.at(1.5));  // stool
  Recipe with_marks = recipe;
  with_marks.mission.landmarks.min_contrast = 20.0;
  return make(with_marks, scene, through_room());
}

Mission sphere_inside(const Recipe& recipe) {
  Textures textures(recipe);
  Scene scene;
  scene.add(Sphere{Eigen::Vector3d(0.1, -0.1, 0.0), 2.8}, textures.at(2.8));
  Flight flight;
  flight.start = Eigen::Vector3d(0.0, 0.0, -1.1);
  flight.step = 0.36;
  return make(recipe, scene, flight);
}

Mission slanted_plane(const Recipe& recipe) {
  Textures textures(recipe);
  Scene scene;
  scene.add(Plane{Eigen::Vector3d(0.9, 0.4, 0.9), Eigen::Vector3d(-0.7, -0.4, -0.5).normalized()}, textures.at(2.2));
  scene.add(Sphere{Eigen::Vector3d::Zero(), 3.0}, textures.at(3.0));
  Flight flight;
  flight.start = Eigen::Vector3d(0.7, 0.0, -1.0);
  flight.direction = Eigen::Vector3d(-0.71, 0.0, 1.0);
  flight.step = 0.3;
  return make(recipe, scene, flight);
}

Mission corridor_across_seam(const Recipe& recipe) {
  Textures textures(recipe);
  Scene scene;
  scene.add(Box{Eigen::Vector3d::Zero(), {1.1, 1.3, 9.0}, Eigen::Matrix3d::Identity()}, textures.at(1.5));
  Flight flight;
  flight.start = Eigen::Vector3d(0.1, 0.0, -1.0);
  flight.step = 0.22;
  flight.sway = 0.04;
  flight.yaw_deg = 80.0;
  return make(recipe, scene, flight);
}

Mission floor_at_nadir(const Recipe& recipe) {
  Textures textures(recipe);
  Scene scene;
  scene.add(Plane{Eigen::Vector3d(0.0, 1.6, 0.0), -Eigen::Vector3d::UnitY()}, textures.at(2.0));
  scene.add(Sphere{Eigen::Vector3d::Zero(), 3.6}, textures.at(3.6));
  Flight flight;
  flight.start = Eigen::Vector3d(0.0, 0.0, -1.0);
  flight.step = 0.36;
  return make(recipe, scene, flight);
}

}  // namespace pmsp::synth
