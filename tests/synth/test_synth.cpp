// SPDX-License-Identifier: BSD-2-Clause
// pmsp-synth on the command line, and its files as read by the project's readers.
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "pmsp/camera.h"
#include "pmsp/io/depth.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"
#include "support/temp_dir.h"
#include "synth/mission.h"

namespace fs = std::filesystem;
using namespace pmsp;
using pmsp_test::read_text;
using pmsp_test::TempDir;

namespace {

struct Outcome {
  int code = 0;
  std::string text;
};

Outcome synth_tool(const TempDir& folder, const std::string& arguments) {
  const fs::path log = folder / "log.txt";
  const std::string command = std::string("'") + PMSP_SYNTH + "' " + arguments + " >'" + log.string() + "' 2>&1";
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_text(log)};
}

std::string quoted(const fs::path& path) { return "'" + path.string() + "'"; }

std::size_t files_in(const fs::path& folder) {
  return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

}  // namespace

TEST_CASE("a written mission is read back with the true poses, landmarks, images and ranges") {
  const TempDir folder;
  const fs::path out = folder / "mission";
  const Outcome run = synth_tool(folder,
                                 "--scene room --keyframes 3 -w 256 --frame-step 4 --landmarks 200 "
                                 "--map-scale 0.5 --seed 3 -o " +
                                     quoted(out));
  INFO(run.text);
  REQUIRE(run.code == 0);

  synth::Recipe recipe;
  recipe.width = 256;
  recipe.height = 128;
  recipe.keyframes = 3;
  recipe.texture_seed = 3;
  recipe.mission.landmarks.count = 200;
  recipe.mission.landmarks.seed = 10;
  const synth::Mission truth = synth::textured_room(recipe);

  const SlamMap map = read_map(out / "map.msg");
  REQUIRE(map.keyframes.size() == 3);
  CHECK(map.landmarks.size() == 200);
  CHECK(map.cameras.at(0).width == 256);
  CHECK(map.cameras.at(0).fps == 10.0);
  const auto images = open_image_folder(map, out / "images");
  for (std::size_t i = 0; i < 3; ++i) {
    const MapKeyframe& keyframe = map.keyframes[i];
    const synth::Frame& frame = truth.frames[i];
    CHECK(keyframe.timestamp == Approx(0.4 * static_cast<double>(i)));
    CHECK((keyframe.cam_from_world.rotation - frame.cam_from_world.rotation).norm() < 1e-9);
    CHECK((keyframe.cam_from_world.translation - 0.5 * frame.cam_from_world.translation).norm() < 1e-9);
    CHECK(keyframe.observations.size() == frame.landmarks.size());
    for (const MapObservation& observation : keyframe.observations) {
      const MapLandmark* landmark = map.find_landmark(observation.landmark_id);
      REQUIRE(landmark != nullptr);
      const Eigen::Vector2d expected = pixel_from_bearing(keyframe.cam_from_world * landmark->position_world, 256, 128);
      double across = std::abs(expected.x() - observation.pixel.x());
      across = std::min(across, 256.0 - across);
      REQUIRE(across < 1e-3);
      REQUIRE(std::abs(expected.y() - observation.pixel.y()) < 1e-3);
    }
    const auto item = images->next();
    REQUIRE(item);
    CHECK(item->keyframe_id == keyframe.id);
    CHECK(item->image.pixels() == frame.image.pixels());
    const std::string name = std::string("00000") + std::to_string(4 * i) + ".png";
    const Image<float> range = read_png16(out / "gt" / "range_mm" / name, 1e-3);
    REQUIRE(range.width() == 256);
    CHECK(synth::share_within(range, frame.depth, 1e-3) == 1.0);
  }
}

TEST_CASE("the true trajectory is camera to world in metres, whatever the map's scale") {
  const TempDir folder;
  const fs::path out = folder / "mission";
  REQUIRE(synth_tool(folder, "--scene sphere --keyframes 2 -w 64 --map-scale 7 -o " + quoted(out)).code == 0);
  const SlamMap map = read_map(out / "map.msg");
  std::ifstream file(out / "gt" / "traj_tum.txt");
  std::string line;
  std::size_t row = 0;
  while (std::getline(file, line)) {
    if (line[0] == '#') {
      continue;
    }
    double v[8];
    std::istringstream values(line);
    for (double& value : v) {
      REQUIRE(values >> value);
    }
    REQUIRE(row < map.keyframes.size());
    const RigidTransform world_from_cam = map.keyframes[row].cam_from_world.inverse();
    CHECK((world_from_cam.translation / 7.0 - Eigen::Vector3d(v[1], v[2], v[3])).norm() < 1e-7);
    const Eigen::Matrix3d rotation = Eigen::Quaterniond(v[7], v[4], v[5], v[6]).toRotationMatrix();
    CHECK((world_from_cam.rotation - rotation).norm() < 1e-7);
    CHECK(v[0] == Approx(0.1 * static_cast<double>(row)));
    ++row;
  }
  CHECK(row == 2);
}

TEST_CASE("pmsp-synth --mask-nadir adds a rig to mask and images and leaves its range unknown") {
  const TempDir folder;
  const fs::path out = folder / "mission";
  REQUIRE(synth_tool(folder, "--scene floor --keyframes 1 -w 128 --mask-nadir 45 --jpeg 95 -o " + quoted(out)).code ==
          0);
  const Image<std::uint8_t> mask = read_mask(out / "mask.png", 128, 64);
  const Image<float> range = read_png16(out / "gt" / "range_mm" / "000000.png", 1e-3);
  CHECK(fs::exists(out / "images" / "000000.jpg"));
  for (int y = 0; y < 64; ++y) {
    CHECK((mask(5, y) != 0) == (y < 48));
    CHECK((range(5, y) > 0.0F) == (y < 48));
  }
}

TEST_CASE("only scenes with labels have label images") {
  const TempDir folder;
  const fs::path out = folder / "mission";
  REQUIRE(synth_tool(folder, "--scene gloss --camera cheap --keyframes 2 -w 128 -o " + quoted(out)).code == 0);
  CHECK(files_in(out / "gt" / "label") == 2);
  const Image<float> label = read_png16(out / "gt" / "label" / "000001.png", 1.0);
  const Image<float> range = read_png16(out / "gt" / "range_mm" / "000001.png", 1e-3);
  REQUIRE(label.width() == 128);
  CHECK(label(64, 63) == 2.0F);  // the floor
  CHECK(range(64, 63) == Approx(1.4F).margin(0.1));
  const auto count = [&](float value) { return std::count(label.pixels().begin(), label.pixels().end(), value); };
  CHECK(count(3.0F) > 100);
  CHECK(count(1.0F) == 0);
  REQUIRE(synth_tool(folder, "--scene thin --keyframes 1 -w 128 --force -o " + quoted(out)).code == 0);
  CHECK(files_in(out / "gt" / "label") == 1);
  REQUIRE(synth_tool(folder, "--scene room --keyframes 1 -w 64 --force -o " + quoted(out)).code == 0);
  CHECK_FALSE(fs::exists(out / "gt" / "label"));
}

TEST_CASE("the same seed gives the same bytes, another one does not") {
  const TempDir folder;
  const auto make = [&](const std::string& name, const std::string& seed) {
    REQUIRE(synth_tool(folder, "--scene plane --keyframes 2 -w 64 --noise 2 --landmarks 50 --seed " + seed + " -o " +
                                   quoted(folder / name))
                .code == 0);
    return read_text(folder / name / "map.msg") + read_text(folder / name / "images" / "000001.png");
  };
  const std::string first = make("a", "5");
  CHECK(first == make("b", "5"));
  CHECK(first != make("c", "6"));
}

TEST_CASE("a non-empty directory is refused without --force and replaced with it") {
  const TempDir folder;
  const fs::path out = folder / "mission";
  REQUIRE(synth_tool(folder, "--scene corridor --keyframes 3 -w 64 --mask-nadir 20 -o " + quoted(out)).code == 0);
  const std::string map = read_text(out / "map.msg");
  const std::string again = "--scene corridor --keyframes 2 -w 64 --jpeg 90 -o " + quoted(out);
  const Outcome refused = synth_tool(folder, again);
  CHECK(refused.code == 6);
  CHECK_THAT(refused.text, Catch::Contains("not empty") && Catch::Contains("--force"));
  CHECK(read_text(out / "map.msg") == map);

  std::ofstream(out / "images" / "notes.txt") << "mine";
  CHECK(synth_tool(folder, again + " --force").code == 0);
  CHECK(files_in(out / "images") == 3);
  CHECK(read_text(out / "images" / "notes.txt") == "mine");
  CHECK(files_in(out / "gt" / "range_mm") == 2);
  CHECK_FALSE(fs::exists(out / "mask.png"));
}

TEST_CASE("wrong usage exits with 2 and an unwritable output with 6 and both name the cause") {
  const TempDir folder;
  CHECK(synth_tool(folder, "").code == 2);
  CHECK(synth_tool(folder, "--scene moon -o " + quoted(folder / "m")).code == 2);
  CHECK(synth_tool(folder, "--keyframes 0 -o " + quoted(folder / "m")).code == 2);
  const Outcome odd = synth_tool(folder, "--width 130 -o " + quoted(folder / "m"));
  CHECK(odd.code == 2);
  CHECK_THAT(odd.text, Catch::Contains("130"));
  const Outcome long_flight = synth_tool(folder, "--keyframes 900 -w 64 -o " + quoted(folder / "m"));
  CHECK(long_flight.code == 2);
  CHECK_THAT(long_flight.text, Catch::Contains("at most"));
  CHECK_FALSE(fs::exists(folder / "m"));

  std::ofstream(folder / "file") << "x";
  const Outcome no_folder = synth_tool(folder, "-w 64 -o " + quoted(folder / "file" / "inside"));
  CHECK(no_folder.code == 6);
  CHECK_THAT(no_folder.text, Catch::Contains("inside"));

  const Outcome help = synth_tool(folder, "--help");
  CHECK(help.code == 0);
  CHECK_THAT(help.text, Catch::Contains("Examples:") && Catch::Contains("--mask-nadir"));
}
