// SPDX-License-Identifier: BSD-2-Clause
#include "export/voxel_map.h"

#include <algorithm>

#include "pmsp/error.h"
#include "util/text.h"

namespace pmsp {
namespace {

/// Distance from the camera within which points do not end rays: noise of the rig [cells].
constexpr double kAroundCamera = 2.0;
/// Distance before the end of a ray from which on cells are not free [cells].
constexpr double kBeforeEnd = 2.0;
/// Rays that make the occupancy of a cell the least of an OctoMap.
constexpr int kRaysOfOctomap = 5;

}  // namespace

VoxelMap::VoxelMap(const Options& options)
    : options_(options), most_rays_(static_cast<std::uint8_t>(std::max(options.least_rays, kRaysOfOctomap))) {}

CellIndex VoxelMap::index_of(const Eigen::Vector3d& position) const {
  CellIndex cell;
  for (std::size_t i = 0; i < 3; ++i) {
    const double at = std::floor(position[static_cast<Eigen::Index>(i)] / options_.cell);
    if (!(std::abs(at) < kCellLimit - 1)) {
      throw InvalidInput("the maps for robots: position " + number_text(position.x()) + " " +
                         number_text(position.y()) + " " + number_text(position.z()) + " is more than " +
                         std::to_string(kCellLimit) + " cells of " + number_text(options_.cell) +
                         " from the origin; give a larger --cell-size, or move the origin with --transform");
    }
    cell[i] = static_cast<std::int32_t>(at);
  }
  return cell;
}

Eigen::Vector3d VoxelMap::center_of(const CellIndex& cell) const {
  return options_.cell * Eigen::Vector3d(cell[0] + 0.5, cell[1] + 0.5, cell[2] + 0.5);
}

void VoxelMap::add_point(const CellIndex& cell, float confidence) {
  const double share = std::clamp(static_cast<double>(confidence), 0.0, 0.9999);
  const long evidence = std::max(1L, std::lround(-kEvidenceScale * std::log1p(-share)));
  VoxelBlock::Cell& it = block_for(VoxelBlock::of(cell)).cells[VoxelBlock::place(cell)];
  it.evidence = static_cast<std::uint8_t>(std::min(255L, it.evidence + evidence));
}

void VoxelMap::Rays::add(const Eigen::Vector3d& camera, const CellIndex& end) {
  const VoxelBlock* const last = block(VoxelBlock::of(end), false);
  if (last == nullptr || map_.state(last->cells[VoxelBlock::place(end)]) != Space::kOccupied) return;
  const Eigen::Vector3d from = camera / map_.cell();
  const Eigen::Vector3d to(end[0] + 0.5, end[1] + 0.5, end[2] + 0.5);
  const double free_until = (to - from).norm() - kBeforeEnd;
  CellIndex at{std::numeric_limits<std::int32_t>::max()};
  VoxelBlock* current = nullptr;
  traverse(from, to, [&](const CellIndex& cell, double entry, double exit) {
    if (exit > free_until) return false;
    const CellIndex in = VoxelBlock::of(cell);
    const bool is_inside = map_.contains(cell);
    if (in != at || (current == nullptr && is_inside)) {
      at = in;
      current = block(in, is_inside);
    }
    if (current == nullptr) return true;
    VoxelBlock::Cell& it = current->cells[VoxelBlock::place(cell)];
    if (it.evidence >= kOccupiedEvidence) return entry < kAroundCamera;
    if (!is_inside) return true;
    std::uint8_t rays = it.rays.load(std::memory_order_relaxed);
    while (rays < map_.most_rays_ &&
           !it.rays.compare_exchange_weak(rays, static_cast<std::uint8_t>(rays + 1), std::memory_order_relaxed)) {
    }
    return true;
  });
}

/// Returns nullptr if there is none and `creates` is false.
VoxelBlock* VoxelMap::Rays::block(const CellIndex& at, bool creates) {
  const std::uint64_t key = packed(at);
  const auto found = known_.find(key);
  if (found != known_.end()) return found->second;
  const std::lock_guard<std::mutex> lock(map_.mutex_);
  const auto stored = map_.blocks_.find(key);
  if (stored == map_.blocks_.end() && !creates) return nullptr;
  return known_[key] = stored != map_.blocks_.end() ? stored->second.get() : &map_.block_for(at);
}

Space VoxelMap::at(const CellIndex& cell) const {
  const VoxelBlock* const in = block(VoxelBlock::of(cell));
  return in != nullptr && contains(cell) ? state(in->cells[VoxelBlock::place(cell)]) : Space::kUnknown;
}

const VoxelBlock* VoxelMap::block(const CellIndex& at) const {
  const auto found = blocks_.find(packed(at));
  return found != blocks_.end() ? found->second.get() : nullptr;
}

std::vector<CellIndex> VoxelMap::blocks() const {
  std::vector<std::uint64_t> keys;
  keys.reserve(blocks_.size());
  for (const auto& entry : blocks_) keys.push_back(entry.first);
  std::sort(keys.begin(), keys.end());
  std::vector<CellIndex> all;
  all.reserve(keys.size());
  for (const std::uint64_t key : keys) {
    const CellIndex at = unpacked(key);
    const Eigen::Vector3d low = options_.cell * VoxelBlock::kSide * Eigen::Vector3d(at[0], at[1], at[2]);
    const Eigen::Vector3d high = low.array() + options_.cell * VoxelBlock::kSide;
    const bool overlaps = !options_.box || ((high.array() >= options_.box->low.array()).all() &&
                                            (low.array() <= options_.box->high.array()).all());
    if (overlaps) all.push_back(at);
  }
  return all;
}

VoxelBlock& VoxelMap::block_for(const CellIndex& at) {
  const std::uint64_t key = packed(at);
  const auto found = blocks_.find(key);
  if (found != blocks_.end()) return *found->second;
  if (bytes() + sizeof(VoxelBlock) > options_.most_bytes) {
    throw InvalidInput("the maps for robots need more than " + std::to_string(options_.most_bytes >> 20U) +
                       " MiB with cells of " + number_text(options_.cell) +
                       "; give a larger --cell-size, or a part of it with --crop");
  }
  return *blocks_.emplace(key, std::make_unique<VoxelBlock>()).first->second;
}

}  // namespace pmsp
