// SPDX-License-Identifier: BSD-2-Clause
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "elementary.h"
#include "pmsp/error.h"
#include "synth/mission.h"

namespace pmsp::synth {
namespace {

/// Clearance between the last camera and the scene ahead [m].
constexpr double kClearance = 0.6;

constexpr double kFloor = 1.5;

/// Textures of one mission.
class Textures {
 public:
  explicit Textures(const Recipe& recipe) : recipe_(recipe) {}

  /// Returns a texture with blobs of about 2 to 12 pixels of a 640 x 320 image at `distance`.
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

Eigen::Matrix3d turned_by(double degrees, const Eigen::Vector3d& axis = Eigen::Vector3d::UnitY()) {
  return Eigen::AngleAxisd(degrees * kernels::kPi / 180.0, axis).toRotationMatrix();
}

/// Returns a box on the floor of the room.
Box furniture(double x, double z, const Eigen::Vector3d& size, double turned_deg) {
  Box box;
  box.half_size = 0.5 * size;
  box.center = Eigen::Vector3d(x, kFloor - box.half_size.y(), z);
  box.world_from_box = turned_by(turned_deg);
  return box;
}

Box block(double x, double y, double z, const Eigen::Vector3d& size) {
  return Box{{x, y, z}, 0.5 * size, Eigen::Matrix3d::Identity()};
}

Cylinder rod(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double diameter) {
  return Cylinder{0.5 * (from + to), (to - from).normalized(), 0.5 * diameter, 0.5 * (to - from).norm()};
}

/// Returns `texture` with another mean colour and contrast.
TextureOptions tinted(TextureOptions texture, const Eigen::Vector3d& base, double contrast) {
  texture.base = base;
  texture.contrast = contrast;
  return texture;
}

/// Parts of a cyclist or driver visible to their camera, in its axes.
Scene make_rider(Textures textures) {
  Scene scene;
  const TextureOptions skin = tinted(textures.at(0.5), {190.0, 140.0, 115.0}, 12.0);
  const TextureOptions plastic = tinted(textures.at(0.8), {60.0, 62.0, 66.0}, 14.0);
  scene.add(Box{{0.0, 0.62, 0.55}, {0.7, 0.06, 0.22}, Eigen::Matrix3d::Identity()}, plastic);       // dashboard
  scene.add(rod({0.0, 0.05, 0.0}, {0.0, 0.6, 0.02}, 0.03), plastic);                                // pole
  scene.add(Sphere{{0.05, 0.42, 0.08}, 0.06}, skin);                                                // hand
  scene.add(rod({0.05, 0.45, 0.1}, {0.3, 0.75, -0.3}, 0.08), skin);                                 // arm
  scene.add(Sphere{{0.1, 0.35, -0.55}, 0.13}, tinted(textures.at(0.5), {90.0, 70.0, 55.0}, 20.0));  // head
  return scene;
}

/// Adds figures that walk to and fro across the trajectory, and a bus that overtakes the camera.
void add_movers(Scene& scene, Textures textures, int count, const Flight& flight, std::size_t index) {
  const auto time = static_cast<double>(index);
  const Eigen::Vector3d here = flight.start + time * flight.step * flight.direction.normalized();
  for (int i = 0; i < count; ++i) {
    const double phase = 1.7 * i;
    const Eigen::Vector3d feet(3.2 * std::sin(0.35 * time + phase), kFloor,
                               here.z() + 2.5 * std::cos(phase + 0.2 * time));
    TextureOptions skin = tinted(textures.at(0.5), {190.0, 140.0, 115.0}, 12.0);
    TextureOptions cloth = tinted(textures.at(1.5), {60.0 + 40.0 * (i % 4), 70.0, 150.0 - 30.0 * (i % 4)}, 22.0);
    skin.origin = cloth.origin = feet;
    const double swing = 0.25 * std::sin(2.0 * time + phase);
    const auto add = [&](const Primitive& primitive, const TextureOptions& texture) {
      scene.add(primitive, texture, {}, Label::kMover);
    };
    for (const double side : {-1.0, 1.0}) {
      add(rod(feet + Eigen::Vector3d(side * swing, 0.0, 0.1 * side), feet + Eigen::Vector3d(0.0, -0.85, 0.06 * side),
              0.15),
          cloth);
    }
    add(rod(feet + Eigen::Vector3d(0.0, -0.85, 0.0), feet + Eigen::Vector3d(0.0, -1.5, 0.0), 0.4), cloth);
    add(Sphere{feet + Eigen::Vector3d(0.0, -1.65, 0.0), 0.13}, skin);
  }
  if (count > 2) {
    TextureOptions paint = tinted(textures.at(3.0), {180.0, 60.0, 50.0}, 25.0);
    paint.origin.z() = -14.0 + 1.1 * time;
    scene.add(block(4.4, kFloor - 1.4, paint.origin.z(), {2.2, 2.6, 7.0}), paint, {}, Label::kMover);
  }
}

/// Renders with the rider if the recipe has one.
Mission render_mission(Recipe recipe, const Scene& scene, const std::vector<RigidTransform>& poses) {
  const Scene rider = make_rider(Textures(recipe));
  if (recipe.rider) recipe.mission.render.rider = &rider;
  return make_mission(scene, poses, recipe.width, recipe.height, recipe.mission);
}

Mission make(Recipe recipe, const Scene& scene, Flight flight) {
  flight.keyframes = recipe.keyframes;
  flight.yaw_deg += recipe.yaw_deg;
  const double length = flight.step * (recipe.keyframes - 1);
  const std::optional<Hit> ahead = scene.intersect(flight.start, flight.direction);
  if (ahead && ahead->distance < length + kClearance) {
    const int most = 1 + static_cast<int>((ahead->distance - kClearance) / flight.step);
    throw InvalidOption("keyframes is " + std::to_string(recipe.keyframes) + "; expected at most " +
                        std::to_string(most) + " in this scene: the path would hit a wall");
  }
  if (recipe.movers > 0) {
    recipe.mission.movers = [&](Scene& then, std::size_t index) {
      add_movers(then, Textures(recipe), recipe.movers, flight, index);
    };
  }
  return render_mission(recipe, scene, fly(flight));
}

Flight through_room() {
  Flight flight;
  flight.start = Eigen::Vector3d(0.2, 0.1, -1.6);
  flight.step = 0.36;
  return flight;
}

/// For rooms twice as long as the others.
Flight through_long_room() {
  Flight flight = through_room();
  flight.start.z() = -5.0;
  return flight;
}

/// Behind the glass wall of glossy_room, x < -3.1: reflections of the room show best on distant plain surfaces.
void add_street(Scene& scene, Textures& textures) {
  const Eigen::Vector3d plaster(205.0, 190.0, 165.0);
  const Eigen::Vector3d dark(70.0, 80.0, 95.0);
  scene.add(block(-4.3, 1.65, 0.0, {2.4, 0.2, 60.0}), textures.at(3.0));                                    // pavement
  scene.add(block(-9.0, 1.75, 0.0, {7.0, 0.2, 60.0}), tinted(textures.at(5.0), {95.0, 95.0, 98.0}, 10.0));  // road
  scene.add(block(-13.0, -4.2, 0.0, {1.0, 12.0, 60.0}), tinted(textures.at(9.0), plaster, 12.0));           // house
  scene.add(block(-12.45, 0.9, 0.0, {0.2, 1.6, 60.0}), textures.at(9.0));                                   // its base
  scene.add(block(-8.0, -4.2, 26.0, {10.0, 12.0, 1.0}), textures.at(20.0));  // street's ends
  scene.add(block(-8.0, -4.2, -26.0, {10.0, 12.0, 1.0}), textures.at(20.0));
  for (int i = -5; i <= 5; ++i) {
    const double z = 3.6 * i;
    scene.add(block(-12.45, -1.6, z, {0.2, 1.8, 1.3}), tinted(textures.at(9.0), dark, 25.0));  // windows
    scene.add(block(-12.45, -4.8, z, {0.2, 1.8, 1.3}), tinted(textures.at(9.0), dark, 25.0));
  }
  for (const double z : {-5.5, -0.4, 4.9}) {  // parked cars
    scene.add(block(-7.2, 1.2, z, {1.7, 0.7, 3.9}), tinted(textures.at(4.0), {150.0, 50.0 + 8.0 * z, 60.0}, 20.0));
    scene.add(block(-7.2, 0.6, z - 0.2, {1.4, 0.6, 2.0}), tinted(textures.at(4.0), dark, 25.0));
  }
  for (const double z : {-3.4, 2.3, 8.5}) {  // trees
    scene.add(rod({-5.0, 1.6, z}, {-5.0, -1.2, z}, 0.2), textures.at(2.0));
    scene.add(Sphere{{-5.0, -2.0, z}, 1.1}, tinted(textures.at(2.0), {70.0, 110.0, 60.0}, 35.0));
  }
}

void add_chair(Scene& scene, double x, double z, double turned_deg, const TextureOptions& texture) {
  const Eigen::Matrix3d turn = turned_by(turned_deg);
  const auto at = [&](double right, double up, double ahead) -> Eigen::Vector3d {
    return Eigen::Vector3d(x, kFloor - up, z) + turn * Eigen::Vector3d(right, 0.0, ahead);
  };
  const auto add_rod = [&](const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
    scene.add(rod(from, to, 0.03), texture, {}, Label::kThin);
  };
  for (const double side : {-0.19, 0.19}) {
    add_rod(at(side, 0.0, 0.19), at(side, 0.44, 0.19));
    add_rod(at(side, 0.0, -0.19), at(side, 0.95, -0.19));
  }
  for (const double height : {0.7, 0.92}) {
    add_rod(at(-0.19, height, -0.19), at(0.19, height, -0.19));
  }
  scene.add(Box{at(0.0, 0.46, 0.0), {0.21, 0.02, 0.21}, turn}, texture);
}

/// Adds a hanging cable between two points, as pieces of a parabola.
void add_cable(Scene& scene, const Eigen::Vector3d& from, const Eigen::Vector3d& to, double sag, double diameter,
               const TextureOptions& texture) {
  constexpr int kPieces = 10;
  const auto at = [&](int i) -> Eigen::Vector3d {
    const double t = static_cast<double>(i) / kPieces;
    return from + t * (to - from) + 4.0 * sag * t * (1.0 - t) * Eigen::Vector3d::UnitY();
  };
  for (int i = 0; i < kPieces; ++i) {
    scene.add(rod(at(i), at(i + 1), diameter), texture, {}, Label::kThin);
  }
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
  scene.add(furniture(-0.9, 0.6, {0.5, 0.5, 0.5}, 45.0), textures.at(1.5));   // stool beside the trajectory
  return make(recipe, scene, through_room());
}

Mission painted_room(const Recipe& recipe) {
  constexpr double kThin = 0.02;  // thickness of objects on walls
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

Mission glossy_room(const Recipe& recipe) {
  Textures textures(recipe);
  Scene scene;
  scene.add(block(0.0, 1.55, 0.0, {6.2, 0.1, 13.0}), tinted(textures.at(1.2), {125.0, 115.0, 105.0}, 10.0), {0.15},
            Label::kGlossy);  // floor
  scene.add(block(0.0, -1.55, 0.0, {6.2, 0.1, 13.0}),
            tinted(textures.at(2.6), {195.0, 188.0, 175.0}, 20.0));      // ceiling
  scene.add(block(3.05, 0.0, 0.0, {0.1, 3.0, 13.0}), textures.at(2.8));  // walls
  scene.add(block(0.0, 0.0, 6.55, {6.2, 3.0, 0.1}), textures.at(2.8));
  scene.add(block(0.0, 0.0, -6.55, {6.2, 3.0, 0.1}), textures.at(2.8));
  const TextureOptions lamp = plain({1000.0, 990.0, 960.0});  // bright enough for white reflections on the floor
  for (const double z : {-4.8, -1.6, 1.6, 4.8}) {
    scene.add(block(0.4, -1.48, z, {0.3, 0.04, 1.3}), lamp);
  }
  scene.add(rod({1.25, -1.5, 0.2}, {1.25, 1.5, 0.2}, 0.7), tinted(textures.at(1.2), {140.0, 135.0, 125.0}, 12.0),
            {0.35},
            Label::kGlossy);  // column

  scene.add(block(-3.05, 1.35, 0.0, {0.1, 0.3, 13.0}), textures.at(2.8));  // below and above the glass wall
  scene.add(block(-3.05, -1.3, 0.0, {0.1, 0.4, 13.0}), textures.at(2.8));
  for (const double z : {-6.3, -3.15, 0.0, 3.15, 6.3}) {  // its posts
    scene.add(block(-3.05, 0.0, z, {0.1, 3.0, 0.16}), tinted(textures.at(1.5), {90.0, 90.0, 95.0}, 20.0));
  }
  scene.add(block(-3.05, 0.05, 0.0, {0.012, 2.3, 13.0}), lamp, {0.1, true});
  add_street(scene, textures);

  scene.add(block(2.97, -0.3, -2.6, {0.06, 0.9, 1.3}), textures.at(2.0));  // pictures
  scene.add(block(2.97, -0.2, 3.4, {0.06, 0.8, 0.8}), textures.at(2.0));
  scene.add(furniture(2.6, -4.4, {0.7, 2.0, 1.4}, 0.0), textures.at(2.0));    // cupboard
  scene.add(furniture(2.3, -1.2, {0.9, 0.75, 1.7}, 8.0), textures.at(2.0));   // desk
  scene.add(furniture(-1.9, 1.9, {0.8, 0.5, 1.8}, -10.0), textures.at(2.0));  // bench beside the glass
  scene.add(furniture(2.2, 4.4, {1.0, 1.1, 0.8}, 30.0), textures.at(2.0));    // crate
  scene.add(furniture(-1.6, -4.2, {0.5, 0.5, 0.5}, 45.0), textures.at(1.5));  // stool
  Recipe without_lamps = recipe;
  without_lamps.mission.landmarks.min_contrast = recipe.weak_texture ? 1.0 : 5.0;
  return make(without_lamps, scene, through_long_room());
}

Mission thin_room(const Recipe& recipe) {
  Textures textures(recipe);
  Scene scene;
  scene.add(Box{Eigen::Vector3d::Zero(), {3.0, 1.5, 6.5}, Eigen::Matrix3d::Identity()},
            tinted(textures.at(2.6), {165.0, 150.0, 130.0}, 30.0));                                           // walls
  scene.add(block(0.0, 1.54, 0.0, {6.0, 0.1, 13.0}), tinted(textures.at(1.8), {115.0, 105.0, 100.0}, 30.0));  // floor
  scene.add(block(0.0, -1.54, 0.0, {6.0, 0.1, 13.0}),
            tinted(textures.at(2.0), {200.0, 195.0, 185.0}, 18.0));  // ceiling
  const auto thin = [&](const Eigen::Vector3d& from, const Eigen::Vector3d& to, double diameter,
                        const TextureOptions& texture) {
    scene.add(rod(from, to, diameter), texture, {}, Label::kThin);
  };
  const TextureOptions steel = tinted(textures.at(0.5), {60.0, 62.0, 68.0}, 12.0);
  const TextureOptions white = tinted(textures.at(0.5), {225.0, 222.0, 215.0}, 8.0);
  const TextureOptions red = tinted(textures.at(0.5), {170.0, 50.0, 45.0}, 12.0);
  const TextureOptions wood = tinted(textures.at(0.5), {125.0, 85.0, 55.0}, 15.0);
  // Diameters [m] of 2 to 6 pixels in a panorama of 960 pixels, at their distance from the trajectory.
  const auto pole = [&](double x, double z, double diameter, const TextureOptions& texture) {
    thin({x, -1.5, z}, {x, 1.5, z}, diameter, texture);
  };
  pole(-1.0, -4.3, 0.025, white);
  pole(1.5, -3.4, 0.04, steel);
  pole(-1.5, -2.0, 0.04, red);
  pole(-1.7, -1.7, 0.025, steel);
  pole(1.2, -0.6, 0.02, white);
  pole(-1.3, 1.3, 0.03, steel);
  pole(1.7, 2.3, 0.05, red);
  pole(-1.1, 3.8, 0.02, wood);
  pole(0.7, 5.4, 0.04, steel);  // ahead, with little parallax

  for (const double height : {0.45, 0.95}) {  // a railing along the right wall, and one across the room behind
    thin({2.0, 1.5 - height, 0.4}, {2.0, 1.5 - height, 4.6}, 0.04, steel);
    thin({-2.0, 1.5 - height, -5.8}, {2.0, 1.5 - height, -5.8}, 0.03, wood);
  }
  for (const double z : {0.4, 1.8, 3.2, 4.6}) {
    thin({2.0, 1.5, z}, {2.0, 0.5, z}, 0.03, steel);
  }
  for (const double x : {-2.0, 0.0, 2.0}) {
    thin({x, 1.5, -5.8}, {x, 0.5, -5.8}, 0.03, wood);
  }
  thin({-2.2, -0.6, -0.6}, {-2.2, -0.6, 5.0}, 0.03, white);  // a pipe along the left wall

  const TextureOptions black = tinted(textures.at(0.5), {35.0, 35.0, 38.0}, 8.0);
  add_cable(scene, {-2.9, -1.3, -3.0}, {2.9, -1.3, -2.4}, 0.35, 0.02, black);  // across the trajectory, above it
  add_cable(scene, {-2.9, -1.3, 2.0}, {2.9, -1.3, 1.2}, 0.3, 0.025, black);
  add_cable(scene, {-0.9, -1.4, -5.0}, {-0.9, -1.4, 0.5}, 0.5, 0.015, white);  // along it
  add_cable(scene, {1.3, -1.5, 0.6}, {1.6, 0.2, 0.8}, 0.5, 0.015, black);      // loose

  add_chair(scene, 1.2, -4.6, 25.0, wood);
  add_chair(scene, -1.2, -3.2, -70.0, black);
  add_chair(scene, 1.3, -1.9, 160.0, red);
  add_chair(scene, -1.4, 0.2, 100.0, wood);
  add_chair(scene, -1.2, 2.6, -20.0, white);
  scene.add(furniture(2.3, -3.0, {0.9, 0.75, 1.6}, 0.0), textures.at(2.0));  // desk
  scene.add(furniture(-2.6, -4.9, {0.7, 2.0, 1.2}, 0.0), textures.at(2.0));  // cupboard
  return make(recipe, scene, through_long_room());
}

namespace {

/// A house with a saddle roof along z that overhangs its walls, a chimney, and windows on both long sides.
void add_house(Scene& scene, Textures& textures, const Eigen::Vector3d& center, const Eigen::Vector3d& size,
               double turned_deg, const Eigen::Vector3d& color, double contrast) {
  const Eigen::Matrix3d turn = turned_by(turned_deg);
  const auto part = [&](const Eigen::Vector3d& at, const Eigen::Vector3d& extent, double tilt_deg,
                        const TextureOptions& texture) {
    scene.add(Box{center + turn * at, 0.5 * extent, turn * turned_by(tilt_deg, Eigen::Vector3d::UnitZ())}, texture);
  };
  const double top = -size.y();
  part({0.0, 0.5 * top, 0.0}, size, 0.0, tinted(textures.at(8.0), color, contrast));
  const TextureOptions tiles = tinted(textures.at(5.0), {120.0, 70.0, 60.0}, 22.0);
  const double slope = 0.25 * size.x() + 0.3;
  for (const double side : {-1.0, 1.0}) {
    part({side * 0.25 * size.x(), top - 0.5 * slope, 0.0}, {1.36 * (0.5 * size.x() + 0.5), 0.14, size.z() + 0.8},
         -side * -38.0, tiles);
    for (double z = -0.5 * size.z() + 1.2; z < 0.5 * size.z() - 0.6; z += 2.4) {
      for (double y = -1.6; y > top + 0.8; y -= 2.6) {
        part({side * 0.5 * size.x(), y, z}, {0.1, 1.2, 0.9}, 0.0, tinted(textures.at(6.0), {60.0, 66.0, 76.0}, 22.0));
      }
    }
  }
  part({0.2 * size.x(), top - 1.3, 0.2 * size.z()}, {0.6, 2.6, 0.6}, 0.0,
       tinted(textures.at(4.0), {140.0, 90.0, 75.0}, 25.0));
}

void add_tree(Scene& scene, Textures& textures, double x, double z, double height, std::uint64_t seed) {
  const TextureOptions bark = tinted(textures.at(1.0), {95.0, 80.0, 65.0}, 20.0);
  const Eigen::Vector3d crown(x, kFloor - height, z);
  scene.add(rod({x, kFloor, z}, crown, 0.22), bark);
  for (int i = 0; i < 5; ++i) {
    const double angle = 1.3 * i + 0.4 * static_cast<double>(seed);
    scene.add(rod({x, kFloor - height + 1.1 - 0.2 * i, z},
                  crown + Eigen::Vector3d(1.3 * std::cos(angle), -0.5 - 0.2 * i, 1.3 * std::sin(angle)), 0.05),
              bark, {}, Label::kThin);
  }
  scene.add(foliage(crown - Eigen::Vector3d(0.0, 0.6, 0.0), 1.6, 220, 0.13, seed),
            tinted(textures.at(1.5), {85.0, 125.0, 60.0}, 30.0));
}

}  // namespace

Mission yard(const Recipe& recipe) {
  Textures textures(recipe);
  Scene scene;
  Recipe outdoors = recipe;
  Sky sky;
  sky.seed = recipe.texture_seed;
  sky.horizon = {215.0, 222.0, 230.0};
  sky.zenith = {140.0, 175.0, 225.0};
  sky.cloud_contrast = 16.0;
  sky.sun_radius_deg = 2.0;
  if (recipe.overexposed_sky) {
    sky.horizon = sky.zenith = Eigen::Vector3d::Constant(1000.0);
    sky.cloud_contrast = 0.0;
    outdoors.mission.render.brightest = 1000.0;
  }
  scene.set_sky(sky);
  scene.add(block(0.0, kFloor + 0.1, 0.0, {60.0, 0.2, 60.0}),
            tinted(textures.at(2.5), {95.0, 125.0, 70.0}, 28.0));  // lawn
  scene.add(block(1.2, kFloor + 0.08, 0.0, {1.4, 0.2, 40.0}),
            tinted(textures.at(2.5), {150.0, 145.0, 140.0}, 16.0));  // path
  add_house(scene, textures, {-9.0, kFloor, 1.0}, {6.0, 5.6, 18.0}, 0.0, {205.0, 195.0, 175.0}, 9.0);
  add_house(scene, textures, {10.5, kFloor, -3.0}, {7.0, 3.2, 10.0}, 0.0, {150.0, 90.0, 75.0}, 24.0);
  add_house(scene, textures, {1.0, kFloor, 19.0}, {9.0, 6.4, 16.0}, 90.0, {215.0, 208.0, 195.0}, 7.0);
  scene.add(block(0.0, kFloor - 1.0, -15.0, {16.0, 2.0, 1.0}),
            tinted(textures.at(2.5), {70.0, 100.0, 55.0}, 30.0));  // hedge
  scene.add(block(13.0, kFloor - 0.9, 9.0, {0.3, 1.8, 12.0}),
            tinted(textures.at(5.0), {160.0, 150.0, 135.0}, 10.0));  // wall
  add_tree(scene, textures, -3.4, -4.0, 2.6, 1);
  add_tree(scene, textures, 4.6, 1.5, 3.0, 2);
  add_tree(scene, textures, -4.2, 6.5, 2.4, 3);
  add_tree(scene, textures, 6.0, 9.0, 3.4, 4);
  const TextureOptions black = tinted(textures.at(0.5), {40.0, 40.0, 44.0}, 8.0);
  add_cable(scene, {-6.0, kFloor - 5.2, -1.0}, {7.0, kFloor - 3.4, -3.0}, 0.5, 0.03, black);  // across the trajectory
  add_cable(scene, {-6.0, kFloor - 5.0, 5.0}, {3.0, kFloor - 6.0, 13.5}, 0.6, 0.03, black);
  scene.add(rod({3.0, kFloor, -6.0}, {3.0, kFloor - 4.5, -6.0}, 0.1), black, {}, Label::kThin);  // lamp
  scene.add(Sphere{{3.0, kFloor - 4.6, -6.0}, 0.22}, plain({235.0, 235.0, 225.0}));
  scene.add(block(-2.0, kFloor - 0.25, 3.0, {0.5, 0.5, 1.6}), textures.at(2.0));  // bench
  Flight flight;
  flight.start = Eigen::Vector3d(0.2, 0.1, -7.0);
  flight.step = 0.5;
  outdoors.mission.landmarks.min_contrast = recipe.weak_texture ? 1.0 : 6.0;
  return make(outdoors, scene, flight);
}

Mission flat_photos(const Recipe& recipe) {
  if (recipe.movers > 0) {
    throw InvalidOption("movers is " + std::to_string(recipe.movers) +
                        "; expected 0 in this scene, which has no path to walk beside");
  }
  Textures textures(recipe);
  Scene scene;
  const auto wall = [&](double x0, double z0, double x1, double z1) {  // along one axis
    constexpr double kThick = 0.12;
    scene.add(
        block(0.5 * (x0 + x1), 0.15, 0.5 * (z0 + z1), {std::abs(x1 - x0) + kThick, 2.7, std::abs(z1 - z0) + kThick}),
        tinted(textures.at(2.6), {210.0, 204.0, 192.0}, 14.0));
  };
  scene.add(block(0.0, kFloor + 0.1, 0.0, {10.4, 0.2, 8.4}), tinted(textures.at(1.8), {130.0, 105.0, 85.0}, 25.0));
  scene.add(block(0.0, kFloor - 2.8, 0.0, {10.4, 0.2, 8.4}), tinted(textures.at(2.6), {225.0, 222.0, 215.0}, 8.0));
  wall(-5.0, -4.0, 5.0, -4.0);
  wall(-5.0, 4.0, 5.0, 4.0);
  wall(-5.0, -4.0, -5.0, 4.0);
  wall(5.0, -4.0, 5.0, 4.0);
  wall(-5.0, 0.0, -3.4, 0.0);  // a corridor 0 < z < 1.4 between rooms, with doors
  wall(-2.5, 0.0, 1.6, 0.0);
  wall(2.5, 0.0, 5.0, 0.0);
  wall(-5.0, 1.4, -3.0, 1.4);
  wall(-2.1, 1.4, 2.4, 1.4);
  wall(3.3, 1.4, 5.0, 1.4);
  wall(0.4, -4.0, 0.4, 0.0);
  wall(0.0, 1.4, 0.0, 4.0);
  scene.add(furniture(-4.3, -3.0, {1.0, 0.5, 1.8}, 0.0), textures.at(2.0));
  scene.add(furniture(-1.0, -3.5, {1.4, 1.9, 0.6}, 0.0), textures.at(2.0));
  scene.add(furniture(3.6, -3.2, {1.6, 0.75, 0.8}, 0.0), textures.at(2.0));
  scene.add(furniture(-4.4, 3.3, {0.8, 1.1, 0.8}, 15.0), textures.at(2.0));
  scene.add(furniture(4.2, 3.2, {1.0, 2.0, 0.6}, 0.0), textures.at(2.0));
  const std::vector<std::pair<double, double>> places = {{-3.6, -2.2}, {-2.2, -1.7}, {-2.9, -0.8}, {-2.9, 0.7},
                                                         {-1.4, 0.7},  {0.1, 0.7},   {1.6, 0.7},   {2.1, -0.9},
                                                         {3.0, -2.1},  {-2.6, 2.3},  {-1.3, 2.9},  {2.9, 2.3}};
  std::vector<RigidTransform> poses;
  for (const auto& [x, z] : places) {
    const double yaw_deg = recipe.yaw_deg + 50.0 * static_cast<double>(poses.size());
    poses.push_back(yawed(RigidTransform{Eigen::Matrix3d::Identity(), Eigen::Vector3d(-x, 0.0, -z)}, yaw_deg));
  }
  return render_mission(recipe, scene, poses);
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
