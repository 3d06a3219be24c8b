// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <catch2/catch.hpp>

#include <Eigen/Geometry>

#include "export/sample_points.h"
#include "pmsp/error.h"
#include "pmsp/io/cloud.h"
#include "support/temp_dir.h"

using namespace pmsp;
using namespace pmsp_test;
using Catch::Contains;

namespace {

/// A splat as viewers read it: activations applied.
struct Gaussian {
  Eigen::Vector3f position, normal, color, scale;
  Eigen::Quaternionf rotation;
  float opacity;
};

/// Reads the PLY of 3DGS with the order of properties that its readers expect.
std::vector<Gaussian> read_splats(const std::filesystem::path& path) {
  const std::string text = read_text(path);
  std::string properties;
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0",
                           "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) {
    properties += std::string("property float ") + name + "\n";
  }
  REQUIRE(text.rfind("ply\nformat binary_little_endian 1.0\n", 0) == 0);
  const std::string element = "\nelement vertex ";
  const std::size_t count_at = text.find(element) + element.size(), begin = text.find('\n', count_at) + 1;
  REQUIRE(text.compare(begin, properties.size() + 11, properties + "end_header\n") == 0);
  const std::size_t count = std::stoul(text.substr(count_at)), body = begin + properties.size() + 11;
  REQUIRE(text.size() == body + count * 68);
  std::vector<Gaussian> splats(count);
  for (std::size_t i = 0; i < count; ++i) {
    std::array<float, 17> v{};
    for (std::size_t k = 0; k < v.size(); ++k) v[k] = number_at<float>(text, body + 68 * i + 4 * k);
    Gaussian& it = splats[i];
    it.position = {v[0], v[1], v[2]};
    it.normal = {v[3], v[4], v[5]};
    for (int c = 0; c < 3; ++c) it.color[c] = 0.5F + 0.28209479F * v[static_cast<std::size_t>(6 + c)];
    it.opacity = 1.0F / (1.0F + std::exp(-v[9]));
    it.scale = Eigen::Vector3f(v[10], v[11], v[12]).array().exp();
    it.rotation = Eigen::Quaternionf(v[13], v[14], v[15], v[16]);
  }
  return splats;
}

std::vector<Gaussian> written(const std::vector<OutputPoint>& points) {
  const TempDir dir, scratch;
  CloudHeader header;
  header.reach = 20.0;
  header.scratch = scratch.path();
  CloudOutput output(dir / "c.splat.ply", header);
  output.add(points.data(), points.size(), {});
  output.commit();
  CHECK(scratch.entries() == 0);
  return read_splats(dir / "c.splat.ply");
}

/// Points of a plane through the origin on a grid with the given steps.
std::vector<OutputPoint> plane(int side, double across, double along, const Eigen::Matrix3d& rotation) {
  std::vector<OutputPoint> points;
  for (int i = 0; i < side * side; ++i) {
    OutputPoint point;
    point.position = rotation * Eigen::Vector3d(across * (i % side - side / 2), along * (i / side - side / 2), 0.0);
    point.normal = rotation.col(2).cast<float>();
    point.confidence = 0.9F;
    points.push_back(point);
  }
  return points;
}

/// Share of what is behind a place that shows through the splats.
double transmittance(const std::vector<Gaussian>& splats, const Eigen::Vector3f& place) {
  double share = 1.0;
  for (const Gaussian& it : splats) {
    const Eigen::Vector3f at = (it.rotation.conjugate() * (place - it.position)).cwiseQuotient(it.scale);
    share *= 1.0 - it.opacity * std::exp(-0.5 * at.squaredNorm());
  }
  return share;
}

const Eigen::Matrix3d kTilted = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -0.5).normalized()).toRotationMatrix();

}  // namespace

TEST_CASE("a splat has the colour and confidence of its point and its axis along the normal") {
  std::vector<OutputPoint> points = sample_points(3000);
  for (OutputPoint& point : points) point.position -= Eigen::Vector3d(1000.0, -500.0, 30.0);
  points[0].normal = {0.0F, 0.0F, -1.0F};
  points[1].normal.setZero();
  points[2].confidence = 0.0F;  // unknown
  points[3].confidence = 1.0F;
  const std::vector<Gaussian> splats = written(points);
  REQUIRE(splats.size() == points.size());
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const OutputPoint& point = points[i];
    const Gaussian& it = splats[i];
    wrong += it.position != point.position.cast<float>() || it.normal != point.normal;
    const Eigen::Vector3f color(point.color.r, point.color.g, point.color.b);
    wrong += (255.0F * it.color - color).cwiseAbs().maxCoeff() > 0.01F;
    const float lacks = point.confidence > 0.0F ? 1.0F - point.confidence : 0.0F;
    const float opacity = std::min(std::max(1.0F - lacks * lacks, 0.05F), 0.99F);
    wrong += std::abs(it.opacity - opacity) > 1e-4F;
    wrong += std::abs(it.rotation.norm() - 1.0F) > 1e-5F;
    if (i == 1) continue;
    wrong += (it.rotation * Eigen::Vector3f::UnitZ() - point.normal).norm() > 1e-3F;
    wrong += it.scale.x() != it.scale.y() || it.scale.z() > 0.2F * it.scale.x();
  }
  CHECK(wrong == 0);
  CHECK(splats[1].scale.isConstant(splats[1].scale.x()));  // a sphere where there is no normal
}

TEST_CASE("splats of a surface leave no holes and stay thin") {
  for (const double stretch : {1.0, 3.0}) {  // as where a floor is seen at a shallow angle
    CAPTURE(stretch);
    const std::vector<Gaussian> splats = written(plane(24, 0.1, 0.1 * stretch, kTilted));
    const Eigen::Matrix3f to_place = kTilted.cast<float>();
    double most = 0.0;
    for (int i = 0; i < 400; ++i) {
      const float x = 0.01F * static_cast<float>(i % 20),
                  y = 0.01F * static_cast<float>(stretch) * static_cast<float>(i / 20);
      most = std::max(most, transmittance(splats, to_place * Eigen::Vector3f(x, y, 0.0F)));
    }
    CHECK(most < 0.1);
    const float spacing = 0.1F * static_cast<float>(std::sqrt(stretch));
    for (const Gaussian& it : splats) {
      if (it.position.norm() > 0.5F) continue;
      CHECK(it.scale.x() == Approx(0.75F * spacing).epsilon(0.2));
      CHECK(transmittance({it}, it.position + spacing * it.normal) > 0.999);
    }
  }
}

TEST_CASE("a splat away from the others is not larger than its surroundings explain") {
  std::vector<OutputPoint> points = plane(20, 0.1, 0.1, kTilted);
  points.push_back(points.front());
  points.back().position = 7.0 * kTilted.col(2);
  points.push_back(points.front());
  points.push_back(points.front());  // coincident points
  for (int i = 0; i < 3; ++i) {      // far from all and from each other
    points.push_back(points.front());
    points.back().position = Eigen::Vector3d(10.0, 3.0 * i, -12.0);
  }
  const std::vector<Gaussian> splats = written(points);
  for (const std::size_t stray : {400, 403, 404, 405}) CHECK(splats[stray].scale.x() < 0.8F);
  for (const Gaussian& it : splats) CHECK((it.scale.allFinite() && it.scale.minCoeff() > 0.0F));
  CHECK(written({points.front()}).size() == 1);
  CHECK(written({}).empty());
}

TEST_CASE("splats of a cloud that exceeds memory are complete and of equal sizes") {
  constexpr int kSide = 1100;
  const std::vector<OutputPoint> points = plane(kSide, 0.01, 0.01, Eigen::Matrix3d::Identity());
  const std::vector<Gaussian> splats = written(points);
  REQUIRE(splats.size() == points.size());
  std::vector<char> seen(points.size(), 0);
  std::size_t wrong = 0;
  float least = 1.0F, most = 0.0F;
  for (const Gaussian& it : splats) {
    const long column = std::lround(it.position.x() / 0.01F) + kSide / 2,
               row = std::lround(it.position.y() / 0.01F) + kSide / 2;
    char& place = seen.at(static_cast<std::size_t>(row * kSide + column));
    wrong += place != 0;
    place = 1;
    if (std::min({column, row, kSide - 1 - column, kSide - 1 - row}) < 3) continue;
    least = std::min(least, it.scale.x());
    most = std::max(most, it.scale.x());
  }
  CHECK(wrong == 0);
  CHECK(most < 1.6F * least);
}

TEST_CASE("splats too far from the origin for floats are refused") {
  const TempDir dir;
  CloudHeader header;
  header.reach = 50.0;
  header.center = {400000.0, 5000000.0, 80.0};  // as in UTM
  CHECK_THROWS_WITH(CloudOutput(dir / "c.splat.ply", header), Contains("c.splat.ply") && Contains("--transform"));
  CHECK(dir.entries() == 0);
}

TEST_CASE("the longest extension determines the format") {
  CHECK(cloud_format_of("a/cloud.splat.ply") == find_cloud_format("splat"));
  CHECK(cloud_format_of("a/CLOUD.SPLAT.PLY") == find_cloud_format("splat"));
  CHECK(cloud_format_of("splat.ply") == find_cloud_format("ply"));
  CHECK(cloud_format_of("a.b.ply") == find_cloud_format("ply"));
  CHECK(cloud_format_of("a/c.potree/") == find_cloud_format("potree"));
  CHECK(cloud_format_of(".ply") == nullptr);
  CHECK(cloud_format_of("cloud.plyx") == nullptr);
}
