// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "util/thread_pool.h"

namespace pmsp {

/// A cell of a surface, of side 2^level [scene units]. u and v count along the surface, w across it: `face` says which
/// axis of the world the normal is nearest to, and its sign.
struct SurfaceCell {
  std::int32_t u, v, w;
  std::int8_t level;
  std::uint8_t face;
};

/// A set of cells in bounded memory. 4 x 4 x 4 cells share an entry, one bit each. Entries are spread over shards, so
/// that threads can add at a time: each is two hash tables, of which the older is emptied when the younger is full.
class OccupiedCells {
 public:
  /// `max_bytes`: 32 KiB may be used in any case.
  explicit OccupiedCells(std::size_t max_bytes);

  /// Adds cells and the coarser ones that they lie in. The number of threads makes no difference.
  void add(std::vector<SurfaceCell> cells, ThreadPool& pool);

  /// Whether `first`, or a cell between it and the one at `last_w`, is in the set. Several threads may ask at a time.
  bool any(SurfaceCell first, std::int32_t last_w) const;

  std::size_t bytes() const;

 private:
  struct Entry {
    std::uint64_t key = 0;  ///< 0 = free
    std::uint64_t cells = 0;
  };
  class Table {
   public:
    std::uint64_t find(std::uint64_t key) const;
    void prefetch(std::uint64_t key) const;
    bool full() const { return 10 * used_ >= 7 * entries_.size(); }
    bool add(std::uint64_t key, std::uint64_t bit);  ///< whether it is new; the table must not be full
    void grow();
    void clear();
    std::size_t size() const { return entries_.size(); }
    std::size_t bytes() const { return bytes_of(size()); }
    static std::size_t bytes_of(std::size_t entries) { return entries * sizeof(Entry); }

   private:
    std::size_t first_place(std::uint64_t key) const { return static_cast<std::size_t>(key >> 8) & (size() - 1); }
    std::size_t place(std::uint64_t key) const;

    std::vector<Entry> entries_;  ///< a power of two
    std::size_t used_ = 0;
  };

  struct Shard {
    Table young, old;

    bool add(std::uint64_t key, std::uint64_t bit, std::size_t max_entries);
  };
  static constexpr std::size_t kShards = 16;

  static std::size_t shard_of(std::uint64_t key) { return static_cast<std::size_t>(key >> 60); }
  std::vector<SurfaceCell> add_new(const std::vector<SurfaceCell>& cells, ThreadPool& pool);

  std::size_t max_entries_;  ///< of each table
  std::array<Shard, kShards> shards_;
};

}  // namespace pmsp
