// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>
#include <vector>

#include <catch2/catch.hpp>

#include "export/little_endian.h"
#include "export/page_cloud.h"
#include "support/temp_dir.h"

using namespace pmsp;
using pmsp_test::TempDir;

namespace {

/// Points on the floor and a wall of a room, in the order of a grid.
std::vector<OutputPoint> points_of_room(int along) {
  std::vector<OutputPoint> points;
  for (int i = 0; i < along; ++i) {
    for (int k = 0; k < along; ++k) {
      OutputPoint point;
      const double u = 4.0 * i / along, v = 4.0 * k / along;
      point.position = i % 2 == 0 ? Eigen::Vector3d(100.0 + u, v, 0.0) : Eigen::Vector3d(100.0, v, u);
      point.normal = i % 2 == 0 ? Eigen::Vector3f::UnitZ() : Eigen::Vector3f::UnitX();
      point.confidence = static_cast<float>(k) / static_cast<float>(along);
      point.color = {static_cast<std::uint8_t>(i % 256), static_cast<std::uint8_t>(k % 256), 7};
      point.views = static_cast<std::uint8_t>(k % 200);
      point.keyframe_id = i % 3 == 0 ? 12 : 30;
      point.pixel = static_cast<std::uint32_t>(k);
      points.push_back(point);
    }
  }
  return points;
}

CloudHeader header_in(const TempDir& dir) {
  CloudHeader header;
  header.center = {100.0, 0.0, 0.0};
  header.reach = 8.0;
  header.scratch = dir.path();
  return header;
}

struct Read {
  Eigen::Vector3d position;
  Rgb color;
  double confidence;
  int views;
  int keyframe;
};

std::vector<Read> read(const PageCloud& cloud, double& coarsest) {
  std::vector<Read> points;
  coarsest = 0.0;
  for (const PageNode& node : cloud.nodes()) {
    const std::size_t n = node.points;
    REQUIRE(node.bytes.size() == n * PageCloud::kPointBytes);
    const char* bytes = node.bytes.data();
    const auto byte = [&](std::size_t at) { return get_little<std::uint8_t>(bytes + at); };
    coarsest = std::max(coarsest, node.side / 65535.0);
    for (std::size_t i = 0; i < n; ++i) {
      Read point;
      for (std::size_t k = 0; k < 3; ++k) {
        point.position[static_cast<int>(k)] = cloud.origin()[static_cast<int>(k)] + node.corner[k] +
                                              node.side * get_little<std::uint16_t>(bytes + 6 * i + 2 * k) / 65535.0;
      }
      point.color = {byte(6 * n + 3 * i), byte(6 * n + 3 * i + 1), byte(6 * n + 3 * i + 2)};
      point.confidence = byte(9 * n + i) / 255.0;
      point.views = byte(10 * n + i);
      point.keyframe = get_little<std::uint16_t>(bytes + 13 * n + 2 * i);
      points.push_back(point);
    }
  }
  return points;
}

}  // namespace

TEST_CASE("a page holds every point if all fit") {
  const TempDir dir;
  const std::vector<OutputPoint> points = points_of_room(200);
  PageCloud cloud(header_in(dir), 100000, {30, 12});
  cloud.add(points.data(), points.size());
  cloud.finish();
  CHECK(dir.entries() == 0);
  CHECK(cloud.points() == 40000);
  CHECK(cloud.points_in() == 40000);
  double step = 0.0;
  std::vector<Read> found = read(cloud, step);
  REQUIRE(found.size() == points.size());
  CHECK(step < 1e-3);
  // i and k identify each point.
  std::sort(found.begin(), found.end(), [](const Read& a, const Read& b) {
    return std::make_pair(a.color.r, a.color.g) < std::make_pair(b.color.r, b.color.g);
  });
  double farthest = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    farthest = std::max(farthest, (found[i].position - points[i].position).norm());
    if (found[i].views != points[i].views || found[i].keyframe != (points[i].keyframe_id == 30 ? 0 : 1) ||
        std::abs(found[i].confidence - static_cast<double>(points[i].confidence)) > 0.002 || found[i].color.b != 7) {
      FAIL("point " << i << " differs");
    }
  }
  CHECK(farthest < 2.0 * step);
  for (std::size_t i = 1; i < cloud.nodes().size(); ++i) CHECK(cloud.nodes()[i - 1].level <= cloud.nodes()[i].level);
}

TEST_CASE("a page that is too small holds the most confident points evenly spread") {
  const TempDir dir;
  std::vector<OutputPoint> points = points_of_room(400);
  std::vector<OutputPoint> worse = points;
  for (OutputPoint& point : points) point.confidence = 1.0F;
  for (OutputPoint& point : worse) {
    point.confidence = 0.1F;
    point.position += Eigen::Vector3d::Constant(1e-4);
  }
  PageCloud cloud(header_in(dir), 30000, {});
  cloud.add(worse.data(), worse.size());
  cloud.add(points.data(), points.size());
  cloud.finish();
  CHECK(cloud.points_in() == 320000);
  CHECK(cloud.points() <= 30000);
  CHECK(cloud.points() > 29000);
  CHECK(cloud.confidences()[1] == 160000);
  CHECK(cloud.confidences()[9] == 160000);
  double step = 0.0;
  std::int64_t sure = 0;
  std::array<int, 16> of_part{};  // of the floor
  for (const Read& point : read(cloud, step)) {
    CHECK(point.keyframe == 65535);
    sure += point.confidence > 0.9 ? 1 : 0;
    if (point.position.x() < 100.01) continue;
    const int part = 4 * std::clamp(static_cast<int>(point.position.x() - 100.0), 0, 3) +
                     std::clamp(static_cast<int>(point.position.y()), 0, 3);
    ++of_part[static_cast<std::size_t>(part)];
  }
  CHECK(100 * sure > 95 * cloud.points());
  const auto [least, most] = std::minmax_element(of_part.begin(), of_part.end());
  CHECK(*most < 1.5 * *least);
}

TEST_CASE("a page without points or without space is empty") {
  const TempDir dir;
  PageCloud none(header_in(dir), 1000, {});
  none.finish();
  CHECK(none.nodes().empty());
  PageCloud no_room(header_in(dir), 0, {});
  const std::vector<OutputPoint> points = points_of_room(50);
  no_room.add(points.data(), points.size());
  no_room.finish();
  CHECK(no_room.points() == 0);
  CHECK(no_room.points_in() == 2500);
}

TEST_CASE("base64 is that of RFC 4648") {
  const auto encoded = [](const std::string& bytes) {
    std::string text;
    append_base64(text, bytes);
    return text;
  };
  CHECK(encoded("").empty());
  CHECK(encoded("f") == "Zg==");
  CHECK(encoded("fo") == "Zm8=");
  CHECK(encoded("foobar") == "Zm9vYmFy");
  CHECK(encoded("\xff\xfe\xfd") == "//79");
}

TEST_CASE("normals are decoded from two bytes") {
  for (int i = 0; i < 1000; ++i) {
    const double z = 1.0 - 2.0 * (i + 0.5) / 1000.0, turn = 2.4 * i, r = std::sqrt(1.0 - z * z);
    const Eigen::Vector3d normal(r * std::cos(turn), r * std::sin(turn), z);
    const auto two =
        octahedral({static_cast<float>(normal.x()), static_cast<float>(normal.y()), static_cast<float>(normal.z())});
    Eigen::Vector3d back(two[0] / 127.0, two[1] / 127.0, 0.0);
    back.z() = 1.0 - std::abs(back.x()) - std::abs(back.y());
    const double fold = std::max(-back.z(), 0.0);
    back.x() += back.x() >= 0.0 ? -fold : fold;
    back.y() += back.y() >= 0.0 ? -fold : fold;
    CHECK((back.normalized() - normal).norm() < 0.02);
  }
}
