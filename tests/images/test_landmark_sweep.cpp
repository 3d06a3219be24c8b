// SPDX-License-Identifier: BSD-2-Clause
// Verification of the poses of a map without landmarks by its images.
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <memory>
#include <random>
#include <vector>

#include <Eigen/Geometry>

#include "drawn_scene.h"
#include "io/landmark_sweep.h"

using namespace pmsp;
using namespace pmsp::test;
using Catch::Matchers::Contains;
using Result = LandmarkSweep::Result;

namespace {

std::vector<Shot> sweep_flight() {
  std::vector<Shot> shots;
  for (int i = 0; i < 8; ++i) shots.push_back({2 * i, 0.3 * i, 4 * i});
  return shots;
}

SlamMap poses_alone() {
  SlamMap map = room_map(sweep_flight());
  map.landmarks.clear();
  for (MapKeyframe& keyframe : map.keyframes) keyframe.observations.clear();
  return map;
}

const std::vector<Image<Rgb>>& images() {
  static const std::vector<Image<Rgb>> rendered = [] {
    std::vector<Image<Rgb>> result;
    for (const Shot& shot : sweep_flight()) result.push_back(render_room(shot.frame));
    return result;
  }();
  return rendered;
}

std::unique_ptr<LandmarkSweep> sweep_of(const SlamMap& map) {
  auto sweep = std::make_unique<LandmarkSweep>(map);
  for (std::size_t i = 0; i < map.keyframes.size(); ++i) sweep->add(map.keyframes[i].id, images()[i].view());
  return sweep;
}

SlamMap with_poses(const std::function<RigidTransform(const SlamMap& right, std::size_t i)>& pose) {
  const SlamMap right = poses_alone();
  SlamMap map = right;
  for (std::size_t i = 0; i < map.keyframes.size(); ++i) map.keyframes[i].cam_from_world = pose(right, i);
  return map;
}

SlamMap turned(const Eigen::Matrix3d& turn) {
  return with_poses([&](const SlamMap& right, std::size_t i) {
    const RigidTransform& pose = right.keyframes[i].cam_from_world;
    return RigidTransform{turn * pose.rotation, turn * pose.translation};
  });
}

Eigen::Matrix3d matrix(std::initializer_list<double> rows) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rows.begin());
}

}  // namespace

TEST_CASE("consistent poses give landmarks for any number of threads") {
  const SlamMap map = poses_alone();
  const std::unique_ptr<LandmarkSweep> sweep = sweep_of(map);
  SlamMap one = map;
  const Result result = sweep->make_landmarks(one, 1);
  INFO(result.message << result.share);
  CHECK(result.conclusive);
  CHECK(result.fits);
  CHECK_FALSE(result.doubtful);
  CHECK(result.message.empty());
  CHECK(result.share > 0.4);
  REQUIRE(one.landmarks.size() == result.landmarks);
  const SlamMap truth = room_map(sweep_flight());
  double farthest = 0.0;
  for (const MapLandmark& landmark : truth.landmarks) farthest = std::max(farthest, landmark.position_world.norm());
  for (const MapLandmark& landmark : one.landmarks) CHECK(landmark.position_world.norm() < 1.5 * farthest);
  SlamMap three = map;
  sweep->make_landmarks(three, 3);
  REQUIRE(three.landmarks.size() == one.landmarks.size());
  for (std::size_t i = 0; i < one.landmarks.size(); ++i) {
    CHECK(one.landmarks[i].position_world == three.landmarks[i].position_world);
  }
}

TEST_CASE("wrong poses are refused with their kind of error") {
  const auto w_first = [](const SlamMap& right, std::size_t i) {
    const RigidTransform& pose = right.keyframes[i].cam_from_world;
    const Eigen::Quaterniond q(Eigen::Matrix3d(pose.rotation.transpose()));
    const Eigen::Matrix3d turn = Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y()).toRotationMatrix().transpose();
    return RigidTransform{turn, -(turn * pose.center())};
  };
  const auto late = [](const SlamMap& right, std::size_t i) {
    RigidTransform pose = right.keyframes[i > 0 ? i - 1 : 0].cam_from_world;
    if (i == 0) pose.translation += Eigen::Vector3d(0.1, 0.0, 0.2);
    return pose;
  };
  struct Wrong {
    const char* name;
    SlamMap map;
  };
  const Wrong wrong[] = {
      {"quaternions with w first", with_poses(w_first)},
      {"a body, an IMU's or a base's, with x forward, y left, z up", turned(matrix({0, 0, 1, -1, 0, 0, 0, -1, 0}))},
      {"poses one keyframe late", with_poses(late)}};
  for (const Wrong& it : wrong) {
    const Result result = sweep_of(it.map)->check_poses();
    INFO(it.name << ": " << result.message << ", share " << result.share);
    CHECK_FALSE(result.fits);
    CHECK_THAT(result.fits_better, Contains(it.name));
    CHECK_THAT(result.message, Contains(it.name) && Contains("instead of"));
  }
}

TEST_CASE("poses that fit no better than chance are refused and poor ones give a warning") {
  std::mt19937 random(3);
  std::normal_distribution<double> gauss;
  const auto anyhow = [&](const SlamMap& right, std::size_t i) {
    const Eigen::Quaterniond q(gauss(random), gauss(random), gauss(random), gauss(random));
    const Eigen::Matrix3d turn = q.normalized().toRotationMatrix();
    return RigidTransform{turn, -(turn * right.keyframes[i].cam_from_world.center())};
  };
  const SlamMap wrong = with_poses(anyhow);
  const Result result = sweep_of(wrong)->check_poses();
  INFO(result.message);
  CHECK_FALSE(result.fits);
  CHECK(result.fits_better.empty());
  CHECK(result.share < 0.05);
  SlamMap map = wrong;
  CHECK(sweep_of(wrong)->make_landmarks(map).patches == 0);
  CHECK(map.landmarks.empty());
  CHECK_THAT(result.message, Contains("by chance") && Contains("--camera-from-body") && Contains("--no-verify"));

  const SlamMap tilted = turned(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()).toRotationMatrix());
  const Result some = sweep_of(tilted)->check_poses();
  INFO(some.message << some.share);
  CHECK(some.fits);
  CHECK(some.doubtful);
  CHECK_THAT(some.message, Contains("may not fit"));
}

TEST_CASE("three images are reported as too few") {
  SlamMap map = poses_alone();
  map.keyframes.resize(3);
  const Result result = sweep_of(map)->check_poses();
  CHECK_FALSE(result.conclusive);
  CHECK(result.fits);
  CHECK_THAT(result.message, Contains("unknown whether") && Contains("3 images"));
}
