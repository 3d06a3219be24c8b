// SPDX-License-Identifier: BSD-2-Clause
// Potree 2: metadata.json, hierarchy.bin, octree.bin with encoding DEFAULT (uncompressed).
#include <algorithm>
#include <string>

#include <nlohmann/json.hpp>

#include "export/atomic_folder.h"
#include "export/background_file.h"
#include "export/files.h"
#include "export/integer_frame.h"
#include "export/little_endian.h"
#include "export/octree.h"
#include "pmsp/error.h"
#include "pmsp/io/cloud.h"

namespace pmsp {

bool is_potree_name(const std::string& name) {
  return name == "metadata.json" || name == "hierarchy.bin" || name == "octree.bin";
}

namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kPotreePointBytes = 12 + 6 + 12 + 4 + 1;
constexpr std::size_t kBlockBytes = std::size_t{1} << 20;
constexpr std::uint8_t kNode = 0, kLeaf = 1;  // node types in hierarchy.bin
constexpr double kCellsAlongRoot = 1 << Octree::kCellBits;

char* put_point(char* to, const OctreePoint& point) {
  for (const std::int32_t value : point.position) to = put_little(to, value);
  for (const std::uint8_t value : point.color) to = put_little(to, static_cast<std::uint16_t>(value * 257));
  for (const float value : point.normal) to = put_little(to, value);
  to = put_little(to, point.confidence);
  return put_little(to, point.views);
}

Json attribute(const char* name, const char* type, int elements, int bytes, const Json& low, const Json& high) {
  return {{"name", name},
          {"description", ""},
          {"size", elements * bytes},
          {"numElements", elements},
          {"elementSize", bytes},
          {"type", type},
          {"min", low},
          {"max", high}};
}

class Potree final : public CloudWriter {
 public:
  Potree(const std::filesystem::path& path, const CloudHeader& header)
      : folder_(path, is_potree_name),
        header_(header),
        frame_(integer_frame(header)),
        octree_(header.scratch.string(), header.reach / frame_.scale) {}

  void add(const OutputPoint* points, std::size_t count) override {
    for (const OutputPoint* point = points; point != points + count; ++point) {
      OctreePoint it;
      if (!to_octree_point(*point, frame_, it)) refuse(*point);
      most_confidence_ = std::max(most_confidence_, it.confidence);
      most_views_ = std::max(most_views_, it.views);
      octree_.add(it);
    }
  }

  void finish() override {
    BackgroundFile file(folder_ / "octree.bin");
    BackgroundFile::Block block;
    octree_.build([&](const OctreePoint* points, std::size_t count) {
      std::size_t at = block.size();
      block.resize(at + count * kPotreePointBytes);
      char* to = block.data() + at;
      for (const OctreePoint* point = points; point != points + count; ++point) to = put_point(to, *point);
      if (block.size() < kBlockBytes) return;
      file.write(std::move(block));
      block = file.block();
      block.clear();
    });
    file.write(std::move(block));
    const std::string nodes = hierarchy();
    file.commit();
    write_file(folder_ / "hierarchy.bin", nodes);
    write_file(folder_ / "metadata.json", metadata(nodes.size()).dump(1) + "\n");
    folder_.commit();
  }

 private:
  [[noreturn]] void refuse(const OutputPoint& point) const {
    throw OutputError(folder_.target().string() + ": point " + std::to_string(point.position.x()) + " " +
                      std::to_string(point.position.y()) + " " + std::to_string(point.position.z()) +
                      " is out of range for the resolution; give a larger --resolution, or exclude it with --crop");
  }

  /// All nodes in one chunk, breadth first: 22 bytes each.
  std::string hierarchy() const {
    std::vector<std::size_t> order{octree_.root()};
    std::string text;
    for (std::size_t i = 0; i < order.size(); ++i) {
      const OctreeNode& node = octree_.nodes()[order[i]];
      std::uint8_t mask = 0;
      for (std::size_t k = 0; k < 8; ++k) {
        if (node.children[k] < 0) continue;
        mask = static_cast<std::uint8_t>(mask | 1U << k);
        order.push_back(static_cast<std::size_t>(node.children[k]));
      }
      append_little(text, node.is_leaf() ? kLeaf : kNode);
      append_little(text, mask);
      append_little(text, node.points);
      append_little(text, node.first * kPotreePointBytes);
      append_little(text, node.points * std::uint64_t{kPotreePointBytes});
    }
    return text;
  }

  Json metadata(std::size_t hierarchy_bytes) const {
    Json low = Json::array(), high = Json::array(), box_low = Json::array(), box_high = Json::array();
    for (int i = 0; i < 3; ++i) {
      const auto axis = static_cast<std::size_t>(i);
      const bool is_empty = octree_.points() == 0;
      const double first = is_empty ? 0.0 : octree_.low()[axis];
      low.push_back(frame_.coordinate(first, i));
      high.push_back(frame_.coordinate(is_empty ? 0.0 : octree_.high()[axis], i));
      const double corner = octree_.corner()[axis];
      box_low.push_back(frame_.coordinate(corner, i));
      box_high.push_back(frame_.coordinate(corner + static_cast<double>(octree_.side()), i));
    }
    int depth = 0;
    for (const OctreeNode& node : octree_.nodes()) depth = std::max(depth, node.level);
    Json json{{"version", "2.0"},
              {"name", "cloud"},
              {"description", ""},
              {"points", octree_.points()},
              {"projection", header_.wkt},
              {"hierarchy", {{"firstChunkSize", hierarchy_bytes}, {"stepSize", 4}, {"depth", depth}}},
              {"offset", {frame_.offset.x(), frame_.offset.y(), frame_.offset.z()}},
              {"scale", {frame_.scale, frame_.scale, frame_.scale}},
              {"spacing", static_cast<double>(octree_.side()) * frame_.scale / kCellsAlongRoot},
              {"boundingBox", {{"min", box_low}, {"max", box_high}}},
              {"encoding", "DEFAULT"}};
    json["attributes"] = {attribute("position", "int32", 3, 4, low, high),
                          attribute("rgb", "uint16", 3, 2, {0, 0, 0}, {65535, 65535, 65535}),
                          attribute("NormalX", "float", 1, 4, {-1.0}, {1.0}),
                          attribute("NormalY", "float", 1, 4, {-1.0}, {1.0}),
                          attribute("NormalZ", "float", 1, 4, {-1.0}, {1.0}),
                          attribute("confidence", "float", 1, 4, {0.0}, {most_confidence_}),
                          attribute("views", "uint8", 1, 1, {0}, {most_views_})};
    json["generator"] = header_.generator;
    json["comments"] = header_.comments;
    return json;
  }

  AtomicFolder folder_;
  CloudHeader header_;
  IntegerFrame frame_;
  Octree octree_;
  float most_confidence_ = 0.0F;
  std::uint8_t most_views_ = 0;
};

}  // namespace

std::unique_ptr<CloudWriter> open_potree(const std::filesystem::path& path, const CloudHeader& header) {
  return std::make_unique<Potree>(path, header);
}

}  // namespace pmsp
