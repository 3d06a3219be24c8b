// SPDX-License-Identifier: BSD-2-Clause
#include "export/octree.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace pmsp {
namespace {

constexpr std::size_t kLeafPoints = 1 << 14;
constexpr std::int64_t kInMemory = 1 << 20;
constexpr int kNearBits = 7;  ///< log2 of the number of cells per axis around the origin with direct lookup
constexpr double kCellsOfReach = 32.0;
constexpr int kCountedLevels = 7;  ///< depth of the counting grid in build_list

/// Spreads the lowest ten bits, with two zeros between each pair.
std::uint32_t spread(std::uint32_t x) {
  x = (x | x << 16) & 0x030000ffU;
  x = (x | x << 8) & 0x0300f00fU;
  x = (x | x << 4) & 0x030c30c3U;
  return (x | x << 2) & 0x09249249U;
}

}  // namespace

bool to_octree_point(const OutputPoint& point, const IntegerFrame& frame, OctreePoint& result) {
  for (int i = 0; i < 3; ++i) {
    const auto axis = static_cast<std::size_t>(i);
    const double steps = frame.steps(point.position[i], i);
    if (!(std::abs(steps) <= std::numeric_limits<std::int32_t>::max())) return false;  // true for NaN
    result.position[axis] = static_cast<std::int32_t>(steps);
    result.normal[axis] = point.normal[i];
  }
  result.confidence = point.confidence;
  result.color = {point.color.r, point.color.g, point.color.b};
  result.views = point.views;
  return true;
}

bool OctreeNode::is_leaf() const {
  return std::all_of(children.begin(), children.end(), [](std::int32_t child) { return child < 0; });
}

Octree::Octree(const std::string& scratch_folder, double reach_steps)
    : folder_(scratch_folder),
      spool_(scratch_folder, 0),
      cell_bits_(std::clamp(static_cast<int>(std::ceil(std::log2(std::max(reach_steps / kCellsOfReach, 1.0)))), 0, 30)),
      near_(std::size_t{1} << (3 * kNearBits), -1) {
  low_.fill(std::numeric_limits<std::int32_t>::max());
  high_.fill(std::numeric_limits<std::int32_t>::min());
}

void Octree::add(const OctreePoint& point) {
  std::array<std::int32_t, 3> key;
  for (std::size_t i = 0; i < 3; ++i) {
    low_[i] = std::min(low_[i], point.position[i]);
    high_[i] = std::max(high_[i], point.position[i]);
    key[i] = point.position[i] >> cell_bits_;
  }
  spool_.add(list_of(key), point);
  ++points_;
}

std::size_t Octree::list_of(const std::array<std::int32_t, 3>& key) {
  constexpr std::int32_t kHalfRange = 1 << (kNearBits - 1);
  bool is_near = true;
  std::size_t number = 0;
  for (const std::int32_t at : key) {
    is_near = is_near && at >= -kHalfRange && at < kHalfRange;
    number = number << kNearBits | (static_cast<std::size_t>(at + kHalfRange) & ((1U << kNearBits) - 1));
  }
  if (is_near && near_[number] >= 0) return static_cast<std::size_t>(near_[number]);
  const auto [found, is_new] = cells_.try_emplace(key, 0);
  if (is_new) found->second = spool_.add_list();
  if (is_near) near_[number] = static_cast<std::int32_t>(found->second);
  return found->second;
}

/// Places the cube of the root at the corner of a cell, so that cells coincide with nodes.
void Octree::place_cube() {
  side_bits_ = cell_bits_;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::int64_t corner = std::int64_t{low_[i] >> cell_bits_} * (std::int64_t{1} << cell_bits_);
    corner_[i] = static_cast<std::int32_t>(corner);
    while (side() < high_[i] - corner + 1) ++side_bits_;
  }
}

void Octree::build(const Take& take) {
  take_ = &take;
  best_.assign(std::size_t{1} << (3 * kCellBits), 0);
  Open top;
  if (points_ > 0) {
    place_cube();
    std::vector<Cell> cells;
    for (const auto& [key, list] : cells_) cells.push_back({key, list});
    top = build_cells(cells, 0);
  } else {
    top = leaf(nullptr, 0, 0);
  }
  root_ = static_cast<std::size_t>(top.node);
  close(top);
  std::vector<std::uint32_t>().swap(best_);
  Points().swap(loaded_);
  Points().swap(spare_);
}

/// Builds a node from cells of the spool.
Octree::Open Octree::build_cells(const std::vector<Cell>& cells, int level) {
  if (cells.empty()) return {};
  std::int64_t count = 0;
  for (const Cell& it : cells) count += spool_.size(it.list);
  const int cell_level = side_bits_ - cell_bits_;
  if (level == cell_level) return build_list(spool_, cells.front().list, level);
  if (count <= kInMemory) {
    loaded_.clear();
    for (const Cell& it : cells) load(spool_, it.list);
    return build_loaded(level);
  }
  std::array<std::vector<Cell>, 8> of_child;
  for (const Cell& it : cells) {
    OctreePoint corner{};
    for (std::size_t i = 0; i < 3; ++i) {
      corner.position[i] = static_cast<std::int32_t>(std::int64_t{it.key[i]} * (std::int64_t{1} << cell_bits_));
    }
    of_child[octant(corner, level)].push_back(it);
  }
  std::array<Open, 8> children;
  for (std::size_t k = 0; k < 8; ++k) children[k] = build_cells(of_child[k], level + 1);
  return join(children, level);
}

/// Child (0 to 7) of the point's node at `level` that contains the point.
unsigned Octree::octant(const OctreePoint& point, int level) const { return cell(point, level, 1); }

/// Index of the point's cell in its node at `level`, divided into 2^bits cells per axis; in octant order, so that the
/// cells of a child are contiguous.
std::uint32_t Octree::cell(const OctreePoint& point, int level, int bits) const {
  const int shift = side_bits_ - level - bits;
  const std::uint32_t mask = (1U << bits) - 1;
  std::uint32_t number = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::uint32_t steps = static_cast<std::uint32_t>(point.position[i]) - static_cast<std::uint32_t>(corner_[i]);
    number = number << 1 | spread(steps >> shift & mask);
  }
  return number;
}

/// Builds a node from points that may exceed memory: counts them on a grid, distributes them to the largest nodes that
/// fit into memory, and builds these one after the other.
Octree::Open Octree::build_list(Spool<OctreePoint>& spool, std::size_t list, int level) {
  if (spool.size(list) <= kInMemory || level >= side_bits_) {
    loaded_.clear();
    load(spool, list);
    return build_loaded(level);
  }
  const int depth = std::min(kCountedLevels, side_bits_ - level);
  std::vector<std::vector<std::uint32_t>> counts(static_cast<std::size_t>(depth) + 1);
  for (int i = 0; i <= depth; ++i) counts[static_cast<std::size_t>(i)].assign(std::size_t{1} << (3 * i), 0);
  std::vector<std::uint32_t>& finest = counts.back();
  spool.read(list, [&](const OctreePoint* some, std::size_t count) {
    for (const OctreePoint* point = some; point != some + count; ++point) ++finest[cell(*point, level, depth)];
  });
  for (std::size_t i = counts.size() - 1; i > 0; --i) {
    for (std::size_t k = 0; k < counts[i].size(); ++k) counts[i - 1][k / 8] += counts[i][k];
  }
  // List for the points of each finest cell.
  std::vector<std::int32_t> list_of(finest.size(), -1);
  std::int32_t lists = 0;
  std::vector<std::pair<int, std::uint32_t>> open{{0, 0}};
  while (!open.empty()) {
    const auto [at, number] = open.back();
    open.pop_back();
    const std::uint32_t count = counts[static_cast<std::size_t>(at)][number];
    if (count == 0) continue;
    if (count > kInMemory && at < depth) {
      for (std::uint32_t k = 8; k > 0; --k) open.emplace_back(at + 1, 8 * number + k - 1);
      continue;
    }
    const std::size_t cells = std::size_t{1} << (3 * (depth - at));
    std::fill_n(list_of.begin() + static_cast<std::ptrdiff_t>(number * cells), cells, lists++);
  }
  Spool<OctreePoint> chunks(folder_, static_cast<std::size_t>(lists));
  spool.read(list, [&](const OctreePoint* some, std::size_t count) {
    for (const OctreePoint* point = some; point != some + count; ++point) {
      chunks.add(static_cast<std::size_t>(list_of[cell(*point, level, depth)]), *point);
    }
  });
  spool.drop(list);
  return build_counted(chunks, counts, 0, depth, 0, list_of, level);
}

/// Builds a node of the counting grid, after distribution.
Octree::Open Octree::build_counted(Spool<OctreePoint>& chunks, const std::vector<std::vector<std::uint32_t>>& counts,
                                   int from, int depth, std::uint32_t number, const std::vector<std::int32_t>& list_of,
                                   int level) {
  const std::uint32_t count = counts[static_cast<std::size_t>(from)][number];
  if (count == 0) return {};
  if (count <= kInMemory || from == depth) {
    const std::size_t first = static_cast<std::size_t>(number) << (3 * (depth - from));
    return build_list(chunks, static_cast<std::size_t>(list_of[first]), level);
  }
  std::array<Open, 8> children;
  for (std::uint32_t k = 0; k < 8; ++k) {
    children[k] = build_counted(chunks, counts, from + 1, depth, 8 * number + k, list_of, level + 1);
  }
  return join(children, level);
}

void Octree::load(Spool<OctreePoint>& spool, std::size_t list) {
  spool.read(list,
             [&](const OctreePoint* some, std::size_t count) { loaded_.insert(loaded_.end(), some, some + count); });
  spool.drop(list);
}

Octree::Open Octree::build_loaded(int level) {
  if (spare_.size() < loaded_.size()) spare_.resize(loaded_.size());
  return build_range(loaded_.data(), spare_.data(), loaded_.size(), level);
}

/// Builds a node from points in memory, with a second buffer of the same size.
Octree::Open Octree::build_range(OctreePoint* points, OctreePoint* spare, std::size_t count, int level) {
  if (count == 0) return {};
  if (count <= kLeafPoints || level >= side_bits_) return leaf(points, count, level);
  std::array<std::size_t, 9> begin{};
  for (std::size_t i = 0; i < count; ++i) ++begin[octant(points[i], level) + 1];
  for (std::size_t k = 0; k < 8; ++k) begin[k + 1] += begin[k];
  std::array<std::size_t, 9> next = begin;
  for (std::size_t i = 0; i < count; ++i) spare[next[octant(points[i], level)]++] = points[i];
  std::array<Open, 8> children;
  for (std::size_t k = 0; k < 8; ++k) {
    children[k] = build_range(spare + begin[k], points + begin[k], begin[k + 1] - begin[k], level + 1);
  }
  return join(children, level);
}

/// Creates the parent of some nodes: the best point of each cell moves up, then the children are emitted.
Octree::Open Octree::join(std::array<Open, 8>& children, int level) {
  const int bits = std::min(kCellBits, side_bits_ - level);
  cell_of_.clear();
  confidence_of_.clear();
  std::size_t taken = 0;
  for (const Open& child : children) {
    for (const OctreePoint& point : child.points) {
      cell_of_.push_back(cell(point, level, bits));
      confidence_of_.push_back(point.confidence);
      std::uint32_t& best = best_[cell_of_.back()];
      taken += best == 0 ? 1 : 0;
      if (best == 0 || point.confidence > confidence_of_[best - 1]) {
        best = static_cast<std::uint32_t>(cell_of_.size());
      }
    }
  }
  Open parent;
  parent.points.reserve(taken);
  OctreeNode node;
  node.level = level;
  node.children.fill(-1);
  std::uint32_t number = 0;
  for (std::size_t k = 0; k < 8; ++k) {
    Open& child = children[k];
    std::size_t left = 0;
    for (const OctreePoint& point : child.points) {
      std::uint32_t& best = best_[cell_of_[number]];
      if (best == ++number) {
        best = 0;
        parent.points.push_back(point);
      } else {
        child.points[left++] = point;
      }
    }
    if (child.node < 0) continue;
    child.points.resize(left);
    if (left == 0 && nodes_[static_cast<std::size_t>(child.node)].is_leaf()) continue;
    close(child);
    node.children[k] = child.node;
  }
  parent.node = static_cast<std::int32_t>(nodes_.size());
  nodes_.push_back(node);
  return parent;
}

Octree::Open Octree::leaf(const OctreePoint* points, std::size_t count, int level) {
  OctreeNode node;
  node.level = level;
  node.children.fill(-1);
  nodes_.push_back(node);
  return {static_cast<std::int32_t>(nodes_.size()) - 1, Points(points, points + count)};
}

/// Emits the points of a node, which are final.
void Octree::close(Open& open) {
  OctreeNode& node = nodes_[static_cast<std::size_t>(open.node)];
  node.first = emitted_;
  node.points = static_cast<std::uint32_t>(open.points.size());
  emitted_ += node.points;
  if (node.points > 0) (*take_)(open.points.data(), open.points.size());
  Points().swap(open.points);
}

}  // namespace pmsp
