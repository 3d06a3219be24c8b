// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <array>
#include <map>

#include <catch2/catch.hpp>

#include "export/sample_points.h"
#include "pmsp/error.h"
#include "pmsp/io/cloud.h"
#include "support/temp_dir.h"

using namespace pmsp;
using namespace pmsp_test;

namespace {

// LAS 1.4 - R15, by the byte offsets of its tables.
struct Las {
  explicit Las(const std::filesystem::path& path) : bytes(read_text(path)) {
    REQUIRE(bytes.substr(0, 4) == "LASF");
    REQUIRE(number_at<std::uint8_t>(bytes, 24) == 1);
    REQUIRE(number_at<std::uint8_t>(bytes, 25) == 4);
    REQUIRE(number_at<std::uint16_t>(bytes, 94) == 375);
    points_at = number_at<std::uint32_t>(bytes, 96);
    REQUIRE(number_at<std::uint8_t>(bytes, 104) == 7);
    record = number_at<std::uint16_t>(bytes, 105);
    count = number_at<std::uint64_t>(bytes, 247);
    REQUIRE(bytes.size() == points_at + record * count);
    std::size_t at = 375;
    for (std::uint32_t i = number_at<std::uint32_t>(bytes, 100); i > 0; --i) {
      const std::size_t size = number_at<std::uint16_t>(bytes, at + 20);
      const std::string user = bytes.substr(at + 2, 16).c_str();
      records[user + " " + std::to_string(number_at<std::uint16_t>(bytes, at + 18))] = bytes.substr(at + 54, size);
      at += 54 + size;
    }
    REQUIRE(at == points_at);
    const std::string& extra = records.at("LASF_Spec 4");
    REQUIRE(extra.size() % 192 == 0);
    std::size_t offset = 36;
    for (std::size_t i = 0; i < extra.size(); i += 192) {
      const auto type = number_at<std::uint8_t>(extra, i + 2);
      REQUIRE((type == 1 || type == 9));
      extra_at[extra.substr(i + 4, 32).c_str()] = offset;
      offset += type == 9 ? 4 : 1;
    }
    REQUIRE(offset == record);
  }

  std::size_t at(std::size_t i) const { return points_at + i * record; }
  double coordinate(std::size_t i, std::size_t axis) const {
    return number_at<std::int32_t>(bytes, at(i) + 4 * axis) * number_at<double>(bytes, 131 + 8 * axis) +
           number_at<double>(bytes, 155 + 8 * axis);
  }
  template <class T>
  T extra(std::size_t i, const std::string& name) const {
    return number_at<T>(bytes, at(i) + extra_at.at(name));
  }

  std::string bytes;
  std::size_t points_at = 0, record = 0, count = 0;
  std::map<std::string, std::string> records;
  std::map<std::string, std::size_t> extra_at;
};

void write(const std::filesystem::path& path, const CloudHeader& header, const std::vector<OutputPoint>& points,
           std::size_t each = 1 << 20) {
  const auto writer = find_cloud_format("las")->open(path, header);
  for (std::size_t i = 0; i < points.size(); i += each) {
    writer->add(points.data() + i, std::min(each, points.size() - i));
  }
  writer->finish();
}

}  // namespace

TEST_CASE("a LAS file holds each point at the offsets of the specification") {
  const TempDir dir;
  const std::vector<OutputPoint> points = sample_points(60000);
  CloudHeader header = sample_header();
  header.wkt = "LOCAL_CS[\"hall\"]";
  header.year = 2026;
  header.day_of_year = 73;
  write(dir / "c.las", header, points);
  const Las las(dir / "c.las");
  REQUIRE(las.count == points.size());
  CHECK(number_at<std::uint64_t>(las.bytes, 255) == points.size());  // first returns
  CHECK(number_at<std::uint32_t>(las.bytes, 107) == 0);              // counts of older versions
  CHECK(number_at<std::uint16_t>(las.bytes, 6) == 16);               // coordinate systems are WKT
  CHECK(number_at<std::uint16_t>(las.bytes, 90) == 73);
  CHECK(number_at<std::uint16_t>(las.bytes, 92) == 2026);
  CHECK(number_at<double>(las.bytes, 131) == 1e-5);
  CHECK(number_at<double>(las.bytes, 155) == 1000.0);
  CHECK(las.records.at("LASF_Projection 2112") == header.wkt + '\0');
  CHECK(las.records.at("LASF_Spec 3").find("first\nsecond\n") == 0);
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e9), high = -low;
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const OutputPoint& p = points[i];
    Eigen::Vector3d read;
    for (std::size_t axis = 0; axis < 3; ++axis) read[static_cast<int>(axis)] = las.coordinate(i, axis);
    low = low.cwiseMin(read);
    high = high.cwiseMax(read);
    wrong += (read - p.position).cwiseAbs().maxCoeff() > 0.5000001e-5;
    const std::array<std::uint8_t, 3> color{p.color.r, p.color.g, p.color.b};
    for (std::size_t k = 0; k < 3; ++k) {
      wrong += number_at<std::uint16_t>(las.bytes, las.at(i) + 30 + 2 * k) != color[k] * 257;
    }
    wrong += number_at<std::uint8_t>(las.bytes, las.at(i) + 14) != 0x11;
    wrong += las.extra<float>(i, "NormalX") != p.normal.x() || las.extra<float>(i, "NormalY") != p.normal.y() ||
             las.extra<float>(i, "NormalZ") != p.normal.z();
    wrong += las.extra<float>(i, "confidence") != p.confidence || las.extra<std::uint8_t>(i, "views") != p.views;
  }
  CHECK(wrong == 0);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    CHECK(number_at<double>(las.bytes, 179 + 16 * axis) == high[static_cast<int>(axis)]);
    CHECK(number_at<double>(las.bytes, 187 + 16 * axis) == low[static_cast<int>(axis)]);
  }
}

TEST_CASE("the bytes of a LAS file depend on the points and not on chunks or time") {
  const TempDir dir;
  const std::vector<OutputPoint> points = sample_points(50000);
  write(dir / "a.las", sample_header(), points);
  write(dir / "b.las", sample_header(), points, 777);
  CHECK(read_text(dir / "a.las") == read_text(dir / "b.las"));
}

TEST_CASE("LAS files of no point and of one") {
  const TempDir dir;
  write(dir / "none.las", sample_header(), {});
  const Las none(dir / "none.las");
  CHECK(none.count == 0);
  for (std::size_t at = 179; at < 227; at += 8) CHECK(number_at<double>(none.bytes, at) == 0.0);
  write(dir / "one.las", sample_header(), sample_points(1));
  const Las one(dir / "one.las");
  CHECK(one.count == 1);
  CHECK(number_at<double>(one.bytes, 179) == one.coordinate(0, 0));
  CHECK(number_at<double>(one.bytes, 187) == one.coordinate(0, 0));
}

TEST_CASE("values that LAS cannot hold are an error and leave no file") {
  const TempDir dir;
  std::vector<OutputPoint> points = sample_points(1);
  points[0].position.x() = 1e6;
  CHECK_THROWS_WITH(write(dir / "c.las", sample_header(), points),
                    Catch::Contains("c.las") && Catch::Contains("--resolution"));
  CloudHeader header = sample_header();
  header.wkt = std::string(70000, 'x');
  CHECK_THROWS_WITH(write(dir / "c.las", header, {}), Catch::Contains("65534"));
  CHECK(dir.entries() == 0);
  header = sample_header();
  header.resolution = 0.001;
  write(dir / "c.las", header, points);
  CHECK(Las(dir / "c.las").coordinate(0, 0) == 1e6);
}
