// SPDX-License-Identifier: BSD-2-Clause
// EXIF data of images: orientation and GPS position.
#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "drawn_scene.h"
#include "export/cloud_frame.h"
#include "io/exif.h"
#include "pmsp/error.h"

using namespace pmsp;
using namespace pmsp::test;
using namespace pmsp_test;
using Catch::Matchers::Contains;

namespace {

std::string little(std::uint64_t value, int count) {
  std::string bytes;
  for (int i = 0; i < count; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xffU);
  return bytes;
}

std::string big(std::uint64_t value, int count) {
  const std::string bytes = little(value, count);
  return {bytes.rbegin(), bytes.rend()};
}

std::string entry(unsigned tag, unsigned type, unsigned count, std::uint64_t value) {
  return little(tag, 2) + little(type, 2) + little(count, 4) + little(value, 4);
}

std::string rationals(const std::vector<std::pair<unsigned, unsigned>>& values) {
  std::string bytes;
  for (const auto& [above, below] : values) bytes += little(above, 4) + little(below, 4);
  return bytes;
}

/// A TIFF block with an orientation and a place: 52 deg 30' 15" N, 7 deg 18' 0" W, 3.5 m below the sea.
std::string tiff(unsigned orientation) {
  const std::string head = std::string("II") + little(42, 2) + little(8, 4);
  const std::string first = little(2, 2) + entry(0x0112, 3, 1, orientation) + entry(0x8825, 4, 1, 38) + little(0, 4);
  const unsigned values = 38 + 2 + 6 * 12 + 4;
  const std::string gps = little(6, 2) + entry(1, 2, 2, 'N') + entry(2, 5, 3, values) + entry(3, 2, 2, 'W') +
                          entry(4, 5, 3, values + 24) + entry(5, 1, 1, 1) + entry(6, 5, 1, values + 48) + little(0, 4);
  return head + first + gps + rationals({{52, 1}, {30, 1}, {1500, 100}, {7, 1}, {18, 1}, {0, 1}, {7, 2}});
}

/// A place north and east, in millionths of a degree, and its height in centimetres.
std::string place(unsigned north, unsigned east, unsigned up) {
  const std::string head = std::string("II") + little(42, 2) + little(8, 4);
  const unsigned values = 26 + 2 + 6 * 12 + 4;
  const std::string gps = little(6, 2) + entry(1, 2, 2, 'N') + entry(2, 5, 3, values) + entry(3, 2, 2, 'E') +
                          entry(4, 5, 3, values + 24) + entry(5, 1, 1, 0) + entry(6, 5, 1, values + 48) + little(0, 4);
  return head + little(1, 2) + entry(0x8825, 4, 1, 26) + little(0, 4) + gps +
         rationals({{north, 1000000}, {0, 1}, {0, 1}, {east, 1000000}, {0, 1}, {0, 1}, {up, 100}});
}

std::vector<std::uint8_t> numbers(const std::string& bytes) { return {bytes.begin(), bytes.end()}; }

std::string in_jpeg(const std::string& jpeg, const std::string& block) {
  const std::string payload = std::string("Exif\0\0", 6) + block;
  return jpeg.substr(0, 2) + "\xFF\xE1" + big(payload.size() + 2, 2) + payload + jpeg.substr(2);
}

std::string in_png(const std::string& png, const std::string& block) {
  const std::string chunk = "eXIf" + block;
  std::uint32_t crc = 0xffffffffU;
  for (const char c : chunk) {
    crc ^= static_cast<unsigned char>(c);
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 1U) != 0 ? 0xedb88320U ^ crc >> 1U : crc >> 1U;
  }
  const std::size_t header = 8 + 8 + 13 + 4;
  return png.substr(0, header) + big(block.size(), 4) + chunk + big(crc ^ 0xffffffffU, 4) + png.substr(header);
}

/// Black but for the upper left quarter (200) and the upper right one (100).
Image<Rgb> quarters(int width, int height) {
  Image<Rgb> image(width, height);
  for (int y = 0; y < height / 2; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::uint8_t gray = x < width / 2 ? 200 : 100;
      image(x, y) = {gray, gray, gray};
    }
  }
  return image;
}

/// Gray levels at the corners of the image that the source gives: upper left and right, lower left and right.
std::array<int, 4> corners_of(const std::filesystem::path& folder) {
  const auto source = open_image_folder(bare_map({{0, 0.0, 0}}), folder);
  const auto item = source->next();
  REQUIRE(item);
  const int right = item->image.width() - 1, bottom = item->image.height() - 1;
  std::array<int, 4> corners{};
  std::size_t at = 0;
  for (const int y : {0, bottom}) {
    for (const int x : {0, right}) corners[at++] = (item->image(x, y).r + 25) / 50 * 50;
  }
  return corners;
}

}  // namespace

TEST_CASE("images are rotated by their EXIF orientation", "[exif]") {
  const std::string ending = GENERATE(".jpg", ".png");
  CAPTURE(ending);
  // Orientation n: what is stored is the picture seen so that this undoes it (Exif 2.32, table 6).
  const std::array<int, 4> upright{200, 100, 0, 0};
  const std::array<std::array<int, 4>, 9> shown{{{},
                                                 {200, 100, 0, 0},
                                                 {100, 200, 0, 0},
                                                 {0, 0, 100, 200},
                                                 {0, 0, 200, 100},
                                                 {200, 0, 100, 0},
                                                 {0, 200, 0, 100},
                                                 {0, 100, 0, 200},
                                                 {100, 0, 200, 0}}};
  for (unsigned orientation = 1; orientation <= 8; ++orientation) {
    CAPTURE(orientation);
    const TempDir folder;
    const auto path = folder / ("0" + ending);
    const bool is_quarter = orientation >= 5;
    write_image(path, is_quarter ? quarters(32, 64) : quarters(64, 32));
    const std::string plain = read_text(path);
    write_text(path, ending == ".jpg" ? in_jpeg(plain, tiff(orientation)) : in_png(plain, tiff(orientation)));
    CHECK(corners_of(folder.path()) == shown[orientation]);
  }
  CHECK(shown[1] == upright);
}

TEST_CASE("a panorama rotated by a quarter turn is refused", "[exif]") {
  const TempDir folder;
  write_image(folder / "0.jpg", quarters(64, 32));
  write_text(folder / "0.jpg", in_jpeg(read_text(folder / "0.jpg"), tiff(6)));
  const auto source = open_image_folder(bare_map({{0, 0.0, 0}}), folder.path());
  CHECK_THROWS_WITH(source->next(), Contains("orientation 6") && Contains("twice as wide"));
}

TEST_CASE("the GPS position of an image is read", "[exif]") {
  const TempDir folder;
  write_image(folder / "0.jpg", quarters(64, 32));
  const std::string file = in_jpeg(read_text(folder / "0.jpg"), tiff(1));
  const auto gps = io::read_exif(numbers(file)).gps;
  REQUIRE(gps);
  CHECK(gps->latitude_deg == Approx(52.0 + 30.0 / 60.0 + 15.0 / 3600.0).epsilon(1e-12));
  CHECK(gps->longitude_deg == Approx(-7.3).epsilon(1e-12));
  CHECK(gps->altitude_m == Approx(-3.5));
  write_text(folder / "0.jpg", file);
  CHECK(io::read_exif(folder / "0.jpg").gps);
  CHECK_FALSE(io::read_exif(numbers(read_text(folder / "0.jpg").substr(0, 60))).gps);
}

TEST_CASE("the GPS position of a TIFF file is read also if its tags follow the pixels", "[exif]") {
  const TempDir folder;
  const std::string block = tiff(3);
  write_text(folder / "0.tif", block);
  // The same with the directories far behind: offsets are from the beginning of the file.
  constexpr unsigned kPixels = 3'000'000;
  const std::string head = std::string("II") + little(42, 2) + little(kPixels, 4);
  const unsigned values = kPixels + 18 + 2 + 6 * 12 + 4;
  const std::string first = little(1, 2) + entry(0x8825, 4, 1, kPixels + 18) + little(0, 4);
  const std::string gps = little(6, 2) + entry(1, 2, 2, 'N') + entry(2, 5, 3, values) + entry(3, 2, 2, 'W') +
                          entry(4, 5, 3, values + 24) + entry(5, 1, 1, 1) + entry(6, 5, 1, values + 48) + little(0, 4);
  write_text(folder / "1.tif", head + std::string(kPixels - head.size(), 'x') + first + gps +
                                   rationals({{52, 1}, {30, 1}, {1500, 100}, {7, 1}, {18, 1}, {0, 1}, {7, 2}}));
  for (const char* name : {"0.tif", "1.tif"}) {
    CAPTURE(name);
    const io::Exif exif = io::read_exif(folder / name);
    REQUIRE(exif.gps);
    CHECK(exif.gps->latitude_deg == Approx(52.0 + 30.0 / 60.0 + 15.0 / 3600.0).epsilon(1e-12));
    CHECK(exif.gps->longitude_deg == Approx(-7.3).epsilon(1e-12));
    CHECK(exif.orientation == 1);  // OpenCV turns TIFF files itself
  }
  for (std::size_t size = 0; size < block.size(); ++size) {
    write_text(folder / "0.tif", block.substr(0, size));
    io::read_exif(folder / "0.tif");
  }
}

TEST_CASE("broken EXIF data are ignored", "[exif]") {
  const TempDir folder;
  write_image(folder / "0.jpg", quarters(64, 32));
  const std::string good = in_jpeg(read_text(folder / "0.jpg"), tiff(3)).substr(0, 400);
  for (std::size_t size = 0; size < good.size(); ++size) io::read_exif(numbers(good.substr(0, size)));
  for (std::size_t at = 0; at < good.size(); ++at) {
    for (const char value : {'\0', '\x7f', '\xff'}) {
      std::string bytes = good;
      bytes[at] = value;
      const io::Exif exif = io::read_exif(numbers(bytes));
      CHECK((exif.orientation >= 1 && exif.orientation <= 8));
    }
  }
}

TEST_CASE("a cloud is aligned with the GPS positions in the images' EXIF data", "[exif]") {
  // At the equator a thousandth of a degree is 111.3195 m to the east and 110.5743 m to the north (WGS 84).
  const TempDir folder;
  SlamMap map = bare_map({{0, 0.0, 0}, {1, 0.1, 1}, {2, 0.2, 2}, {3, 0.3, 3}, {4, 0.4, 4}});
  const std::vector<std::array<unsigned, 3>> places{
      {0, 7000000, 1000}, {0, 7001000, 1000}, {1000, 7000000, 1000}, {0, 7000000, 9000}};
  const std::vector<Eigen::Vector3d> metres{{0, 0, 0}, {111.3195, 0, 0}, {0, 110.5743, 0}, {0, 0, 80}};
  ImageFiles files;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const std::filesystem::path path = folder / (std::to_string(i) + ".jpg");
    write_image(path, quarters(64, 32));
    write_text(path, in_jpeg(read_text(path), place(places[i][0], places[i][1], places[i][2])));
    files[map.keyframes[i].id] = path;
    RigidTransform world_from_cam;  // the map: east is -z, north is x, up is -y, half the size
    world_from_cam.translation = {metres[i].y() / 2, -metres[i].z() / 2, -metres[i].x() / 2};
    map.keyframes[i].cam_from_world = world_from_cam.inverse();
  }
  write_image(folder / "4.jpg", quarters(64, 32));  // without a place
  files[map.keyframes[4].id] = folder / "4.jpg";
  FrameOptions options;
  options.align = kAlignExif;
  const CloudFrame frame = find_cloud_frame(options, map, files);
  CHECK(frame.residuals.size() == 4);
  CHECK(frame.residual_max() < 0.01);
  CHECK(frame.file_from_map.scale == Approx(2.0).epsilon(1e-4));
  CHECK((frame.file_from_map * Eigen::Vector3d(0, 0, -1) - Eigen::Vector3d(2, 0, 0)).norm() < 0.01);
  CHECK((frame.file_from_map * Eigen::Vector3d(0, -1, 0) - Eigen::Vector3d(0, 0, 2)).norm() < 0.01);
  CHECK_THAT(frame.description, Contains("longitude 7.0000") && Contains("east, north and up"));

  files.erase(map.keyframes[0].id);
  files.erase(map.keyframes[1].id);
  CHECK_THROWS_WITH(find_cloud_frame(options, map, files), Contains("EXIF") && Contains("2 positions"));
}
