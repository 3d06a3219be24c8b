// SPDX-License-Identifier: BSD-2-Clause
#include "export/octomap.h"

#include <algorithm>
#include <cmath>
#include <ostream>
#include <streambuf>

#include <octomap/OcTree.h>

#include "export/files.h"
#include "pmsp/error.h"
#include "util/text.h"

namespace pmsp {
namespace {

constexpr std::int32_t kKeyOfOrigin = 1 << 15;
constexpr unsigned kDepth = 16;  ///< of an OctoMap

/// Stream into an AtomicFile, whose exceptions pass through.
class AtomicStream final : public std::streambuf {
 public:
  explicit AtomicStream(AtomicFile& file) : file_(file) {}

 protected:
  int_type overflow(int_type c) override {
    const char byte = traits_type::to_char_type(c);
    file_.write(&byte, 1);
    return traits_type::not_eof(c);
  }
  std::streamsize xsputn(const char* data, std::streamsize bytes) override {
    file_.write(data, static_cast<std::size_t>(bytes));
    return bytes;
  }

 private:
  AtomicFile& file_;
};

/// Builds the tree depth first, pruned on the way, so that it never takes more nodes than the file.
class OctomapBuilder {
 public:
  OctomapBuilder(const VoxelMap& map, bool binary) : map_(map), binary_(binary), tree_(map.cell()) {
    for (const CellIndex& at : map.blocks()) {
      if (!has_known(*map.block(at), first_cell(at), VoxelBlock::kSideBits)) continue;
      require_octomap_range(map, first_cell(at));
      blocks_.push_back({morton(at), at});
    }
    std::sort(blocks_.begin(), blocks_.end(), [](const Placed& a, const Placed& b) { return a.morton < b.morton; });
    if (blocks_.empty()) return;
    tree_.setNodeValue(first_known_key(), 0.0F, true);  // creates the root; its value is set below
    add_blocks(tree_.getRoot(), 0, 0, blocks_.size());
  }

  octomap::OcTree& tree() { return tree_; }

 private:
  struct Placed {
    std::uint64_t morton;
    CellIndex at;  ///< of the block
  };

  static constexpr unsigned kBlockDepth = kDepth - VoxelBlock::kSideBits;

  static CellIndex first_cell(const CellIndex& block) {
    return {block[0] * VoxelBlock::kSide, block[1] * VoxelBlock::kSide, block[2] * VoxelBlock::kSide};
  }

  /// Order of a block's key in the tree; bit 0 of each three is x, as in the indices of children.
  static std::uint64_t morton(const CellIndex& block) {
    std::uint64_t bits = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto key =
          static_cast<std::uint32_t>((block[i] * VoxelBlock::kSide + kKeyOfOrigin) >> VoxelBlock::kSideBits);
      for (unsigned bit = 0; bit < kBlockDepth; ++bit) bits |= std::uint64_t{key >> bit & 1U} << (3 * bit + i);
    }
    return bits;
  }

  Space space(const VoxelBlock& block, const CellIndex& cell) const {
    return map_.contains(cell) ? map_.state(block.cells[VoxelBlock::place(cell)]) : Space::kUnknown;
  }

  static bool is_known(Space space) { return space == Space::kFree || space == Space::kOccupied; }

  /// Whether a cube of 2^bits cells has a known one.
  bool has_known(const VoxelBlock& block, const CellIndex& low, int bits) const {
    const std::int32_t side = 1 << bits;
    for (std::int32_t z = 0; z < side; ++z) {
      for (std::int32_t y = 0; y < side; ++y) {
        for (std::int32_t x = 0; x < side; ++x) {
          if (is_known(space(block, {low[0] + x, low[1] + y, low[2] + z}))) return true;
        }
      }
    }
    return false;
  }

  octomap::OcTreeKey first_known_key() const {
    CellIndex cell = first_cell(blocks_[0].at);
    for (std::int32_t n = 0; n < static_cast<std::int32_t>(VoxelBlock::kCells); ++n) {
      const CellIndex low = first_cell(blocks_[0].at);
      cell = {low[0] + n % VoxelBlock::kSide, low[1] + n / VoxelBlock::kSide % VoxelBlock::kSide,
              low[2] + n / (VoxelBlock::kSide * VoxelBlock::kSide)};
      if (is_known(space(*map_.block(blocks_[0].at), cell))) break;
    }
    octomap::OcTreeKey key;
    for (unsigned i = 0; i < 3; ++i) key[i] = static_cast<octomap::key_type>(cell[i] + kKeyOfOrigin);
    return key;
  }

  float log_odds(const VoxelBlock& block, const CellIndex& cell) const {
    const VoxelBlock::Cell& it = block.cells[VoxelBlock::place(cell)];
    const bool is_occupied = map_.state(it) == Space::kOccupied;
    if (binary_) return is_occupied ? tree_.getClampingThresMaxLog() : tree_.getClampingThresMinLog();
    if (!is_occupied)
      return std::max(tree_.getClampingThresMinLog(), static_cast<float>(it.rays) * tree_.getProbMissLog());
    const double p = VoxelMap::occupancy(it);
    return std::clamp(static_cast<float>(std::log(p / std::max(1.0 - p, 1e-6))), 0.01F, tree_.getClampingThresMaxLog());
  }

  octomap::OcTreeNode* child(octomap::OcTreeNode* node, unsigned index) {
    return tree_.nodeChildExists(node, index) ? tree_.getNodeChild(node, index) : tree_.createNodeChild(node, index);
  }

  void close(octomap::OcTreeNode* node) {
    if (!tree_.pruneNode(node)) node->updateOccupancyChildren();
  }

  /// Fills a node at `depth` with blocks [first, last).
  void add_blocks(octomap::OcTreeNode* node, unsigned depth, std::size_t first, std::size_t last) {
    if (depth == kBlockDepth) {
      const CellIndex& at = blocks_[first].at;
      add_cells(node, *map_.block(at), first_cell(at), VoxelBlock::kSideBits);
      return;
    }
    const unsigned shift = 3 * (kBlockDepth - 1 - depth);
    while (first < last) {
      const auto index = static_cast<unsigned>(blocks_[first].morton >> shift & 7U);
      std::size_t end = first;
      while (end < last && (blocks_[end].morton >> shift & 7U) == index) ++end;
      add_blocks(child(node, index), depth + 1, first, end);
      first = end;
    }
    close(node);
  }

  /// Fills a node with the cube of 2^bits cells, at least one of them known.
  void add_cells(octomap::OcTreeNode* node, const VoxelBlock& block, const CellIndex& low, int bits) {
    if (bits == 0) {
      node->setLogOdds(log_odds(block, low));
      return;
    }
    const std::int32_t half = 1 << (bits - 1);
    for (unsigned index = 0; index < 8; ++index) {
      const CellIndex at{low[0] + ((index & 1U) != 0 ? half : 0), low[1] + ((index & 2U) != 0 ? half : 0),
                         low[2] + ((index & 4U) != 0 ? half : 0)};
      if (has_known(block, at, bits - 1)) add_cells(child(node, index), block, at, bits - 1);
    }
    close(node);
  }

  const VoxelMap& map_;
  const bool binary_;
  octomap::OcTree tree_;
  std::vector<Placed> blocks_;
};

}  // namespace

void require_octomap_range(const VoxelMap& map, const CellIndex& cell) {
  const bool fits =
      std::all_of(cell.begin(), cell.end(), [](std::int32_t at) { return at >= -kKeyOfOrigin && at < kKeyOfOrigin; });
  if (fits) return;
  const Eigen::Vector3d at = map.center_of(cell);
  throw InvalidInput("an OctoMap holds 32768 cells in each direction from the origin; " + number_text(at.x()) + " " +
                     number_text(at.y()) + " " + number_text(at.z()) + " is outside with cells of " +
                     number_text(map.cell()) + "; move the origin with --transform, or give a larger --cell-size");
}

void write_octomap(const std::filesystem::path& path, const VoxelMap& map, bool binary,
                   const std::vector<std::string>& comments) {
  OctomapBuilder builder(map, binary);
  AtomicFile file(path);
  AtomicStream buffer(file);
  std::ostream stream(&buffer);
  stream.exceptions(std::ios::badbit);  // passes the exceptions of the file on
  // The header by hand: OctoMap's own functions print to stderr, and leave no room for comments.
  octomap::OcTree& tree = builder.tree();
  stream << (binary ? "# Octomap OcTree binary file\n" : "# Octomap OcTree file\n");
  for (const std::string& comment : comments) stream << "# " << comment << '\n';
  stream << "id " << tree.getTreeType() << "\nsize " << tree.size() << "\nres " << number_text(map.cell(), "%.17g")
         << "\ndata\n";
  if (binary) {
    tree.writeBinaryData(stream);
  } else {
    tree.writeData(stream);
  }
  file.commit();
}

}  // namespace pmsp
