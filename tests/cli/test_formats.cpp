// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <vector>

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "map/scene_files.h"
#include "pmsp/io/cloud.h"
#include "pmsp/io/map.h"
#include "stats.h"

using namespace pmsp;
using namespace pmsp::test;
using namespace pmsp_test;
using Catch::Contains;

namespace {

namespace fs = std::filesystem;

/// The mission's map, as a reconstruction that names its images.
SlamMap named_map() {
  SlamMap map = read_map(mission() / "map.msg");
  for (MapKeyframe& keyframe : map.keyframes) {
    char name[32];
    std::snprintf(name, sizeof name, "%06d.png", static_cast<int>(keyframe.id));
    keyframe.image = name;
  }
  return map;
}

/// A quick run on another map; `images` "" = where the map says.
std::vector<std::string> run_on(const fs::path& map, const fs::path& images, const fs::path& output,
                                const ReadMapOptions& options = {}) {
  std::vector<std::string> words = quick_run(output);
  words[1] = map.string();
  if (!options.points.empty()) words.insert(words.end(), {"--points", options.points.string()});
  if (!options.image_list.empty()) words.insert(words.end(), {"--image-list", options.image_list.string()});
  words[3] = images.string();
  if (images.empty()) words.erase(words.begin() + 2, words.begin() + 4);
  return words;
}

/// The share of points that another cloud has within 2 % of the room.
double share_in(const PlyCloud& cloud, const PlyCloud& other) {
  constexpr double kNear = 0.1;
  std::vector<Eigen::Vector3d> along_x = other.positions;
  std::sort(along_x.begin(), along_x.end(), [](const auto& a, const auto& b) { return a.x() < b.x(); });
  const auto first_from = [&](double x) {
    return std::lower_bound(along_x.begin(), along_x.end(), x, [](const auto& p, double at) { return p.x() < at; });
  };
  const auto near = std::count_if(cloud.positions.begin(), cloud.positions.end(), [&](const Eigen::Vector3d& point) {
    return std::any_of(first_from(point.x() - kNear), first_from(point.x() + kNear),
                       [&](const Eigen::Vector3d& p) { return (p - point).squaredNorm() < kNear * kNear; });
  });
  return static_cast<double>(near) / static_cast<double>(cloud.positions.size());
}

}  // namespace

TEST_CASE("every map format gives the same cloud") {
  const TempDir dir;
  const SlamMap map = named_map();
  REQUIRE(densify(quick_run(dir / "map.ply")).code == 0);
  const PlyCloud expected = read_ply(dir / "map.ply");
  REQUIRE(densify(quick_run(dir / "seed.ply", {"--seed", "2"})).code == 0);
  const double usual = share_in(read_ply(dir / "seed.ply"), expected);  // difference between two seeds
  std::string colmap;
  for (const FormatFiles& format : all_formats()) {
    CAPTURE(format.name, usual);
    const fs::path folder = dir / "in" / format.name;
    fs::create_directories(folder);
    fs::create_directory_symlink(mission() / "images", folder / "images");
    const bool says_where = format.name != std::string("TUM") && format.name != std::string("AliceVision") &&
                            format.name[0] != 'C' && format.name != std::string("Metashape");
    const fs::path images = says_where ? fs::path() : mission() / "images";
    const fs::path output = dir / (std::string(format.name) + ".ply");
    const Result result = densify(run_on(format.write(folder, map), images, output, format.options(folder)));
    INFO(result.err);
    REQUIRE(result.code == 0);
    const PlyCloud cloud = read_ply(output);
    const double points = static_cast<double>(cloud.positions.size()) / static_cast<double>(expected.positions.size());
    CHECK(points == Approx(1.0).margin(format.has_observations ? 0.01 : 0.1));
    // Rounding of poses changes less than half as much as another seed.
    const double least = format.has_observations ? 1.0 - 0.5 * (1.0 - usual) : usual - 0.02;
    CHECK(share_in(cloud, expected) > least);
    CHECK(share_in(expected, cloud) > least);
    if (format.name[0] != 'C') continue;
    if (colmap.empty()) colmap = read_text(output);
    CHECK(read_text(output) == colmap);  // text and binary
  }
}

TEST_CASE("poses alone suffice with landmarks from the images and contradicted poses are refused by name") {
  const TempDir dir;
  REQUIRE(densify(quick_run(dir / "map.ply")).code == 0);
  const PlyCloud expected = read_ply(dir / "map.ply");
  const auto run = [&](const SlamMap& map, const std::string& name) {
    write_tum(dir / name / "t.txt", map);
    ReadMapOptions options;
    options.image_list = dir / name / "images.txt";
    return densify(run_on(dir / name / "t.txt", mission() / "images", dir / (name + ".ply"), options));
  };
  const Result right = run(named_map(), "right");
  INFO(right.err);
  REQUIRE(right.code == 0);
  CHECK_THAT(right.err, Contains("made from the images"));
  const PlyCloud cloud = read_ply(dir / "right.ply");
  CHECK(static_cast<double>(cloud.positions.size()) > 0.85 * static_cast<double>(expected.positions.size()));
  CHECK(share_in(cloud, expected) > 0.85);

  const Result inverted = run(with_fault(named_map(), Fault::inverted), "inverted");
  CHECK(inverted.code == 3);
  CHECK_THAT(inverted.err, Contains("inverted poses (world_from_cam"));
  SlamMap map = named_map();
  const Eigen::Matrix3d opengl = Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
  for (MapKeyframe& keyframe : map.keyframes) {
    keyframe.cam_from_world = {opengl * keyframe.cam_from_world.rotation, opengl * keyframe.cam_from_world.translation};
  }
  const Result axes = run(map, "axes");
  CHECK(axes.code == 3);
  CHECK_THAT(axes.err, Contains("OpenGL"));
}

TEST_CASE("poses and points that contradict each other are named instead of the images") {
  const TempDir dir;
  const auto run = [&](const SlamMap& map, const std::string& name) {
    write_nerfstudio(dir / name, map);
    fs::create_directory_symlink(mission() / "images", dir / name / "images");
    return densify(run_on(dir / name / "transforms.json", {}, dir / (name + ".ply")));
  };
  SlamMap map = named_map();
  const Eigen::Matrix3d opencv = Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
  for (MapKeyframe& keyframe : map.keyframes) {
    keyframe.cam_from_world = {opencv * keyframe.cam_from_world.rotation, opencv * keyframe.cam_from_world.translation};
  }
  const Result axes = run(map, "axes");
  CHECK(axes.code == 3);
  CHECK_THAT(axes.err, Contains("camera axes of OpenGL") && !Contains("images do not belong"));
  map = named_map();
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(1.0, Eigen::Vector3d(1.0, 2.0, 3.0).normalized()).toRotationMatrix();
  for (MapLandmark& landmark : map.landmarks) landmark.position_world = 0.1 * (turn * landmark.position_world);
  const Result points = run(map, "points");
  INFO(points.err);
  CHECK(points.code == 3);
  CHECK_THAT(points.err, Contains("points do not fit its poses and images") && Contains("another frame"));
  map = named_map();
  map.landmarks.resize(50);  // too few to compare looks, and right
  for (MapKeyframe& keyframe : map.keyframes) keyframe.observations.clear();
  const Result few = run(map, "few");
  INFO(few.err);
  CHECK(few.code == 0);
  CHECK_THAT(few.err, Contains("warning: unknown whether the images belong") && !Contains("points do not fit"));
}

TEST_CASE("poses that contradict the images are refused and three images are too few for it") {
  const TempDir dir;
  const auto run = [&](const SlamMap& map, const std::string& name) {
    write_tum(dir / name / "t.txt", map);
    ReadMapOptions options;
    options.image_list = dir / name / "images.txt";
    return densify(run_on(dir / name / "t.txt", mission() / "images", dir / (name + ".ply"), options));
  };
  SlamMap map = named_map();
  for (std::size_t i = 0; i < map.keyframes.size(); ++i) {
    RigidTransform& pose = map.keyframes[i].cam_from_world;
    const Eigen::Vector3d axis = Eigen::Vector3d(1.0, static_cast<double>(i), 2.0).normalized();
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7 + 1.9 * static_cast<double>(i), axis).toRotationMatrix();
    pose = {turn * pose.rotation, turn * pose.translation};
  }
  const Result random = run(map, "random");
  CHECK(random.code == 3);
  CHECK_THAT(random.err, Contains("the poses do not fit the images") && Contains("by chance"));
  CHECK_FALSE(fs::exists(dir / "random.ply"));
  map = named_map();
  map.keyframes.resize(3);
  const Result few = run(map, "few");
  CHECK(few.code == 0);
  CHECK_THAT(few.err, Contains("warning: unknown whether the poses fit the images: 3 images"));
}

TEST_CASE("an undecided check gives a warning") {
  const TempDir dir;
  SlamMap map = named_map();
  for (MapKeyframe& keyframe : map.keyframes) keyframe.observations.resize(15);
  write_opensfm(dir / "few", map);
  const Result few = densify(run_on(dir / "few/reconstruction.json", mission() / "images", dir / "few.ply"));
  CHECK_THAT(few.err, Contains("warning: unknown whether the map was read by the right conventions") &&
                          Contains("warning: unknown whether the images belong to their keyframes"));
}

TEST_CASE("a consistency filter that keeps less than a fifth gives a warning") {
  DensifierStats stats;
  stats.pixels_after_median = 1000;
  stats.pixels_after_consistency = 199;
  CHECK_THAT(tool::consistency_warning(stats), Contains("keeps only 19.9 %") && Contains("poses"));
  stats.pixels_after_consistency = 200;
  CHECK(tool::consistency_warning(stats).empty());
  stats.pixels_after_consistency = 0;  // an empty result says why
  CHECK(tool::consistency_warning(stats).empty());
}

TEST_CASE("info reports on an import and a wrong one is refused by name") {
  const TempDir dir;
  write_opensfm(dir / "a", named_map(), {sample_scene(2, 30)});
  const Result told =
      densify({"info", (dir / "a/reconstruction.json").string(), "--images", (mission() / "images").string()});
  INFO(told.err);
  CHECK(told.code == 0);
  CHECK_THAT(told.out, Contains("OpenSfM") && Contains("component 0 of 2; keyframes of each: 5 2") &&
                           Contains("projection: landmarks are") && Contains("5 of 5 keyframes have one"));
  const Result other = densify({"info", (dir / "a/reconstruction.json").string(), "--component", "1", "--json"});
  const auto json = nlohmann::json::parse(other.out);
  CHECK(json["keyframes"] == 2);
  CHECK(json["component"] == 1);
  CHECK(densify({"info", (dir / "a/reconstruction.json").string(), "--component", "7"}).code == 2);

  write_colmap_binary(dir / "b", with_fault(named_map(), Fault::inverted));
  const auto words = run_on(dir / "b", mission() / "images", dir / "c.ply");
  const Result refused = densify(words);
  CHECK(refused.code == 3);
  CHECK_THAT(refused.err, Contains("inverted poses"));
  CHECK(!fs::exists(dir / "c.ply"));

  // Images named by the map but not requested may be elsewhere.
  write_nerfstudio(dir / "n", named_map());
  const Result elsewhere = densify({"info", (dir / "n/transforms.json").string()});
  CHECK(elsewhere.code == 0);
  CHECK_THAT(elsewhere.out, Contains("nerfstudio") && Contains("no images:"));

  // A model without image paths.
  write_colmap_text(dir / "d", named_map());
  const Result nowhere = densify(run_on(dir / "d", {}, dir / "c.ply"));
  CHECK(nowhere.code == 2);
  CHECK_THAT(nowhere.err, Contains("the images are missing"));
}

TEST_CASE("images named by the map are found by that name only") {
  const TempDir dir;
  SlamMap map = named_map();
  map.keyframes[1].image = "sub/second.png";
  map.keyframes[2].image = "000007";
  write_colmap_text(dir / "model", map);
  fs::create_directories(dir / "images/sub");
  for (int i : {0, 1, 3, 4}) {
    const std::string name = "00000" + std::to_string(i) + ".png";
    fs::copy(mission() / "images" / name, dir / "images" / (i == 1 ? "sub/second.png" : name));
  }
  fs::copy(mission() / "images/000002.png", dir / "images/000002.png");
  const auto words = run_on(dir / "model", dir / "images", dir / "c.ply");
  const Result some = densify(words);
  CHECK(some.code == 0);
  CHECK_THAT(some.err,
             Contains("4 of 5 keyframes found") && Contains("keyframe 2 skipped: ") && Contains("does not exist"));
  fs::copy(mission() / "images/000002.png", dir / "images/000007.png");  // a name without ending
  fs::remove(dir / "c.ply");
  const Result all = densify(words);
  CHECK_THAT(all.err, Contains("5 of 5 keyframes found"));
  fs::create_directory(dir / "empty");
  const Result none = densify(run_on(dir / "model", dir / "empty", dir / "e.ply"));
  CHECK(none.code == 3);
  CHECK_THAT(none.err, Contains("none of the 5 images that the map names exists"));
}

TEST_CASE("a workspace and shards work on a folder of COLMAP") {
  const TempDir dir;
  write_colmap_binary(dir / "model", named_map());
  const auto words = [&](const std::string& output) {
    std::vector<std::string> all = run_on(dir / "model", mission() / "images", dir / output);
    all.insert(all.end(), {"--workspace", (dir / "work").string()});
    return all;
  };
  REQUIRE(densify(run_on(dir / "model", mission() / "images", dir / "plain.ply")).code == 0);
  std::vector<std::string> shard = words("unused.ply");
  shard.erase(std::find(shard.begin(), shard.end(), "-o"), std::find(shard.begin(), shard.end(), "-o") + 2);
  shard.insert(shard.end(), {"--shard", "0/1"});
  const Result made = densify(shard);
  INFO(made.err);
  REQUIRE(made.code == 0);
  const Result merged = densify({"merge", (dir / "work").string(), "-o", (dir / "merged.ply").string()});
  INFO(merged.err);
  REQUIRE(merged.code == 0);
  CHECK(read_ply(dir / "merged.ply").positions == read_ply(dir / "plain.ply").positions);
  const Result again = densify(words("again.ply"));
  CHECK(again.code == 0);
}

TEST_CASE("a body trajectory is read with the camera extrinsics and other maps refuse them") {
  const TempDir dir;
  const SlamMap map = named_map();
  write_kitti(dir / "poses.txt", map);
  std::string names;
  for (const MapKeyframe& keyframe : map.keyframes) names += keyframe.image + "\n";
  write_text(dir / "names.txt", names);
  write_text(dir / "body.txt", "0 0 0 0 0 0 1\n");
  const std::string images = (mission() / "images").string();
  const Result info = densify({"info", (dir / "poses.txt").string(), "--images", images, "--image-list",
                               (dir / "names.txt").string(), "--camera-from-body", (dir / "body.txt").string()});
  INFO(info.err);
  CHECK(info.code == 0);
  CHECK_THAT(info.out, Contains("KITTI poses") && Contains("poses are those of a body") && Contains("body.txt"));
  const Result refused = densify({"info", (mission() / "map.msg").string(), "--images", images, "--camera-from-body",
                                  (dir / "body.txt").string()});
  CHECK(refused.code == 2);
  CHECK_THAT(refused.err, Contains("expected a trajectory"));
}
