// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "pmsp/api.h"
#include "pmsp/io/cloud.h"

namespace pmsp {

/// Index of a cell: floor of the coordinates over its side, as in an OctoMap. |index| < kCellLimit.
using CellIndex = std::array<std::int32_t, 3>;

constexpr int kCellIndexBits = 21;
constexpr std::int32_t kCellLimit = 1 << (kCellIndexBits - 1);

/// Packs an index of cells within kCellLimit; order of z, y, x.
inline std::uint64_t packed(const CellIndex& cell) {
  const auto part = [](std::int32_t at) { return static_cast<std::uint64_t>(at + kCellLimit); };
  return (part(cell[2]) << 2 * kCellIndexBits) | (part(cell[1]) << kCellIndexBits) | part(cell[0]);
}
inline CellIndex unpacked(std::uint64_t bits) {
  constexpr std::uint64_t kMask = (std::uint64_t{1} << kCellIndexBits) - 1;
  const auto part = [](std::uint64_t at) { return static_cast<std::int32_t>(at & kMask) - kCellLimit; };
  return {part(bits), part(bits >> kCellIndexBits), part(bits >> 2 * kCellIndexBits)};
}

/// Cubic block of cells: 8 KiB.
struct VoxelBlock {
  static constexpr int kSideBits = 4;
  static constexpr int kSide = 1 << kSideBits;
  static constexpr std::size_t kCells = std::size_t{1} << 3 * kSideBits;

  struct Cell {
    std::uint8_t evidence = 0;          ///< -32 ln(1 - c), summed over the confidences c of its points; saturating
    std::atomic<std::uint8_t> rays{0};  ///< number of rays that cross it, as far as it matters
  };

  /// Position within the block from an index of cells.
  static std::size_t place(const CellIndex& cell) {
    constexpr std::int32_t kMask = kSide - 1;
    return (static_cast<std::size_t>(cell[2] & kMask) << 2 * kSideBits) |
           (static_cast<std::size_t>(cell[1] & kMask) << kSideBits) | static_cast<std::size_t>(cell[0] & kMask);
  }
  static CellIndex of(const CellIndex& cell) {
    return {cell[0] >> kSideBits, cell[1] >> kSideBits, cell[2] >> kSideBits};
  }

  std::array<Cell, kCells> cells{};
};

/// State of a cell.
enum class Space : std::uint8_t {
  kUnknown,
  kFree,      ///< crossed by rays
  kWeak,      ///< has points whose confidence does not suffice: unknown, but part of a floor
  kOccupied,  ///< has points
};

/// Occupied, free and unknown space in cubic cells, in blocks that are allocated where points or rays are. Occupancy is
/// that of an OctoMap (Hornung et al. 2013), with two differences: occupied cells are never overruled by rays, and rays
/// end at the first occupied cell, so that wrong points behind a surface free nothing.
class PMSP_API VoxelMap {
 public:
  struct Options {
    double cell = 0.0;       ///< side of a cell, > 0 [unit of the file]
    int least_rays = 3;      ///< least number of rays that make a cell free, 1 to 255
    std::optional<Box> box;  ///< bounds of the map
    std::size_t most_bytes = std::size_t{2} << 30;
  };

  explicit VoxelMap(const Options& options);

  double cell() const { return options_.cell; }
  /// Throws InvalidInput if the cell is out of range.
  CellIndex index_of(const Eigen::Vector3d& position) const;
  Eigen::Vector3d center_of(const CellIndex& cell) const;

  /// Throws InvalidInput if the memory is exhausted.
  void add_point(const CellIndex& cell, float confidence);

  /// Adds rays after the last point. Several threads may do so, each with its own: the result is the same.
  class Rays {
   public:
    explicit Rays(VoxelMap& map) : map_(map) {}
    /// Marks the cells of the ray from `camera` to an occupied cell, except the last two before it. Traversal:
    /// Amanatides, Woo 1987. Throws InvalidInput if the memory is exhausted.
    void add(const Eigen::Vector3d& camera, const CellIndex& end);

   private:
    VoxelBlock* block(const CellIndex& at, bool creates);

    VoxelMap& map_;
    std::unordered_map<std::uint64_t, VoxelBlock*> known_;  ///< blocks found so far
  };
  void add_ray(const Eigen::Vector3d& camera, const CellIndex& end) { Rays(*this).add(camera, end); }

  /// State of a cell; kUnknown outside `box`.
  Space at(const CellIndex& cell) const;
  Space state(const VoxelBlock::Cell& cell) const {
    if (cell.evidence >= kOccupiedEvidence) return Space::kOccupied;
    if (cell.evidence > 0) return Space::kWeak;
    return cell.rays >= options_.least_rays ? Space::kFree : Space::kUnknown;
  }
  bool contains(const CellIndex& cell) const { return !options_.box || options_.box->contains(center_of(cell)); }
  /// Probability of occupancy by the points of a cell, 0 to 1.
  static double occupancy(const VoxelBlock::Cell& cell) { return 1.0 - std::exp(-cell.evidence / kEvidenceScale); }

  const VoxelBlock* block(const CellIndex& at) const;
  /// Indices of blocks that overlap `box`, sorted by z, y, x.
  std::vector<CellIndex> blocks() const;
  std::size_t bytes() const { return blocks_.size() * sizeof(VoxelBlock); }

  /// Longest rays, and distances of points from their cameras [cells].
  static constexpr double kRange = 1000.0;

 private:
  static constexpr double kEvidenceScale = 32.0;
  static constexpr std::uint8_t kOccupiedEvidence = 22;  ///< occupancy of 0.5

  VoxelBlock& block_for(const CellIndex& at);

  Options options_;
  std::uint8_t most_rays_;
  std::mutex mutex_;  ///< of `blocks_`, for Rays
  std::unordered_map<std::uint64_t, std::unique_ptr<VoxelBlock>> blocks_;
};

/// Calls `visit(cell)` for the cells on the segment between two positions in units of cells, from the one that contains
/// `from`, with the distances at which it enters and leaves them, until it returns false (Amanatides, Woo 1987).
template <class Visit>
void traverse(const Eigen::Vector3d& from, const Eigen::Vector3d& to, const Visit& visit) {
  const double length = (to - from).norm();
  if (!(length > 0.0)) return;
  const Eigen::Vector3d direction = (to - from) / length;
  CellIndex cell{}, step{};
  std::array<double, 3> next{}, delta{};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    const double d = direction[axis], floor = std::floor(from[axis]);
    cell[i] = static_cast<std::int32_t>(floor);
    step[i] = d > 0.0 ? 1 : -1;
    const bool moves = std::abs(d) > 1e-12;
    delta[i] = moves ? 1.0 / std::abs(d) : std::numeric_limits<double>::infinity();
    next[i] = moves ? (d > 0.0 ? floor + 1.0 - from[axis] : from[axis] - floor) * delta[i]
                    : std::numeric_limits<double>::infinity();
  }
  for (double entry = 0.0; entry < length;) {
    const std::size_t axis = next[0] < next[1] ? (next[0] < next[2] ? 0 : 2) : (next[1] < next[2] ? 1 : 2);
    if (!visit(cell, entry, next[axis])) return;
    entry = next[axis];
    cell[axis] += step[axis];
    next[axis] += delta[axis];
  }
}

}  // namespace pmsp
