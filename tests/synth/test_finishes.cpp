// SPDX-License-Identifier: BSD-2-Clause
// Cylinders, mirrors and glass, and the rooms made of them.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <optional>

#include <Eigen/Geometry>

#include "elementary.h"
#include "pmsp/camera.h"
#include "synth/mission.h"
#include "synth/rng.h"
#include "synth/scene.h"

using Eigen::Vector2d;
using Eigen::Vector3d;
using namespace pmsp;
using namespace pmsp::synth;

namespace {

const Vector3d kRed(200.0, 0.0, 0.0);
const Vector3d kGreen(0.0, 180.0, 0.0);
const Vector3d kBlue(0.0, 0.0, 160.0);

/// One keyframe of a ready-made room, with what its pixels show.
struct Room {
  Room(Mission (*make)(const Recipe&), int width) {
    Recipe recipe;
    recipe.width = width;
    recipe.height = width / 2;
    recipe.keyframes = 1;
    recipe.mission.render.samples = 1;
    recipe.mission.landmarks.count = 0;
    mission = make(recipe);
  }

  const Frame& frame() const { return mission.frames[0]; }
  Vector3d center() const { return frame().cam_from_world.center(); }
  Vector2d pixel(const Vector3d& point) const {
    return pixel_from_bearing(frame().cam_from_world * point, mission.width, mission.height);
  }
  double depth(const Vector3d& point, int columns_aside = 0) const {
    return static_cast<double>(frame().depth(column(point, columns_aside), row(point)));
  }
  Label label(const Vector3d& point, int columns_aside = 0) const {
    return static_cast<Label>(frame().label(column(point, columns_aside), row(point)));
  }
  double gray(const Vector3d& point, int columns_aside = 0) const {
    const Rgb rgb = frame().image(column(point, columns_aside), row(point));
    return (rgb.r + rgb.g + rgb.b) / 3.0;
  }

  Mission mission;

 private:
  int column(const Vector3d& point, int aside) const {
    return (static_cast<int>(pixel(point).x()) + aside + mission.width) % mission.width;
  }
  int row(const Vector3d& point) const { return static_cast<int>(pixel(point).y()); }
};

}  // namespace

TEST_CASE("a cylinder is hit on its side, on its ends and not beyond them") {
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7, Vector3d(1.0, 2.0, -0.5).normalized()).toRotationMatrix();
  const Vector3d center(0.3, -0.2, 4.0);
  Scene scene;
  scene.add(Cylinder{center, turn * Vector3d::UnitY(), 0.5, 2.0}, textured(1));
  const auto cast = [&](const Vector3d& from, const Vector3d& direction) {
    return scene.intersect(center + turn * from, turn * direction);
  };
  const auto side = cast({0.3, 1.9, -5.0}, Vector3d::UnitZ());
  REQUIRE(side);
  CHECK(side->distance == Approx(5.0 - 0.4).epsilon(1e-12));
  CHECK((turn.transpose() * side->normal - Vector3d(0.6, 0.0, -0.8)).norm() < 1e-12);
  const auto end = cast({0.1, -5.0, 0.2}, Vector3d::UnitY());
  REQUIRE(end);
  CHECK(end->distance == Approx(3.0).epsilon(1e-12));
  CHECK((turn.transpose() * end->normal + Vector3d::UnitY()).norm() < 1e-12);
  const auto oblique = cast({0.0, -3.0, -1.0}, Vector3d(0.0, 1.0, 1.0));  // over the rim, onto the end
  REQUIRE(oblique);
  CHECK(oblique->distance == Approx(std::sqrt(2.0)).epsilon(1e-12));
  const auto inside = cast(Vector3d::Zero(), Vector3d::UnitX());
  REQUIRE(inside);
  CHECK(inside->distance == Approx(0.5).epsilon(1e-12));
  CHECK(inside->normal.dot(turn * Vector3d::UnitX()) < 0.0);
  CHECK_FALSE(cast({0.0, 2.01, -5.0}, Vector3d::UnitZ()));
  CHECK_FALSE(cast({0.51, 0.0, -5.0}, Vector3d::UnitZ()));
  CHECK_FALSE(cast({0.4, -5.0, 0.4}, Vector3d::UnitY()));

  const auto large = scene.scaled(10.0).intersect(10.0 * (center + turn * Vector3d(0.3, 1.9, -5.0)), turn.col(2));
  REQUIRE(large);
  CHECK(large->distance == Approx(46.0).epsilon(1e-12));
}

TEST_CASE("a mirroring floor shows its own colour and that at the mirrored ray's hit") {
  Scene scene;
  scene.add(Plane{{0.0, 1.0, 0.0}, -Vector3d::UnitY()}, plain(kGreen), {0.2, false}, Label::kGlossy);
  scene.add(Sphere{{0.0, -1.0, 6.0}, 0.2}, plain(kRed));
  scene.add(Sphere{Vector3d::Zero(), 20.0}, plain(kBlue));
  // From the origin to the floor at (0, 1, 2), and from there up to the ball.
  const Vector3d to_floor(0.0, 1.0, 2.0);
  const double share = 0.2 + 0.8 * std::pow(1.0 - 1.0 / std::sqrt(5.0), 5);
  CHECK((scene.radiance(Vector3d::Zero(), to_floor) - (1.0 - share) * kGreen - share * kRed).norm() < 1e-9);
  const Vector3d beside(0.3, 1.0, 2.0);  // the mirrored ray passes the ball
  CHECK(scene.radiance(Vector3d::Zero(), beside).x() < 1e-9);
  CHECK(scene.radiance(Vector3d::Zero(), beside).z() > 0.2 * kBlue.z());
  CHECK((scene.radiance(Vector3d::Zero(), Vector3d::UnitY()) - 0.8 * kGreen - 0.2 * kBlue).norm() < 1e-9);
  CHECK(scene.radiance(Vector3d::Zero(), {10.0, 1.0, 0.0}).z() > 0.6 * kBlue.z());  // grazing

  const auto hit = scene.intersect(Vector3d::Zero(), to_floor);  // the truth knows the floor alone
  REQUIRE(hit);
  CHECK(hit->distance == Approx(std::sqrt(5.0)));
  CHECK(hit->label == Label::kGlossy);
  CHECK(scene.scaled(3.0).radiance(Vector3d::Zero(), to_floor).isApprox(scene.radiance(Vector3d::Zero(), to_floor)));
}

TEST_CASE("glass reflects once and transmits the rest and the truth is the surface behind it") {
  Scene scene;
  scene.add(Box{{0.0, 0.0, 2.0}, {1.0, 1.0, 0.01}, Eigen::Matrix3d::Identity()}, plain(kGreen), {0.1, true});
  scene.add(Plane{{0.0, 0.0, 5.0}, Vector3d::UnitZ()}, plain(kRed));
  scene.add(Plane{{0.0, 0.0, -3.0}, Vector3d::UnitZ()}, plain(kBlue));
  CHECK((scene.radiance(Vector3d::Zero(), Vector3d::UnitZ()) - 0.9 * kRed - 0.1 * kBlue).norm() < 1e-9);
  const auto through = scene.intersect(Vector3d::Zero(), Vector3d::UnitZ());
  REQUIRE(through);
  CHECK(through->distance == Approx(5.0));
  CHECK(through->label == Label::kBehindGlass);
  CHECK(scene.visible(Vector3d::Zero(), {0.0, 0.0, 5.0}));
  const auto past = scene.intersect(Vector3d::Zero(), {3.0, 0.0, 5.0});  // beside the pane
  REQUIRE(past);
  CHECK(past->label == Label::kOther);
  CHECK((scene.radiance(Vector3d::Zero(), {3.0, 0.0, 5.0}) - kRed).norm() < 1e-9);
}

TEST_CASE("thin room: a pole's depth and width are those of the cylinder, the wall is behind it") {
  const Room room(thin_room, 480);
  const auto check = [&](const Vector3d& axis, double diameter) {
    const Vector3d level(axis.x(), room.center().y(), axis.z());
    const double distance = (level - room.center()).norm();
    CHECK(room.label(level) == Label::kThin);
    CHECK(room.depth(level) == Approx(distance - 0.5 * diameter).epsilon(0.003));
    int width = 0;
    for (int aside = -6; aside <= 6; ++aside) {
      const bool thin = room.label(level, aside) == Label::kThin;
      width += thin ? 1 : 0;
      CHECK((room.depth(level, aside) < distance) == thin);
      if (!thin) CHECK(room.depth(level, aside) > 1.2 * distance);
    }
    const double pixels = 2.0 * std::asin(0.5 * diameter / distance) * room.mission.width / (2.0 * kernels::kPi);
    CHECK(std::abs(width - pixels) <= 1.0);
    CHECK(std::abs(room.gray(level) - room.gray(level, 6)) > 10.0);
  };
  check({-1.0, 0.0, -4.3}, 0.025);
  check({1.5, 0.0, -3.4}, 0.04);
}

TEST_CASE("glossy room: the truth is floor, column and street, the floor shows the lamps") {
  const Room room(glossy_room, 240);
  const Vector3d from = room.center();
  const Vector3d on_floor(0.5, 1.5, -3.0);
  CHECK(room.label(on_floor) == Label::kGlossy);
  CHECK(room.depth(on_floor) == Approx((on_floor - from).norm()).epsilon(0.02));

  const Vector3d on_column = Vector3d(1.25, from.y(), 0.2) - 0.35 * (Vector3d(1.25, from.y(), 0.2) - from).normalized();
  CHECK(room.label(on_column) == Label::kGlossy);
  CHECK(room.depth(on_column) == Approx((on_column - from).norm()).epsilon(0.003));

  const Vector3d on_house(-12.5, -0.5, from.z() - 1.5);  // a plain wall between two windows
  CHECK(room.label(on_house) == Label::kBehindGlass);
  CHECK(room.depth(on_house) == Approx((on_house - from).norm()).epsilon(0.02));

  // The lamp above, mirrored at the floor's height 1.5, is seen where the line to its image below meets the floor.
  const Vector3d lamp(0.4, -1.46, -4.8);
  const Vector3d image(lamp.x(), 3.0 - lamp.y(), lamp.z());
  const Vector3d glint = from + (1.5 - from.y()) / (image.y() - from.y()) * (image - from);
  CHECK(room.label(glint) == Label::kGlossy);
  CHECK(room.gray(glint) > room.gray(glint + Vector3d(0.6, 0.0, 0.0)) + 60.0);
}
