// SPDX-License-Identifier: BSD-2-Clause
#include <cstring>
#include <limits>
#include <map>

#include <opencv2/imgcodecs.hpp>

#include <catch2/catch.hpp>

#include "pmsp/error.h"
#include "pmsp/io/depth.h"
#include "support/temp_dir.h"

using namespace pmsp;
using pmsp_test::read_text;
using pmsp_test::TempDir;
using pmsp_test::write_text;

namespace {

Image<float> ramp(int width, int height) {
  Image<float> image(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) image(x, y) = 100.0F * static_cast<float>(y) + static_cast<float>(x) + 0.25F;
  }
  return image;
}

std::string bytes_of(std::vector<float> values, bool big_endian) {
  std::string all;
  for (const float value : values) {
    std::string bytes(4, '\0');
    std::memcpy(bytes.data(), &value, 4);
    all += big_endian ? std::string(bytes.rbegin(), bytes.rend()) : bytes;
  }
  return all;
}

}  // namespace

TEST_CASE("PFM keeps every bit") {
  const TempDir dir;
  Image<float> image = ramp(5, 3);
  image(2, 1) = std::numeric_limits<float>::infinity();
  image(3, 1) = 1e-42F;
  write_pfm(dir / "d.pfm", image);
  const Image<float> read = read_pfm(dir / "d.pfm");
  CHECK(read.width() == 5);
  CHECK(read.height() == 3);
  CHECK(read.pixels() == image.pixels());

  Image<Eigen::Vector3f> normals(4, 2, Eigen::Vector3f(0.0F, 0.6F, -0.8F));
  normals(3, 1) = {1.0F, 2.0F, 3.0F};
  write_pfm(dir / "n.pfm", normals);
  const Image<Eigen::Vector3f> read3 = read_pfm3(dir / "n.pfm");
  CHECK(read3.width() == 4);
  CHECK(read3.pixels() == normals.pixels());
  CHECK(dir.entries() == 2);
}

TEST_CASE("PFM rows go from the bottom to the top, little endian") {
  const TempDir dir;
  write_pfm(dir / "d.pfm", ramp(2, 2));
  CHECK(read_text(dir / "d.pfm") == "Pf\n2 2\n-1.0\n" + bytes_of({100.25F, 101.25F, 0.25F, 1.25F}, false));
}

TEST_CASE("OpenCV reads the same PFM") {
  const TempDir dir;
  write_pfm(dir / "d.pfm", ramp(6, 4));
  const cv::Mat seen = cv::imread((dir / "d.pfm").string(), cv::IMREAD_UNCHANGED);
  REQUIRE(seen.type() == CV_32FC1);
  CHECK(seen.at<float>(0, 5) == 5.25F);
  CHECK(seen.at<float>(3, 0) == 300.25F);
}

TEST_CASE("big-endian PFM is read") {
  const TempDir dir;
  write_text(dir / "b.pfm", "Pf\n2 1\n1.0\n" + bytes_of({1.5F, -2.5F}, true));
  const Image<float> image = read_pfm(dir / "b.pfm");
  CHECK(image(0, 0) == 1.5F);
  CHECK(image(1, 0) == -2.5F);
}

TEST_CASE("broken PFM files are refused with a reason") {
  const TempDir dir;
  const std::vector<std::pair<std::string, std::string>> cases{
      {"", "is no PFM"},
      {"P6\n1 1\n255\nabc", "is no PFM"},
      {"PF\n1 1\n-1\n" + std::string(12, 'x'), "channels"},
      {"Pf\n0 1\n-1\n", "no valid size"},
      {"Pf\n-4 1\n-1\n", "no valid size"},
      {"Pf\n+4 1\n-1\n", "no valid size"},
      {"Pf\n2000000000 2000000000\n-1\n", "no valid size"},
      {"Pf\n1000000 1000000\n-1\nabc", "is it cut off"},
      {"Pf\n1 1\n0\nabcd", "scale"},
      {"Pf\n1 1\nnan\nabcd", "scale"},
      {"Pf\n1 1\n-1\nabc", "is it cut off"},
      {"Pf\n1 1", "no valid"},
  };
  for (const auto& [text, expected] : cases) {
    write_text(dir / "bad.pfm", text);
    INFO(text);
    CHECK_THROWS_AS(read_pfm(dir / "bad.pfm"), InvalidInput);
    CHECK_THROWS_WITH(read_pfm(dir / "bad.pfm"), Catch::Contains(expected) && Catch::Contains("bad.pfm"));
  }
  CHECK_THROWS_AS(read_pfm(dir / "missing.pfm"), IoError);
  CHECK_THROWS_WITH(read_pfm(dir / "missing.pfm"), Catch::Contains("there is no such file"));
  CHECK_THROWS_WITH(read_pfm(dir.path()), Catch::Contains("it is a directory"));
  CHECK_THROWS_WITH(read_png16("/dev/null", 1.0), Catch::Contains("no regular file"));
  CHECK_THROWS_AS(write_pfm(dir / "empty.pfm", Image<float>()), InvalidInput);
  CHECK_THROWS_AS(write_pfm(dir / "no/such.pfm", ramp(2, 2)), OutputError);
}

TEST_CASE("16-bit PNG holds scaled depth and 0 for values out of range") {
  const TempDir dir;
  Image<float> image(4, 2, 0.0F);
  image(0, 0) = 1.2344F;
  image(1, 0) = 65.535F;
  image(2, 0) = 65.536F;
  image(3, 0) = std::numeric_limits<float>::quiet_NaN();
  image(0, 1) = -1.0F;
  image(1, 1) = std::numeric_limits<float>::infinity();
  image(3, 1) = 2.0F;
  write_png16(dir / "d.png", image, 1000.0);
  const Image<float> raw = read_png16(dir / "d.png", 1.0);
  CHECK(raw.pixels() == std::vector<float>{1234, 65535, 0, 0, 0, 0, 0, 2000});
  CHECK(read_png16(dir / "d.png", 0.001)(3, 1) == Approx(2.0));
  CHECK(dir.entries() == 1);
}

TEST_CASE("8-bit gray PNG is read and colour and invalid files are refused") {
  const TempDir dir;
  cv::imwrite((dir / "g.png").string(), cv::Mat(2, 3, CV_8UC1, cv::Scalar(7)));
  CHECK(read_png16(dir / "g.png", 2.0)(2, 1) == 14.0F);
  cv::imwrite((dir / "c.png").string(), cv::Mat(2, 3, CV_8UC3, cv::Scalar(7)));
  CHECK_THROWS_AS(read_png16(dir / "c.png", 1.0), InvalidInput);
  write_text(dir / "r.png", "rubbish");
  CHECK_THROWS_AS(read_png16(dir / "r.png", 1.0), IoError);
  CHECK_THROWS_AS(read_png16(dir / "missing.png", 1.0), IoError);
  CHECK_THROWS_AS(write_png16(dir / "z.png", Image<float>(2, 2), 0.0), InvalidInput);
}

TEST_CASE("an EXR holds its channels as float in the layout of the format") {
  const TempDir dir;
  Image<float> other(5, 3, 7.5F);
  other(0, 0) = -1.0F;
  write_exr(dir / "d.exr", {{"Z", ramp(5, 3)}, {"confidence", other}, {"N.X", other}});
  const std::string bytes = read_text(dir / "d.exr");
  std::size_t at = 0;
  const auto number = [&](std::size_t size) {
    std::uint64_t value = 0;
    std::memcpy(&value, bytes.data() + at, size);
    at += size;
    return value;
  };
  const auto word = [&] {
    const std::string text = bytes.c_str() + at;
    at += text.size() + 1;
    return text;
  };
  CHECK(number(4) == 20000630);
  CHECK(number(4) == 2);
  std::map<std::string, std::string> attributes;
  for (std::string name = word(); !name.empty(); name = word()) {
    const std::string type = word();
    const std::size_t size = number(4);
    attributes[name + " " + type] = bytes.substr(at, size);
    at += size;
  }
  const char box[] = "\0\0\0\0\0\0\0\0\4\0\0\0\2\0\0";  // from 0, 0 to 4, 2
  CHECK(attributes.at("dataWindow box2i") == std::string(box, 16));
  CHECK(attributes.at("displayWindow box2i") == std::string(box, 16));
  CHECK(attributes.at("compression compression") == std::string(1, '\0'));
  CHECK(attributes.at("lineOrder lineOrder") == std::string(1, '\0'));
  for (const char* name : {"pixelAspectRatio float", "screenWindowCenter v2f", "screenWindowWidth float"}) {
    CHECK(attributes.count(name) == 1);
  }
  const std::string& list = attributes.at("channels chlist");
  CHECK(std::string(list.c_str()) == "N.X");
  CHECK(std::string(list.c_str() + 4 + 16) == "Z");
  CHECK(std::string(list.c_str() + 20 + 2 + 16) == "confidence");
  CHECK(list.size() == 4 + 2 + 11 + 3 * 16 + 1);
  CHECK(list[4] == 2);
  std::vector<std::size_t> rows;
  for (int y = 0; y < 3; ++y) rows.push_back(number(8));
  for (std::size_t y = 0; y < 3; ++y) {
    CHECK(rows[y] == at);
    CHECK(number(4) == y);
    CHECK(number(4) == 3 * 5 * 4);
    std::vector<float> values(15);
    std::memcpy(values.data(), bytes.data() + at, 60);
    at += 60;
    CHECK(values[0] == (y == 0 ? -1.0F : 7.5F));
    CHECK(values[5 + 2] == ramp(5, 3)(2, static_cast<int>(y)));
    CHECK(values[14] == 7.5F);
  }
  CHECK(at == bytes.size());
  CHECK_THROWS_AS(write_exr(dir / "e.exr", std::vector<ImageChannel>{}), InvalidInput);
  CHECK_THROWS_AS(write_exr(dir / "e.exr", {{"Z", ramp(5, 3)}, {"A", ramp(4, 3)}}), InvalidInput);
  CHECK(dir.entries() == 1);
}

TEST_CASE("normals as PNG: red, green and blue are x, y and z") {
  const TempDir dir;
  Image<Eigen::Vector3f> normals(3, 2, Eigen::Vector3f::Zero());
  normals(1, 0) = {1.0F, -1.0F, 0.0F};
  write_png16(dir / "n.png", normals);
  const cv::Mat read = cv::imread((dir / "n.png").string(), cv::IMREAD_UNCHANGED);
  REQUIRE(read.type() == CV_16UC3);
  CHECK(read.at<cv::Vec3w>(0, 1) == cv::Vec3w(32768, 0, 65535));  // blue, green, red
  CHECK(read.at<cv::Vec3w>(1, 2) == cv::Vec3w(0, 0, 0));
}

TEST_CASE("normals in a PNG are read back") {
  const TempDir dir;
  Image<Eigen::Vector3f> normals(3, 2, Eigen::Vector3f::Zero());
  normals(0, 0) = Eigen::Vector3f(0.3F, -0.5F, 0.7F).normalized();
  normals(2, 1) = {0.0F, 0.0F, -1.0F};
  write_png16(dir / "n.png", normals);
  const Image<Eigen::Vector3f> read = read_png16_normals(dir / "n.png");
  REQUIRE(read.width() == 3);
  REQUIRE(read.height() == 2);
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 3; ++x) CHECK((read(x, y) - normals(x, y)).norm() < 5e-5F);
  }
  CHECK(read(1, 0).isZero(0.0F));
  write_png16(dir / "d.png", Image<float>(3, 2, 1.0F), 1000.0);
  CHECK_THROWS_AS(read_png16_normals(dir / "d.png"), InvalidInput);
}
