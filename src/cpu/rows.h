// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "cpu/lanes.h"
#include "cpu/own_row.h"
#include "cpu/row_kernels.h"
#include "median.h"
#include "patchmatch.h"
#include "plane_prior.h"

// The row functions over a number type; each instruction set's file instantiates them with its own batch.
namespace pmsp::cpu {

template <class F, class Arrays>
PMSP_HD kernels::Vec3<F> plane_at(const Arrays& planes, std::size_t ring, int k, int count) {
  return {load_ring<F>(planes.x + ring, k, count), load_ring<F>(planes.y + ring, k, count),
          load_ring<F>(planes.z + ring, k, count)};
}

template <class F>
PMSP_HD void begin(kernels::Visit<F>& visit, const MatchJob& job, int y, int parity, int k, std::size_t ring) {
  F sin_lon;
  F cos_lon;
  load(sin_lon, job.grid.sin_lon[parity] + k);
  load(cos_lon, job.grid.cos_lon[parity] + k);
  kernels::begin_visit(visit, job.matching, sin_lon, cos_lon, F(job.grid.sin_lat[y]), F(job.grid.cos_lat[y]));
  visit.prior = F(0);
  if (job.prior.x != nullptr) {
    visit.prior = dot(plane_at<F>(job.prior, ring, k, job.grid.width / 2), visit.frame.bearing);
  }
}

PMSP_HD bool any_usable(const MatchJob& job, std::size_t at, int count) {
  if (job.usable == nullptr) return true;
  for (int i = 0; i < count; ++i) {
    if (job.usable[at + static_cast<std::size_t>(i)] != 0.0F) return true;
  }
  return false;
}

template <class F>
PMSP_HD void keep(const kernels::Hypothesis<F>& best, const MatchJob& job, std::size_t at, int count) {
  kernels::Hypothesis<F> result = best;
  if (job.usable != nullptr) {
    const auto usable = load_ring<F>(job.usable + at, 0, count < lanes<F>() ? count : lanes<F>()) > F(0);
    result.plane = select(usable, best.plane, kernels::Vec3<F>{F(0), F(0), F(0)});
    result.score = select(usable, best.score, F(-1));
  }
  store_some(result.plane.x, job.planes.x + at, count);
  store_some(result.plane.y, job.planes.y + at, count);
  store_some(result.plane.z, job.planes.z + at, count);
  store_some(result.score, job.planes.score + at, count);
}

/// Start of the k-th pixel of a colour in a row, in checkerboard order.
PMSP_HD std::size_t ring_start(const MatchJob& job, int y, int colour) {
  return (static_cast<std::size_t>(y) * 2 + static_cast<std::size_t>(colour)) *
         static_cast<std::size_t>(job.grid.width / 2);
}

template <class F>
PMSP_HD UIntOf<F> pixel_numbers(const MatchJob& job, int y, int parity, int k) {
  UIntOf<F> pixel;
  iota(pixel, static_cast<std::uint32_t>(y * job.grid.width + parity + 2 * k), 2U);
  return pixel;
}

template <class F>
void start_row(const MatchJob& job, int y) {
  const int half = job.grid.width / 2;
  kernels::Visit<F> visit;
  for (int colour = 0; colour < 2; ++colour) {
    const int parity = (y + colour) & 1;
    const std::size_t ring = ring_start(job, y, colour);
    for (int k = 0; k < half; k += lanes<F>()) {
      const int count = half - k;
      const std::size_t at = ring + static_cast<std::size_t>(k);
      kernels::Hypothesis<F> best{{F(0), F(0), F(0)}, F(-1)};
      if (any_usable(job, at, count < lanes<F>() ? count : lanes<F>())) {
        begin(visit, job, y, parity, k, ring);
        const auto pixel = pixel_numbers<F>(job, y, parity, k);
        kernels::propose(best, kernels::random_start<F>(pixel, visit.frame.bearing, job.matching), visit, job.matching);
        for (int i = 0; i < job.num_candidates; ++i) {
          kernels::propose(best, plane_at<F>(job.candidates[i], ring, k, half), visit, job.matching);
        }
      }
      keep(best, job, at, count);
    }
  }
}

template <class F>
void iterate_row(const MatchJob& job, int y, int colour, int iteration, bool rescore) {
  const int half = job.grid.width / 2;
  const int parity = (y + colour) & 1;
  const std::size_t ring = ring_start(job, y, colour);
  kernels::Visit<F> visit;
  for (int k = 0; k < half; k += lanes<F>()) {
    const int count = half - k;
    const std::size_t at = ring + static_cast<std::size_t>(k);
    if (!any_usable(job, at, count < lanes<F>() ? count : lanes<F>())) continue;
    begin(visit, job, y, parity, k, ring);
    kernels::Hypothesis<F> best{plane_at<F>(job.planes, ring, k, half), load_ring<F>(job.planes.score + ring, k, half)};
    if (rescore) {
      const kernels::Vec3<F> before = best.plane;
      best = {{F(0), F(0), F(0)}, F(-1)};
      kernels::propose(best, before, visit, job.matching);
      if (job.prior.x != nullptr) {
        kernels::propose(best, plane_at<F>(job.prior, ring, k, half), visit, job.matching);
      }
    }
    for (int i = 0; i < kernels::kNeighbours; ++i) {
      const kernels::NeighbourOffset offset = kernels::neighbour_offset(i);
      const kernels::NeighbourRing from =
          kernels::neighbour_ring(job.grid.width, job.grid.height, y, colour, offset.dx, offset.dy);
      const std::size_t other = ring_start(job, from.y, 1 - colour);
      kernels::propose(best, plane_at<F>(job.planes, other, k + from.shift, half), visit, job.matching);
    }
    const auto pixel = pixel_numbers<F>(job, y, parity, k);
    for (int draw = 0; draw < job.matching.refinements; ++draw) {
      kernels::propose(best, kernels::refined(best, pixel, iteration, draw, visit.frame.bearing, job.matching), visit,
                       job.matching);
    }
    keep(best, job, at, count);
  }
}

template <class F>
void median_row(const MedianJob& job, int y) {
  for (int x = 0; x < job.width; x += lanes<F>()) {
    F around[9];
    for (int dy = -1; dy <= 1; ++dy) {
      int row = y + dy;
      int shift = 0;
      if (row < 0 || row >= job.height) {  // beyond a pole, on the opposite meridian
        row = y;
        shift = job.width / 2;
      }
      const float* ring = job.depth + static_cast<std::size_t>(row) * static_cast<std::size_t>(job.width);
      for (int dx = -1; dx <= 1; ++dx) around[3 * dy + dx + 4] = load_ring<F>(ring, x + shift + dx, job.width);
    }
    const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(job.width);
    const F score = load_ring<F>(job.score + at, x, job.width);
    const F kept = kernels::median_filtered(around, score, F(job.max_relative_deviation), F(job.min_score));
    store_some(kept, job.filtered + at + x, job.width - x);
  }
}

template <class F>
void compare_row(const CompareJob& job, int y, const CompareRow& out) {
  const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(job.grid.width);
  for (int x = 0; x < job.grid.width; x += lanes<F>()) {
    F sin_lon;
    F cos_lon;
    load(sin_lon, job.grid.sin_lon[2] + x);
    load(cos_lon, job.grid.cos_lon[2] + x);
    const F depth = load_ring<F>(job.depth + at, x, job.grid.width);
    const auto known = depth > F(0);
    const auto seen =
        kernels::agreement(kernels::bearing(sin_lon, cos_lon, F(job.grid.sin_lat[y]), F(job.grid.cos_lat[y])),
                           select(known, depth, F(1)), job.other, job.other_from_first);
    const int count = job.grid.width - x;
    store_some(select(known, seen.closeness, F(0)), out.closeness + x, count);
    store_some(seen.implied_depth, out.implied_depth + x, count);
    store_some(seen.parallax_gain, out.parallax_gain + x, count);
    store_some(seen.index, out.index + x, count);
  }
}

template <class F>
void roughness_row(const RoughnessJob& job, int y) {
  const int width = job.grid.width;
  const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
  for (int x = 0; x < width; x += lanes<F>()) {
    F sin_lon;
    F cos_lon;
    load(sin_lon, job.grid.sin_lon[2] + x);
    load(cos_lon, job.grid.cos_lon[2] + x);
    const kernels::Vec3<F> bearing = kernels::bearing(sin_lon, cos_lon, F(job.grid.sin_lat[y]), F(job.grid.cos_lat[y]));
    const F depth = load_ring<F>(job.depth + at, x, width);
    F sum(0);
    for (int i = 0; i < kernels::kRoughnessOffsets; ++i) {
      int dx = 0;
      int dy = 0;
      kernels::roughness_offset(i, dx, dy);
      int row = y + dy;
      if (row < 0 || row >= job.grid.height) {  // beyond a pole, on the opposite meridian
        row = row < 0 ? -1 - row : 2 * job.grid.height - 1 - row;
        dx = width / 2;
      }
      const std::size_t ring = static_cast<std::size_t>(row) * static_cast<std::size_t>(width);
      const kernels::Vec3<F> neighbour{load_ring<F>(job.planes.x + ring, x + dx, width),
                                       load_ring<F>(job.planes.y + ring, x + dx, width),
                                       load_ring<F>(job.planes.z + ring, x + dx, width)};
      sum = sum + kernels::deviation(neighbour, bearing, depth);
    }
    store_some(sum * F(1.0F / kernels::kRoughnessOffsets), job.roughness + at + x, width - x);
  }
}

template <class F>
void variance_row(const VarianceJob& job, int y) {
  for (int x = 0; x < job.grid.width; x += lanes<F>()) {
    F sin_lon;
    F cos_lon;
    load(sin_lon, job.grid.sin_lon[2] + x);
    load(cos_lon, job.grid.cos_lon[2] + x);
    const auto frame =
        kernels::patch_frame(sin_lon, cos_lon, F(job.grid.sin_lat[y]), F(job.grid.cos_lat[y]), F(job.spacing));
    store_some(kernels::ramp_free_variance(job.image, frame), job.variance + y * job.grid.width + x,
               job.grid.width - x);
  }
}

template <class F>
void fuse_row(const kernels::FusePixels<kernels::PlaneMapView>& stage, int y, const FusedArrays& to) {
  constexpr int kLanes = lanes<F>();
  const int width = stage.first.planes.width;
  const std::size_t row = static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
  for (int x = 0; x < width; x += kLanes) {
    const auto made = stage.template at<F>(columns_from<F>(x, width), IntOf<F>(y));
    const int count = width - x;
    const std::size_t at = row + static_cast<std::size_t>(x);
    store_some(made.point.surfel, to.surfels + at, count);
    store_some(made.point.detail, to.details + at, count);
    std::uint32_t standings[kLanes];
    std::uint32_t agree[kLanes];
    store(made.standing, standings);
    store(made.agree, agree);
    for (int i = 0; i < kLanes && i < count; ++i) {
      const std::size_t pixel = at + static_cast<std::size_t>(i);
      to.standings[pixel] = static_cast<std::uint8_t>(standings[i]);
      for (int byte = 0; byte < to.agree_bytes; ++byte) {
        to.agree[pixel * static_cast<std::size_t>(to.agree_bytes) + static_cast<std::size_t>(byte)] =
            static_cast<std::uint8_t>(agree[i] >> static_cast<unsigned>(8 * byte));
      }
    }
  }
}

template <class F>
void judge_row(const kernels::Eligibility& stage, int y, std::uint8_t* standings) {
  for (int x = 0; x < stage.width; x += lanes<F>()) {
    std::uint32_t made[lanes<F>()];
    store(stage.template at<F>(columns_from<F>(x, stage.width), IntOf<F>(y)), made);
    for (int i = 0; i < lanes<F>() && x + i < stage.width; ++i) standings[x + i] = static_cast<std::uint8_t>(made[i]);
  }
}

template <class F>
constexpr RowKernels row_kernels() {
  return {&start_row<F>,    &iterate_row<F>, &median_row<F>, &compare_row<F>, &roughness_row<F>,
          &variance_row<F>, &fuse_row<F>,    &judge_row<F>,  &own_row<F>};
}

}  // namespace pmsp::cpu
