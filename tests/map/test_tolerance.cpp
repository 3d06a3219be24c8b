// SPDX-License-Identifier: BSD-2-Clause
// Tolerated deviations of files.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include <nlohmann/json.hpp>

#include "map_files.h"
#include "pmsp/error.h"
#include "pmsp/io/map.h"
#include "scene_files.h"
#include "support/temp_dir.h"

namespace pmsp::test {

using Catch::Contains;
using pmsp_test::TempDir;

namespace {

namespace fs = std::filesystem;

constexpr const char* kMark = "\xEF\xBB\xBF";

std::string replace_all(std::string text, const std::string& from, const std::string& to) {
  REQUIRE(text.find(from) != std::string::npos);
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size())) {
    text.replace(at, from.size(), to);
  }
  return text;
}

bool has_note(const SlamMap& map, const std::string& text) {
  return std::any_of(map.notes.begin(), map.notes.end(),
                     [&](const std::string& note) { return note.find(text) != std::string::npos; });
}

}  // namespace

TEST_CASE("text files of every format may begin with a byte order mark") {
  const SlamMap map = sample_scene();
  for (const FormatFiles& format : all_formats()) {
    const TempDir folder;
    const fs::path path = format.write(folder.path(), map);
    for (const std::string& name : format.files) {
      if (name.find(".bin") != std::string::npos || name.find(".ply") != std::string::npos) continue;
      write_file(folder / name, kMark + read_file(folder / name));
    }
    CAPTURE(format.name);
    CHECK(read_map(path, format.options(folder.path())).keyframes.size() == map.keyframes.size());
  }
}

TEST_CASE("a lost pose or point is skipped and counted in every format and only lost poses are refused") {
  for (const FormatFiles& format : all_formats()) {
    CAPTURE(format.name);
    const TempDir folder;
    SlamMap map = sample_scene();
    map.keyframes[1].cam_from_world.translation.x() = std::nan("");
    if (format.has_observations) map.landmarks[4].position_world.y() = std::nan("");
    const SlamMap read = read_map(format.write(folder.path(), map), format.options(folder.path()));
    CHECK(read.keyframes.size() == map.keyframes.size() - 1);
    CHECK(has_note(read, "poses are lost (not finite, or a quaternion of length 0): 1"));
    if (format.has_observations) {
      CHECK(read.landmarks.size() == map.landmarks.size() - 1);
      CHECK(has_note(read, "positions are not finite: 1"));
    }
    for (MapKeyframe& keyframe : map.keyframes) keyframe.cam_from_world.translation.x() = std::nan("");
    const fs::path path = format.write(folder.path(), map);
    CHECK_THROWS_WITH(read_map(path, format.options(folder.path())), Contains("poses are lost") && Contains(": 8"));
  }
}

TEST_CASE("NaN and Infinity of Python are read in JSON but not in text files") {
  const TempDir folder;
  const SlamMap map = sample_scene();
  write_openmvg(folder / "sfm_data.json", map);
  nlohmann::json tree = nlohmann::json::parse(read_file(folder / "sfm_data.json"));
  tree["structure"][3]["value"]["X"][1] = "one";
  tree["structure"][5]["value"]["X"] = {"one", "one", "two"};
  tree["extrinsics"][2]["value"]["center"][0] = "one";
  tree["root_path"] = "NaN -Infinity \"NaN\" \\";
  std::string text = replace_all(tree.dump(), "\"one\"", "NaN");
  write_file(folder / "sfm_data.json", replace_all(text, "\"two\"", "-Infinity"));
  const SlamMap read = read_map(folder / "sfm_data.json");
  CHECK(read.landmarks.size() == map.landmarks.size() - 2);
  CHECK(read.keyframes.size() == map.keyframes.size() - 1);
  for (const char* word : {"Nan", "Inf", "-Inf", "NaNs", "Infinit", "-", "--1", "N"}) {
    CAPTURE(word);
    write_file(folder / "sfm_data.json", replace_all(text, "\"two\"", word));
    CHECK_THROWS_WITH(read_map(folder / "sfm_data.json"), Contains("broken JSON"));
  }
}

TEST_CASE("quaternions of non-unit norm are normalised and counted") {
  const TempDir folder;
  write_colmap_text(folder.path(), sample_scene());
  const std::string images = read_file(folder / "images.txt");
  const auto with = [&](const std::string& quaternion) {
    const std::size_t begin = images.find("\n0 ") + 3;
    std::size_t end = begin;
    for (int i = 0; i < 4; ++i) end = images.find(' ', end) + 1;
    write_file(folder / "images.txt", images.substr(0, begin) + quaternion + " " + images.substr(end));
  };
  with("1.5 0 0 0");
  const SlamMap read = read_map(folder.path());
  CHECK(read.find_keyframe(0)->cam_from_world.rotation.isIdentity(1e-12));
  CHECK(has_note(read, "not of length 1, normalised: 1"));
  with("1.0000001 0 0 0");
  CHECK(read_map(folder.path()).notes.empty());
  with("3 0 0 0");
  CHECK_THROWS_WITH(read_map(folder.path()), Contains("has length 3"));
}

TEST_CASE("a panorama of one row more or less is accepted") {
  const SlamMap map = sample_scene();
  for (const auto& [width, height] : {std::pair(640, 321), {641, 320}, {640, 319}, {642, 321}}) {
    CAPTURE(width, height);
    SlamMap odd = map;
    odd.cameras[0].width = width;
    odd.cameras[0].height = height;
    for (MapKeyframe& keyframe : odd.keyframes) {
      for (MapObservation& o : keyframe.observations) {
        o.pixel.x() *= static_cast<float>(width) / 640.0F;
        o.pixel.y() *= static_cast<float>(height) / 320.0F;
      }
    }
    const TempDir folder;
    write_colmap_text(folder.path(), odd);
    const SlamMap read = read_map(folder.path());
    CHECK(read.cameras[0].width == 640);
    CHECK(read.cameras[0].height == 320);
    CHECK(has_note(read, "are resized to 640 x 320"));
    std::size_t near = 0;
    for (std::size_t i = 0; i < map.keyframes[2].observations.size(); ++i) {
      const auto& a = read.keyframes[2].observations[i];
      const auto& b = map.keyframes[2].observations[i];
      near += a.landmark_id == b.landmark_id && (a.pixel - b.pixel).norm() < 1e-3F ? 1 : 0;
    }
    CHECK(near == map.keyframes[2].observations.size());
  }
}

TEST_CASE("Metashape skips disabled cameras and distinguishes photos of one label by group") {
  const TempDir folder;
  const SlamMap map = sample_scene();
  write_metashape(folder / "c.xml", map);
  const std::string text = read_file(folder / "c.xml");
  for (const char* off : {"false", "0"}) {
    write_file(folder / "c.xml",
               replace_all(text, "<camera id=\"3\"", std::string("<camera enabled=\"") + off + "\" id=\"3\""));
    const SlamMap read = read_map(folder / "c.xml");
    CHECK(read.find_keyframe(3) == nullptr);
    CHECK(has_note(read, "disabled in Metashape: 1"));
  }
  const std::string one_label = replace_all(text, map.keyframes[3].image, map.keyframes[2].image);
  write_file(folder / "c.xml", one_label);
  CHECK_THROWS_WITH(read_map(folder / "c.xml"),
                    Contains("appears more than once") && Contains("--image-list") && Contains("8 cameras"));
  const std::size_t begin = one_label.find("<camera id=\"3\""), end = one_label.find("<camera id=\"4\"");
  write_file(folder / "c.xml", one_label.substr(0, begin) + "<group id=\"0\" label=\"right\">" +
                                   one_label.substr(begin, end - begin) + "</group>" + one_label.substr(end));
  const SlamMap grouped = read_map(folder / "c.xml");
  CHECK(grouped.find_keyframe(2)->image == map.keyframes[2].image);
  CHECK(grouped.find_keyframe(3)->image == "right/" + map.keyframes[2].image);
}

TEST_CASE("openMVG 0.2 directories may begin with a separator") {
  const TempDir folder;
  const SlamMap map = sample_scene();
  write_openmvg(folder / "sfm_data.json", map);
  nlohmann::json tree = nlohmann::json::parse(read_file(folder / "sfm_data.json"));
  for (auto& view : tree["views"]) view["value"]["ptr_wrapper"]["data"]["local_path"] = "/";
  write_file(folder / "sfm_data.json", tree.dump());
  CHECK(read_map(folder / "sfm_data.json").keyframes[0].image == "frame 5.png");
}

TEST_CASE("AliceVision skips views without a pose or of other cameras and refuses a shifted centre") {
  const TempDir folder;
  const SlamMap map = sample_scene();
  write_alicevision(folder / "cameras.sfm", map);
  const nlohmann::json good = nlohmann::json::parse(read_file(folder / "cameras.sfm"));
  const auto read = [&](const nlohmann::json& tree) {
    write_file(folder / "cameras.sfm", tree.dump());
    return read_map(folder / "cameras.sfm");
  };
  nlohmann::json tree = good;
  tree["views"][2].erase("poseId");
  tree["views"][4]["rigId"] = "1";
  tree["views"][4]["isPoseIndependant"] = "false";
  SlamMap found = read(tree);
  CHECK(found.keyframes.size() == 6);
  CHECK(has_note(found, "without a pose of their own: 2"));
  tree = good;
  tree["intrinsics"].push_back({{"intrinsicId", "7"}, {"type", "pinhole"}});
  tree["views"][2]["intrinsicId"] = "7";
  found = read(tree);
  CHECK(has_note(found, "not equirectangular: 1"));
  tree = good;
  tree["intrinsics"][0]["principalPoint"] = {"12", "0"};
  CHECK_THROWS_WITH(read(tree), Contains("principalPoint") && Contains("from the middle"));
  tree["version"] = {"1", "2", "0"};
  tree["intrinsics"][0]["principalPoint"] = {"320", "160"};
  CHECK(read(tree).keyframes.size() == 8);
  tree = good;
  tree["poses"][1]["pose"]["transform"]["center"][0] = "x";
  CHECK_THROWS_WITH(read(tree), Contains("poses[1].pose.transform.center[0]") && Contains("a number"));
}

TEST_CASE("binary files of openMVG and Meshroom are refused with the conversion to use") {
  const TempDir folder;
  const std::string version = std::string("\x03\0\0\0\0\0\0\0", 8) + "0.3";
  for (const std::string& begin : {std::string(), std::string("\x01")}) {
    write_file(folder / "sfm_data.bin", begin + version + std::string("\x02\0\0\0\0\0\0\0", 8) + "ab");
    CHECK_THAT(error_of(folder / "sfm_data.bin"),
               Contains("sfm_data.bin of openMVG") && Contains("openMVG_main_ConvertSfM_DataFormat -i"));
  }
  write_file(folder / "sfm.abc", "Ogawa\xFF");
  CHECK_THAT(error_of(folder / "sfm.abc"), Contains("Alembic") && Contains("cameras.sfm"));
}

}  // namespace pmsp::test
