// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "export/integer_frame.h"
#include "export/spool.h"

namespace pmsp {

/// Point of an octree; 36 bytes.
struct OctreePoint {
  std::array<std::int32_t, 3> position;
  std::array<float, 3> normal;
  float confidence;
  std::array<std::uint8_t, 3> color;
  std::uint8_t views;
  std::uint32_t tag = 0;  ///< user data
};

/// False if the position is out of the frame's range. The tag is not set.
bool to_octree_point(const OutputPoint& point, const IntegerFrame& frame, OctreePoint& result);

struct OctreeNode {
  std::array<std::int32_t, 8> children;  ///< indices into nodes(), -1 = none; octant bit 2 is x, bit 1 y, bit 0 z
  int level = 0;                         ///< 0 = root
  std::uint64_t first = 0;               ///< index of its first point in the order of emission
  std::uint32_t points = 0;

  bool is_leaf() const;
};

/// Octree with each point in exactly one node: nodes near the root contain an even sample of all points below. A node,
/// divided into 128 x 128 x 128 cells, takes the most confident point of each cell. Out of core: points are sorted in a
/// scratch folder, about a million at a time in memory.
class Octree {
 public:
  using Take = std::function<void(const OctreePoint* points, std::size_t count)>;

  /// log2 of the number of cells per axis of a node.
  static constexpr int kCellBits = 7;

  /// `reach_steps`: CloudHeader::reach in steps of the coordinates. Points are first distributed to cells of 1/32 of
  /// it, which should contain some 100 000 points: much smaller cells take memory, larger ones are subdivided later.
  Octree(const std::string& scratch_folder, double reach_steps);

  void add(const OctreePoint& point);
  std::int64_t points() const { return points_; }
  /// Bounds of all points; low > high if there are none.
  const std::array<std::int32_t, 3>& low() const { return low_; }
  const std::array<std::int32_t, 3>& high() const { return high_; }

  /// To be called after the last point: emits the points, node by node.
  void build(const Take& take);

  /// Cube of the root: corner and side, a power of two [steps].
  const std::array<std::int32_t, 3>& corner() const { return corner_; }
  std::int64_t side() const { return std::int64_t{1} << side_bits_; }
  const std::vector<OctreeNode>& nodes() const { return nodes_; }
  std::size_t root() const { return root_; }

 private:
  using Points = std::vector<OctreePoint>;
  /// Node whose points may still move to its parent.
  struct Open {
    std::int32_t node = -1;
    Points points;
  };

  struct Cell {
    std::array<std::int32_t, 3> key;  ///< position of its points >> cell_bits_
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
  std::map<std::array<std::int32_t, 3>, std::size_t> cells_;  ///< indices of the spool's lists
  std::vector<std::int32_t> near_;                            ///< the same for cells around the origin; -1 = none yet
  std::int64_t points_ = 0;
  std::array<std::int32_t, 3> low_, high_;
  std::array<std::int32_t, 3> corner_{};
  int side_bits_ = 0;
  std::vector<OctreeNode> nodes_;
  std::size_t root_ = 0;
  std::vector<std::uint32_t> best_;  ///< per cell of a node: 1 + index of its best candidate; all 0 between uses
  std::uint64_t emitted_ = 0;
  const Take* take_ = nullptr;
  Points loaded_, spare_;               ///< kept between lists: allocation is expensive
  std::vector<std::uint32_t> cell_of_;  ///< per candidate of join
  std::vector<float> confidence_of_;
};

}  // namespace pmsp
