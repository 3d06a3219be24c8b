// SPDX-License-Identifier: BSD-2-Clause
// Occupancy grids as Nav2 reads them, with paths planned on them.
#include <array>
#include <cmath>
#include <sstream>

#include <catch2/catch.hpp>

#include "export/floor_grid.h"
#include "export/robot_scene.h"
#include "pmsp/error.h"

using namespace pmsp;
using namespace pmsp_test;
using Catch::Contains;

namespace {

ReadGrid grid_of(const RobotScene& scene, const TempDir& dir, CloudHeader header) {
  scene.write(header, dir, {"map.pgm"});
  return ReadGrid(dir / "map.yaml");
}

ReadGrid grid_of(const RobotScene& scene) {
  const TempDir dir;
  return grid_of(scene, dir, scene.header(dir));
}

/// The room, with a camera in each half so that all of it is seen.
RobotScene seen_room() {
  RobotScene scene = room();
  scene.cameras = {{-2.5, -0.7, 1.3}, {-2.2, 0.8, 1.4}, {2.4, 0.6, 1.3}, {2.1, -0.9, 1.4}};
  return scene;
}

}  // namespace

TEST_CASE("a grid has the conventions of Nav2 and lies where its YAML says", "[robot]") {
  RobotScene scene = seen_room();
  scene.add(-0.25, 0.55, -0.1, 1.05, 2.05, 1.05);  // off centre: a flipped axis is noticed
  const TempDir dir;
  CloudHeader header = scene.header(dir);
  const ReadGrid grid = grid_of(scene, dir, header);
  CHECK(grid.mode == "trinary");
  CHECK(grid.negate == "0");
  CHECK(grid.cell == 0.1);
  CHECK((1.0 - 205.0 / 255.0 > grid.free_thresh && 1.0 - 205.0 / 255.0 < grid.occupied_thresh));  // unknown
  CHECK(grid.image.type() == CV_8UC1);
  CHECK(grid.low_x == Approx(-4.1).margin(0.15));
  CHECK(grid.low_y == Approx(-3.1).margin(0.15));
  CHECK(grid.at(-1.0, -1.0) == 254);
  CHECK(grid.at(0.4, -1.2) == 254);
  CHECK(grid.at(0.45, 0.55) == 0);  // side of the box
  CHECK(grid.count(254, -0.1, 0.6, 0.9, 1.9) == 0);
  CHECK(grid.at(4.05, 0.0) == 0);
  CHECK(grid.count(254, -3.8, -2.8, 3.8, 2.8) > 3600);  // of 4256 - 180
  CHECK(grid.count(254, -9, -9, -4.1, 9) + grid.count(254, 4.1, -9, 9, 9) == 0);
  CHECK(grid.has_path(-2.5, -0.7, 3.0, 2.0));
  CHECK_THAT(read_text(dir / "map.yaml"), Contains("lengths in metres"));

  const cv::Mat elevation = cv::imread((dir / "map.elevation.tif").string(), cv::IMREAD_UNCHANGED);
  const cv::Mat slope = cv::imread((dir / "map.slope.tif").string(), cv::IMREAD_UNCHANGED);
  REQUIRE((elevation.type() == CV_32FC1 && slope.type() == CV_32FC1));
  REQUIRE((elevation.size() == grid.image.size() && slope.size() == grid.image.size()));
  CHECK(elevation.at<float>(grid.pixel(-1.0, -1.0)) == Approx(0.0).margin(0.06));
  CHECK(slope.at<float>(grid.pixel(-1.0, -1.0)) < 3.0F);
  CHECK(std::isnan(elevation.at<float>(grid.pixel(4.05, 0.0))));
  for (const char* name : {"map.elevation.tfw", "map.slope.tfw"}) {  // as GDAL reads them: of the first pixel's centre
    std::istringstream world(read_text(dir / name));
    std::array<double, 6> v{};
    for (double& value : v) world >> value;
    CHECK((v[0] == 0.1 && v[1] == 0.0 && v[2] == 0.0 && v[3] == -0.1));
    CHECK(grid.pixel(v[4], v[5]) == cv::Point(0, 0));
    CHECK(v[4] - 0.05 == Approx(grid.low_x));
    CHECK(v[5] + 0.05 == Approx(grid.low_y + 0.1 * grid.image.rows));
  }
}

TEST_CASE("a path leads through a door but not through a wall or a low lintel", "[robot]") {
  const double lintel = GENERATE(2.0, 0.6, 0.0);  // height of the door
  RobotScene scene = seen_room();
  scene.add(-0.15, -3.1, -0.1, 0.15, 1.05, 3.1);
  scene.add(-0.15, 2.25, -0.1, 0.15, 3.1, 3.1);
  scene.add(-0.15, 1.0, lintel - 0.05, 0.15, 2.3, 3.1);
  scene.cameras.push_back({0.0, 1.6, lintel / 2});
  if (lintel == 0.0) scene.cameras.pop_back();
  const ReadGrid grid = grid_of(scene);
  CHECK(grid.at(-2.0, 0.0) == 254);
  CHECK(grid.at(2.0, 0.0) == 254);
  CHECK(grid.at(-0.15, 0.0) == 0);
  CHECK(grid.has_path(-2.0, 0.0, 2.0, 0.0) == (lintel == 2.0));
}

TEST_CASE("space below obstacles that are higher than the robot is free", "[robot]") {
  RobotScene scene = seen_room();
  scene.add(-0.45, -3.1, 1.55, 0.45, 3.1, 1.85);
  CHECK(grid_of(scene).has_path(-2.0, 0.0, 2.0, 0.0));
  const TempDir dir;
  CloudHeader header = scene.header(dir);
  header.robot_height = 1.7;
  const ReadGrid tall = grid_of(scene, dir, header);
  CHECK_FALSE(tall.has_path(-2.0, 0.0, 2.0, 0.0));
  CHECK(tall.at(-0.45, 0.0) == 0);
}

TEST_CASE("floor is free only if most of the space above it was seen", "[robot]") {
  const int seen = GENERATE(6, 9);  // of 11 cells: those of the robot, and one
  VoxelMap::Options options;
  options.cell = 0.1;
  options.least_rays = 1;
  VoxelMap map(options);
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 30; ++x) map.add_point({x, y, 0}, 0.9F);
    for (int z = 1; z <= seen; ++z) map.add_point({40, y, z}, 0.9F);
  }
  for (int y = 0; y < 30; ++y) {
    for (int z = 1; z <= seen; ++z) map.add_ray({-0.05, 0.1 * y + 0.05, 0.1 * z + 0.05}, {40, y, z});
  }
  const auto grid = [&map] { return FloorGrid(map, {{1.5, 1.5, 0.55}}, FloorRobot{1.0, 0.1, 20.0}); };
  if (seen == 6) {
    CHECK_THROWS_WITH(grid(), Contains("no free floor"));
  } else {
    CHECK(grid().at(15, 15) == FloorGrid::kFree);
  }
}

TEST_CASE("ramps are passable up to the slope and stairs up to the step", "[robot]") {
  const double rise = GENERATE(0.2, 0.5, 1.2);  // over 2 m, or at once
  const bool is_ramp = GENERATE(true, false);
  RobotScene scene = seen_room();
  scene.add(1.5, -3.1, -0.1, 4.1, 3.1, rise - 0.05);
  if (is_ramp) {
    for (int i = 0; i < 100; ++i)
      scene.add(-0.5 + 0.02 * i, -3.1, -0.1, -0.48 + 0.02 * i, 3.1, rise * (i + 1) / 100.0 - 0.05);
  }
  for (Eigen::Vector3d& camera : scene.cameras) camera.z() += rise;
  const ReadGrid grid = grid_of(scene);
  CHECK(grid.at(-2.0, 0.0) == 254);
  const bool is_passable = is_ramp && rise < 0.7;  // 20 degrees
  CHECK(grid.has_path(-2.0, 0.0, 2.0, 0.0) == is_passable);
}

TEST_CASE("a step of the floor is passable up to the height of the option", "[robot]") {
  RobotScene scene = seen_room();
  scene.add(0.05, -3.1, -0.1, 4.1, 3.1, 0.2);
  const TempDir dir;
  CloudHeader header = scene.header(dir);
  header.robot_step = GENERATE(0.1, 0.3);
  CHECK(grid_of(scene, dir, header).has_path(-2.0, 0.0, 2.0, 0.0) == (header.robot_step > 0.25));
}

TEST_CASE("a hole in the floor is not free, with a bottom or without", "[robot]") {
  const double depth = GENERATE(1.0, 50.0);
  RobotScene scene = seen_room();
  scene.boxes.erase(scene.boxes.begin());
  scene.add(-4.1, -3.1, -0.35, -0.45, 3.1, -0.05);
  scene.add(0.45, -3.1, -0.35, 4.1, 3.1, -0.05);
  scene.add(-4.1, -3.1, -depth - 0.3, 4.1, 3.1, -depth);
  const ReadGrid grid = grid_of(scene);
  CHECK(grid.at(-2.0, 0.0) == 254);
  CHECK(grid.count(254, -0.3, -2.9, 0.3, 2.9) == 0);
  CHECK_FALSE(grid.has_path(-2.0, 0.0, 2.0, 0.0));
}

TEST_CASE("the floor is the largest level below the cameras and not a table or the ceiling", "[robot]") {
  RobotScene scene = seen_room();
  scene.add(-3.35, -1.5, 0.65, -1.75, 1.5, 0.75);  // a camera is above it
  const TempDir dir;
  const ReadGrid grid = grid_of(scene, dir, scene.header(dir));
  const cv::Mat elevation = cv::imread((dir / "map.elevation.tif").string(), cv::IMREAD_UNCHANGED);
  CHECK(elevation.at<float>(grid.pixel(2.0, 0.0)) == Approx(0.0).margin(0.06));
  CHECK(grid.at(-2.5, 0.0) != 254);
}

TEST_CASE("a grid without floor under the cameras, or with z not upwards, is refused", "[robot]") {
  const TempDir dir;
  RobotScene scene = seen_room();
  CloudHeader header = scene.header(dir);
  header.robot_height = 5.0;  // higher than the room
  CHECK_THROWS_WITH(scene.write(header, dir, {"map.pgm"}), Contains("no free floor") && Contains("--robot-height"));
  scene.boxes.erase(scene.boxes.begin());
  header = scene.header(dir);
  CHECK_THROWS_WITH(scene.write(header, dir, {"map.pgm"}), Contains("floor") && Contains("--up"));
  for (auto& [id, pose] : header.cameras) pose.rotation.setIdentity();
  CHECK_THROWS_WITH(scene.write(header, dir, {"map.pgm"}), Contains("z of the cloud") && Contains("--up"));
  CHECK(dir.entries() == 0);
}
