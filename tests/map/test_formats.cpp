// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <map>
#include <random>
#include <set>

#include <nlohmann/json.hpp>

#include "map_files.h"
#include "pmsp/error.h"
#include "pmsp/io/map.h"
#include "scene_files.h"
#include "support/temp_dir.h"

namespace pmsp::test {

using Catch::Contains;
using nlohmann::json;
using pmsp_test::TempDir;

namespace {

namespace fs = std::filesystem;

void check_same_keyframes(const SlamMap& read, const SlamMap& map, const std::string& folder) {
  REQUIRE(read.keyframes.size() == map.keyframes.size());
  for (std::size_t i = 0; i < map.keyframes.size(); ++i) {
    const MapKeyframe& a = read.keyframes[i];
    const MapKeyframe& b = map.keyframes[i];
    CAPTURE(b.image);
    CHECK(a.id == b.id);
    CHECK(a.image == folder + b.image);
    CHECK((a.cam_from_world.rotation - b.cam_from_world.rotation).cwiseAbs().maxCoeff() < 2e-9);
    CHECK((a.cam_from_world.translation - b.cam_from_world.translation).norm() < 1e-8);
  }
}

void check_same_observations(const SlamMap& read, const SlamMap& map) {
  REQUIRE(read.landmarks.size() == map.landmarks.size());
  for (std::size_t i = 0; i < map.landmarks.size(); ++i) {
    CHECK(read.landmarks[i].id == map.landmarks[i].id);
    CHECK(read.landmarks[i].position_world == map.landmarks[i].position_world);
  }
  for (std::size_t i = 0; i < map.keyframes.size(); ++i) {
    const auto& a = read.keyframes[i].observations;
    const auto& b = map.keyframes[i].observations;
    REQUIRE(a.size() == b.size());
    std::map<std::int64_t, Eigen::Vector2f> places;
    for (const MapObservation& observation : a) places[observation.landmark_id] = observation.pixel;
    for (const MapObservation& observation : b) {
      CHECK((places.at(observation.landmark_id) - observation.pixel).norm() < 1e-3F);
    }
  }
}

std::string error_of_read(const fs::path& path, const ReadMapOptions& options = {}) {
  try {
    read_map(path, options);
  } catch (const InvalidInput& error) {
    return std::string("InvalidInput: ") + error.what();
  } catch (const IoError& error) {
    return std::string("IoError: ") + error.what();
  } catch (const InvalidOption& error) {
    return std::string("InvalidOption: ") + error.what();
  }
  return "";
}

std::string replace(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

}  // namespace

TEST_CASE("each format reads back the written map") {
  const SlamMap map = sample_scene();
  for (const FormatFiles& format : all_formats()) {
    CAPTURE(format.name);
    const TempDir folder;
    const SlamMap read = read_map(format.write(folder.path(), map), format.options(folder.path()));
    const std::string name = format.name;
    check_same_keyframes(read, map, name == "nerfstudio" ? "images/" : name == "AliceVision" ? "data/" : "");
    CHECK(read.observations_are_measured == format.has_observations);
    CHECK(read.observations_skipped + read.observations_repeated == 0);
    CHECK(read.component_keyframes == std::vector<std::size_t>{map.keyframes.size()});
    if (format.has_observations) check_same_observations(read, map);
    CHECK(error_of_read(format.write(folder.path(), map), {1, {}, {}}).find("InvalidOption: ") == 0);
  }
}

TEST_CASE("masks named by transforms.json are found at any path") {
  const TempDir folder;
  write_nerfstudio(folder.path(), sample_scene());
  json tree = json::parse(pmsp_test::read_text(folder / "transforms.json"));
  fs::create_directories(folder / "masks");
  std::ofstream(folder / "masks/0.png") << "a mask";
  const json names[] = {"masks/0.png",
                        "./masks/0.png",
                        "/home/other/dataset/masks/0.png",
                        "C:\\set\\masks\\0.png",
                        "../set/masks/0.png",
                        "masks/1.png",
                        nullptr,
                        "",
                        "../../masks/2.png",
                        "..",
                        std::string(100000, 'a')};
  const char* found[] = {"masks/0.png",
                         "masks/0.png",
                         "masks/0.png",
                         "masks/0.png",
                         "masks/0.png",
                         "masks/1.png",
                         "",
                         "",
                         "2.png",
                         "..",
                         ""};
  for (std::size_t i = 0; i < std::size(names); ++i) {
    tree["frames"][0]["mask_path"] = names[i];
    std::ofstream(folder / "transforms.json") << tree.dump();
    const SlamMap map = read_map(folder / "transforms.json");
    const std::string image = tree["frames"][0]["file_path"].get<std::string>();
    const auto first = std::find_if(map.keyframes.begin(), map.keyframes.end(),
                                    [&](const MapKeyframe& keyframe) { return keyframe.image == image; });
    REQUIRE(first != map.keyframes.end());
    CAPTURE(i);
    CHECK(first->mask == (std::string(found[i]).empty() ? fs::path() : folder / found[i]));
  }
}

TEST_CASE("text and binary models of COLMAP give the same bits") {
  const SlamMap map = sample_scene();
  const TempDir folder;
  write_colmap_text(folder / "text", map);
  write_colmap_binary(folder / "binary", map);
  write_colmap_binary(folder / "old", map, false);
  const SlamMap text = read_map(folder / "text");
  for (const char* name : {"binary", "old"}) {
    const SlamMap other = read_map(folder / name);
    for (std::size_t i = 0; i < map.keyframes.size(); ++i) {
      CHECK(text.keyframes[i].cam_from_world == other.keyframes[i].cam_from_world);
      REQUIRE(text.keyframes[i].observations.size() == other.keyframes[i].observations.size());
      for (std::size_t k = 0; k < text.keyframes[i].observations.size(); ++k) {
        CHECK(text.keyframes[i].observations[k].pixel == other.keyframes[i].observations[k].pixel);
      }
    }
  }
}

TEST_CASE("older COLMAP camera names are read and others refused with the reason") {
  const SlamMap map = sample_scene();
  const TempDir folder;
  write_colmap_text(folder.path(), map);
  const std::string cameras = read_file(folder / "cameras.txt");
  write_file(folder / "cameras.txt", replace(cameras, "EQUIRECTANGULAR", "SPHERICAL"));
  check_same_keyframes(read_map(folder.path()), map, "");
  write_file(folder / "cameras.txt", "1 SPHERE 640 320 1 320 160\n");
  check_same_keyframes(read_map(folder.path()), map, "");
  write_file(folder / "cameras.txt", "1 PINHOLE 640 320 300 300 320 160\n");
  CHECK_THAT(error_of_read(folder.path()), Contains("PINHOLE") && Contains("not equirectangular"));
  write_file(folder / "cameras.txt", "1 EQUIRECTANGULAR 640 300 640 300\n");
  CHECK_THAT(error_of_read(folder.path()), Contains("640 x 300") && Contains("full panoramas"));
  write_file(folder / "cameras.txt", "1 EQUIRECTANGULAR 640 320 1280 640\n");
  CHECK_THAT(error_of_read(folder.path()), Contains("1280 x 640"));
  write_file(folder / "cameras.txt", "2 EQUIRECTANGULAR 640 320 640 320\n");
  CHECK_THAT(error_of_read(folder.path()), Contains("camera 1"));
  write_file(folder / "cameras.txt", cameras + cameras);
  CHECK_THAT(error_of_read(folder.path()), Contains("camera 1 appears more than once"));

  // Views that were cut from panoramas are left out beside these.
  write_file(folder / "cameras.txt", cameras + "2 SIMPLE_PINHOLE 640 640 300 320 320\n");
  const std::string images = read_file(folder / "images.txt");
  write_file(folder / "images.txt", images + "77 1 0 0 0 0 0 0 2 cut.jpg\n\n");
  const SlamMap mixed = read_map(folder.path());
  check_same_keyframes(mixed, map, "");
  REQUIRE(mixed.notes.size() == 1);
  CHECK_THAT(mixed.notes[0], Contains("not equirectangular: 1 (SIMPLE_PINHOLE)"));
  // Also a name that is part of another one, and a tab after the name of an image.
  write_file(folder / "cameras.txt",
             cameras + "2 SIMPLE_PINHOLE 640 640 300 320 320\n3 PINHOLE 640 640 300 300 320 320\n");
  write_file(folder / "images.txt", images + "77 1 0 0 0 0 0 0 2 cut.jpg\t\n\n78 1 0 0 0 0 0 0 3 other.jpg\n\n");
  CHECK_THAT(read_map(folder.path()).notes[0], Contains("not equirectangular: 2 (PINHOLE, SIMPLE_PINHOLE)"));
}

TEST_CASE("binary cameras of COLMAP forks are recognised by their length") {
  const SlamMap map = sample_scene();
  const TempDir folder;
  write_colmap_binary(folder.path(), map);
  std::string bytes = read_file(folder / "cameras.bin");
  bytes[12] = 16;  // SPHERICAL before it was 17
  write_file(folder / "cameras.bin", bytes);
  check_same_keyframes(read_map(folder.path()), map, "");
  bytes[12] = 6;
  write_file(folder / "cameras.bin", bytes);
  CHECK_THAT(error_of_read(folder.path()), Contains("truncated"));
  bytes[12] = 99;
  write_file(folder / "cameras.bin", bytes);
  CHECK_THAT(error_of_read(folder.path()), Contains("model is 99"));
}

TEST_CASE("the largest or the requested component is read") {
  const SlamMap small = sample_scene(3);
  SlamMap large = sample_scene(6);
  for (MapKeyframe& keyframe : large.keyframes) keyframe.image = "large/" + keyframe.image;
  const TempDir folder;
  write_opensfm(folder / "sfm", small, {large});
  write_colmap_text(folder / "colmap/sparse/0", small);
  write_colmap_binary(folder / "colmap/sparse/1", large);
  for (const fs::path& path : {folder / "sfm/reconstruction.json", folder / "colmap", folder / "colmap/sparse"}) {
    CAPTURE(path);
    const SlamMap chosen = read_map(path);
    CHECK(chosen.component == 1);
    CHECK(chosen.component_keyframes == std::vector<std::size_t>{3, 6});
    check_same_keyframes(chosen, large, "");
    ReadMapOptions options;
    options.component = 0;
    check_same_keyframes(read_map(path, options), small, "");
    options.component = 2;
    CHECK_THAT(error_of_read(path, options), Contains("InvalidOption: component is 2") && Contains("0 to 1"));
  }
}

TEST_CASE("Metashape chunks and components with unaligned and framed cameras") {
  const SlamMap map = sample_scene();
  const TempDir folder;
  write_metashape(folder / "c.xml", map);
  const std::string text = read_file(folder / "c.xml");
  const SlamMap read = read_map(folder / "c.xml");
  CHECK(read.landmarks.empty());
  REQUIRE(read.notes.size() == 1);
  CHECK_THAT(read.notes[0], Contains("not aligned: 1"));
  write_file(folder / "c.xml", replace(text, "type=\"spherical\"", "type=\"frame\""));
  CHECK_THAT(error_of_read(folder / "c.xml"), Contains("not spherical"));
  // Before version 1.3 the chunk had the transform.
  std::string old =
      replace(text, "<components next_id=\"1\" active_id=\"0\"><component id=\"0\" label=\"Component 1\">", "");
  old = replace(old, "</component></components>", "");
  write_file(folder / "c.xml", old);
  check_same_keyframes(read_map(folder / "c.xml"), map, "");
  const std::size_t begin = text.find("  <chunk");
  const std::string chunk = text.substr(begin, text.find("</document>") - begin);
  write_file(folder / "c.xml", replace(text, "</document>", chunk + "</document>"));
  CHECK(read_map(folder / "c.xml").component_keyframes == std::vector<std::size_t>{8, 8});
}

TEST_CASE("a TUM trajectory is read with and without an image list and in nanoseconds") {
  const SlamMap map = sample_scene();
  const TempDir folder;
  write_tum(folder / "t.txt", map);
  const SlamMap bare = read_map(folder / "t.txt");
  REQUIRE(bare.keyframes.size() == map.keyframes.size());
  CHECK(bare.keyframes[3].timestamp == 1.5);
  CHECK(bare.keyframes[3].image.empty());
  CHECK(bare.landmarks.empty());
  ReadMapOptions options;
  options.image_list = folder / "list";
  write_file(folder / "list", "0.0 a.png\n1.0 sub/b.png\n");
  const SlamMap some = read_map(folder / "t.txt", options);
  REQUIRE(some.keyframes.size() == 2);
  CHECK(some.keyframes[0].image == "a.png");
  CHECK_THAT(some.notes.at(0), Contains("without an image in") && Contains(": 6"));
  // The pose that is nearest to the last one is a second away, more than half of the usual step.
  write_file(folder / "list", "0.0 a.png\n1.0 b.png\n2.0 c.png\n4.5 d.png\n");
  const SlamMap near = read_map(folder / "t.txt", options);
  REQUIRE(near.keyframes.size() == 3);
  CHECK(near.keyframes[2].image == "c.png");
  CHECK(near.keyframes[2].timestamp == 2.0);
  write_file(folder / "list", "a.png\n");
  CHECK_THAT(error_of_read(folder / "t.txt", options), Contains("1 images") && Contains("8 keyframes"));
  write_file(folder / "list", "0.0 a.png\nb.png\n");
  CHECK_THAT(error_of_read(folder / "t.txt", options), Contains("line 2") && Contains("alike"));
  write_file(folder / "t.txt", "1763660000250000000 1 2 3 0 0 0 1\n1763660000350000000,1,2,3,0,0,0,1\n");
  CHECK(read_map(folder / "t.txt").keyframes[1].timestamp == Approx(1763660000.35).epsilon(1e-12));
  write_file(folder / "list", "1763660000350000000 b.png\n1763660000250000000 a.png\n");
  const SlamMap nanoseconds = read_map(folder / "t.txt", options);
  REQUIRE(nanoseconds.keyframes.size() == 2);
  CHECK(nanoseconds.keyframes[0].image == "a.png");
  CHECK(nanoseconds.keyframes[1].image == "b.png");
}

TEST_CASE("an image list applies to every map with spaces and a header and in any unit of time") {
  const SlamMap map = sample_scene();
  const TempDir folder;
  write_colmap_text(folder / "model", map);
  write_tum(folder / "t.txt", map);
  const std::size_t n = map.keyframes.size();
  ReadMapOptions options;
  options.image_list = folder / "list";
  std::string names = "filename\n";
  std::string times = "#comment\ntimestamp [ns],name\n";
  for (std::size_t i = 0; i < n; ++i) {
    names += "R 0001 (" + std::to_string(i) + ").jpg\n";
    times += std::to_string(500'000'000 * i) + ",left/R 1 (" + std::to_string(i) + ").jpg\n";
  }
  write_file(folder / "list", names);
  for (const char* file : {"model", "t.txt"}) {
    const SlamMap read = read_map(folder / file, options);
    REQUIRE(read.keyframes.size() == n);
    CHECK(read.keyframes[2].image == "R 0001 (2).jpg");
  }
  write_file(folder / "list", times);
  const SlamMap timed = read_map(folder / "t.txt", options);
  REQUIRE(timed.keyframes.size() == n);
  CHECK(timed.keyframes[2].image == "left/R 1 (2).jpg");
  write_file(folder / "list", "1700000000.5 a.png\n1700000001 b.png\n");
  CHECK_THAT(error_of_read(folder / "t.txt", options), Contains("same clock") && Contains("1700000000.5"));
}

TEST_CASE("the absolute directory of openMVG is reported and not followed") {
  const SlamMap map = sample_scene();
  const TempDir folder;
  write_openmvg(folder / "sfm_data.json", map, "/somewhere/else");
  const SlamMap read = read_map(folder / "sfm_data.json");
  CHECK(read.images.empty());
  REQUIRE(read.notes.size() == 1);
  CHECK_THAT(read.notes[0], Contains("/somewhere/else") && Contains("--images"));
  write_openmvg(folder / "sfm_data.json", map, (folder / "pictures").string());
  CHECK(read_map(folder / "sfm_data.json").images == folder / "pictures");
}

TEST_CASE("names lose components that leave the directory in every format") {
  const std::map<std::string, std::string> names{{"../escape.png", "escape.png"},
                                                 {"a/../../escape.png", "escape.png"},
                                                 {"/etc/passwd", "etc/passwd"},
                                                 {"\\\\host\\\\a.png", "host/a.png"},
                                                 {"./b//c.png", "b/c.png"},
                                                 {"..", ""},
                                                 {"a/..", ""},
                                                 {"a/", ""}};
  for (const auto& [name, inside] : names) {
    CAPTURE(name);
    for (const FormatFiles& format : all_formats()) {
      CAPTURE(format.name);
      SlamMap map = sample_scene();
      map.keyframes[2].image = "name-to-replace";
      const TempDir folder;
      const fs::path path = format.write(folder.path(), map);
      if (format.name == std::string("COLMAP binary")) continue;  // one function for text and binary
      for (const std::string& file : format.files) {
        std::string text = read_file(folder / file);
        for (const char* begin : {"images/", "/data/", ""}) {
          const std::string whole = begin + std::string("name-to-replace");
          for (std::size_t at = text.find(whole); at != std::string::npos; at = text.find(whole)) {
            const bool is_json = file.find(".json") != std::string::npos || file.find(".sfm") != std::string::npos;
            text.replace(at, whole.size(), is_json ? json(name).dump().substr(1, json(name).dump().size() - 2) : name);
          }
        }
        write_file(folder / file, text);
      }
      if (format.name == std::string("openMVG")) continue;  // folder and name are apart there
      const std::string error = error_of_read(path, format.options(folder.path()));
      if (inside.empty()) {
        CHECK_THAT(error, Contains("InvalidInput: ") && Contains("names the image"));
        continue;
      }
      REQUIRE(error.empty());
      const SlamMap read = read_map(path, format.options(folder.path()));
      CHECK(std::any_of(read.keyframes.begin(), read.keyframes.end(),
                        [&, &expected = inside](const MapKeyframe& k) { return k.image == expected; }));
    }
  }
}

TEST_CASE("a repeated id or image is refused") {
  for (const FormatFiles& format : all_formats()) {
    CAPTURE(format.name);
    const TempDir folder;
    SlamMap map = sample_scene();
    map.keyframes[3].id = map.keyframes[2].id;
    const bool has_ids =
        format.name[0] == 'C' || std::string(format.name) == "openMVG" || std::string(format.name) == "Metashape";
    const auto error = [&] { return error_of_read(format.write(folder.path(), map), format.options(folder.path())); };
    if (has_ids) CHECK_THAT(error(), Contains("once"));
    map = sample_scene();
    map.keyframes[3].image = map.keyframes[2].image;
    if (std::string(format.name) != "OpenSfM") CHECK_THAT(error(), Contains("more than once"));
    map = sample_scene();
    map.landmarks[3].id = map.landmarks[2].id;
    if (format.name[0] == 'C' || std::string(format.name) == "openMVG") CHECK_THAT(error(), Contains("more than once"));
  }
  const TempDir folder;
  write_file(folder / "r.json", R"([{"cameras": {}, "shots": {"a": {}, "a": {}}}])");
  CHECK_THAT(error_of_read(folder / "r.json"), Contains("the key \"a\" appears twice"));
}

TEST_CASE("invalid and absurd numbers are refused in every format") {
  const TempDir folder;
  for (const double value : {1e300, -1e13}) {
    SlamMap map = sample_scene();
    map.keyframes[1].cam_from_world.translation.x() = value;
    for (const FormatFiles& format : all_formats()) {
      CAPTURE(format.name, value);
      CHECK_THAT(error_of_read(format.write(folder.path(), map), format.options(folder.path())),
                 Contains("InvalidInput: ") && Contains("expected"));
    }
  }
  SlamMap map = sample_scene();
  map.keyframes[2].observations[5].pixel = {1e9F, 0.0F};
  for (const FormatFiles& format : all_formats()) {
    if (!format.has_observations) continue;
    CAPTURE(format.name);
    CHECK_THAT(error_of_read(format.write(folder.path(), map), format.options(folder.path())),
               Contains("InvalidInput: "));
  }
  map = sample_scene();
  map.keyframes[1].cam_from_world.rotation *= 1.01;
  for (const FormatFiles& format : all_formats()) {
    const std::string name = format.name;
    if (name != "openMVG" && name != "nerfstudio" && name != "Metashape" && name != "AliceVision")
      continue;  // the others hold no matrix
    CAPTURE(name);
    CHECK_THAT(error_of_read(format.write(folder.path(), map), format.options(folder.path())),
               Contains("is no rotation"));
  }
  map = sample_scene();
  map.keyframes[1].cam_from_world.rotation.row(0) *= -1.0;
  for (const FormatFiles& format : all_formats()) {
    const std::string name = format.name;
    if (name != "openMVG" && name != "nerfstudio" && name != "Metashape" && name != "AliceVision") continue;
    CHECK_THAT(error_of_read(format.write(folder.path(), map), format.options(folder.path())), Contains("mirrors"));
  }
}

TEST_CASE("truncated files are refused or give a valid map") {
  const SlamMap map = sample_scene(3, 12);
  for (const FormatFiles& format : all_formats()) {
    const TempDir folder;
    const fs::path path = format.write(folder.path(), map);
    for (const std::string& name : format.files) {
      CAPTURE(format.name, name);
      const std::string bytes = read_file(folder / name);
      const bool must_fail = name.find(".json") != std::string::npos || name.find(".bin") != std::string::npos ||
                             name.find(".xml") != std::string::npos;
      std::size_t accepted = 0;
      const std::size_t last = bytes.find_last_not_of(" \r\n");  // what follows may well be missing
      for (std::size_t size = 0; size < last; ++size) {
        write_file(folder / name, bytes.substr(0, size));
        accepted += error_of_read(path, format.options(folder.path())).empty() ? 1 : 0;
      }
      if (must_fail) CHECK(accepted == 0);
      write_file(folder / name, bytes);
      CHECK(error_of_read(path, format.options(folder.path())).empty());
    }
  }
}

TEST_CASE("random damage gives an error or a valid map in every format") {
  const SlamMap map = sample_scene(4, 20);
  std::mt19937 random(11);
  for (const FormatFiles& format : all_formats()) {
    const TempDir folder;
    const fs::path path = format.write(folder.path(), map);
    for (const std::string& name : format.files) {
      CAPTURE(format.name, name);
      const std::string bytes = read_file(folder / name);
      int read = 0;
      for (int i = 0; i < 400; ++i) {
        std::string damaged = bytes;
        for (std::size_t k = 0; k < 1 + random() % 3; ++k) {
          damaged[random() % damaged.size()] = static_cast<char>(random() % 256);
        }
        if (i % 4 == 0) damaged.erase(random() % damaged.size(), random() % 40);
        write_file(folder / name, damaged);
        try {
          const SlamMap result = read_map(path, format.options(folder.path()));
          ++read;
          for (const MapKeyframe& keyframe : result.keyframes) {
            const Eigen::Matrix3d& r = keyframe.cam_from_world.rotation;
            REQUIRE((r.transpose() * r - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-12);
            REQUIRE(static_cast<std::size_t>(keyframe.camera) < result.cameras.size());
            REQUIRE(keyframe.cam_from_world.translation.allFinite());
            for (const fs::path& part : fs::path(keyframe.image)) REQUIRE(part != "..");
            for (const MapObservation& o : keyframe.observations)
              REQUIRE(result.find_landmark(o.landmark_id) != nullptr);
          }
        } catch (const Error&) {  // anything else fails the test
        }
      }
      CHECK(read > 0);
      write_file(folder / name, bytes);
    }
  }
}

TEST_CASE("absurd lengths and deep nesting neither crash nor fill the memory") {
  const TempDir folder;
  const SlamMap map = sample_scene(3, 12);
  write_colmap_binary(folder / "colmap", map);
  for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) {
    const std::string bytes = read_file(folder / "colmap" / name);
    write_file(folder / "colmap" / name, std::string(8, '\xFF') + bytes.substr(8));
    CHECK_THAT(error_of_read(folder / "colmap"), Contains("announces 18446744073709551615"));
    write_file(folder / "colmap" / name, bytes + "x");
    CHECK_THAT(error_of_read(folder / "colmap"), Contains("more data after the end"));
    write_file(folder / "colmap" / name, bytes);
  }
  write_file(folder / "deep.json", std::string(1'000'000, '['));
  CHECK_THAT(error_of_read(folder / "deep.json"), Contains("nested"));
  write_file(
      folder / "deep.xml", "<document><chunk>" + [] {
        std::string text;
        for (int i = 0; i < 100'000; ++i) text += "<a>";
        return text;
      }());
  CHECK_THAT(error_of_read(folder / "deep.xml"), Contains("broken XML"));
  write_file(folder / "long.json", "{\"" + std::string(4'000'000, 'x') + "\": 1}");
  CHECK_THAT(error_of_read(folder / "long.json"), Contains("mebibyte"));
}

TEST_CASE("points without observations are assigned to the keyframes that see them unoccluded") {
  SlamMap map = sample_scene(2, 300);
  for (MapKeyframe& keyframe : map.keyframes) {
    keyframe.cam_from_world = {};
    keyframe.cam_from_world.translation.x() = 0.05 * static_cast<double>(keyframe.id);
  }
  for (int i = 0; i < 400; ++i) {  // a wall in front of a part of the ball
    map.landmarks.push_back({10'000 + i, {-1.0 + 0.1 * (i % 20), -1.0 + 0.1 * (i / 20.0), 1.5}});
  }
  const TempDir folder;
  write_tum(folder / "t.txt", map);
  ReadMapOptions options;
  options.points = folder / "points.ply";
  const SlamMap read = read_map(folder / "t.txt", options);
  std::set<std::int64_t> first;
  int behind = 0;
  for (const MapObservation& o : read.keyframes[0].observations) {
    first.insert(o.landmark_id);
    const Eigen::Vector3d p = read.find_landmark(o.landmark_id)->position_world;
    behind += p.norm() > 4.9 && p.z() > 0.0 && std::abs(p.x() / p.z()) < 0.6 && std::abs(p.y() / p.z()) < 0.6 ? 1 : 0;
  }
  CHECK(first.size() > 250);
  CHECK(behind == 0);
  std::size_t shared = 0;
  for (const MapObservation& o : read.keyframes[1].observations) shared += first.count(o.landmark_id);
  CHECK(shared > read.keyframes[1].observations.size() * 3 / 4);
}

}  // namespace pmsp::test
