// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "ranges.h"
#include "rigid.h"
#include "stage.h"
#include "surfel.h"
#include "wide_plane.h"

// A mirror is a wide plane with (1) points behind it that lie behind other keyframes' points on the plane, and (2) many
// points behind it that mirror other keyframes' points in front, such as a polished floor. Windows and doors have at
// most (2), fences (1). A plane with a camera behind it is no mirror. Behind a mirror, mirror images are removed, and
// points next to confirmed parts of its surface.
//
// Evidence is gathered for every other pixel of every other row: per cell of the range maps.
namespace pmsp::kernels {

constexpr float kBehindMirror = 1.1F;           ///< minimum depth over the plane's depth for a point behind it
constexpr float kOnMirror = 0.02F;              ///< maximum relative deviation for a point on it
constexpr float kLeastMirrored = 0.2F;          ///< minimum share of mirror images among the points behind a mirror
constexpr float kLeastConfirmed = 0.1F;         ///< minimum share of these with a confirmed mirror surface in front
constexpr float kLeastMirror = 1.0F / 4000.0F;  ///< minimum share of the sphere with such confirmed mirror images
constexpr int kBesideConfirmed = 4;  ///< distance from a confirmed cell up to which points are removed [cells]

/// Evidence of a cell, two bits per plane: its point lies behind the plane; it is a mirror image.
PMSP_HD std::uint32_t behind_bit(int plane) { return 1U << static_cast<unsigned>(plane); }
PMSP_HD std::uint32_t mirrored_bit(int plane) { return 1U << static_cast<unsigned>(kWidePlanes + plane); }

template <class F>
PMSP_HD MaskOf<F> has_bit(const UIntOf<F>& word, std::uint32_t bit) {
  return from_uint<F>(UIntOf<F>(word & UIntOf<F>(bit))) > F(0);
}

/// Finds cells with points behind planes, and mirror images among them; a stage over the cells.
struct FindMirrored {
  static constexpr int kCounts = 0;

  const std::uint32_t* surfels;
  GridView grid;  ///< of the pixels
  Viewer viewers[kMaxViewers];
  int count;
  FreeSpaceLimits limits;
  const WidePlane* planes;
  std::uint32_t* evidence;
  std::uint32_t* confirmed;  ///< set to 0

  PMSP_HD int width() const { return grid.width / kRangeCell; }
  PMSP_HD int height() const { return grid.height / kRangeCell; }

  template <class F>
  PMSP_HD void operator()(const RowPixels<F>& at, MaskOf<F>* /*counted*/) const {
    using U = UIntOf<F>;
    const IntOf<F> column = at.column * IntOf<F>(kRangeCell);
    const IntOf<F> row(at.row * kRangeCell);
    const F depth = depth_of_surfel<F>(gather_words<F>(surfels, IntOf<F>(row * IntOf<F>(grid.width) + column)));
    const MaskOf<F> known = depth > F(0);
    const Vec3<F> point = select(known, depth, F(1)) * bearing_at<F>(grid, column, row);
    U word(0U);
    for (int p = 0; p < kWidePlanes && any(known); ++p) {
      const Vec3<F> plane = plane_of<F>(planes[p]);
      const F beyond = dot(plane, point);
      const MaskOf<F> behind = known & (beyond > F(kBehindMirror));
      if (!any(behind)) continue;
      const Vec3<F> image = fma(F(2) * (F(1) - beyond) / dot(plane, plane), plane, point);
      F confirm(0);
      F deny(0);
      for (int k = 0; k < count; ++k) {
        const RangeVote<F> seen = range_vote(image, viewers[k].ranges, viewers[k].other_from_first, limits);
        confirm = confirm + select(seen.on_surface, F(1), F(0));
        deny = deny + select(seen.through, F(1), F(0));
      }
      const MaskOf<F> mirrored = behind & (confirm > F(1.5F)) & (confirm > deny);
      word = word | select_bits<F>(behind, U(behind_bit(p))) | select_bits<F>(mirrored, U(mirrored_bit(p)));
    }
    store<F>(word, evidence + at.first, at.count);
    store<F>(U(0U), confirmed + at.first, at.count);
  }
};

/// Finds points of others on a plane, in front of points behind it; a stage over the cells of all viewers.
struct ConfirmMirrors {
  static constexpr int kCounts = 0;

  struct ViewerRanges {
    RangeMapView ranges;
    Rigid first_from_other;
  };
  GridView grid;  ///< of the pixels
  ViewerRanges viewers[kMaxViewers];
  int count;
  const WidePlane* planes;
  const std::uint32_t* evidence;
  std::uint32_t* confirmed;  ///< `behind_bit` of each plane with a confirmed surface in front of the cell's point

  PMSP_HD int cell_rows() const { return grid.height / kRangeCell; }
  PMSP_HD int width() const { return grid.width / kRangeCell; }
  PMSP_HD int height() const { return count * cell_rows(); }

  template <class F>
  PMSP_HD void operator()(const RowPixels<F>& at, MaskOf<F>* /*counted*/) const {
    constexpr float kOneSurface = 1.1F;  // maximum ratio of depths in a cell
    using U = UIntOf<F>;
    using I = IntOf<F>;
    const ViewerRanges& viewer = viewers[at.row / cell_rows()];
    const int cell_row = at.row % cell_rows();
    const I cell = I(cell_row * width()) + at.column;
    const F nearest = gather<F>(viewer.ranges.nearest, cell);
    const F farthest = gather<F>(viewer.ranges.farthest, cell);
    const MaskOf<F> known = (nearest > F(0)) & (farthest <= F(kOneSurface) * nearest);
    if (!any(known)) return;
    // Centre of the cell; approximately a unit vector.
    const I column = at.column * I(kRangeCell);
    const I row(cell_row * kRangeCell);
    const Vec3<F> bearing =
        F(0.5F) * (bearing_at<F>(grid, column, row) + bearing_at<F>(grid, I(column + I(1)), I(row + I(1))));
    const F depth = select(known, F(0.5F) * (nearest + farthest), F(1));
    const Vec3<F> point = transform(viewer.first_from_other, depth * bearing);
    U on(0U);
    for (int p = 0; p < kWidePlanes; ++p) {
      const MaskOf<F> near = known & (abs(dot(plane_of<F>(planes[p]), point) - F(1)) < F(kOnMirror));
      on = on | select_bits<F>(near, U(behind_bit(p)));
    }
    if (!any(has_bit<F>(on, ~0U >> 1U))) return;
    const I there = pixel_index(point, width(), cell_rows());
    on = on & gather_words<F>(evidence, there);
    if (!any(has_bit<F>(on, ~0U >> 1U))) return;
    std::int32_t cells[Num<F>::kLanes];
    std::uint32_t bits[Num<F>::kLanes];
    store<F>(there, cells, Num<F>::kLanes);
    store<F>(on, bits, Num<F>::kLanes);
    for (int i = 0; i < Num<F>::kLanes && i < at.count; ++i) {
      if (bits[i] != 0) set_bits(confirmed + cells[i], bits[i]);
    }
  }
};

/// Solid angles of the points behind each plane, of mirror images, and of those behind a confirmed surface; integers.
struct MirrorCounts {
  int behind[kWidePlanes], mirrored[kWidePlanes], confirmed[kWidePlanes];
};

constexpr int kCountColumns = 16;  ///< parts of a row of cells, counted separately
constexpr int kMirrorSums = 128;   ///< number of partial sums of the counts

/// Counts each part of each row of cells; a stage over the parts.
struct CountMirrored {
  static constexpr int kCounts = 0;

  GridView grid;  ///< of the pixels
  const std::uint32_t* evidence;
  const std::uint32_t* confirmed;
  MirrorCounts* counts;

  PMSP_HD int width() const { return kCountColumns; }
  PMSP_HD int height() const { return grid.height / kRangeCell; }

  PMSP_HD void operator()(const RowPixels<float>& at, bool* /*counted*/) const {
    const int columns = grid.width / kRangeCell;
    const int weight = static_cast<int>(kWeight * grid.cos_lat[at.row * kRangeCell]);
    MirrorCounts own{};
    for (int column = at.column * columns / kCountColumns; column < (at.column + 1) * columns / kCountColumns;
         ++column) {
      const std::uint32_t word = evidence[at.row * columns + column];
      const std::uint32_t in_front = confirmed[at.row * columns + column];
      for (int p = 0; p < kWidePlanes && word != 0; ++p) {
        const bool mirrored = (word & mirrored_bit(p)) != 0;
        own.behind[p] += (word & behind_bit(p)) != 0 ? weight : 0;
        own.mirrored[p] += mirrored ? weight : 0;
        own.confirmed[p] += mirrored && (in_front & behind_bit(p)) != 0 ? weight : 0;
      }
    }
    counts[at.index] = own;
  }

  /// Of a cell at the equator.
  static constexpr float kWeight = 64.0F;
};

/// Sums counts of parts; a stage over the sums.
struct SumMirrored {
  static constexpr int kCounts = 0;

  const MirrorCounts* counts;
  int count;
  MirrorCounts* sums;

  PMSP_HD int width() const { return kMirrorSums; }
  PMSP_HD int height() const { return 1; }

  PMSP_HD void operator()(const RowPixels<float>& at, bool* /*counted*/) const {
    MirrorCounts all{};
    for (int i = at.index; i < count; i += kMirrorSums) {
      for (int p = 0; p < kWidePlanes; ++p) {
        all.behind[p] += counts[i].behind[p];
        all.mirrored[p] += counts[i].mirrored[p];
        all.confirmed[p] += counts[i].confirmed[p];
      }
    }
    sums[at.index] = all;
  }
};

/// Removes planes that are no mirrors, including those with a camera behind them; a stage over the planes.
struct ChooseMirrors {
  static constexpr int kCounts = 0;

  const MirrorCounts* sums;          ///< of SumMirrored
  int cells;                         ///< number on the sphere
  Vec3<float> viewers[kMaxViewers];  ///< positions in the keyframe's frame
  int viewer_count;
  WidePlane* planes;

  PMSP_HD int width() const { return kWidePlanes; }
  PMSP_HD int height() const { return 1; }

  PMSP_HD void operator()(const RowPixels<float>& at, bool* /*counted*/) const {
    float behind = 0.0F;
    float mirrored = 0.0F;
    float confirmed = 0.0F;
    for (int i = 0; i < kMirrorSums; ++i) {
      behind += static_cast<float>(sums[i].behind[at.index]);
      mirrored += static_cast<float>(sums[i].mirrored[at.index]);
      confirmed += static_cast<float>(sums[i].confirmed[at.index]);
    }
    bool has_camera_behind = false;
    for (int k = 0; k < viewer_count; ++k)
      has_camera_behind = has_camera_behind || dot(planes[at.index].plane, viewers[k]) > 1.0F;
    const float sphere = CountMirrored::kWeight * static_cast<float>(2.0 / kPi) * static_cast<float>(cells);
    const bool is_mirror = !has_camera_behind && mirrored >= kLeastMirrored * behind &&
                           confirmed >= kLeastConfirmed * mirrored && confirmed >= kLeastMirror * sphere;
    if (!is_mirror) planes[at.index] = {{0.0F, 0.0F, 0.0F}, 0.0F};
  }
};

/// Result of the search for mirrors in a keyframe.
struct MirrorView {
  const WidePlane* mirrors;  ///< kWidePlanes; nullptr = disabled
  const std::uint32_t* evidence;
  const std::uint32_t* confirmed;
};

/// Whether a keyframe's point is a mirror image, or lies behind a mirror next to its confirmed surface. `at`: the
/// pixel.
template <class F>
PMSP_HD MaskOf<F> is_mirrored(const MirrorView& view, const GridView& grid, const RowPixels<F>& at,
                              const Vec3<F>& point) {
  const GridView cells{grid.width / kRangeCell, grid.height / kRangeCell, nullptr, nullptr, nullptr, nullptr};
  MaskOf<F> found = F(0) > F(1);
  for (int p = 0; p < kWidePlanes; ++p) {
    if (!is_plane(view.mirrors[p])) continue;
    const MaskOf<F> behind = dot(plane_of<F>(view.mirrors[p]), point) > F(kBehindMirror);
    if (!any(behind)) continue;
    static_assert(kRangeCell == 2, "columns of cells are shifted by one bit");
    const IntOf<F> column = at.column >> 1;
    const int row = at.row / kRangeCell;
    const UIntOf<F> own = gather_words<F>(view.evidence, IntOf<F>(IntOf<F>(row * cells.width) + column));
    found = found | (behind & has_bit<F>(own, mirrored_bit(p)));
    for (int dy = -kBesideConfirmed; dy <= kBesideConfirmed; ++dy) {
      if (row + dy < 0 || row + dy >= cells.height) continue;
      const float wider = 1.0F / max(grid.cos_lat[(row + dy) * kRangeCell], 8.0F / static_cast<float>(cells.width));
      for (int dx = -kBesideConfirmed; dx <= kBesideConfirmed && any(behind & !found); ++dx) {
        const WrappedPixel<F> there =
            wrapped_pixel<F>(cells, column, row, static_cast<int>(static_cast<float>(dx) * wider), dy);
        const IntOf<F> index = there.row * IntOf<F>(cells.width) + there.column;
        const UIntOf<F> word = gather_words<F>(view.confirmed, index);
        found = found | (behind & has_bit<F>(word, behind_bit(p)));
      }
    }
  }
  return found;
}

}  // namespace pmsp::kernels
