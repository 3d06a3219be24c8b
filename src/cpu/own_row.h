// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "cpu/lanes.h"
#include "ownership.h"

// Rounds of ownership over a row. Who is asked differs from pixel to pixel, so that pixels are packed into batches anew
// for each keyframe, and once more for the few of its pixels that lie within reach.
namespace pmsp::cpu {

using kernels::any;

/// Open pixels of a row, as many as are worked on at a time, for one array a number.
template <class F>
class OwnershipChunk {
 public:
  explicit OwnershipChunk(const kernels::OwnershipRound& stage) : stage_(stage) {}

  /// Takes `count` open pixels of a row (kSize at most).
  void start(int y, const std::int32_t* columns, const std::uint8_t* standings, int count) {
    for (int i = 0; i < count; i += lanes<F>()) {
      std::int32_t xs[kLanes];
      std::uint32_t packed[kLanes];
      for (int j = 0; j < kLanes; ++j) {
        xs[j] = columns[i + j < count ? i + j : count - 1];
        packed[j] = standings[xs[j]];
      }
      IntOf<F> x;
      UIntOf<F> standing;
      load(x, xs);
      load(standing, packed);
      const UIntOf<F> surfel =
          kernels::gather_words<F>(stage_.map.surfels, IntOf<F>(IntOf<F>(y * stage_.map.width) + x));
      const kernels::Claim<F> claim = kernels::claim_of<F>(
          surfel, standing, kernels::bearing_at<F>(stage_.grid, x, IntOf<F>(y)), stage_.map, stage_.limits);
      store(claim.point.x, point_[0] + i);
      store(claim.point.y, point_[1] + i);
      store(claim.point.z, point_[2] + i);
      store(claim.normal.x, normal_[0] + i);
      store(claim.normal.y, normal_[1] + i);
      store(claim.normal.z, normal_[2] + i);
      store(claim.off.error, error_ + i);
      store(claim.off.most, most_ + i);
      store(claim.reach, reach_ + i);
      store(claim.rank, rank_ + i);
    }
    for (int i = 0; i < count; ++i) {
      open[i] = 0;
      owned[i] = 0;
    }
  }

  /// Asks keyframe k for the `count` pixels of the list.
  void ask(int k, const std::int32_t* list, int count) {
    const kernels::OwnershipView& other = stage_.others[k];
    int found = 0;
    for (int i = 0; i < count; i += lanes<F>()) {
      const IntOf<F> claim = lanes_of(list, i, count);
      const kernels::Approach<F> there = kernels::approach<F>(
          gathered(point_, claim), kernels::gather<F>(reach_, claim), kernels::gather<F>(rank_, claim), other);
      if (!any(there.possible)) continue;
      const kernels::Within<F> within = kernels::within(there, stage_.grid, other.map.width, other.map.height);
      std::uint32_t one[kLanes];
      std::uint32_t several[kLanes];
      std::int32_t pixels[kLanes];
      store(kernels::select_bits<F>(within.this_one, UIntOf<F>(1U)), one);
      store(kernels::select_bits<F>(within.several, UIntOf<F>(1U)), several);
      store(IntOf<F>(within.row * IntOf<F>(other.map.width) + within.column), pixels);
      float x[kLanes];
      float y[kLanes];
      float spacing[kLanes];
      const bool any_several = any(within.several);
      if (any_several) {
        store(there.at.x, x);
        store(there.at.y, y);
        store(there.spacing, spacing);
      }
      for (int j = 0; j < kLanes && i + j < count; ++j) {
        const std::int32_t asks = list[i + j];
        if (one[j] != 0U) {
          const std::uint8_t standing = other.map.standings[pixels[j]];
          claim_[found] = asks;
          pixel_[found] = pixels[j];
          standing_[found] = standing;
          found += kernels::makes_point(standing) ? 1 : 0;
        }
        if (any_several && several[j] != 0U) {
          kernels::for_each_within({x[j], y[j]}, spacing[j], stage_.grid.cos_lat, other.map.width, other.map.height,
                                   [&](int pixel) {
                                     const std::uint8_t standing = other.map.standings[pixel];
                                     if (owned[asks] != 0 || !kernels::makes_point(standing)) return;
                                     claim_[found] = asks;
                                     pixel_[found] = pixel;
                                     standing_[found] = standing;
                                     if (++found == kSize) found = compare(k, found);
                                   });
        }
        if (found == kSize) found = compare(k, found);
      }
    }
    compare(k, found);
  }

  static constexpr int kSize = 128;
  std::uint32_t open[kSize];  ///< bits of the keyframes with pixels that would stand for this one if they were owners
  std::uint8_t owned[kSize];  ///< not 0: an owner stands for it

 private:
  static constexpr int kLanes = lanes<F>();

  /// Lanes from i on; the last element again for those beyond it.
  static IntOf<F> lanes_of(const std::int32_t* list, int i, int count) {
    IntOf<F> value;
    if (i + kLanes <= count) {
      load(value, list + i);
      return value;
    }
    std::int32_t some[kLanes];
    for (int j = 0; j < kLanes; ++j) some[j] = list[i + j < count ? i + j : count - 1];
    load(value, some);
    return value;
  }
  static kernels::Vec3<F> gathered(const float (*arrays)[kSize], const IntOf<F>& index) {
    return {kernels::gather<F>(arrays[0], index), kernels::gather<F>(arrays[1], index),
            kernels::gather<F>(arrays[2], index)};
  }

  /// Compares the first `count` pairs of a claim and a pixel. Returns 0, the number that is left.
  int compare(int k, int count) {
    const kernels::OwnershipView& other = stage_.others[k];
    const std::uint32_t bit = 1U << static_cast<unsigned>(k);
    for (int i = 0; i < count; i += kLanes) {
      const IntOf<F> claim = lanes_of(claim_, i, count);
      const IntOf<F> pixel = lanes_of(pixel_, i, count);
      std::int32_t xs[kLanes];
      std::int32_t ys[kLanes];
      std::uint32_t packed[kLanes];
      for (int j = 0; j < kLanes; ++j) {
        const int from = i + j < count ? i + j : count - 1;
        ys[j] = pixel_[from] / other.map.width;
        xs[j] = pixel_[from] - ys[j] * other.map.width;
        packed[j] = standing_[from];
      }
      IntOf<F> x;
      IntOf<F> y;
      UIntOf<F> standing;
      load(x, xs);
      load(y, ys);
      load(standing, packed);
      const kernels::Vec3<F> p = kernels::transform(other.other_from_first, gathered(point_, claim));
      const kernels::OffSurface<F> off{kernels::gather<F>(error_, claim), kernels::gather<F>(most_, claim)};
      const auto stands = kernels::stands_for<F>(kernels::gather_words<F>(other.map.surfels, pixel), standing,
                                                 kernels::bearing_at<F>(stage_.grid, x, y), p, gathered(normal_, claim),
                                                 off, kernels::gather<F>(rank_, claim), other, stage_.limits);
      if (!any(stands)) continue;
      std::uint32_t stand[kLanes];
      store(kernels::select_bits<F>(stands, UIntOf<F>(1U)), stand);
      for (int j = 0; j < kLanes && i + j < count; ++j) {
        if (stand[j] == 0U) continue;
        const std::int32_t asks = claim_[i + j];
        open[asks] |= bit;
        if (kernels::standing_of(standing_[i + j]) == kernels::Standing::kOwner) owned[asks] = 1;
      }
    }
    return 0;
  }

  const kernels::OwnershipRound& stage_;
  float point_[3][kSize];
  float normal_[3][kSize];
  float error_[kSize], most_[kSize], reach_[kSize], rank_[kSize];
  std::int32_t claim_[kSize], pixel_[kSize];  ///< pairs that are to be compared
  std::uint8_t standing_[kSize];
};

template <class F>
int own_row(const kernels::OwnershipRound& stage, int y, const std::uint32_t* ask, std::uint32_t there,
            std::uint8_t* standings, std::uint32_t* still) {
  using Chunk = OwnershipChunk<F>;
  const int width = stage.map.width;
  const std::uint8_t* const before =
      stage.map.standings + static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
  Chunk chunk(stage);
  std::int32_t columns[Chunk::kSize];
  std::int32_t list[Chunk::kSize];
  std::uint32_t bits[Chunk::kSize];
  int left = 0;
  for (int x = 0; x < width;) {
    int count = 0;
    for (; x < width && count < Chunk::kSize; ++x) {
      standings[x] = before[x];
      columns[count] = x;
      count += kernels::standing_of(before[x]) == kernels::Standing::kOpen ? 1 : 0;
    }
    if (count == 0) continue;
    for (int i = 0; i < count; ++i) bits[i] = ask == nullptr ? there : *ask++ & there;
    chunk.start(y, columns, before, count);
    for (int k = 0; k < stage.count; ++k) {
      int asking = 0;
      for (int i = 0; i < count; ++i) {
        list[asking] = i;
        asking += chunk.owned[i] == 0 ? static_cast<int>((bits[i] >> static_cast<unsigned>(k)) & 1U) : 0;
      }
      if (asking > 0) chunk.ask(k, list, asking);
    }
    for (int i = 0; i < count; ++i) {
      using kernels::Standing;
      const bool dropped = chunk.owned[i] != 0;
      const bool open = !dropped && chunk.open[i] != 0U;
      standings[columns[i]] = kernels::with_standing(before[columns[i]], dropped ? Standing::kDropped
                                                                         : open  ? Standing::kOpen
                                                                                 : Standing::kOwner);
      if (open) still[left++] = chunk.open[i];
    }
  }
  return left;
}

}  // namespace pmsp::cpu
