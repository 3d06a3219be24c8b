// SPDX-License-Identifier: BSD-2-Clause
#include "fusion/occupied_cells.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace pmsp {
namespace {

constexpr int kCoarserLevels = 6;  ///< a point makes points superfluous whose cells are up to 2^6 times as large
constexpr std::size_t kFirstEntries = 64;  ///< of a table
constexpr std::size_t kChunk = 4096;       ///< cells that a thread sorts at a time
constexpr std::size_t kAhead = 8;          ///< cells by which memory is asked for before it is used

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

std::uint64_t bit_of(const SurfaceCell& cell) { return std::uint64_t{1} << (column_of(cell) + (cell.w & 3)); }

SurfaceCell coarser(const SurfaceCell& cell) {
  return {cell.u >> 1, cell.v >> 1, cell.w >> 1, static_cast<std::int8_t>(cell.level + 1), cell.face};
}

}  // namespace

std::size_t OccupiedCells::Table::place(std::uint64_t key) const {
  std::size_t at = first_place(key);
  while (entries_[at].key != 0 && entries_[at].key != key) at = (at + 1) & (size() - 1);
  return at;
}

std::uint64_t OccupiedCells::Table::find(std::uint64_t key) const {
  return entries_.empty() ? 0 : entries_[place(key)].cells;
}

void OccupiedCells::Table::prefetch(std::uint64_t key) const {
  if (!entries_.empty()) __builtin_prefetch(&entries_[first_place(key)]);
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
  while (2 * kShards * Table::bytes_of(2 * max_entries_) <= max_bytes) max_entries_ *= 2;
}

std::size_t OccupiedCells::bytes() const {
  std::size_t sum = 0;
  for (const Shard& shard : shards_) sum += shard.young.bytes() + shard.old.bytes();
  return sum;
}

/// Whether the cell is new.
bool OccupiedCells::Shard::add(std::uint64_t key, std::uint64_t bit, std::size_t max_entries) {
  while (young.full()) {
    if (young.size() < max_entries) {
      young.grow();
    } else {
      std::swap(young, old);
      young.clear();
    }
  }
  return young.add(key, bit);
}

void OccupiedCells::add(std::vector<SurfaceCell> cells, ThreadPool& pool) {
  for (int level = 0; level <= kCoarserLevels && !cells.empty(); ++level) cells = add_new(cells, pool);
}

/// Adds cells of any levels. Returns those a level above the new ones: above the others they were added before.
std::vector<SurfaceCell> OccupiedCells::add_new(const std::vector<SurfaceCell>& cells, ThreadPool& pool) {
  const std::size_t chunks = (cells.size() + kChunk - 1) / kChunk;
  std::vector<std::uint64_t> keys(cells.size());
  std::vector<std::uint32_t> order(cells.size());  // each chunk's cells, sorted by shard
  std::vector<std::array<std::size_t, kShards + 1>> starts(chunks);
  pool.for_each(static_cast<int>(chunks), [&](int c) {
    const std::size_t first = static_cast<std::size_t>(c) * kChunk;
    const std::size_t end = std::min(first + kChunk, cells.size());
    auto& start = starts[static_cast<std::size_t>(c)];
    start.fill(0);
    for (std::size_t i = first; i < end; ++i) {
      keys[i] = key_of(cells[i], cells[i].w);
      ++start[shard_of(keys[i]) + 1];
    }
    start[0] = first;
    std::partial_sum(start.begin(), start.end(), start.begin());
    auto next = start;
    for (std::size_t i = first; i < end; ++i) order[next[shard_of(keys[i])]++] = static_cast<std::uint32_t>(i);
  });
  std::vector<std::uint8_t> is_new(cells.size());  // in that order
  pool.for_each(static_cast<int>(kShards), [&](int s) {
    Shard& shard = shards_[static_cast<std::size_t>(s)];
    for (const auto& start : starts) {
      const std::size_t end = start[static_cast<std::size_t>(s) + 1];
      for (std::size_t j = start[static_cast<std::size_t>(s)]; j < end; ++j) {
        if (j + kAhead < end) shard.young.prefetch(keys[order[j + kAhead]]);
        is_new[j] = shard.add(keys[order[j]], bit_of(cells[order[j]]), max_entries_) ? 1 : 0;
      }
    }
  });
  std::vector<SurfaceCell> above;
  for (std::size_t j = 0; j < cells.size(); ++j) {
    if (is_new[j] != 0) above.push_back(coarser(cells[order[j]]));
  }
  return above;
}

bool OccupiedCells::any(SurfaceCell first, std::int32_t last_w) const {
  const int column = column_of(first);
  for (std::int64_t w = first.w; w <= last_w; w = (w | 3) + 1) {
    const std::uint64_t key = key_of(first, static_cast<std::int32_t>(w));
    const unsigned last = (w | 3) <= last_w ? 3U : static_cast<unsigned>(last_w & 3);
    const unsigned wanted = (0xFU >> (3U - last)) & (0xFU << static_cast<unsigned>(w & 3));
    const Shard& shard = shards_[shard_of(key)];
    if ((((shard.young.find(key) | shard.old.find(key)) >> column) & wanted) != 0) return true;
  }
  return false;
}

}  // namespace pmsp
