// SPDX-License-Identifier: BSD-2-Clause
// Layouts of published benchmarks, line by line as their documentation describes them.
#include <catch2/catch.hpp>

#include <filesystem>
#include <string>

#include <Eigen/Geometry>

#include "map_files.h"
#include "pmsp/error.h"
#include "pmsp/io/map.h"
#include "scene_files.h"
#include "support/temp_dir.h"
#include "support/zip_file.h"

namespace pmsp::test {

using Catch::Contains;
using pmsp_test::TempDir;

namespace {

namespace fs = std::filesystem;

/// Text of a camera of OB3D; `rotation`: rows of cam_from_world.
std::string ob3d_camera(int id, const std::string& rotation, const std::string& translation) {
  return "[{\"id\": " + std::to_string(id) +
         ", \"width\": 1600, \"height\": 800, \"intrinsics\": {\"focal\": 800, \"cx\": 800.0, \"cy\": 400.0},"
         "\"extrinsics\": {\"rotation\": [" +
         rotation + "], \"translation\": [" + translation + "]}}]";
}

// A level camera that looks along -y in Blender's world, z up: rows are its right, down and forward.
constexpr const char* kLevel = "[-1, 0, 0], [0, 0, -1], [0, -1, 0]";

/// The tree of OB3D's README for a path of a scene, with two images.
void write_ob3d(const TempDir& folder) {
  for (const char* name : {"cameras", "depths", "images", "normals", "sparse"}) fs::create_directory(folder / name);
  write_file(folder / "cameras/00000_cam.json", ob3d_camera(0, kLevel, "0, 1.5, 0"));
  write_file(folder / "cameras/00001_cam.json", ob3d_camera(1, kLevel, "0.25, 1.5, -0.5"));
  write_file(folder / "sparse/sparse.ply",
             "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n"
             "end_header\n0 -3 1.5\n1 -3 1.5\n");
  write_file(folder / "train.txt", "00000\n");
  write_file(folder / "test.txt", "00001\n");
}

/// A scene of COLMAP's TartanAir set: frames 10 and 11.
void write_tartanair(const TempDir& folder, const std::string& poses) {
  write_file(folder / "poses.txt", poses);
  write_file(folder / "scene.json",
             "{\"manifest_version\": 1, \"environment\": \"House\", \"difficulty\": \"easy\", \"trajectory\": \"P000\","
             "\"image_size\": [2048, 1024], \"depth_size\": [512, 256], \"depth_scale\": 8.0,"
             "\"frames\": [{\"source_frame\": 10, \"image_name\": \"000010.jpg\", \"depth_name\": \"000010.png\"},"
             "{\"source_frame\": 11, \"image_name\": \"000011.jpg\", \"depth_name\": \"000011.png\"}]}");
}

}  // namespace

TEST_CASE("a path of OB3D is read as its documentation describes it") {
  const TempDir folder;
  write_ob3d(folder);
  const SlamMap map = read_map(folder.path());
  CHECK(map.format == "OB3D");
  CHECK(map.images == folder / "images");            // |--images
  REQUIRE(map.keyframes.size() == 2);                // train.txt and test.txt do not select
  CHECK(map.keyframes[0].image == "00000_rgb.png");  //    |--00000_rgb.png
  CHECK(map.keyframes[1].image == "00001_rgb.png");
  CHECK(map.keyframes[0].id == 0);  // |--cameras, 00000_cam.json
  CHECK(map.keyframes[1].id == 1);  // names depths/00001_depth.exr, normals/00001_normal.exr
  REQUIRE(map.cameras.size() == 1);
  CHECK(map.cameras[0].width == 1600);  // equirectangular, 1600 x 800
  CHECK(map.cameras[0].height == 800);
  // "rotation", "translation": OpenCV's, world to camera; t = -R c.
  CHECK((map.keyframes[0].cam_from_world.center() - Eigen::Vector3d(0.0, 0.0, 1.5)).norm() < 1e-12);
  const Eigen::Matrix3d world_from_cam = map.keyframes[1].cam_from_world.rotation.transpose();
  CHECK((world_from_cam * Eigen::Vector3d::UnitZ() - Eigen::Vector3d(0.0, -1.0, 0.0)).norm() < 1e-9);  // looks along
  CHECK((world_from_cam * Eigen::Vector3d::UnitY() - Eigen::Vector3d(0.0, 0.0, -1.0)).norm() < 1e-9);  // down
  CHECK((map.keyframes[1].cam_from_world.center() - Eigen::Vector3d(0.25, -0.5, 1.5)).norm() < 1e-12);
  REQUIRE(map.landmarks.size() == 2);  // |--sparse, sparse.ply
  CHECK((map.landmarks[0].position_world - Eigen::Vector3d(0.0, -3.0, 1.5)).norm() < 1e-6);

  fs::remove_all(folder / "sparse");
  CHECK(read_map(folder.path()).landmarks.empty());
}

TEST_CASE("a broken path of OB3D is refused with file and place") {
  const TempDir folder;
  write_ob3d(folder);
  const fs::path camera = folder / "cameras/00001_cam.json";
  const std::string good = read_file(camera);
  const auto refuse = [&](const std::string& text, const std::string& place) {
    write_file(camera, text);
    CHECK_THROWS_WITH(read_map(folder.path()), Contains("00001_cam.json") && Contains(place));
    CHECK_THROWS_AS(read_map(folder.path()), InvalidInput);
  };
  refuse("", "");
  refuse("[]", "one camera");
  refuse("{}", "one camera");
  refuse(ob3d_camera(2, kLevel, "0, 0, 0"), "the number of the file, 1");
  refuse(ob3d_camera(1, "[-1, 0, 0], [0, 0, -1]", "0, 0, 0"), "rotation");
  refuse(ob3d_camera(1, "[1, 0, 0], [0, 2, 0], [0, 0, 1]", "0, 0, 0"), "no rotation");
  refuse(ob3d_camera(1, "[1, 0, 0], [0, 1, 0], [0, 0, -1]", "0, 0, 0"), "mirrors");
  refuse(ob3d_camera(1, kLevel, "0, 0"), "translation");
  std::string square = good;
  refuse(square.replace(square.find("\"height\": 800"), 13, "\"height\": 900"), "1600 x 900");
  write_file(camera, good);
  fs::copy(camera, folder / "cameras/1_cam.json");
  CHECK_THROWS_WITH(read_map(folder.path()), Contains("has the number of"));
  fs::remove_all(folder / "cameras");
  CHECK_THROWS_WITH(read_map(folder.path()), Contains("cameras/*_cam.json"));
}

TEST_CASE("a scene of COLMAP's TartanAir set is read as its documentation describes it") {
  const TempDir folder;
  write_tartanair(folder, "10 1 2 3 0 0 0 1\n11 2 2 3 0 0 0.70710678 0.70710678\n");
  const SlamMap map = read_map(folder / "scene.json");
  CHECK(map.format == "TartanAir (COLMAP's benchmark)");
  CHECK(map.images == folder / "images");
  REQUIRE(map.keyframes.size() == 2);
  CHECK(map.keyframes[0].id == 10);  // names depth/000010.png
  CHECK(map.keyframes[0].image == "000010.jpg");
  CHECK(map.cameras.at(0).width == 2048);
  // Poses of the body, x forward, y right, z down; the panorama's x is forward, y down, z left.
  const auto in_world = [&](std::size_t i, const Eigen::Vector3d& direction) {
    return Eigen::Vector3d(map.keyframes[i].cam_from_world.rotation.transpose() * direction);
  };
  CHECK((map.keyframes[0].cam_from_world.center() - Eigen::Vector3d(1.0, 2.0, 3.0)).norm() < 1e-9);
  CHECK((in_world(0, Eigen::Vector3d::UnitX()) - Eigen::Vector3d::UnitX()).norm() < 1e-9);
  CHECK((in_world(0, Eigen::Vector3d::UnitY()) - Eigen::Vector3d::UnitZ()).norm() < 1e-9);
  CHECK((in_world(0, Eigen::Vector3d::UnitZ()) + Eigen::Vector3d::UnitY()).norm() < 1e-9);
  CHECK((in_world(1, Eigen::Vector3d::UnitX()) - Eigen::Vector3d::UnitY()).norm() < 1e-8);  // turned right
}

TEST_CASE("a broken scene of TartanAir is refused with file and place") {
  const TempDir folder;
  const auto refuse = [&](const std::string& poses, const std::string& message) {
    write_tartanair(folder, poses);
    CHECK_THROWS_WITH(read_map(folder / "scene.json"), Contains(message));
  };
  refuse("10 1 2 3 0 0 0 1\n", "frames[1].source_frame");
  refuse("10 1 2 3 0 0 0 1\n10 1 2 3 0 0 0 1\n", "second pose");
  refuse("10 1 2 3 0 0 0\n", "line 1");
  refuse("10 1 2 3 0 0 0 1 9\n", "more than 8 numbers");
  refuse("10 1 x 3 0 0 0 1\n", "position");
  refuse("10 1 2 3 0 0 0 9\n", "length 9");
  write_tartanair(folder, "");
  fs::remove(folder / "poses.txt");
  CHECK_THROWS_AS(read_map(folder / "scene.json"), IoError);
}

TEST_CASE("results of ViPE are a map with prior depth and masks of objects") {
  const TempDir folder;
  SlamMap scene = sample_scene(4);
  for (MapKeyframe& keyframe : scene.keyframes) keyframe.id *= 3;
  write_vipe(folder.path(), scene);
  pmsp_test::write_zip(folder / "depth/flight.zip", {{"00000.exr", ""}, {"00009.exr", ""}, {"00010.exr", ""}});
  pmsp_test::write_zip(folder / "mask/flight.zip", {{"00003.png", ""}, {"00009.png", ""}});
  fs::create_directories(folder / "rgb");
  write_file(folder / "rgb/flight.mp4", "video");
  for (const fs::path& path : {folder.path(), folder / "pose/flight.npz"}) {
    const SlamMap map = read_map(path);
    CHECK(map.format == "ViPE");
    CHECK(map.images == folder / "rgb/flight.mp4");
    CHECK(map.masks_are_instances);
    CHECK(map.notes.empty());
    REQUIRE(map.keyframes.size() == 4);
    for (std::size_t i = 0; i < 4; ++i) {
      const MapKeyframe& keyframe = map.keyframes[i];
      CHECK(keyframe.id == scene.keyframes[i].id);
      CHECK(keyframe.source_frame == keyframe.id);
      const RigidTransform& pose = scene.keyframes[i].cam_from_world;
      CHECK((keyframe.cam_from_world.rotation - pose.rotation).cwiseAbs().maxCoeff() < 1e-6);
      CHECK((keyframe.cam_from_world.center() - pose.center()).norm() < 1e-6);
    }
    CHECK(map.keyframes[0].prior_depth == folder / "depth/flight.zip/00000.exr");
    CHECK(map.keyframes[1].prior_depth.empty());
    CHECK(map.keyframes[3].prior_depth == folder / "depth/flight.zip/00009.exr");
    CHECK(map.keyframes[0].mask.empty());
    CHECK(map.keyframes[1].mask == folder / "mask/flight.zip/00003.png");
  }
  const fs::path before = fs::current_path();
  fs::current_path(folder / "pose");
  CHECK(read_map("flight.npz").keyframes.size() == 4);
  fs::current_path(before);
  write_file(folder / "intrinsics/flight_camera.txt", "0: PANORAMA\n3: PINHOLE\n9: PANORAMA\n");
  const SlamMap some = read_map(folder.path());
  CHECK(some.keyframes.size() == 2);
  CHECK_THAT(some.notes.at(0), Contains("PANORAMA: 2"));
  fs::remove_all(folder / "depth");
  CHECK_THAT(read_map(folder.path()).notes.at(1), Contains("depth/flight.zip") && Contains("depth_align_model"));
}

TEST_CASE("broken results of ViPE are refused with file and place") {
  const TempDir folder;
  const SlamMap scene = sample_scene(2);
  const auto refuse = [&](const std::string& message) {
    CHECK_THROWS_WITH(read_map(folder.path()), Contains(message));
  };
  const fs::path poses = folder / "pose/flight.npz", depth = folder / "depth/flight.zip";
  write_vipe(folder.path(), scene);
  pmsp_test::write_zip(depth, {{"00007.exr", ""}});
  refuse("none of the 2 frames");
  write_file(depth, "no archive");
  refuse("depth/flight.zip: cannot be read as a ZIP archive");
  fs::remove(depth);
  const std::string sound = read_file(poses);
  write_file(poses, sound.substr(0, sound.size() / 2));
  refuse("pose/flight.npz: cannot be read");
  const std::string frames = npy_bytes("<i8", "2,", std::string(16, '\0'));
  const auto with = [&](const std::string& type, const std::string& shape, std::size_t bytes, const char* message) {
    pmsp_test::write_zip(poses, {{"data.npy", npy_bytes(type, shape, std::string(bytes, '\0'))}, {"inds.npy", frames}});
    refuse(message);
  };
  with("<f4", "1, 4, 4", 64, "16 numbers, expected a 4 x 4 matrix for each of the 2 frames");
  with("<f4", "2, 4, 4", 64, "truncated");
  with("<f4", "2, 4, 99999999999999", 64, "shape");
  with("<c8", "2, 4, 4", 256, "<c8");
  with("<f4", "2, 4, 4", 128, "no image with a pose");  // zeros are lost poses
  pmsp_test::write_zip(poses, {{"inds.npy", frames}});
  refuse("data.npy: the archive has no such member");
  write_vipe(folder.path(), scene);
  write_file(folder / "intrinsics/flight_camera.txt", "0 PANORAMA\n");
  refuse("line 1");
  fs::remove(folder / "intrinsics/flight_camera.txt");
  refuse("flight_camera.txt: there is no such file");
  write_vipe(folder.path(), scene, "other");
  refuse("results of 2 videos");
  CHECK(read_map(folder / "pose/other.npz").keyframes.size() == 2);
}

TEST_CASE("true poses with seconds and nanoseconds in columns of their own have their time") {
  const TempDir folder;  // as gt_poses.csv of the Hilti-Trimble challenge
  const std::string head = "# counter, sec, nsec, x, y, z, qx, qy, qz, qw\n";
  write_file(folder / "gt_poses.csv", head +
                                          "0, 4, 15030999, 36.5, 20.25, 1.5, 0, 0, 0, 1\n"
                                          "1, 4, 48397999, 36.5, 20.5, 1.5, 0, 0, 0, 1\n"
                                          "2, 5, 7000000, 36.5, 20.75, 1.5, 0, 0, 0.6, 0.8\n");
  const SlamMap map = read_map(folder / "gt_poses.csv");
  REQUIRE(map.keyframes.size() == 3);
  CHECK(map.keyframes[0].timestamp == Approx(4.015030999).epsilon(1e-12));
  CHECK(map.keyframes[2].timestamp == Approx(5.007).epsilon(1e-12));
  CHECK((map.keyframes[2].cam_from_world.center() - Eigen::Vector3d(36.5, 20.75, 1.5)).norm() < 1e-9);
  write_file(folder / "gt_poses.csv", head + "0, 4, 1500000000, 36.5, 20.25, 1.5, 0, 0, 0, 1\n");
  CHECK_THROWS_WITH(read_map(folder / "gt_poses.csv"), Contains("nanoseconds") && Contains("line 2"));
}

}  // namespace pmsp::test
