// SPDX-License-Identifier: BSD-2-Clause
//
// Feeds libFuzzer's bytes to the readers of maps. The first byte selects the file of a format that the others replace;
// the other files of that format are valid. Errors of the library are expected.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "io/convention.h"
#include "map/map_files.h"
#include "map/scene_files.h"
#include "pmsp/error.h"
#include "support/temp_dir.h"
#include "support/zip_file.h"

namespace {

namespace fs = std::filesystem;
using namespace pmsp;
using namespace pmsp::test;

/// A file of a format that is to be replaced.
struct Case {
  fs::path map;   ///< to be read
  fs::path file;  ///< to be replaced
  std::string sound;
  ReadMapOptions options;
};

std::vector<Case> make_cases(const fs::path& folder) {
  std::vector<Case> cases;
  const SlamMap map = sample_scene(3, 8);
  for (const FormatFiles& format : all_formats()) {
    const fs::path home = folder / format.name;
    fs::create_directories(home);
    const fs::path path = format.write(home, map);
    for (const std::string& name : format.files) {
      cases.push_back({path, home / name, read_file(home / name), format.options(home)});
    }
  }
  write_kitti(folder / "kitti.txt", map);
  write_euroc(folder / "euroc.csv", map);
  for (const char* name : {"kitti.txt", "euroc.csv"}) {
    cases.push_back({folder / name, folder / name, read_file(folder / name), {}});
  }
  const std::string sensor = "T_BS:\n  data: [0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1]\nrate_hz: 20\n";
  ReadMapOptions with_body;
  with_body.camera_from_body = folder / "sensor.yaml";
  write_file(with_body.camera_from_body, sensor);
  cases.push_back({folder / "kitti.txt", with_body.camera_from_body, sensor, with_body});
  const std::string camera =
      R"([{"id": 0, "width": 64, "height": 32, "extrinsics": {"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],)"
      R"( "translation": [0, 0, 0]}}])";
  fs::create_directories(folder / "ob3d/cameras");
  write_file(folder / "ob3d/cameras/00000_cam.json", camera);
  cases.push_back({folder / "ob3d", folder / "ob3d/cameras/00000_cam.json", camera, {}});
  const std::string scene = R"({"trajectory": "P000", "image_size": [64, 32], "depth_scale": 8.0,)"
                            R"( "frames": [{"source_frame": 1, "image_name": "1.jpg"}]})";
  const std::string poses = "1 0 0 0 0 0 0 1\n";
  write_file(folder / "scene.json", scene);
  write_file(folder / "poses.txt", poses);
  cases.push_back({folder / "scene.json", folder / "scene.json", scene, {}});
  cases.push_back({folder / "scene.json", folder / "poses.txt", poses, {}});
  write_vipe(folder / "vipe", map);
  const fs::path depth = folder / "vipe/depth/flight.zip";
  pmsp_test::write_zip(depth, {{"00000.exr", "depth"}});
  for (const fs::path& file : {depth, folder / "vipe/pose/flight.npz", folder / "vipe/intrinsics/flight_camera.txt"}) {
    cases.push_back({folder / "vipe", file, read_file(file), {}});
  }
  write_file(folder / "map.msg", msgpack_bytes(msgpack_tree(sample_map(), MsgpackVersion::stella_0_3_6)));
  write_sqlite(folder / "map.db", sample_map(), SqliteVersion::stella_0_6_0);
  for (const char* name : {"map.msg", "map.db"}) {
    cases.push_back({folder / name, folder / name, read_file(folder / name), {}});
  }
  return cases;
}

const std::vector<Case>& cases() {
  static const pmsp_test::TempDir folder;
  static const std::vector<Case> all = make_cases(folder.path());
  return all;
}

}  // namespace

/// PMSP_FUZZ_SEEDS=DIR: writes a sound input for each file of each format there.
extern "C" int LLVMFuzzerInitialize(int* /*argc*/, char*** /*argv*/) {
  const char* const folder = std::getenv("PMSP_FUZZ_SEEDS");
  if (folder == nullptr) return 0;
  fs::create_directories(folder);
  for (std::size_t i = 0; i < cases().size(); ++i) {
    write_file(fs::path(folder) / ("seed-" + std::to_string(i)), static_cast<char>(i) + cases()[i].sound);
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) return 0;
  const Case& one = cases()[data[0] % cases().size()];
  write_file(one.file, std::string(reinterpret_cast<const char*>(data + 1), size - 1));
  try {
    check_convention(read_map(one.map, one.options));
  } catch (const Error&) {
  }
  write_file(one.file, one.sound);
  return 0;
}
