// SPDX-License-Identifier: BSD-2-Clause
//
// Feeds libFuzzer's bytes to the readers of all files except maps. The first byte selects the reader. Errors of the
// library are expected.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "export/little_endian.h"
#include "export/number_table.h"
#include "io/image_decode.h"
#include "io/mask_rectangles.h"
#include "io/plan_io.h"
#include "io/zip_member.h"
#include "pmsp-densify/batch/batch_manifest.h"
#include "pmsp-densify/options.h"
#include "pmsp/error.h"
#include "pmsp/io/cloud.h"
#include "pmsp/io/depth.h"
#include "pmsp/io/images.h"
#include "support/temp_dir.h"
#include "support/zip_file.h"
#include "workspace/artefact_file.h"
#include "workspace/record.h"

namespace {

namespace fs = std::filesystem;
using namespace pmsp;

using pmsp_test::read_text;
using pmsp_test::write_text;

const fs::path& home() {
  static const pmsp_test::TempDir folder;
  return folder.path();
}

/// A kind of file.
struct Reader {
  const char* name;  ///< of a file
  std::function<void(const fs::path&)> read;
  std::vector<std::string> sound;  ///< what it reads
};

template <class Write>
std::string written(const fs::path& path, const Write& write) {
  write(path);
  return read_text(path);
}

KeyframeCloud small_cloud() {
  KeyframeCloud cloud;
  cloud.keyframe_id = 7;
  for (int i = 0; i < 3; ++i) {
    cloud.points.push_back({});
    cloud.points.back().position = {static_cast<float>(i), 1.0F, 2.0F};
  }
  return cloud;
}

PlaneMap small_planes() {
  PlaneMap planes(32, 16);
  planes.keyframe_id = 7;
  return planes;
}

std::string encoded(const char* extension) {
  cv::Mat image(16, 32, CV_8UC3, cv::Scalar(30, 60, 90));
  cv::rectangle(image, {4, 4, 9, 5}, cv::Scalar(200, 10, 90), cv::FILLED);
  std::vector<unsigned char> bytes;
  cv::imencode(extension, image, bytes);
  return {bytes.begin(), bytes.end()};
}

/// A JPEG with the XMP data of a partial panorama.
std::string cropped_panorama() {
  const std::string xmp = std::string("http://ns.adobe.com/xap/1.0/") + '\0' +
                          "<x:xmpmeta><rdf:Description GPano:FullPanoWidthPixels=\"64\" "
                          "GPano:FullPanoHeightPixels=\"32\" GPano:CroppedAreaImageWidthPixels=\"32\" "
                          "GPano:CroppedAreaImageHeightPixels=\"16\"/></x:xmpmeta>";
  std::string jpeg = encoded(".jpg");
  const auto length = static_cast<unsigned>(xmp.size() + 2);
  const std::string marker{'\xFF', '\xE1', static_cast<char>(length >> 8U), static_cast<char>(length & 255U)};
  return jpeg.insert(2, marker + xmp);
}

Image<float> ramp() {
  Image<float> image(4, 2);
  for (std::size_t i = 0; i < image.size(); ++i) image.pixels()[i] = static_cast<float>(i);
  return image;
}

std::string npy() {
  const std::string header = "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2), }\n";
  return std::string("\x93NUMPY\x01\x00", 8) + static_cast<char>(header.size()) + '\0' + header + std::string(8, 'a');
}

void read_cloud(const fs::path& path) {
  const std::unique_ptr<CloudReader> cloud = open_cloud(path);
  std::int64_t points = 0;
  cloud->read([&](const OutputPoint* /*first*/, std::size_t count) { points += static_cast<std::int64_t>(count); });
  if (points != cloud->info().points) std::abort();
}

void write_cloud(const char* format, const fs::path& path) {
  CloudHeader header;
  header.comments = {"cloud {\"file_from_map\":[[2,0,0,1],[0,2,0,2],[0,0,2,3],[0,0,0,1]],\"scale\":2,\"unit\":\"m\"}"};
  header.wkt = "LOCAL_CS[\"hall\"]";
  header.scratch = path.parent_path();
  header.threads = 1;
  const std::unique_ptr<CloudWriter> writer = find_cloud_format(format)->open(path, header);
  const OutputPoint points[3] = {};
  writer->add(points, 3);
  writer->finish();
}

std::string las(const fs::path& path) {
  write_cloud("las", path);
  return read_text(path);
}

/// LAS 1.2 of format 2, with a point.
std::string old_las() {
  std::string text(227 + 26, '\0');
  const auto put = [&text](std::size_t at, auto value) { put_little(text.data() + at, value); };
  text.replace(0, 4, "LASF");
  put(24, std::uint8_t{1});
  put(25, std::uint8_t{2});
  put(94, std::uint16_t{227});
  put(96, std::uint32_t{227});
  put(104, std::uint8_t{2});
  put(105, std::uint16_t{26});
  put(107, std::uint32_t{1});
  for (const std::size_t at : {131, 139, 147}) put(at, 0.01);
  return text;
}

/// Its metadata; the points stay in `folder`.
std::string potree(const fs::path& folder) {
  write_cloud("potree", folder);
  return read_text(folder / "metadata.json");
}

std::vector<Reader> make_readers(const fs::path& folder) {
  const std::string ply_head = "ply\nformat ascii 1.0\ncomment x\nelement vertex 2\nproperty float x\n";
  const std::string ply_tail = "property float y\nproperty float z\nproperty uchar red\nend_header\n1 2 3 4\n5 6 7 8\n";
  const std::string entry =
      "{\"id\": 3, \"use\": \"depth map\", \"near\": [4], \"range\": [0.5, 20], \"first_planes\": null, "
      "\"consistency\": [4], \"fusion\": [4], \"viewers\": [], \"duplicate_views\": []}";
  return {
      {"a.ply", [](const fs::path& path) { read_ply(path); }, {ply_head + ply_tail}},
      {"a.las", read_cloud, {las(folder / "seed.las"), old_las()}},
      {"points3D.bin",
       [](const fs::path& path) {
         fs::create_directories(home() / "model" / "sparse" / "0");
         fs::rename(path, home() / "model" / "sparse" / "0" / "points3D.bin");
         read_cloud(home() / "model");
       },
       {std::string(8, '\1') + std::string(51, '\0'), std::string("\1\0\0\0\0\0\0\0", 8) + std::string(51, '\0')}},
      {"metadata.json", [](const fs::path& path) { read_cloud(path.parent_path()); }, {potree(folder)}},
      {"a.txt", [](const fs::path& path) { read_number_table(path); }, {"# name x y z\na 1 2 3\nb 4 5e-1 6\n"}},
      {"a.yaml",
       [](const fs::path& path) { io::read_mask_rectangles(path); },
       {"mask_rectangles:\n  - [0.0, 1.0, 0.0, 0.1]\n  - [0.0, 1.0, 0.84, 1.0]\n"}},
      {"mask.png", [](const fs::path& path) { read_mask(path, 32, 16); }, {encoded(".png")}},
      {"a.jpg",
       [](const fs::path& path) { io::decode_image_file(path, cv::IMREAD_COLOR); },
       {encoded(".jpg"), cropped_panorama()}},
      {"a.png", [](const fs::path& path) { io::decode_image_file(path, cv::IMREAD_COLOR); }, {encoded(".png")}},
      {"a.pfm",
       [](const fs::path& path) { read_pfm(path); },
       {written(folder / "a.pfm", [](const fs::path& path) { write_pfm(path, ramp()); })}},
      {"a.exr",
       [](const fs::path& path) {
         read_exr(path, {"N.X", "N.Y", "N.Z", "confidence"});
         read_exr_depth(path);
       },
       {written(folder / "a.exr",
                [](const fs::path& path) {
                  write_exr(path, {{"Z", ramp()}, {"N.X", ramp()}, {"confidence", ramp()}});
                })}},
      {"d.png",
       [](const fs::path& path) { read_png16(path, 0.001); },
       {written(folder / "d.png", [](const fs::path& path) { write_png16(path, ramp(), 1.0); })}},
      {"n.png",
       [](const fs::path& path) { read_png16_normals(path); },
       {written(
           folder / "n.png",
           [](const fs::path& path) { write_png16(path, Image<Eigen::Vector3f>(4, 2, Eigen::Vector3f::UnitX())); })}},
      {"index.json",
       [](const fs::path& path) {
         const DepthFolder depth(path.parent_path(), {});
         depth.file_for(7, "7.jpg");
         depth.read_normals(7);
         depth.read_confidence(7);
       },
       {"{\"kind\": \"raw\", \"png_scale\": 0.001, \"lens_distance\": 0.02, \"maps\": [{\"keyframe_id\": 7, \"depth\": "
        "\"a.pfm\", \"normal_png\": \"n.png\", \"exr\": \"a.exr\"}]}"}},
      {"a.npy", [](const fs::path& path) { read_npy(path); }, {npy()}},
      {"a.zip",
       [](const fs::path& path) {
         for (const std::string& name : io::zip_members(path)) read_npy(path / name);
       },
       {written(folder / "a.zip",
                [](const fs::path& path) {
                  pmsp_test::write_zip(path, {{"a.npy", npy()}, {"b.npy", npy()}});
                })}},
      {"plan.json",
       [](const fs::path& path) { plan_from_json(read_text(path)); },
       {"{\"format\": \"pmsp plan\", \"version\": 1, \"entries\": [" + entry + "]}", plan_json({})}},
      {"record.json",
       [](const fs::path& path) { workspace::record_from_json(read_text(path), "record"); },
       {workspace::record_json({})}},
      {"planes",
       [](const fs::path& path) { workspace::read_planes(path); },
       {written(folder / "planes",
                [](const fs::path& path) { workspace::planes_file(path, small_planes())->commit(); })}},
      {"points",
       [](const fs::path& path) { workspace::read_points(path); },
       {written(folder / "points",
                [](const fs::path& path) { workspace::points_file(path, small_cloud())->commit(); })}},
      {"look",
       [](const fs::path& path) { workspace::read_image_record(path); },
       {written(folder / "look", [](const fs::path& path) { workspace::write_image_record(path, {}); })}},
      {"missions.jsonl",
       [](const fs::path& path) { tool::read_manifest(path.string()); },
       {"{\"name\": \"a\", \"map\": \"a.msg\", \"images\": \"a\"}\n", "name\tmap\timages\na\ta.msg\ta\n"}},
      {"config.json",
       [](const fs::path& path) {
         const nlohmann::json json = nlohmann::json::parse(read_text(path), nullptr, false, true);
         if (json.is_discarded()) return;
         DensifierOptions options;
         tool::apply_json(options, json, "config.json");
         options.validate();
       },
       {"{\"quality\": \"normal\", \"patchmatch\": {\"iterations\": 3}, \"fusion.window\": 5}"}},
  };
}

const std::vector<Reader>& readers() {
  static const std::vector<Reader> all = make_readers(home());
  return all;
}

}  // namespace

/// PMSP_FUZZ_SEEDS=DIR: writes sound inputs of each reader there.
extern "C" int LLVMFuzzerInitialize(int* /*argc*/, char*** /*argv*/) {
  const char* const folder = std::getenv("PMSP_FUZZ_SEEDS");
  if (folder == nullptr) return 0;
  fs::create_directories(folder);
  for (std::size_t i = 0; i < readers().size(); ++i) {
    for (std::size_t k = 0; k < readers()[i].sound.size(); ++k) {
      write_text(fs::path(folder) / ("seed-" + std::to_string(i) + "-" + std::to_string(k)),
                 static_cast<char>(i) + readers()[i].sound[k]);
    }
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) return 0;
  const Reader& reader = readers()[data[0] % readers().size()];
  const fs::path path = home() / reader.name;
  write_text(path, std::string(reinterpret_cast<const char*>(data + 1), size - 1));
  try {
    reader.read(path);
  } catch (const Error&) {
  }
  return 0;
}
