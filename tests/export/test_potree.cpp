// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <tuple>

#include <catch2/catch.hpp>

#include <nlohmann/json.hpp>

#include "export/octree.h"
#include "export/sample_points.h"
#include "pmsp/error.h"
#include "pmsp/io/cloud.h"
#include "support/sanitized.h"
#include "support/temp_dir.h"

using namespace pmsp;
using namespace pmsp_test;

namespace fs = std::filesystem;

namespace {

/// A cloud as Potree's OctreeLoader and DecoderWorker (2.0) read it.
struct Cloud {
  struct Node {
    std::string name;
    Eigen::Vector3d low, high;
    std::uint64_t first = 0, bytes = 0;
    std::uint32_t points = 0;
  };

  explicit Cloud(const fs::path& folder)
      : metadata(nlohmann::json::parse(read_text(folder / "metadata.json"))), points(read_text(folder / "octree.bin")) {
    REQUIRE(metadata["version"] == "2.0");
    REQUIRE(metadata["encoding"] == "DEFAULT");
    for (const auto& attribute : metadata["attributes"]) {
      CHECK(attribute["size"].get<int>() == attribute["numElements"].get<int>() * attribute["elementSize"].get<int>());
      at[attribute["name"]] = record;
      record += attribute["size"].get<std::size_t>();
    }
    const std::string hierarchy = read_text(folder / "hierarchy.bin");
    CHECK(hierarchy.size() == metadata["hierarchy"]["firstChunkSize"].get<std::size_t>());
    REQUIRE(hierarchy.size() % 22 == 0);
    nodes.push_back({"r", vector(metadata["boundingBox"]["min"]), vector(metadata["boundingBox"]["max"])});
    for (std::size_t i = 0; i < hierarchy.size() / 22; ++i) {
      REQUIRE(i < nodes.size());
      const auto type = number_at<std::uint8_t>(hierarchy, 22 * i);
      const auto mask = number_at<std::uint8_t>(hierarchy, 22 * i + 1);
      CHECK(type == (mask == 0 ? 1 : 0));
      nodes[i].points = number_at<std::uint32_t>(hierarchy, 22 * i + 2);
      nodes[i].first = number_at<std::uint64_t>(hierarchy, 22 * i + 6);
      nodes[i].bytes = number_at<std::uint64_t>(hierarchy, 22 * i + 14);
      REQUIRE(nodes[i].bytes == nodes[i].points * record);
      REQUIRE(nodes[i].first + nodes[i].bytes <= points.size());
      for (unsigned k = 0; k < 8; ++k) {
        if ((mask >> k & 1U) == 0) continue;
        Node child{nodes[i].name + std::to_string(k), nodes[i].low, nodes[i].high};
        const Eigen::Vector3d middle = 0.5 * (child.low + child.high);
        for (unsigned axis = 0; axis < 3; ++axis) {
          const bool is_upper = (k >> (2 - axis) & 1U) != 0;
          (is_upper ? child.low : child.high)[static_cast<int>(axis)] = middle[static_cast<int>(axis)];
        }
        nodes.push_back(child);
      }
    }
    CHECK(nodes.size() == hierarchy.size() / 22);
  }

  static Eigen::Vector3d vector(const nlohmann::json& json) {
    return {json[0].get<double>(), json[1].get<double>(), json[2].get<double>()};
  }
  template <class T>
  T get(const Node& node, std::size_t i, const char* attribute, std::size_t element = 0) const {
    return number_at<T>(points, node.first + i * record + at.at(attribute) + element * sizeof(T));
  }
  Eigen::Vector3d position(const Node& node, std::size_t i) const {
    Eigen::Vector3d p;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      p[static_cast<int>(axis)] = get<std::int32_t>(node, i, "position", axis) * metadata["scale"][axis].get<double>() +
                                  metadata["offset"][axis].get<double>();
    }
    return p;
  }

  nlohmann::json metadata;
  std::string points;
  std::size_t record = 0;
  std::map<std::string, std::size_t> at;
  std::vector<Node> nodes;
};

void write(const fs::path& path, const std::vector<OutputPoint>& points, std::size_t each = 1 << 20) {
  CloudHeader header = sample_header();
  const TempDir scratch;
  header.scratch = scratch.path();
  const auto writer = find_cloud_format("potree")->open(path, header);
  for (std::size_t i = 0; i < points.size(); i += each) {
    writer->add(points.data() + i, std::min(each, points.size() - i));
  }
  writer->finish();
  CHECK(scratch.entries() == 0);
}

std::vector<OctreePoint> octree_points(std::size_t count, std::int32_t extent) {
  std::vector<OctreePoint> points(count);
  std::uint64_t state = 7;
  for (OctreePoint& p : points) {
    for (std::int32_t& x : p.position) {
      state = state * 6364136223846793005U + 1442695040888963407U;
      x = static_cast<std::int32_t>((state >> 33) % static_cast<std::uint64_t>(extent)) - extent / 3;
    }
    p.confidence = static_cast<float>(state >> 40) / 16777216.0F;
    p.normal = {0.0F, 0.0F, 1.0F};
    p.color = {1, 2, 3};
    p.views = 4;
  }
  return points;
}

}  // namespace

TEST_CASE("a Potree cloud holds each point once in a node whose cube contains it") {
  const TempDir dir;
  const std::vector<OutputPoint> given = sample_points(120000);
  write(dir / "p", given);
  const Cloud cloud(dir / "p");
  CHECK(cloud.metadata["points"] == given.size());
  CHECK(cloud.points.size() == given.size() * cloud.record);
  CHECK(cloud.nodes.size() > 9);
  const Eigen::Vector3d size = cloud.nodes[0].high - cloud.nodes[0].low;
  CHECK((size.array() - size.x()).abs().maxCoeff() < 1e-9);
  CHECK(cloud.metadata["spacing"].get<double>() == Approx(size.x() / 128.0));
  std::map<std::tuple<float, float, float>, const OutputPoint*> by_normal;
  for (const OutputPoint& p : given) by_normal[{p.normal.x(), p.normal.y(), p.normal.z()}] = &p;
  REQUIRE(by_normal.size() == given.size());
  std::set<const OutputPoint*> seen;
  std::size_t wrong = 0;
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e9), high = -low;
  for (const Cloud::Node& node : cloud.nodes) {
    for (std::size_t i = 0; i < node.points; ++i) {
      const Eigen::Vector3d p = cloud.position(node, i);
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
      const OutputPoint& from =
          *by_normal.at({cloud.get<float>(node, i, "NormalX"), cloud.get<float>(node, i, "NormalY"),
                         cloud.get<float>(node, i, "NormalZ")});
      seen.insert(&from);
      wrong += (p - from.position).cwiseAbs().maxCoeff() > 0.51e-5;
      wrong += (p.array() < node.low.array() - 1e-9).any() || (p.array() > node.high.array() + 1e-9).any();
      wrong += cloud.get<std::uint16_t>(node, i, "rgb", 1) != from.color.g * 257;
      wrong += cloud.get<float>(node, i, "confidence") != from.confidence;
      wrong += cloud.get<std::uint8_t>(node, i, "views") != from.views;
    }
  }
  CHECK(wrong == 0);
  CHECK(seen.size() == given.size());
  CHECK((Cloud::vector(cloud.metadata["attributes"][0]["min"]) - low).norm() < 1e-9);
  CHECK((Cloud::vector(cloud.metadata["attributes"][0]["max"]) - high).norm() < 1e-9);
}

TEST_CASE("the bytes of a Potree cloud do not depend on the chunks of its points") {
  const TempDir dir;
  const std::vector<OutputPoint> points = sample_points(50000);
  write(dir / "a", points);
  write(dir / "b", points, 777);
  for (const char* name : {"hierarchy.bin", "octree.bin"}) {
    CHECK(read_text(dir / "a" / name) == read_text(dir / "b" / name));
  }
}

TEST_CASE("Potree clouds of no point, of one, and of many in one place") {
  const TempDir dir;
  write(dir / "none", {});
  CHECK(Cloud(dir / "none").nodes.size() == 1);
  write(dir / "one", sample_points(1));
  const Cloud one(dir / "one");
  CHECK(one.nodes.size() == 1);
  CHECK((one.position(one.nodes[0], 0) - sample_points(1)[0].position).norm() < 1e-4);
  write(dir / "same", std::vector<OutputPoint>(40000, sample_points(1)[0]));
  const Cloud same(dir / "same");
  std::size_t count = 0;
  for (const Cloud::Node& node : same.nodes) count += node.points;
  CHECK(count == 40000);
}

TEST_CASE("an aborted Potree writer or one with a point out of range leaves no directory") {
  const TempDir dir;
  std::vector<OutputPoint> points = sample_points(100);
  CloudHeader header = sample_header();
  header.scratch = dir.path();
  find_cloud_format("potree")->open(dir / "p", header)->add(points.data(), points.size());
  points[0].position.x() = 1e9;
  CHECK_THROWS_WITH(find_cloud_format("potree")->open(dir / "p", header)->add(points.data(), 1),
                    Catch::Contains("out of range"));
  CHECK(dir.entries() == 0);
}

TEST_CASE("a partially replaced Potree cloud is invalid") {
  const TempDir dir;
  write(dir / "p", sample_points(100));
  fs::remove(dir / "p" / "hierarchy.bin");
  fs::create_directory(dir / "p" / "hierarchy.bin");  // it cannot be replaced
  CHECK_THROWS_AS(write(dir / "p", sample_points(50)), OutputError);
  CHECK_FALSE(fs::exists(dir / "p" / "metadata.json"));
}

TEST_CASE("an octree larger than memory is split into cells recursively") {
  const TempDir scratch;
  const std::size_t count = pmsp::test::kSanitized ? 1100000 : 2500000;
  const std::vector<OctreePoint> points = octree_points(count, 1 << 20);
  const double cell_steps = GENERATE(1 << 17, 1 << 22);  // small cells; a single one, which is split again
  Octree octree(scratch.path().string(), cell_steps);
  for (const OctreePoint& p : points) octree.add(p);
  std::vector<OctreePoint> out;
  octree.build([&](const OctreePoint* some, std::size_t number) { out.insert(out.end(), some, some + number); });
  REQUIRE(out.size() == count);
  const auto sums = [](const std::vector<OctreePoint>& all) {
    std::array<std::int64_t, 4> sum{};
    for (const OctreePoint& p : all) {
      for (std::size_t i = 0; i < 3; ++i) sum[i] += p.position[i];
      sum[3] += std::int64_t{p.position[0]} * p.position[1] % 1000003;
    }
    return sum;
  };
  CHECK(sums(out) == sums(points));
  // From the root down: each point lies in its node, and no inner node has two in one cell.
  struct Place {
    std::size_t node;
    std::array<std::int64_t, 3> low;
  };
  std::vector<Place> open{{octree.root(), {octree.corner()[0], octree.corner()[1], octree.corner()[2]}}};
  std::size_t wrong = 0, total = 0, most = 0;
  while (!open.empty()) {
    const Place at = open.back();
    open.pop_back();
    const OctreeNode& node = octree.nodes()[at.node];
    const std::int64_t side = octree.side() >> node.level;
    const std::int64_t cell = std::max<std::int64_t>(side >> Octree::kCellBits, 1);
    std::set<std::array<std::int64_t, 3>> taken;
    for (std::uint64_t i = node.first; i < node.first + node.points; ++i) {
      std::array<std::int64_t, 3> steps{};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        steps[axis] = out[i].position[axis] - at.low[axis];
        wrong += steps[axis] < 0 || steps[axis] >= side;
        steps[axis] /= cell;
      }
      if (!node.is_leaf()) wrong += taken.insert(steps).second ? 0 : 1;
    }
    total += node.points;
    if (node.is_leaf()) most = std::max<std::size_t>(most, node.points);
    for (std::size_t k = 0; k < 8; ++k) {
      if (node.children[k] < 0) continue;
      Place child{static_cast<std::size_t>(node.children[k]), at.low};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if ((k >> (2 - axis) & 1U) != 0) child.low[axis] += side / 2;
      }
      open.push_back(child);
    }
  }
  CHECK(wrong == 0);
  CHECK(total == count);
  CHECK(most <= 1 << 14);
  CHECK(scratch.entries() == 0);
}
