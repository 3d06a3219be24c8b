// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>

#include <Eigen/Geometry>

#include "elementary.h"
#include "pmsp/camera.h"
#include "synth/mission.h"
#include "synth/render.h"

using Eigen::Vector3d;
using namespace pmsp;
using namespace pmsp::synth;

namespace {

Scene room() {
  Scene scene;
  scene.add(Box{{0.3, 0.1, -0.2}, {3.0, 1.5, 4.0}, Eigen::Matrix3d::Identity()}, textured(1));
  return scene;
}

/// A gray room with a small red ball in the given direction.
Image<Rgb> view_of_ball(const Vector3d& direction, int width, int height) {
  Scene scene;
  scene.add(Sphere{Vector3d::Zero(), 10.0}, plain({90.0, 90.0, 90.0}));
  scene.add(Sphere{3.0 * direction.normalized(), 0.3}, plain({250.0, 0.0, 0.0}));
  return render(scene, {}, width, height).image;
}

int level_difference(const Rgb& a, const Rgb& b) {
  return std::max({std::abs(a.r - b.r), std::abs(a.g - b.g), std::abs(a.b - b.b)});
}

}  // namespace

TEST_CASE("axes: +z is the centre, +x to the right, +y below, -z at the seam") {
  const Rgb red{250, 0, 0};
  const auto at = [&](const Vector3d& direction, int x, int y) { return view_of_ball(direction, 160, 80)(x, y); };
  CHECK(at({0.0, 0.0, 1.0}, 80, 40) == red);
  CHECK(at({1.0, 0.0, 0.0}, 120, 40) == red);
  CHECK(at({-1.0, 0.0, 0.0}, 40, 40) == red);
  CHECK(at({0.0, 1.0, 1.0}, 80, 60) == red);
  CHECK(at({0.0, -1.0, 1.0}, 80, 20) == red);
  CHECK(at({0.0, 0.0, -1.0}, 0, 40) == red);
  CHECK(at({0.0, 0.0, -1.0}, 159, 40) == red);
  CHECK(at({1.0, 0.0, 0.0}, 40, 40) != red);

  const Image<Rgb> below = view_of_ball({0.0, 1.0, 0.0}, 160, 80);
  for (int x = 0; x < 160; ++x) {
    CHECK(below(x, 79) == red);
    CHECK(below(x, 0) != red);
  }
}

TEST_CASE("depth is the Euclidean distance along the ray of the pixel's centre") {
  Scene scene;
  scene.add(Plane{{0.0, 0.0, 2.0}, -Vector3d::UnitZ()}, textured(1));
  const RenderedView view = render(scene, {}, 64, 32, {1, 1.0, 0.0, 1, 1});
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 64; ++x) {
      const double lon = ((x + 0.5) / 64.0 - 0.5) * 2.0 * kernels::kPi;
      const double lat = (0.5 - (y + 0.5) / 32.0) * kernels::kPi;
      const double z = std::cos(lat) * std::cos(lon);
      if (z > 1e-9) {
        CHECK(view.depth(x, y) == Approx(2.0 / z).epsilon(1e-5));
        CHECK((view.normal(x, y) + Eigen::Vector3f::UnitZ()).norm() < 1e-6F);
      } else {
        CHECK(view.depth(x, y) == 0.0F);
        CHECK(view.normal(x, y) == Eigen::Vector3f::Zero());
        CHECK(view.surface(x, y) == -1);
      }
    }
  }
}

TEST_CASE("normals are those of the surface that neighbouring depths span") {
  const Recipe recipe{320, 160, 1, 30.0, false, 1, {}};
  const Mission mission = textured_room(recipe);
  const Frame& frame = mission.frames[0];
  const auto point = [&](int x, int y) {
    const int column = (x + mission.width) % mission.width;
    return Vector3d(frame.depth(column, y) *
                    bearing_from_pixel({column + 0.5, y + 0.5}, mission.width, mission.height));
  };
  int compared = 0;
  for (int y = 1; y + 1 < mission.height; ++y) {
    for (int x = 0; x < mission.width; ++x) {
      const int surface = frame.surface(x, y);
      const bool flat = frame.surface((x + 1) % mission.width, y) == surface && frame.surface(x, y + 1) == surface &&
                        frame.surface((x + mission.width - 1) % mission.width, y) == surface &&
                        frame.surface(x, y - 1) == surface;
      if (!flat) {
        continue;
      }
      Vector3d normal = (point(x + 1, y) - point(x - 1, y)).cross(point(x, y + 1) - point(x, y - 1)).normalized();
      normal *= normal.dot(point(x, y)) > 0.0 ? -1.0 : 1.0;
      REQUIRE(normal.dot(frame.normal(x, y).cast<double>()) > 0.999);
      ++compared;
    }
  }
  CHECK(compared > 0.8 * mission.width * mission.height);
}

TEST_CASE("the image continues across the seam and around the poles") {
  const int width = 320;
  const int height = 160;
  const Image<Rgb> image = render(room(), {}, width, height).image;
  const auto mean_step = [&](int x0, int x1) {
    double sum = 0.0;
    for (int y = 0; y < height; ++y) {
      sum += level_difference(image(x0, y), image(x1, y));
    }
    return sum / height;
  };
  // Neighbouring columns differ by a similar amount anywhere; columns that are no neighbours differ by more.
  CHECK(mean_step(width - 1, 0) < 1.5 * mean_step(width / 2 - 1, width / 2));
  CHECK(mean_step(width - 1, 0) < 0.8 * mean_step(width / 4, 0));
  double across_pole = 0.0;
  double next_column = 0.0;
  for (int x = 0; x < width / 2; ++x) {
    across_pole += level_difference(image(x, 0), image(x + width / 2, 0));
    next_column += level_difference(image(x, height / 2), image(x + width / 4, height / 2));
  }
  CHECK(across_pole < 0.6 * next_column);
}

TEST_CASE("turning the camera by whole columns rolls the image") {
  const int width = 160;
  const int height = 80;
  const RigidTransform pose = fly(Flight{})[3];
  const RenderedView view = render(room(), pose, width, height);
  for (const int columns : {1, width / 4, width / 2, width - 3}) {
    const RenderedView right = render(room(), yawed(pose, 360.0 * columns / width), width, height);
    int differing = 0;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const int from = (x + columns) % width;
        CHECK(level_difference(right.image(x, y), view.image(from, y)) <= 1);
        differing += right.image(x, y) != view.image(from, y) ? 1 : 0;
        REQUIRE(right.depth(x, y) == Approx(view.depth(from, y)).epsilon(1e-6));
      }
    }
    CHECK(differing < width * height / 1000);
  }
}

TEST_CASE("the result depends on scene, pose and seed only, not on threads") {
  RenderOptions options;
  options.noise_sigma = 3.0;
  options.threads = 1;
  const RenderedView one = render(room(), {}, 128, 64, options);
  options.threads = 5;
  const RenderedView five = render(room(), {}, 128, 64, options);
  CHECK(one.image.pixels() == five.image.pixels());
  CHECK(one.depth.pixels() == five.depth.pixels());
  options.seed = 2;
  CHECK(one.image.pixels() != render(room(), {}, 128, 64, options).image.pixels());
}

TEST_CASE("gain and noise change the image by the given amount") {
  Scene scene;
  scene.add(Sphere{Vector3d::Zero(), 1.0}, plain({100.0, 120.0, 140.0}));
  RenderOptions options;
  options.gain = 1.1;
  CHECK(render(scene, {}, 64, 32, options).image(10, 10) == Rgb{110, 132, 154});
  options.gain = 1.0;
  options.noise_sigma = 4.0;
  const RenderedView noisy = render(scene, {}, 128, 64, options);
  double sum = 0.0;
  double squares = 0.0;
  for (const Rgb& pixel : noisy.image.pixels()) {
    sum += pixel.g - 120.0;
    squares += (pixel.g - 120.0) * (pixel.g - 120.0);
  }
  const double count = 128.0 * 64.0;
  CHECK(sum / count == Approx(0.0).margin(0.2));
  CHECK(std::sqrt(squares / count) == Approx(4.0).epsilon(0.05));
}
