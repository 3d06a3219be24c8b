// SPDX-License-Identifier: BSD-2-Clause
// Maps of free and occupied space, read by OctoMap's own library.
#include <cmath>
#include <memory>

#include <octomap/OcTree.h>
#include <catch2/catch.hpp>

#include "export/robot_map.h"
#include "export/robot_scene.h"
#include "export/voxel_map.h"
#include "pmsp/error.h"

using namespace pmsp;
using namespace pmsp_test;
using Catch::Contains;

namespace {

enum class Cell { kUnknown, kFree, kOccupied };

Cell cell_at(const octomap::OcTree& tree, double x, double y, double z) {
  const octomap::OcTreeNode* const node = tree.search(x, y, z);
  if (node == nullptr) return Cell::kUnknown;
  return tree.isNodeOccupied(node) ? Cell::kOccupied : Cell::kFree;
}

std::unique_ptr<octomap::OcTree> read_bt(const std::filesystem::path& path) {
  auto tree = std::make_unique<octomap::OcTree>(1.0);
  REQUIRE(tree->readBinary(path.string()));
  return tree;
}

std::unique_ptr<octomap::OcTree> read_ot(const std::filesystem::path& path) {
  auto* const tree = dynamic_cast<octomap::OcTree*>(octomap::AbstractOcTree::read(path.string()));
  REQUIRE(tree != nullptr);
  return std::unique_ptr<octomap::OcTree>(tree);
}

/// Number of cells of a kind with centres in a box.
int count(const octomap::OcTree& tree, Cell kind, const Box& box) {
  int sum = 0;
  const double cell = tree.getResolution();
  for (double z = box.low.z() + cell / 2; z < box.high.z(); z += cell) {
    for (double y = box.low.y() + cell / 2; y < box.high.y(); y += cell) {
      for (double x = box.low.x() + cell / 2; x < box.high.x(); x += cell) sum += cell_at(tree, x, y, z) == kind;
    }
  }
  return sum;
}

}  // namespace

TEST_CASE("an OctoMap is occupied at surfaces and free between them and the cameras", "[robot]") {
  const RobotScene scene = room();
  const TempDir dir;
  scene.write(scene.header(dir), dir, {"a.bt", "a.ot"});
  const auto binary = read_bt(dir / "a.bt"), full = read_ot(dir / "a.ot");
  for (const octomap::OcTree* const tree : {binary.get(), full.get()}) {
    CHECK(tree->getResolution() == 0.1);
    CHECK(cell_at(*tree, -4.05, 0.05, 1.05) == Cell::kOccupied);
    CHECK(cell_at(*tree, 0.05, 0.05, -0.05) == Cell::kOccupied);
    CHECK(count(*tree, Cell::kFree, {{-3.8, -2.8, 0.2}, {3.8, 2.8, 2.8}}) > 0.95 * 76 * 56 * 26);
    CHECK(count(*tree, Cell::kOccupied, {{-3.8, -2.8, 0.2}, {3.8, 2.8, 2.8}}) == 0);
    CHECK(count(*tree, Cell::kUnknown, {{-6, -5, 0}, {-4.1, 5, 3}}) == 19 * 100 * 30);
    CHECK(tree->size() == tree->calcNumNodes());
    octomap::point3d end;  // along the room
    REQUIRE(tree->castRay(octomap::point3d(-2.55F, -0.75F, 1.35F), octomap::point3d(1, 0, 0), end, true));
    CHECK(end.x() == Approx(4.05).margin(0.06));
  }
  const auto probability = [&](double x, double y, double z) { return full->search(x, y, z)->getOccupancy(); };
  CHECK(probability(-4.05, 0.05, 1.05) > 0.9);
  CHECK(probability(-2.5, 0.0, 1.0) == Approx(0.1192).margin(0.001));  // the least of OctoMap
}

TEST_CASE("nothing is free behind a wall, thick or thin, even with wrong points behind it", "[robot]") {
  const double thickness = GENERATE(0.02, 0.5);
  RobotScene scene = room();
  scene.add(0.05, -3.1, -0.1, 0.05 + thickness, 3.1, 3.1);
  std::vector<Eigen::Vector3d> wrong;  // as by a mirror
  for (int i = 0; i < 400; ++i) wrong.emplace_back(1.5 + 0.05 * (i % 20), -0.5 + 0.05 * (i / 20), 1.25);
  const TempDir dir;
  scene.write(scene.header(dir), dir, {"a.bt"}, {}, wrong);
  const auto tree = read_bt(dir / "a.bt");
  CHECK(count(*tree, Cell::kFree, {{0.0, -3, 0}, {4, 3, 3}}) == 0);
  CHECK(cell_at(*tree, -0.3, 0.0, 1.0) == Cell::kFree);
  CHECK(cell_at(*tree, 1.7, 0.0, 1.25) == Cell::kOccupied);
}

TEST_CASE("a cell is free by the least number of rays, each of another camera or cell", "[robot]") {
  VoxelMap::Options options;
  options.cell = 1.0;
  options.least_rays = 2;
  VoxelMap map(options);
  for (const int x : {10, 20}) map.add_point({x, 0, 0}, 0.9F);
  map.add_ray({0.5, 0.5, 0.5}, {10, 0, 0});
  CHECK(map.at({5, 0, 0}) == Space::kUnknown);
  map.add_ray({1.5, 0.5, 0.5}, {10, 0, 0});
  CHECK(map.at({5, 0, 0}) == Space::kFree);
  CHECK(map.at({7, 0, 0}) == Space::kFree);
  CHECK(map.at({8, 0, 0}) == Space::kUnknown);  // the last two before the surface
  CHECK(map.at({9, 0, 0}) == Space::kUnknown);
  CHECK(map.at({10, 0, 0}) == Space::kOccupied);
  map.add_ray({0.5, 0.5, 0.5}, {20, 0, 0});
  map.add_ray({1.5, 0.5, 0.5}, {20, 0, 0});
  CHECK(map.at({15, 0, 0}) == Space::kUnknown);  // behind the first
}

TEST_CASE("points make a cell occupied by their confidences together", "[robot]") {
  VoxelMap::Options options;
  options.cell = 1.0;
  options.least_rays = 1;
  VoxelMap map(options);
  map.add_point({5, 0, 0}, 0.51F);
  CHECK(map.at({5, 0, 0}) == Space::kOccupied);
  const auto state_of = [&map](int points, float confidence, int y) {
    for (int i = 0; i < points; ++i) map.add_point({5, y, 0}, confidence);
    return map.at({5, y, 0});
  };
  CHECK(state_of(1, 0.3F, 1) == Space::kWeak);
  CHECK(state_of(3, 0.3F, 2) == Space::kOccupied);
  CHECK(state_of(5, 0.1F, 3) == Space::kWeak);
  CHECK(state_of(9, 0.1F, 4) == Space::kOccupied);
  map.add_ray({0.5, 3.5, 0.5}, {5, 3, 0});  // to a weak cell
  CHECK(map.at({2, 3, 0}) == Space::kUnknown);
}

TEST_CASE("a crop bounds the maps but keeps what cameras and points outside make free", "[robot]") {
  const RobotScene scene = room();
  const TempDir dir;
  CloudSelection amount;
  amount.crop = Box{{0.0, -2.0, 0.5}, {2.0, 2.0, 2.0}};  // without cameras and without surfaces
  scene.write(scene.header(dir), dir, {"part.bt"}, amount);
  const auto part = read_bt(dir / "part.bt");
  CHECK(count(*part, Cell::kFree, {{0, -2, 0.5}, {2, 2, 2}}) > 0.98 * 20 * 40 * 15);
  CHECK(count(*part, Cell::kFree, {{-4, -3, 0}, {-0.1, 3, 3}}) == 0);
  CHECK(count(*part, Cell::kOccupied, {{-4.3, -3.3, -0.3}, {4.3, 3.3, 3.3}}) == 0);
}

TEST_CASE("thinning and the number of threads do not change a map", "[robot]") {
  const RobotScene scene = room();
  const TempDir dir;
  CloudHeader header = scene.header(dir);
  scene.write(header, dir, {"a.bt", "a.ot"});
  CloudSelection amount;
  amount.thinning.max_points = 10;
  header.threads = 3;
  scene.write(header, dir, {"b.bt", "b.ot", "b.ply"}, amount);
  CHECK((read_text(dir / "a.bt") == read_text(dir / "b.bt")));
  CHECK((read_text(dir / "a.ot") == read_text(dir / "b.ot")));
  CHECK(read_ply(dir / "b.ply").positions.size() == 10);
}

TEST_CASE("a map without scale, cameras or size of cells is refused before any point", "[robot]") {
  const RobotScene scene = room();
  const TempDir dir;
  const auto open = [&](const CloudHeader& header) { CloudOutput(dir / "a.bt", header); };
  CloudHeader header = scene.header(dir);
  header.unit.kind = CloudUnit::Kind::kMap;
  CHECK_THROWS_WITH(open(header), Contains("no metres") && Contains("--scale") && Contains("--map-units"));
  CHECK_THROWS_AS(open(header), InvalidInput);
  header.map_units = true;
  open(header);
  header.cameras.clear();
  CHECK_THROWS_WITH(open(header), Contains("cameras") && Contains("workspace"));
  header = scene.header(dir);
  header.cell_size = 0.0;
  CHECK_THROWS_WITH(open(header), Contains("--cell-size"));
  CHECK(dir.entries() == 0);
  CloudOutput output(dir / "a.bt", scene.header(dir));
  const OutputPoint point;
  CHECK_THROWS_WITH(output.add(&point, 1, {}), Contains("keyframes"));
}

TEST_CASE("maps that exceed memory or range are refused with a remedy", "[robot]") {
  VoxelMap::Options options;
  options.cell = 1.0;
  options.most_bytes = 10 * sizeof(VoxelBlock);
  VoxelMap map(options);
  map.add_point({300, 0, 0}, 0.9F);
  CHECK_THROWS_WITH(map.add_ray({0.5, 0.5, 0.5}, {300, 0, 0}), Contains("--cell-size") && Contains("--crop"));
  CHECK(map.bytes() <= options.most_bytes);
  CHECK_THROWS_WITH(map.index_of({3e6, 0, 0}), Contains("--cell-size"));

  RobotScene scene = room();
  const TempDir dir;
  for (Box& box : scene.boxes) box.low.x() += 4000.0, box.high.x() += 4000.0;
  for (Eigen::Vector3d& camera : scene.cameras) camera.x() += 4000.0;
  CHECK_THROWS_WITH(scene.write(scene.header(dir), dir, {"a.bt"}), Contains("32768") && Contains("--transform"));
  CHECK(dir.entries() == 0);
}

TEST_CASE("a map with most points out of range is an error and the cloud is written", "[robot]") {
  RobotScene scene = room();
  const TempDir dir;
  scene.boxes = {{{-200.0, 150.0, -200.0}, {200.0, 151.0, 200.0}}};
  CHECK_THROWS_WITH(scene.write(scene.header(dir), dir, {"a.bt", "a.ply"}), Contains("1000 cells of 0.1"));
  CHECK(read_ply(dir / "a.ply").positions.size() > 1000);
  CHECK_FALSE(std::filesystem::exists(dir / "a.bt"));
}

TEST_CASE("a map that cannot be made does not prevent others", "[robot]") {
  const RobotScene scene = room();
  const TempDir dir;
  CloudHeader header = scene.header(dir);
  header.robot_height = 1e10;
  CHECK_THROWS_WITH(scene.write(header, dir, {"a.pgm", "a.bt"}), Contains("a.pgm") && Contains("--robot-height"));
  CHECK(read_bt(dir / "a.bt")->size() > 100);
  header.robot_step = 0.02;
  CHECK_THROWS_WITH(scene.write(header, dir, {"b.pgm"}), Contains("--robot-step"));
}

TEST_CASE("a map takes points at the poses of its header only", "[robot]") {
  const RobotScene scene = room();
  const TempDir dir;
  CloudHeader header = scene.header(dir);
  CloudOutput output(dir / "a.bt", header);
  KeyframePose moved = scene.cloud(0).pose();
  moved.cam_from_world.translation.x() += 1.0;
  CHECK_THROWS_WITH(output.add(scene.cloud(0), moved), Contains("keyframe 0") && Contains("elsewhere"));
  CHECK(output.points_in() == 0);
  header.cameras.erase(1);
  CHECK_THROWS_WITH(scene.write(header, dir, {"b.bt"}), Contains("keyframe 1") && Contains("missing"));
}

TEST_CASE("cells are sized by the spacing of pixels at the median distance", "[robot]") {
  CHECK(default_cell_size({5.0, 5.0, 5.0}, 1440) == 0.05);
  CHECK(default_cell_size({5.0, 5.0, 1000.0}, 640) == Approx(0.1));  // not the mean
  CHECK(default_cell_size({0.01, 5.0, 5.0}, 2880) == Approx(0.02));
  CHECK(default_cell_size({}, 1440) == 0.0);
}
