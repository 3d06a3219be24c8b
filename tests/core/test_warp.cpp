// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Geometry>

#include "core/helpers.h"
#include "core/on_depth_maps.h"
#include "elementary.h"
#include "pmsp/camera.h"
#include "pmsp/stages.h"

using namespace pmsp;
using namespace pmsp::test;
using Eigen::Vector3d;

namespace {

RigidTransform rolled(const RigidTransform& cam_from_world, double degrees, const Vector3d& axis) {
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(degrees * kernels::kPi / 180.0, axis.normalized()).toRotationMatrix();
  return RigidTransform{turn, Vector3d::Zero()} * cam_from_world;
}

struct WarpQuality {
  double present = 0.0;  ///< share of all pixels with a plane
  double depth = 0.0;    ///< share of planes that meet the pixel's ray within 2 % of the truth
  double normal = 0.0;   ///< share of planes whose normal is within 2 degrees of the truth
};

WarpQuality free_space_filter(const PlaneImage& planes, const synth::RenderedView& truth) {
  std::size_t present = 0;
  std::size_t depth = 0;
  std::size_t normal = 0;
  for (int y = 0; y < planes.height(); ++y) {
    for (int x = 0; x < planes.width(); ++x) {
      const Vector3d plane = planes(x, y).cast<double>();
      if (!(plane.norm() > 0.0)) continue;
      ++present;
      const double depth_ratio = plane.dot(bearing_of(truth.depth, x, y)) * static_cast<double>(truth.depth(x, y));
      depth += std::abs(depth_ratio - 1.0) <= 0.02 ? 1 : 0;
      normal += -plane.normalized().dot(truth.normal(x, y).cast<double>()) >= 0.99939 ? 1 : 0;
    }
  }
  const double all = static_cast<double>(planes.size());
  const double there = static_cast<double>(std::max<std::size_t>(present, 1));
  return {static_cast<double>(present) / all, static_cast<double>(depth) / there, static_cast<double>(normal) / there};
}

synth::RenderedView view_from(const synth::Scene& scene, const RigidTransform& cam_from_world, int width) {
  synth::RenderOptions options;
  options.samples = 1;
  return synth::render(scene, cam_from_world, width, width / 2, options);
}

DepthMap map_from(const synth::RenderedView& view, const RigidTransform& cam_from_world) {
  DepthMap map;
  map.cam_from_world = cam_from_world;
  map.depth = view.depth;
  map.normal = view.normal;
  map.confidence = Image<float>(view.depth.width(), view.depth.height(), 1.0F);
  return map;
}

/// At the map's own size.
PlaneImage warped(const DepthMap& map, const RigidTransform& cam_from_world, const Executor& executor) {
  return warp_planes(map, {cam_from_world}, map.depth.width(), map.depth.height(), executor);
}

}  // namespace

TEST_CASE("warping into the same camera changes nothing", "[init][warp]") {
  const synth::Mission mission = synth::textured_room(small_recipe(160, 1));
  const DepthMap map = truth_map(mission.frames[0]);
  const PlaneImage planes = warped(map, map.cam_from_world, Executor());
  int wrong = 0;
  for (int y = 0; y < 80; ++y) {
    for (int x = 0; x < 160; ++x) {
      const Vector3d plane = planes(x, y).cast<double>();
      const double depth_ratio = plane.dot(bearing_of(map.depth, x, y)) * static_cast<double>(map.depth(x, y));
      const bool same_normal = -plane.normalized().dot(map.normal(x, y).cast<double>()) > 1.0 - 1e-6;
      wrong += std::abs(depth_ratio - 1.0) < 1e-4 && same_normal ? 0 : 1;
    }
  }
  CHECK(wrong == 0);
}

TEST_CASE("pixels without a depth are not warped", "[init][warp]") {
  const synth::Mission mission = synth::sphere_inside(small_recipe(160, 1));
  DepthMap map = truth_map(mission.frames[0]);
  for (int x = 0; x < 160; ++x) {
    map.depth(x, 20) = 0.0F;
    map.normal(x, 20).setZero();
  }
  const PlaneImage planes = warped(map, map.cam_from_world, Executor());
  int wrong = 0;
  for (int y = 0; y < 80; ++y) {
    for (int x = 0; x < 160; ++x) wrong += (planes(x, y).norm() > 0.0F) == (y != 20) ? 0 : 1;
  }
  CHECK(wrong == 0);
}

TEST_CASE("a turned and moved camera gets planes through the true surface with turned normals", "[init][warp]") {
  const synth::Mission mission = synth::empty_room(small_recipe(160, 1));
  const RigidTransform& previous = mission.frames[0].cam_from_world;
  const RigidTransform moved{Eigen::Matrix3d::Identity(), Vector3d(0.25, -0.1, 0.3)};
  const std::vector<RigidTransform> poses = {
      moved * previous,
      synth::yawed(previous, 90.0),
      rolled(previous, 50.0, {1.0, 0.3, 0.2}),
      moved * rolled(previous, 35.0, {-0.4, 0.2, 1.0}),
      rolled(previous, 180.0, {0.0, 0.1, 1.0}),
  };
  for (std::size_t i = 0; i < poses.size(); ++i) {
    INFO("pose " << i);
    const PlaneImage planes = warped(truth_map(mission.frames[0]), poses[i], Executor());
    const WarpQuality quality = free_space_filter(planes, view_from(mission.scene, poses[i], 160));
    CHECK(quality.present > 0.55);  // each pixel goes to one; where the image stretches, holes stay
    CHECK(quality.depth > 0.985);
    CHECK(quality.normal > 0.97);
  }
}

TEST_CASE("the nearest surface wins where several pixels meet", "[init][warp]") {
  constexpr int kWidth = 200;
  synth::Scene scene;
  scene.add(synth::Sphere{Vector3d::Zero(), 6.0}, synth::textured(1));
  scene.add(synth::Sphere{Vector3d(0.0, 0.0, 1.8), 0.7}, synth::textured(2));
  const RigidTransform previous;
  const synth::RenderedView view = view_from(scene, previous, kWidth);
  for (const double side : {-0.9, 0.9}) {  // the surface in front comes first in one, last in the other
    INFO(side);
    const RigidTransform pose{Eigen::Matrix3d::Identity(), Vector3d(side, 0.2 * side, 0.0)};
    Image<double> front(kWidth, kWidth / 2, std::numeric_limits<double>::max());
    Image<double> back(kWidth, kWidth / 2, 0.0);
    for (int y = 0; y < kWidth / 2; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const Vector3d p = pose * (static_cast<double>(view.depth(x, y)) * bearing_of(view.depth, x, y));
        const Eigen::Vector2d at = pixel_from_bearing(p, kWidth, kWidth / 2);
        const int column = std::min(static_cast<int>(at.x()), kWidth - 1);
        const int row = std::min(static_cast<int>(at.y()), kWidth / 2 - 1);
        front(column, row) = std::min(front(column, row), p.norm());
        back(column, row) = std::max(back(column, row), p.norm());
      }
    }
    const PlaneImage planes = warped(map_from(view, previous), pose, Executor());
    int contested = 0;
    int lost = 0;
    for (int y = 0; y < kWidth / 2; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        if (back(x, y) < 2.0 * front(x, y)) continue;
        ++contested;
        const double range = 1.0 / planes(x, y).cast<double>().dot(bearing_of(view.depth, x, y));
        lost += std::abs(range / front(x, y) - 1.0) < 0.3 ? 0 : 1;
      }
    }
    CHECK(contested > 50);
    CHECK(lost <= contested / 50);
  }
}

TEST_CASE("warping does not depend on the number of threads", "[init][warp]") {
  const synth::Mission mission = synth::textured_room(small_recipe(160, 1));
  const DepthMap map = truth_map(mission.frames[0]);
  const RigidTransform pose =
      RigidTransform{Eigen::Matrix3d::Identity(), Vector3d(0.3, 0.0, -0.6)} * map.cam_from_world;
  const PlaneImage one = warped(map, pose, Executor(1));
  for (const int threads : {2, 5}) {
    const PlaneImage several = warped(map, pose, Executor(threads));
    CHECK(one.pixels() == several.pixels());
  }
}
