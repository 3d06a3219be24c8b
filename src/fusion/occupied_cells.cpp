// SPDX-License-Identifier: BSD-2-Clause
#include "fusion/occupied_cells.h"

#include <algorithm>
#include <utility>

namespace pmsp {
namespace {

constexpr int kCoarserLevels = 6;  ///< a point makes points superfluous whose cells are up to 2^6 times as large
constexpr std::size_t kFirstEntries = 1024;  ///< of a table

std::uint64_t mixed(std::uint64_t x) {  // splitmix64's finaliser
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9U;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebU;
  return x ^ (x >> 31);
}

std::uint64_t bits(std::int32_t value) { return static_cast<std::uint32_t>(value); }

/// Names the entry of a cell; 64 bits of hash, so that two entries of one name practically never meet.
std::uint64_t key_of(const SurfaceCell& cell, std::int32_t w) {
  const std::uint64_t kind = (bits(cell.level) << 8) | cell.face;
  const std::uint64_t lateral = (bits(cell.u >> 2) << 32) | bits(cell.v >> 2);
  return mixed(mixed(lateral) ^ (bits(w >> 2) | (kind << 32))) | 1U;
}

/// Position of the column's four cells in an entry.
int column_of(const SurfaceCell& cell) { return 16 * (cell.v & 3) + 4 * (cell.u & 3); }

}  // namespace

std::size_t OccupiedCells::Table::place(std::uint64_t key) const {
  const std::size_t mask = entries_.size() - 1;
  std::size_t at = static_cast<std::size_t>(key >> 8) & mask;
  while (entries_[at].key != 0 && entries_[at].key != key) at = (at + 1) & mask;
  return at;
}

std::uint64_t OccupiedCells::Table::find(std::uint64_t key) const {
  return entries_.empty() ? 0 : entries_[place(key)].cells;
}

bool OccupiedCells::Table::add(std::uint64_t key, std::uint64_t bit) {
  Entry& entry = entries_[place(key)];
  if (entry.key == 0) {
    entry.key = key;
    ++used_;
  }
  const bool is_new = (entry.cells & bit) == 0;
  entry.cells |= bit;
  return is_new;
}

void OccupiedCells::Table::grow() {
  std::vector<Entry> before(std::max(kFirstEntries, 2 * entries_.size()));
  std::swap(before, entries_);
  for (const Entry& entry : before) {
    if (entry.key != 0) entries_[place(entry.key)] = entry;
  }
}

void OccupiedCells::Table::clear() {
  std::fill(entries_.begin(), entries_.end(), Entry{});
  used_ = 0;
}

OccupiedCells::OccupiedCells(std::size_t max_bytes) : max_entries_(kFirstEntries) {
  while (2 * Table::bytes_of(2 * max_entries_) <= max_bytes) max_entries_ *= 2;
}

bool OccupiedCells::add_one(const SurfaceCell& cell) {
  while (young_.full()) {
    if (young_.size() < max_entries_) {
      young_.grow();
    } else {
      std::swap(young_, old_);
      young_.clear();
    }
  }
  return young_.add(key_of(cell, cell.w), std::uint64_t{1} << (column_of(cell) + (cell.w & 3)));
}

void OccupiedCells::add(SurfaceCell cell) {
  for (int i = 0; i <= kCoarserLevels && add_one(cell); ++i) {  // where one is known, those above it are
    cell.u >>= 1;
    cell.v >>= 1;
    cell.w >>= 1;
    ++cell.level;
  }
}

bool OccupiedCells::any(SurfaceCell first, std::int32_t last_w) const {
  const int column = column_of(first);
  for (std::int64_t w = first.w; w <= last_w; w = (w | 3) + 1) {
    const std::uint64_t key = key_of(first, static_cast<std::int32_t>(w));
    const unsigned last = (w | 3) <= last_w ? 3U : static_cast<unsigned>(last_w & 3);
    const unsigned wanted = (0xFU >> (3U - last)) & (0xFU << static_cast<unsigned>(w & 3));
    if ((((young_.find(key) | old_.find(key)) >> column) & wanted) != 0) return true;
  }
  return false;
}

}  // namespace pmsp
