// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "cpu/lanes.h"
#include "duplicates.h"

// Rounds of duplicate removal over a row. Candidates differ from pixel to pixel, so that pixels are packed into new
// batches for each keyframe, and again for the few with points within the search radius.
namespace pmsp::cpu {

using kernels::any;

/// Open pixels of a row, up to kSize at a time, as one array per number.
template <class F>
class DuplicateChunk {
 public:
  explicit DuplicateChunk(const kernels::DuplicateRound& stage) : stage_(stage) {}

  /// Loads `count` open pixels of a row (at most kSize).
  void start(int y, const std::int32_t* columns, const std::uint8_t* statuses, int count) {
    for (int i = 0; i < count; i += lanes<F>()) {
      std::int32_t xs[kLanes];
      std::uint32_t packed[kLanes];
      for (int j = 0; j < kLanes; ++j) {
        xs[j] = columns[i + j < count ? i + j : count - 1];
        packed[j] = statuses[xs[j]];
      }
      IntOf<F> x;
      UIntOf<F> status;
      load(x, xs);
      load(status, packed);
      const UIntOf<F> surfel =
          kernels::gather_words<F>(stage_.map.surfels, IntOf<F>(IntOf<F>(y * stage_.map.width) + x));
      const kernels::OpenPoint<F> open_point = kernels::open_point_of<F>(
          surfel, status, kernels::bearing_at<F>(stage_.grid, x, IntOf<F>(y)), stage_.map, stage_.limits);
      store(open_point.point.x, point_[0] + i);
      store(open_point.point.y, point_[1] + i);
      store(open_point.point.z, point_[2] + i);
      store(open_point.normal.x, normal_[0] + i);
      store(open_point.normal.y, normal_[1] + i);
      store(open_point.normal.z, normal_[2] + i);
      store(open_point.off.error, error_ + i);
      store(open_point.off.max, max_off_ + i);
      store(open_point.reach, reach_ + i);
      store(open_point.rank, rank_ + i);
    }
    for (int i = 0; i < count; ++i) {
      open[i] = 0;
      has_kept[i] = 0;
    }
  }

  /// Searches keyframe k for duplicates of the `count` pixels in `list`.
  void search(int k, const std::int32_t* list, int count) {
    const kernels::DuplicateView& other = stage_.others[k];
    int near = 0;
    for (int i = 0; i < count; i += kLanes) {
      IntOf<F> open_index;
      load(open_index, list + i);
      const auto p = kernels::transform(other.other_from_first, gathered(point_, open_index));
      near += append(filled(i, count) & kernels::may_rank_higher(p, kernels::gather<F>(rank_, open_index), other),
                     open_index, near_ + near);
    }
    int found = 0;
    int multiple = 0;
    for (int i = 0; i < near; i += kLanes) {
      IntOf<F> open_index;
      load(open_index, near_ + i);
      const auto p = kernels::transform(other.other_from_first, gathered(point_, open_index));
      const kernels::SearchRegion<F> there = kernels::search_region(p, kernels::gather<F>(reach_, open_index), other);
      const kernels::PixelsInRadius<F> pixels_in_radius =
          kernels::pixels_in_radius(there, stage_.grid, other.map.width, other.map.height);
      const auto valid = filled(i, near);
      const auto single = valid & pixels_in_radius.single;
      append(single, open_index, open_index_ + found);
      append(single, pixels_in_radius.column, column_ + found);
      found += append(single, pixels_in_radius.row, row_ + found);
      if (any(pixels_in_radius.multiple)) {
        const auto more = valid & pixels_in_radius.multiple;
        append(more, there.at.x, x_ + multiple);
        append(more, there.at.y, y_ + multiple);
        append(more, there.spacing, spacing_ + multiple);
        multiple += append(more, open_index, multiple_ + multiple);
      }
    }
    int kept = 0;
    for (int i = 0; i < found; ++i) {
      const std::uint8_t status = other.map.statuses[row_[i] * other.map.width + column_[i]];
      open_index_[kept] = open_index_[i];
      column_[kept] = column_[i];
      row_[kept] = row_[i];
      status_[kept] = status;
      kept += kernels::makes_point(status) ? 1 : 0;
    }
    for (int i = 0; i < multiple; ++i) {
      const std::int32_t open_index = multiple_[i];
      kernels::for_each_within({x_[i], y_[i]}, spacing_[i], stage_.grid.cos_lat, other.map.width, other.map.height,
                               [&](int pixel) {
                                 const std::uint8_t status = other.map.statuses[pixel];
                                 if (has_kept[open_index] != 0 || !kernels::makes_point(status)) return;
                                 if (kept == kSize) kept = compare(k, kept);
                                 open_index_[kept] = open_index;
                                 row_[kept] = pixel / other.map.width;
                                 column_[kept] = pixel % other.map.width;
                                 status_[kept++] = status;
                               });
    }
    compare(k, kept);
  }

  /// Lanes from i on that lie below `count`.
  static kernels::MaskOf<F> filled(int i, int count) { return lane_numbers<F>() < F(static_cast<float>(count - i)); }

  static constexpr int kSize = 256;
  static constexpr int kCapacity = kSize + 16;  ///< whole batches are read and written
  std::uint32_t open[kCapacity];                ///< bits of the keyframes with kept or open duplicates
  std::uint32_t has_kept[kCapacity] = {};       ///< 1: a duplicate is kept

 private:
  static constexpr int kLanes = lanes<F>();

  static kernels::Vec3<F> gathered(const float (*arrays)[kCapacity], const IntOf<F>& index) {
    return {kernels::gather<F>(arrays[0], index), kernels::gather<F>(arrays[1], index),
            kernels::gather<F>(arrays[2], index)};
  }

  /// Compares the first `count` pairs of open pixel and other pixel. Returns 0, the number of remaining pairs.
  int compare(int k, int count) {
    const kernels::DuplicateView& other = stage_.others[k];
    const std::uint32_t bit = 1U << static_cast<unsigned>(k);
    for (int i = 0; i < count; i += kLanes) {
      IntOf<F> indices;
      IntOf<F> x;
      IntOf<F> y;
      UIntOf<F> status;
      load(indices, open_index_ + i);
      load(x, column_ + i);
      load(y, row_ + i);
      load(status, status_ + i);
      const kernels::Vec3<F> p = kernels::transform(other.other_from_first, gathered(point_, indices));
      const kernels::SurfaceDistance<F> off{kernels::gather<F>(error_, indices), kernels::gather<F>(max_off_, indices)};
      const UIntOf<F> surfel = kernels::gather_words<F>(other.map.surfels, IntOf<F>(y * IntOf<F>(other.map.width) + x));
      const auto is_duplicate = kernels::is_duplicate<F>(surfel, status, kernels::bearing_at<F>(stage_.grid, x, y), p,
                                                         gathered(normal_, indices), off,
                                                         kernels::gather<F>(rank_, indices), other, stage_.limits);
      if (!any(is_duplicate)) continue;
      std::uint32_t duplicate_bits[kLanes];
      store(kernels::select_bits<F>(is_duplicate, UIntOf<F>(1U)), duplicate_bits);
      for (int j = 0; j < kLanes && i + j < count; ++j) {
        if (duplicate_bits[j] == 0U) continue;
        const std::int32_t open_index = open_index_[i + j];
        open[open_index] |= bit;
        if ((status_[i + j] & 3U) == static_cast<std::uint32_t>(kernels::PointStatus::kKept)) {
          has_kept[open_index] = 1;
        }
      }
    }
    return 0;
  }

  const kernels::DuplicateRound& stage_;
  float point_[3][kCapacity];
  float normal_[3][kCapacity];
  float error_[kCapacity], max_off_[kCapacity], reach_[kCapacity], rank_[kCapacity];
  std::int32_t near_[kCapacity] =
      {};  ///< open pixels with pixels that may rank higher; lanes beyond the last one are stale
  std::int32_t open_index_[kCapacity] = {}, column_[kCapacity] = {}, row_[kCapacity] = {};  ///< pairs to compare
  std::uint32_t status_[kCapacity] = {};
  std::int32_t multiple_[kCapacity];  ///< open pixels with several pixels within the search radius
  float x_[kCapacity], y_[kCapacity], spacing_[kCapacity];
};

template <class F>
int duplicate_row(const kernels::DuplicateRound& stage, int y, const std::uint32_t* candidates, std::uint32_t available,
                  std::uint32_t* remaining) {
  using Chunk = DuplicateChunk<F>;
  const int width = stage.map.width;
  const std::size_t row = static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
  const std::uint8_t* const before = stage.map.statuses + row;
  std::uint8_t* const statuses = stage.statuses + row;
  Chunk chunk(stage);
  std::int32_t columns[Chunk::kSize];
  std::int32_t list[Chunk::kCapacity] = {};
  std::uint32_t bits[Chunk::kCapacity] = {};
  int left = 0;
  for (int x = 0; x < width;) {
    int count = 0;
    for (; x < width && count < Chunk::kSize; ++x) {
      statuses[x] = before[x];
      columns[count] = x;
      count += kernels::status_of(before[x]) == kernels::PointStatus::kOpen ? 1 : 0;
    }
    if (count == 0) continue;
    for (int i = 0; i < count; ++i) bits[i] = candidates == nullptr ? available : *candidates++ & available;
    chunk.start(y, columns, before, count);
    for (int k = 0; k < stage.count; ++k) {
      int searching = 0;
      for (int i = 0; i < count; i += lanes<F>()) {
        UIntOf<F> wanted;
        UIntOf<F> has_kept;
        load(wanted, bits + i);
        load(has_kept, chunk.has_kept + i);
        const UIntOf<F> searches = (wanted >> k) & UIntOf<F>(1U) & ~has_kept;
        searching += append(Chunk::filled(i, count) & (kernels::from_uint<F>(searches) > F(0)),
                            columns_from<F>(i, Chunk::kCapacity), list + searching);
      }
      if (searching > 0) chunk.search(k, list, searching);
    }
    for (int i = 0; i < count; ++i) {
      using kernels::PointStatus;
      const bool dropped = chunk.has_kept[i] != 0;
      const bool open = !dropped && chunk.open[i] != 0U;
      statuses[columns[i]] = kernels::with_status(before[columns[i]], dropped ? PointStatus::kDropped
                                                                      : open  ? PointStatus::kOpen
                                                                              : PointStatus::kKept);
      if (open) remaining[left++] = chunk.open[i];
    }
  }
  return left;
}

}  // namespace pmsp::cpu
