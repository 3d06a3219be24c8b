// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <vector>

#include <Eigen/Geometry>

#include "core/helpers.h"
#include "core/recording.h"
#include "pmsp/error.h"
#include "pmsp/fusion.h"
#include "pmsp/revisit_filter.h"

using namespace pmsp;
using namespace pmsp::test;
using Eigen::Vector3d;

namespace {

constexpr int kWidth = 320;                                       // of the depth maps that the clouds claim to be of
constexpr double kPixel = 2.0 * 3.14159265358979323846 / kWidth;  // [rad]

FusionOptions remembering(int mib = 16, int window = 1) {
  FusionOptions options;
  options.spacing_px = 1.0;
  options.window = window;
  options.revisit_memory_mib = mib;
  return options;
}

/// A wall through `center`, sampled every pixel of a camera that looks straight at it from `distance`.
KeyframeCloud wall(std::int64_t id, double distance, const Vector3d& center = Vector3d::Zero(),
                   const Vector3d& normal = -Vector3d::UnitZ(), int side = 40, float confidence = 0.8F) {
  KeyframeCloud cloud;
  cloud.keyframe_id = id;
  const Eigen::Matrix3d world_from_cam = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), -normal).matrix();
  cloud.cam_from_world.rotation = world_from_cam.transpose();
  cloud.cam_from_world.translation = -(world_from_cam.transpose() * (center + distance * normal));
  const double spacing = kPixel * distance;
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      CloudPoint point;
      point.position = Vector3d((x - 0.5 * side) * spacing, (y - 0.5 * side) * spacing, distance).cast<float>();
      point.normal = -Eigen::Vector3f::UnitZ();
      point.confidence = confidence;
      cloud.points.push_back(point);
    }
  }
  return cloud;
}

/// Share of the points that stay.
double stays(RevisitFilter& filter, KeyframeCloud cloud, int threads = 2) {
  FilterStats stats;
  filter.filter(cloud, kWidth, Executor(threads), &stats);
  CHECK(stats.after == static_cast<std::int64_t>(cloud.points.size()));
  return static_cast<double>(stats.after) / static_cast<double>(stats.before);
}

/// Share of the second cloud's points that stay after the first one.
double stays_after(const KeyframeCloud& first, const KeyframeCloud& second) {
  RevisitFilter filter(remembering());
  REQUIRE(stays(filter, first) == 1.0);
  return stays(filter, second);
}

const Vector3d kSkew = Vector3d(0.3, -0.5, -0.8).normalized();

}  // namespace

TEST_CASE("a place that is passed again gives its points once", "[revisits]") {
  for (const Vector3d& normal : {Vector3d(-Vector3d::UnitZ()), Vector3d(Vector3d::UnitX()), kSkew}) {
    for (const Vector3d& center : {Vector3d(0.0, 0.0, 0.0), Vector3d(-40.0, 7.0, 1000.0)}) {
      INFO(normal.transpose() << " at " << center.transpose());
      CHECK(stays_after(wall(0, 3.0, center, normal), wall(1, 3.0, center, normal)) < 0.01);
    }
  }
  CHECK(stays_after(wall(0, 3.0), wall(1, 3.0, {10.0, 0.0, 0.0})) == 1.0);
}

TEST_CASE("what lies within the expected error of a surface is that surface", "[revisits]") {
  const auto stays_at = [](double offset, float confidence) {  // across the wall, relative to the distance
    return stays_after(wall(0, 3.0), wall(1, 3.0, {0.0, 0.0, 3.0 * offset}, -Vector3d::UnitZ(), 40, confidence));
  };
  CHECK(stays_at(0.008, 0.5F) < 0.01);   // 0.5 % is expected
  CHECK(stays_at(0.060, 0.5F) == 1.0);   // the wall's relief
  CHECK(stays_at(0.060, 0.05F) == 1.0);  // 10 % is expected, but fusion would not join them either
}

TEST_CASE("both sides of a thin wall stay", "[revisits]") {
  CHECK(stays_after(wall(0, 3.0), wall(1, 3.0, Vector3d::Zero(), Vector3d::UnitZ())) == 1.0);
  CHECK(stays_after(wall(0, 3.0, Vector3d::Zero(), kSkew), wall(1, 3.0, Vector3d::Zero(), -kSkew)) == 1.0);
}

TEST_CASE("points from nearer add detail, points from farther add nothing", "[revisits]") {
  CHECK(stays_after(wall(0, 8.0), wall(1, 2.0)) == 1.0);
  CHECK(stays_after(wall(0, 2.0, Vector3d::Zero(), -Vector3d::UnitZ(), 80),
                    wall(1, 8.0, {0.0, 0.0, 0.0}, -Vector3d::UnitZ(), 16)) < 0.01);
}

TEST_CASE("keyframes that fusion has joined do not stand for each other", "[revisits]") {
  RevisitFilter filter(remembering(16, 5));  // joined with two on either side
  CHECK(stays(filter, wall(0, 3.0)) == 1.0);
  CHECK(stays(filter, wall(1, 3.0)) == 1.0);
  CHECK(stays(filter, wall(2, 3.0)) == 1.0);
  CHECK(stays(filter, wall(3, 3.0)) < 0.01);
}

TEST_CASE("memory is bounded, the oldest is forgotten first", "[revisits]") {
  RevisitFilter filter(remembering(1));
  const auto at = [](int i) { return wall(i, 3.0, {20.0 * i, 0.0, 0.0}, -Vector3d::UnitZ(), 100); };
  int next = 0;
  while (next < 120) {
    CHECK(stays(filter, at(next++)) == 1.0);
    CHECK(filter.memory() <= std::size_t{1} << 20);
  }
  CHECK(stays(filter, at(next - 1)) < 0.01);
  CHECK(stays(filter, at(0)) == 1.0);
  RevisitFilter roomy(remembering(64));
  for (int i = 0; i < next; ++i) stays(roomy, at(i));
  CHECK(stays(roomy, at(0)) < 0.01);
}

TEST_CASE("without memory or spacing nothing is left out", "[revisits]") {
  FusionOptions close = remembering();
  close.spacing_px = 0.0;
  for (const FusionOptions& options : {remembering(0), close}) {
    RevisitFilter filter(options);
    CHECK(stays(filter, wall(0, 3.0)) == 1.0);
    CHECK(stays(filter, wall(1, 3.0)) == 1.0);
    CHECK(filter.memory() == 0);
  }
}

TEST_CASE("odd points do no harm", "[revisits]") {
  RevisitFilter filter(remembering());
  KeyframeCloud empty;
  CHECK_NOTHROW(filter.filter(empty, kWidth, Executor(1)));
  KeyframeCloud odd = wall(1, 3.0);
  for (CloudPoint& point : odd.points) point.normal.setZero();
  odd.points[0].position.setZero();
  odd.points[1].position.setConstant(1e12F);
  CHECK(stays(filter, odd) == 1.0);
}

TEST_CASE("a revisit filter refuses bad options", "[revisits]") {
  CHECK_THROWS_AS(RevisitFilter(remembering(-1)), InvalidOption);
}

TEST_CASE("a second flight through a room adds little", "[revisits]") {
  // The second time half a step farther on, and sideways.
  const synth::Mission room = synth::textured_room(small_recipe(kWidth / 2, 6));
  std::vector<RigidTransform> poses;
  for (const synth::Frame& frame : room.frames) poses.push_back(frame.cam_from_world);
  for (const synth::Frame& frame : room.frames) {
    RigidTransform pose = frame.cam_from_world;
    pose.translation += Vector3d(0.15, 0.05, -0.1);
    poses.push_back(pose);
  }
  const synth::Mission twice =
      synth::make_mission(room.scene, poses, room.width, room.height, small_recipe(room.width).mission);
  const auto points_of = [&](int threads) {
    FusionOptions options = remembering();
    options.spacing_px = 2.0;
    RevisitFilter filter(options);
    std::vector<KeyframeCloud> clouds;
    for (const synth::Frame& frame : twice.frames) {
      const DepthMap map = truth_map(frame, 0.7F);
      std::vector<std::uint8_t> covered(map.depth.size());
      KeyframeCloud cloud = fuse({{&map, &frame.image, &covered}}, 0, options, Executor(threads));
      filter.filter(cloud, room.width, Executor(threads));
      clouds.push_back(cloud);
    }
    return clouds;
  };
  const std::vector<KeyframeCloud> clouds = points_of(2);
  std::size_t once = 0;
  std::size_t again = 0;
  for (std::size_t i = 0; i < clouds.size(); ++i) (i < room.frames.size() ? once : again) += clouds[i].points.size();
  CAPTURE(once, again);
  CHECK(once > room.frames[0].depth.size());
  CHECK(again < once / 3);
  for (const int threads : {1, 3}) {
    const std::vector<KeyframeCloud> others = points_of(threads);
    for (std::size_t i = 0; i < clouds.size(); ++i) CHECK(same(clouds[i], others[i]));
  }
}
