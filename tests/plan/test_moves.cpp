// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cmath>

#include <Eigen/Geometry>

#include "elementary.h"
#include "plan/moves.h"

using namespace pmsp;

TEST_CASE("the image motion is the rotation plus the translation over the range", "[plan]") {
  constexpr double kRange = 4.0;
  constexpr double kTurn = 0.01;  // [rad]
  const PosePair then{{}, {}};
  PosePair turned = then;
  turned.own.cam_from_world.rotation =
      Eigen::AngleAxisd(kTurn, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  CHECK(moved_angle(then, turned, kRange) == Approx(kTurn).epsilon(1e-3));
  CHECK(moved_px(then, turned, kRange, 640) == Approx(kTurn * 640 / (2.0 * kernels::kPi)).epsilon(1e-3));
  PosePair shifted = then;
  shifted.own.cam_from_world.translation = {0.0, 0.2, 0.0};
  CHECK(moved_angle(then, shifted, kRange) == Approx(0.05).epsilon(1e-6));
  PosePair together = shifted;
  together.other = together.own;
  CHECK(moved_angle(then, together, kRange) == Approx(0.0).margin(1e-12));
  CHECK(moved_angle(then, shifted, 0.0) == 0.0);  // no landmarks with a known range
}

TEST_CASE("image motion by translation is the shift over the range in any units of the keyframes", "[plan]") {
  PosePair then;
  then.own.scale = 2.0;
  then.other.scale = 0.5;
  PosePair shifted = then;
  shifted.own.cam_from_world.translation = {0.0, 0.2, 0.0};  // map units
  CHECK(moved_angle(then, shifted, 4.0) == Approx(0.2 / (2.0 * 4.0)).epsilon(1e-6));
  PosePair turned = then;
  turned.own.cam_from_world.rotation = Eigen::AngleAxisd(0.01, Eigen::Vector3d::UnitY()).toRotationMatrix();
  CHECK(moved_angle(then, turned, 4.0) == Approx(0.01).epsilon(1e-3));
}
