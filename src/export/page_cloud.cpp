// SPDX-License-Identifier: BSD-2-Clause
#include "export/page_cloud.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "export/integer_frame.h"
#include "export/little_endian.h"
#include "export/octree.h"
#include "export/spool.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

constexpr std::uint32_t kNoKeyframe = 65535;

std::uint8_t byte_of(float share) {
  return static_cast<std::uint8_t>(std::lround(255.0F * std::clamp(share, 0.0F, 1.0F)));
}

}  // namespace

struct PageCloud::Impl {
  Impl(const CloudHeader& header, std::int64_t most_points, const std::vector<std::int64_t>& keyframes);
  void add(const OutputPoint* points, std::size_t count);
  void finish();
  std::vector<std::uint32_t> shares() const;
  void put(const OctreePoint* points, std::size_t count, std::uint32_t share, PageNode& node) const;

  IntegerFrame frame_;
  std::int64_t most_points_;
  std::map<std::int64_t, std::uint32_t> places_;
  Octree octree_;
  std::string scratch_;
  std::array<std::int64_t, 10> confidences_{};
  std::int64_t points_ = 0;
  std::vector<PageNode> nodes_;
};

PageCloud::Impl::Impl(const CloudHeader& header, std::int64_t most_points, const std::vector<std::int64_t>& keyframes)
    : frame_(integer_frame(header)),
      most_points_(std::clamp<std::int64_t>(most_points, 0, kMostPoints)),
      octree_(header.scratch.string(), header.reach / frame_.scale),
      scratch_(header.scratch.string()) {
  for (const std::int64_t id : keyframes) {
    if (places_.size() < kNoKeyframe) places_.emplace(id, static_cast<std::uint32_t>(places_.size()));
  }
}

void PageCloud::Impl::add(const OutputPoint* points, std::size_t count) {
  for (const OutputPoint* point = points; point != points + count; ++point) {
    OctreePoint it;
    if (!to_octree_point(*point, frame_, it)) {
      throw OutputError("point " + std::to_string(point->position.x()) + " " + std::to_string(point->position.y()) +
                        " " + std::to_string(point->position.z()) +
                        " is out of range for the report; exclude it with --crop");
    }
    const auto place = places_.find(point->keyframe_id);
    it.tag = place != places_.end() ? place->second : kNoKeyframe;
    octree_.add(it);
    ++confidences_[static_cast<std::size_t>(std::clamp(10.0F * point->confidence, 0.0F, 9.0F))];
  }
}

void PageCloud::Impl::finish() {
  Spool<OctreePoint> all(scratch_, 1);
  octree_.build([&all](const OctreePoint* points, std::size_t count) {
    for (const OctreePoint* point = points; point != points + count; ++point) all.add(0, *point);
  });
  std::vector<std::size_t> by_first;  // nodes with points, in order of emission
  for (std::size_t i = 0; i < octree_.nodes().size(); ++i) {
    if (octree_.nodes()[i].points > 0) by_first.push_back(i);
  }
  std::sort(by_first.begin(), by_first.end(),
            [this](std::size_t a, std::size_t b) { return octree_.nodes()[a].first < octree_.nodes()[b].first; });
  // Corners of cubes, from those of their parents.
  std::vector<std::array<std::int64_t, 3>> corners(octree_.nodes().size());
  std::vector<std::size_t> order{octree_.root()};
  for (std::size_t i = 0; i < 3; ++i) corners[octree_.root()][i] = octree_.corner()[i];
  for (std::size_t at = 0; at < order.size(); ++at) {
    const OctreeNode& node = octree_.nodes()[order[at]];
    for (std::size_t k = 0; k < 8; ++k) {
      if (node.children[k] < 0) continue;
      const auto child = static_cast<std::size_t>(node.children[k]);
      order.push_back(child);
      for (std::size_t i = 0; i < 3; ++i) {
        const std::int64_t half = octree_.side() >> (node.level + 1);
        corners[child][i] = corners[order[at]][i] + ((k >> (2 - i) & 1U) != 0 ? half : 0);
      }
    }
  }
  const std::vector<std::uint32_t> share_of_level = shares();
  std::vector<OctreePoint> waiting;
  std::size_t next = 0;
  all.read(0, [&](const OctreePoint* points, std::size_t count) {
    waiting.insert(waiting.end(), points, points + count);
    std::size_t done = 0;
    for (; next < by_first.size(); ++next) {
      const OctreeNode& from = octree_.nodes()[by_first[next]];
      if (waiting.size() - done < from.points) break;
      PageNode node;
      node.level = from.level;
      node.side = std::ldexp(static_cast<double>(octree_.side()), -from.level) * frame_.scale;
      for (std::size_t i = 0; i < 3; ++i) {
        node.corner[i] = static_cast<double>(corners[by_first[next]][i]) * frame_.scale;
      }
      put(waiting.data() + done, from.points, share_of_level[static_cast<std::size_t>(from.level)], node);
      done += from.points;
      points_ += node.points;
      if (node.points > 0) nodes_.push_back(std::move(node));
    }
    waiting.erase(waiting.begin(), waiting.begin() + static_cast<std::ptrdiff_t>(done));
  });
  std::stable_sort(nodes_.begin(), nodes_.end(),
                   [](const PageNode& a, const PageNode& b) { return a.level < b.level; });
}

/// Share of the points of each level that the page contains [1/65536].
std::vector<std::uint32_t> PageCloud::Impl::shares() const {
  std::vector<std::int64_t> of_level(33, 0);
  for (const OctreeNode& node : octree_.nodes()) of_level[static_cast<std::size_t>(node.level)] += node.points;
  std::vector<std::uint32_t> shares;
  std::int64_t left = most_points_;
  for (const std::int64_t count : of_level) {
    shares.push_back(count <= left ? 65536U : static_cast<std::uint32_t>(left * 65536 / count));
    left -= std::min(left, count);
  }
  return shares;
}

/// Takes an even share of a node's points, which are in the order of the cubes below.
void PageCloud::Impl::put(const OctreePoint* points, std::size_t count, std::uint32_t share, PageNode& node) const {
  const auto taken_before = [share](std::size_t number) { return number * share >> 16U; };
  std::vector<const OctreePoint*> taken;
  for (std::size_t i = 0; i < count; ++i) {
    if (taken_before(i + 1) > taken_before(i)) taken.push_back(points + i);
  }
  node.points = static_cast<std::uint32_t>(taken.size());
  node.bytes.reserve(taken.size() * kPointBytes);
  for (const OctreePoint* point : taken) {
    for (std::size_t i = 0; i < 3; ++i) {
      const double share_of_side = (point->position[i] - node.corner[i] / frame_.scale) * frame_.scale / node.side;
      append_little(node.bytes, static_cast<std::uint16_t>(std::lround(65535.0 * std::clamp(share_of_side, 0.0, 1.0))));
    }
  }
  for (const OctreePoint* point : taken) {
    for (const std::uint8_t value : point->color) append_little(node.bytes, value);
  }
  for (const OctreePoint* point : taken) append_little(node.bytes, byte_of(point->confidence));
  for (const OctreePoint* point : taken) append_little(node.bytes, point->views);
  for (const OctreePoint* point : taken) {
    for (const std::int8_t value : octahedral(point->normal)) append_little(node.bytes, value);
  }
  for (const OctreePoint* point : taken) append_little(node.bytes, static_cast<std::uint16_t>(point->tag));
}

PageCloud::PageCloud(const CloudHeader& header, std::int64_t most_points, const std::vector<std::int64_t>& keyframes)
    : impl_(std::make_unique<Impl>(header, most_points, keyframes)) {}

PageCloud::~PageCloud() = default;

void PageCloud::add(const OutputPoint* points, std::size_t count) { impl_->add(points, count); }
void PageCloud::finish() { impl_->finish(); }

std::int64_t PageCloud::points_in() const { return impl_->octree_.points(); }
const std::array<std::int64_t, 10>& PageCloud::confidences() const { return impl_->confidences_; }
const Eigen::Vector3d& PageCloud::origin() const { return impl_->frame_.offset; }
std::int64_t PageCloud::points() const { return impl_->points_; }
const std::vector<PageNode>& PageCloud::nodes() const { return impl_->nodes_; }

std::array<std::int8_t, 2> octahedral(const std::array<float, 3>& normal) {
  const float length = std::abs(normal[0]) + std::abs(normal[1]) + std::abs(normal[2]);
  if (!(length > 0.0F)) return {0, 0};
  float u = normal[0] / length, v = normal[1] / length;
  if (normal[2] < 0.0F) {
    const float folded = (1.0F - std::abs(v)) * (u < 0.0F ? -1.0F : 1.0F);
    v = (1.0F - std::abs(u)) * (v < 0.0F ? -1.0F : 1.0F);
    u = folded;
  }
  return {static_cast<std::int8_t>(std::lround(127.0F * u)), static_cast<std::int8_t>(std::lround(127.0F * v))};
}

void append_base64(std::string& text, const std::string& bytes) {
  constexpr char kLetters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  text.reserve(text.size() + (bytes.size() + 2) / 3 * 4);
  for (std::size_t at = 0; at < bytes.size(); at += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - at);
    std::uint32_t bits = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      bits = bits << 8U | (i < count ? static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[at + i])) : 0U);
    }
    for (std::size_t i = 0; i < 4; ++i) {
      text += i <= count ? kLetters[bits >> (18U - 6U * static_cast<unsigned>(i)) & 63U] : '=';
    }
  }
}

}  // namespace pmsp
