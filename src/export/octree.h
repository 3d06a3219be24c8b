// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "export/spool.h"

namespace pmsp {

/// A point of an octree; 36 bytes.
struct OctreePoint {
  std::array<std::int32_t, 3> position;
  std::array<float, 3> normal;
  float confidence;
  std::array<std::uint8_t, 3> color;
  std::uint8_t views;
  std::uint32_t tag = 0;  ///< whatever who builds the tree wants to know of the point again
};

struct OctreeNode {
  std::array<std::int32_t, 8>
      children;             ///< places among the nodes, -1 = none; bit 2 of the number is x, bit 1 y, bit 0 z
  int level = 0;            ///< of the root 0
  std::uint64_t first = 0;  ///< number of its first point in the order of handing out
  std::uint32_t points = 0;

  bool is_leaf() const;
};

/// An octree whose nodes hold each point once: those near the root an even share of all below, the others what is left.
/// Of a node's cube, cut into 128 x 128 x 128, each cell has one point at most in the node: the most confident one.
/// Points are sorted in a scratch folder; about a million at a time are in memory.
class Octree {
 public:
  using Take = std::function<void(const OctreePoint* points, std::size_t count)>;

  /// Cells along a node's side.
  static constexpr int kCellBits = 7;

  /// `reach_steps`: CloudHeader::reach in the points' steps. Points are dealt out to cells of a 32nd of it as they
  /// come; these should hold some 100 000 points: much smaller ones take memory, larger ones are dealt out once more.
  Octree(const std::string& scratch_folder, double reach_steps);

  void add(const OctreePoint& point);
  std::int64_t points() const { return points_; }
  /// Of all points so far; the one above the other where there is none.
  const std::array<std::int32_t, 3>& low() const { return low_; }
  const std::array<std::int32_t, 3>& high() const { return high_; }

  /// After the last point: hands out the nodes' points, those of one after those of another.
  void build(const Take& take);

  /// The cube of the root: where it begins, and over how many steps, a power of two, it reaches.
  const std::array<std::int32_t, 3>& corner() const { return corner_; }
  std::int64_t side() const { return std::int64_t{1} << side_bits_; }
  const std::vector<OctreeNode>& nodes() const { return nodes_; }
  std::size_t root() const { return root_; }

 private:
  using Points = std::vector<OctreePoint>;
  /// A node whose points may still move to its parent.
  struct Open {
    std::int32_t node = -1;
    Points points;
  };

  struct Cell {
    std::array<std::int32_t, 3> key;  ///< position of its points, cell_bits_ shifted away
    std::size_t list = 0;
  };

  std::size_t list_of(const std::array<std::int32_t, 3>& key);
  void place_cube();
  Open build_cells(const std::vector<Cell>& cells, int level);
  unsigned octant(const OctreePoint& point, int level) const;
  std::uint32_t cell(const OctreePoint& point, int level, int bits) const;
  Open build_list(Spool<OctreePoint>& spool, std::size_t list, int level);
  Open build_counted(Spool<OctreePoint>& chunks, const std::vector<std::vector<std::uint32_t>>& counts, int from,
                     int depth, std::uint32_t number, const std::vector<std::int32_t>& list_of, int level);
  void load(Spool<OctreePoint>& spool, std::size_t list);
  Open build_loaded(int level);
  Open build_range(OctreePoint* points, OctreePoint* spare, std::size_t count, int level);
  Open join(std::array<Open, 8>& children, int level);
  Open leaf(const OctreePoint* points, std::size_t count, int level);
  void close(Open& open);

  std::string folder_;
  Spool<OctreePoint> spool_;
  int cell_bits_;
  std::map<std::array<std::int32_t, 3>, std::size_t> cells_;  ///< lists of the spool
  std::vector<std::int32_t> near_;                            ///< the same for cells around the origin; -1 = not yet
  std::int64_t points_ = 0;
  std::array<std::int32_t, 3> low_, high_;
  std::array<std::int32_t, 3> corner_{};
  int side_bits_ = 0;
  std::vector<OctreeNode> nodes_;
  std::size_t root_ = 0;
  std::vector<std::uint32_t> best_;  ///< of each cell of a node, 1 + the number of its candidate; all 0 between uses
  std::uint64_t handed_out_ = 0;
  const Take* take_ = nullptr;
  Points loaded_, spare_;               ///< kept from list to list: asking for them anew took a fifth of the time
  std::vector<std::uint32_t> cell_of_;  ///< of each candidate of join
  std::vector<float> confidence_of_;
};

}  // namespace pmsp
