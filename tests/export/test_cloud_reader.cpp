// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <utility>

#include <catch2/catch.hpp>

#include "export/little_endian.h"
#include "export/sample_points.h"
#include "pmsp/error.h"
#include "pmsp/io/cloud.h"
#include "support/temp_dir.h"

using namespace pmsp;
using namespace pmsp_test;
using Catch::Contains;

namespace {

void write(const char* format, const std::filesystem::path& path, const CloudHeader& header,
           const std::vector<OutputPoint>& points) {
  const auto writer = find_cloud_format(format)->open(path, header);
  writer->add(points.data(), points.size());
  writer->finish();
}

std::vector<OutputPoint> all_points(CloudReader& cloud) {
  std::vector<OutputPoint> all;
  cloud.read([&](const OutputPoint* points, std::size_t count) { all.insert(all.end(), points, points + count); });
  return all;
}

/// A LAS file of a version, format and record length, all of it 0 except required fields.
std::string las(std::uint8_t minor, std::uint8_t format, std::uint16_t record, std::uint32_t count) {
  const std::size_t header = minor == 4 ? 375 : minor == 3 ? 235 : 227;
  std::string text(header + std::size_t{record} * count, '\0');
  const auto put = [&text](std::size_t at, auto value) { put_little(text.data() + at, value); };
  text.replace(0, 4, "LASF");
  put(24, std::uint8_t{1});
  put(25, minor);
  put(94, static_cast<std::uint16_t>(header));
  put(96, static_cast<std::uint32_t>(header));
  put(104, format);
  put(105, record);
  put(minor == 4 ? 247 : 107, count);
  for (const std::size_t at : {131, 139, 147}) put(at, 0.01);
  for (const std::size_t at : {155, 163, 171}) put(at, 100.0);
  return text;
}

CloudInfo info_of(const std::vector<std::string>& comments) {
  CloudInfo info;
  info.has_normals = info.has_colors = info.has_confidence = info.has_views = true;
  info.comments = comments;
  read_origin(info);
  return info;
}

}  // namespace

TEST_CASE("clouds written as PLY or LAS or Potree are read back with equal points") {
  const TempDir dir;
  std::vector<OutputPoint> points = sample_points(40000);
  CloudHeader header = sample_header();
  header.scratch = dir.path();
  header.wkt = "LOCAL_CS[\"hall\"]";
  header.year = 2026;
  header.day_of_year = 73;
  header.double_positions = true;
  const std::string format = GENERATE("ply", "las", "potree");
  write(format.c_str(), dir / "c", header, points);
  const auto cloud = open_cloud(dir / "c");
  const CloudInfo& info = cloud->info();
  CHECK(info.points == 40000);
  CHECK((info.has_normals && info.has_colors && info.has_confidence && info.has_views));
  CHECK(info.comments == header.comments);
  CHECK(!info.file_from_map);
  CHECK(info.unit.kind == CloudUnit::Kind::kUnknown);
  if (format == "las") CHECK((info.year == 2026 && info.day_of_year == 73));
  if (format != "ply") CHECK(info.wkt == header.wkt);
  std::vector<OutputPoint> read = all_points(*cloud);
  CHECK(all_points(*cloud).size() == read.size());  // once more
  REQUIRE(read.size() == points.size());
  const auto before = [](const OutputPoint& a, const OutputPoint& b) {
    return std::pair(a.confidence, a.normal.x()) < std::pair(b.confidence, b.normal.x());
  };
  std::sort(points.begin(), points.end(), before);  // an octree has its own order
  std::sort(read.begin(), read.end(), before);
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    wrong += (read[i].position - points[i].position).cwiseAbs().maxCoeff() > (format == "ply" ? 0.0 : 0.50001e-5);
    wrong += read[i].normal != points[i].normal || read[i].confidence != points[i].confidence;
    wrong += !(read[i].color == points[i].color) || read[i].views != points[i].views;
  }
  CHECK(wrong == 0);
  const auto box = bounds_of(*cloud);
  REQUIRE(box);
  CHECK((box->second - Eigen::Vector3d(1010.0, -495.0, 32.0)).norm() < 0.1);
}

TEST_CASE("LAS of other versions and formats gives positions and colours of 16 or 8 bits") {
  struct Kind {
    std::uint8_t minor, format;
    std::uint16_t bytes;
    std::size_t colors;
  };
  const auto kind = GENERATE(Kind{0, 0, 20, 0}, Kind{1, 1, 28, 0}, Kind{2, 2, 26, 20}, Kind{2, 3, 34, 28},
                             Kind{3, 5, 63, 28}, Kind{4, 6, 30, 0}, Kind{4, 7, 36, 30}, Kind{4, 8, 38, 30},
                             Kind{4, 6, 33, 0});  // the last one with bytes that nothing describes
  const std::uint16_t level = GENERATE(std::uint16_t{255}, std::uint16_t{65535});
  const TempDir dir;
  std::string text = las(kind.minor, kind.format, kind.bytes, 2);
  const std::size_t second = text.size() - kind.bytes;
  put_little(text.data() + second, std::int32_t{-5});
  put_little(text.data() + second + 8, std::int32_t{7});
  if (kind.colors > 0) put_little(text.data() + second + kind.colors, level);
  write_text(dir / "c.las", text);
  const auto cloud = open_cloud(dir / "c.las");
  CHECK(cloud->info().has_colors == (kind.colors > 0));
  CHECK(!cloud->info().has_normals);
  const std::vector<OutputPoint> points = all_points(*cloud);
  REQUIRE(points.size() == 2);
  CHECK((points[0].position - Eigen::Vector3d(100, 100, 100)).norm() < 1e-9);
  CHECK((points[1].position - Eigen::Vector3d(99.95, 100, 100.07)).norm() < 1e-9);
  CHECK(points[1].color == (kind.colors > 0 ? Rgb{255, 0, 0} : Rgb{200, 200, 200}));
}

TEST_CASE("broken and compressed clouds are refused by name") {
  const TempDir dir;
  const std::string sound = las(2, 2, 26, 3);
  const auto refused = [&](std::string text, std::size_t at, auto value) {
    put_little(text.data() + at, value);
    write_text(dir / "c.las", text);
    try {
      all_points(*open_cloud(dir / "c.las"));
    } catch (const InvalidInput& error) {
      return std::string(error.what());
    }
    return std::string("was read");
  };
  CHECK_THAT(refused(sound, 104, std::uint8_t{0x82}), Contains("laszip"));
  CHECK_THAT(refused(sound, 24, std::uint8_t{2}), Contains("LAS 2.2"));
  CHECK_THAT(refused(sound, 94, std::uint16_t{100}), Contains("header of 100 bytes"));
  CHECK_THAT(refused(sound, 104, std::uint8_t{11}), Contains("format 11"));
  CHECK_THAT(refused(sound, 105, std::uint16_t{25}), Contains("25 bytes"));
  CHECK_THAT(refused(sound, 105, std::uint16_t{0}), Contains("0 bytes"));
  CHECK_THAT(refused(sound, 107, std::uint32_t{4}), Contains("cut off"));
  CHECK_THAT(refused(sound, 107, std::uint32_t{0xffffffff}), Contains("cut off"));
  CHECK_THAT(refused(las(4, 6, 30, 3), 247, std::uint64_t{1} << 62), Contains("cut off"));
  CHECK_THAT(refused(sound, 96, std::uint32_t{20}), Contains("cut off"));
  CHECK_THAT(refused(sound, 131, 0.0), Contains("scale"));
  CHECK_THAT(refused(sound, 131, 1e308), Contains("was read"));             // 0 times a large scale
  CHECK_THAT(refused(sound, 100, std::uint32_t{5}), Contains("was read"));  // no room for records: points follow
  CHECK_THROWS_AS(all_points(*open_cloud((write_text(dir / "e.las", "LASF"), dir / "e.las"))), InvalidInput);
  CHECK_THROWS_WITH(open_cloud((write_text(dir / "c.xyz", "1 2 3\n"), dir / "c.xyz")),
                    Contains("neither a PLY nor a LAS"));
  CHECK_THROWS_WITH(open_cloud(dir.path()), Contains("is no cloud"));
  CHECK_THROWS_AS(open_cloud(dir / "none.ply"), IoError);
}

TEST_CASE("the points of a dataset are read") {
  const TempDir dir;
  const std::string format = GENERATE("colmap", "nerfstudio");
  CloudHeader header = sample_header();
  header.scratch = dir.path();
  header.comments.emplace_back("frame of the SLAM map, its unit of length; normals face the camera");
  header.double_positions = true;
  const std::vector<OutputPoint> points = sample_points(3000);
  write(format.c_str(), dir / "d", header, points);
  const auto cloud = open_cloud(dir / "d");
  CHECK(cloud->info().points == 3000);
  CHECK(cloud->info().comments == header.comments);
  CHECK(cloud->info().unit.kind == CloudUnit::Kind::kMap);
  CHECK(cloud->info().has_normals == (format == "nerfstudio"));
  double sum = 0.0, expected = 0.0;
  for (const OutputPoint& point : points) expected += point.position.x() * point.color.r;
  for (const OutputPoint& point : all_points(*cloud)) sum += point.position.x() * point.color.r;
  CHECK(sum == Approx(expected));
  if (format == "nerfstudio") return;
  const std::filesystem::path file = dir / "d" / "sparse" / "0" / "points3D.bin";
  std::string text = read_text(file);
  put_little(text.data() + 8 + 43, std::uint64_t{1} << 62);  // a track
  write_text(file, text);
  CHECK_THROWS_WITH(all_points(*open_cloud(dir / "d")), Contains("longer than the file"));
  put_little(text.data(), std::uint64_t{1} << 62);
  write_text(file, text);
  CHECK_THROWS_WITH(open_cloud(dir / "d"), Contains("truncated"));
}

TEST_CASE("a broken Potree folder is refused") {
  const TempDir dir;
  CloudHeader header = sample_header();
  header.scratch = dir.path();
  write("potree", dir / "p", header, sample_points(100));
  const std::string sound = read_text(dir / "p" / "metadata.json");
  const auto replaced = [&](const std::string& what, const std::string& by) {
    std::string text = sound;
    text.replace(text.find(what), what.size(), by);
    write_text(dir / "p" / "metadata.json", text);
    try {
      all_points(*open_cloud(dir / "p"));
    } catch (const InvalidInput& error) {
      return std::string(error.what());
    }
    return std::string("was read");
  };
  CHECK(replaced("DEFAULT", "DEFAULT") == "was read");
  CHECK_THAT(replaced("DEFAULT", "BROTLI"), Contains("PotreeConverter"));
  CHECK_THAT(replaced("\"points\": 100", "\"points\": 101"), Contains("cut off"));
  CHECK_THAT(replaced("\"numElements\": 3", "\"numElements\": 4000000000"), Contains("elements"));
  CHECK_THAT(replaced("\"position\"", "\"elsewhere\""), Contains("no positions"));
  CHECK_THAT(replaced("{", "["), Contains("metadata"));
}

TEST_CASE("a cloud's comments contain its transform and unit") {
  const CloudInfo plain = info_of({"options {}", "frame of the SLAM map, its unit of length; normals face the camera"});
  REQUIRE(plain.file_from_map);
  CHECK(plain.file_from_map->is_identity());
  CHECK(plain.unit.kind == CloudUnit::Kind::kMap);
  const std::string moved = R"(cloud {"file_from_map":[[0,-2,0,5],[2,0,0,6],[0,0,2,7],[0,0,0,1]],"scale":2.0)";
  const CloudInfo metres = info_of({moved + R"(,"unit":"m","unit_by":"--length","lacks":["normals"]})"});
  REQUIRE(metres.file_from_map);
  CHECK((*metres.file_from_map * Eigen::Vector3d(1, 2, 3) - Eigen::Vector3d(1, 8, 13)).norm() < 1e-12);
  CHECK(metres.unit.kind == CloudUnit::Kind::kMetres);
  CHECK(metres.unit.by == "--length");
  CHECK(!metres.has_normals);
  CHECK(metres.has_views);
  CHECK(info_of({moved + "}"}).unit.kind == CloudUnit::Kind::kMetres);  // of a version that did not name it
  CHECK(info_of({moved + R"(,"unit":"unknown"})"}).unit.kind == CloudUnit::Kind::kUnknown);
  for (const char* broken : {"cloud {", "cloud {}", "cloud {\"scale\":\"x\",\"file_from_map\":[]}",
                             "cloud {\"scale\":1,\"file_from_map\":[[1,0,0,0],[0,1,0,0],[0,0,-1,0],[0,0,0,1]]}",
                             "cloud {\"scale\":-1,\"file_from_map\":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}"}) {
    INFO(broken);
    CHECK(!info_of({broken}).file_from_map);
    CHECK(info_of({broken}).unit.kind == CloudUnit::Kind::kUnknown);
  }
}

TEST_CASE("long comments of a PLY are read unchanged") {
  const TempDir dir;
  CloudHeader header = sample_header();
  header.comments = {"options {" + std::string(180, 'a') + "," + std::string(500, 'b') + "}", "short"};
  write("ply", dir / "c.ply", header, sample_points(1));
  CHECK(read_text(dir / "c.ply").find("comment ... ") != std::string::npos);
  CHECK(open_cloud(dir / "c.ply")->info().comments == header.comments);
  CHECK(read_ply(dir / "c.ply").comments == header.comments);
}
