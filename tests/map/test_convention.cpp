// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <functional>
#include <random>

#include <Eigen/Geometry>

#include "io/convention.h"
#include "pmsp/camera.h"
#include "pmsp/error.h"
#include "scene_files.h"
#include "support/temp_dir.h"

namespace pmsp::test {

using Catch::Contains;
using pmsp_test::TempDir;

namespace {

void add_noise(SlamMap& map, float deviation) {
  std::mt19937 random(3);
  std::normal_distribution<float> gauss(0.0F, deviation);
  for (MapKeyframe& keyframe : map.keyframes) {
    for (MapObservation& o : keyframe.observations) {
      o.pixel.x() = std::clamp(o.pixel.x() + gauss(random), 0.0F, 640.0F);
      o.pixel.y() = std::clamp(o.pixel.y() + gauss(random), 0.0F, 320.0F);
    }
  }
}

}  // namespace

TEST_CASE("a correctly read map is accepted with its reprojection error") {
  SlamMap map = sample_scene();
  CHECK(require_convention(map).median_error_px < 1e-3);
  CHECK(require_convention(map).observations >= 1000);
  for (const float noise : {0.7F, 2.0F, 6.0F}) {
    map = sample_scene();
    add_noise(map, noise);
    CAPTURE(noise);
    CHECK(require_convention(map).median_error_px == Approx(1.18 * static_cast<double>(noise)).epsilon(0.1));
  }
}

TEST_CASE("a wrong convention is named in every format with observations") {
  for (const FormatFiles& format : all_formats()) {
    if (!format.has_observations) continue;
    CAPTURE(format.name);
    for (const float noise : {0.0F, 0.8F}) {
      SlamMap right = sample_scene();
      if (noise > 0.0F) add_noise(right, noise);
      const auto read = [&](Fault fault) {
        const TempDir folder;
        return read_map(format.write(folder.path(), with_fault(right, fault)));
      };
      CHECK_NOTHROW(require_convention(read(Fault::none)));
      CHECK_THROWS_WITH(require_convention(read(Fault::mirrored)), Contains("mirrored"));
      CHECK_THROWS_WITH(require_convention(read(Fault::inverted)), Contains("inverted poses (world_from_cam"));
      CHECK_THROWS_WITH(require_convention(read(Fault::shifted)), Contains("shifted by half a pixel"));
    }
  }
}

TEST_CASE("an observation on one side of the seam is near its landmark on the other") {
  SlamMap map = sample_scene();
  map.keyframes.resize(1);
  map.keyframes[0].cam_from_world = {};
  map.keyframes[0].observations.clear();
  map.landmarks.clear();
  for (int i = 0; i < 200; ++i) {
    MapLandmark landmark;
    landmark.id = i;
    landmark.position_world = {1e-4 * (i + 1), 0.01 * (i % 50 - 25), -2.0};
    const Eigen::Vector2d pixel = pixel_from_bearing(landmark.position_world, 640, 320);
    REQUIRE(pixel.x() > 638.0);
    map.landmarks.push_back(landmark);
    map.keyframes[0].observations.push_back({i, Eigen::Vector2d(pixel.x() + 2.0 - 640.0, pixel.y()).cast<float>()});
  }
  CHECK(check_convention(map).median_error_px == Approx(2.0).margin(1e-3));
}

TEST_CASE("wrong camera axes are named") {
  const SlamMap right = sample_scene();
  const auto wrong = [&](double x, double y, double z) {
    SlamMap map = right;
    for (MapKeyframe& keyframe : map.keyframes) {
      const Eigen::Matrix3d axes = Eigen::Vector3d(x, y, z).asDiagonal();
      keyframe.cam_from_world = {axes * keyframe.cam_from_world.rotation, axes * keyframe.cam_from_world.translation};
    }
    return map;
  };
  CHECK_THROWS_WITH(require_convention(wrong(1, -1, -1)), Contains("OpenGL"));
  CHECK_THROWS_WITH(require_convention(wrong(-1, 1, -1)), Contains("look backward"));
  const auto pose_of = [&](const std::function<RigidTransform(const RigidTransform&)>& wrongly) {
    SlamMap map = right;
    for (MapKeyframe& keyframe : map.keyframes) keyframe.cam_from_world = wrongly(keyframe.cam_from_world);
    return map;
  };
  CHECK_THROWS_WITH(require_convention(pose_of([](const RigidTransform& pose) {
                      const Eigen::Quaterniond q(Eigen::Matrix3d(pose.rotation.transpose()));
                      const Eigen::Quaterniond read(q.z(), q.w(), q.x(), q.y());
                      const Eigen::Matrix3d turn = read.toRotationMatrix().transpose();
                      return RigidTransform{turn, -(turn * pose.center())};
                    })),
                    Contains("quaternions with w first"));
  CHECK_THROWS_WITH(require_convention(pose_of([](const RigidTransform& pose) {
                      Eigen::Matrix3d body_from_cam;
                      body_from_cam << 0, 0, 1, -1, 0, 0, 0, -1, 0;
                      return RigidTransform{body_from_cam * pose.rotation, body_from_cam * pose.translation};
                    })),
                    Contains("x forward, y left, z up"));
  SlamMap flipped = right;
  for (MapKeyframe& keyframe : flipped.keyframes) {
    for (MapObservation& o : keyframe.observations) o.pixel.y() = 320.0F - o.pixel.y();
  }
  CHECK_THROWS_WITH(require_convention(flipped), Contains("flipped"));
  SlamMap turned = right;
  for (MapKeyframe& keyframe : turned.keyframes) {
    for (MapObservation& o : keyframe.observations) {
      o.pixel.x() += o.pixel.x() < 160.0F ? 480.0F : -160.0F;
    }
  }
  CHECK_THROWS_WITH(require_convention(turned), Contains("quarter of their width"));
}

TEST_CASE("half a row is reported except for SLAM maps and no verdict without evidence") {
  SlamMap map = sample_scene();
  for (MapKeyframe& keyframe : map.keyframes) {
    for (MapObservation& o : keyframe.observations) o.pixel.y() += 0.5F;
  }
  CHECK_THAT(require_convention(map).remark, Contains("half a pixel below"));
  map.pixel_centers_at_integers = true;
  CHECK(require_convention(map).remark.empty());
  map = with_fault(sample_scene(), Fault::mirrored);
  for (MapKeyframe& keyframe : map.keyframes) keyframe.observations.resize(5);
  CHECK(require_convention(map).observations == 0);
  map = with_fault(sample_scene(), Fault::mirrored);
  map.observations_are_measured = false;
  CHECK(require_convention(map).observations == 0);
  // Inconsistent observations are no named fault.
  map = sample_scene();
  std::mt19937 random(3);
  for (MapKeyframe& keyframe : map.keyframes) {
    for (MapObservation& o : keyframe.observations) {
      o.pixel = {static_cast<float>(random() % 640), static_cast<float>(random() % 320)};
    }
  }
  CHECK(require_convention(map).median_error_px > 50.0);
}

}  // namespace pmsp::test
