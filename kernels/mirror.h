// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "rigid.h"
#include "sight.h"
#include "stage.h"
#include "surfel.h"

// Mirrors: planes that a keyframe has seen through where others confirm a surface. A polished floor shows the room
// upside down, and keyframes agree on the depths of what it shows. Such a plane gives itself away by two things: some
// of what a keyframe sees behind it lies behind what other keyframes have on that very plane, and much of it is the
// mirror image of what others have before the plane. A window or a door has the second one at most (rooms are alike),
// a fence the first one. Behind a mirror, what is a mirror image goes, and what lies next to where others have the
// mirror's own surface.
//
// Planes are looked for in the keyframe's own points: one in each field of the sphere, of which those are kept that
// most of the sphere lies on. The rest is done for every other pixel of every other row, a cell of the sight maps.
namespace pmsp::kernels {

constexpr int kFieldColumns = 16;  ///< of fields
constexpr int kFieldRows = 8;
constexpr int kFields = kFieldColumns * kFieldRows;
constexpr int kFieldSide = 20;             ///< points of a field that a plane is laid through, squared
constexpr float kLeastOfField = 0.3F;      ///< share of them that there must be, and that must lie on it
constexpr float kOnPlane = 0.01F;          ///< relative deviation up to which they do
constexpr int kSphereRows = 32;            ///< of the lattice on which a plane's share of the sphere is counted
constexpr float kLeastOfSphere = 0.02F;    ///< that share, at least
constexpr float kOnePlaneCos = 0.97F;      ///< cosine of the normals up to which two planes are one ...
constexpr float kOnePlaneDistance = 0.1F;  ///< ... and relative difference of their distances
constexpr int kMirrors = 4;                ///< planes of a keyframe that may be one

constexpr float kBehindMirror = 1.1F;           ///< depth over the plane's depth from which on a point lies behind it
constexpr float kOnMirror = 0.02F;              ///< relative deviation up to which others have the plane's surface
constexpr float kLeastMirrored = 0.2F;          ///< share of what lies behind a mirror that is a mirror image, ...
constexpr float kLeastConfirmed = 0.1F;         ///< and of that again, where others have the mirror's surface: at least
constexpr float kLeastMirror = 1.0F / 4000.0F;  ///< of the sphere, likewise
constexpr int kBesideConfirmed = 4;             ///< cells up to which a point is next to such a place

/// A plane v: v · X = 1 for its points X. In the keyframe's frame; 0 = none.
struct WidePlane {
  Vec3<float> plane;
  float support;  ///< share of the sphere that lies on it
};

/// The keyframe's point at a pixel; 0 = none.
PMSP_HD Vec3<float> surfel_point(const std::uint32_t* surfels, const GridView& grid, int column, int row) {
  return depth_of_surfel<float>(surfels[row * grid.width + column]) * bearing_at<float>(grid, column, row);
}

PMSP_HD float off_plane(const Vec3<float>& plane, const Vec3<float>& point) { return abs(dot(plane, point) - 1.0F); }

/// A plane for each field; a stage over the fields. Least squares of what is not too far from the plane before.
struct FindWidePlanes {
  static constexpr int kCounts = 0;

  const std::uint32_t* surfels;
  GridView grid;
  WidePlane* found;

  PMSP_HD int width() const { return kFieldColumns; }
  PMSP_HD int height() const { return kFieldRows; }

  PMSP_HD void operator()(const Place<float>& at, bool* /*counted*/) const {
    constexpr float kFar[] = {1e30F, 0.2F, 0.05F, 0.02F};
    constexpr float kWanted = kLeastOfField * kFieldSide * kFieldSide;
    Vec3<float> plane{0.0F, 0.0F, 0.0F};
    float on = 0.0F;
    for (const float far : kFar) {
      const Fit fit = fit_of(at, plane, far);
      if (fit.count < kWanted) return put(at, {{0.0F, 0.0F, 0.0F}, 0.0F});
      plane = solved(fit);
    }
    for (int i = 0; i < kFieldSide * kFieldSide; ++i) {
      const Vec3<float> point = field_point(at, i);
      on += dot(point, point) > 0.0F && off_plane(plane, point) < kOnPlane ? 1.0F : 0.0F;
    }
    put(at, on < kWanted ? WidePlane{{0.0F, 0.0F, 0.0F}, 0.0F} : WidePlane{plane, share_on(plane)});
  }

 private:
  /// Sums of the products of coordinates, and of coordinates, in units of `unit`.
  struct Fit {
    float xx, xy, xz, yy, yz, zz;
    Vec3<float> sum;
    float count, unit;
  };

  PMSP_HD void put(const Place<float>& at, const WidePlane& plane) const { found[at.index] = plane; }

  PMSP_HD Vec3<float> field_point(const Place<float>& at, int i) const {
    const int column = (at.column * kFieldSide + i % kFieldSide) * grid.width / (kFieldColumns * kFieldSide);
    const int row = (at.row * kFieldSide + i / kFieldSide) * grid.height / (kFieldRows * kFieldSide);
    return surfel_point(surfels, grid, column, row);
  }

  PMSP_HD Fit fit_of(const Place<float>& at, const Vec3<float>& before, float far) const {
    Fit fit{};
    for (int i = 0; i < kFieldSide * kFieldSide; ++i) {
      Vec3<float> point = field_point(at, i);
      const float square = dot(point, point);
      if (!(square > 0.0F) || !(off_plane(before, point) < far)) continue;
      if (fit.count == 0.0F) fit.unit = sqrt(square);
      point = (1.0F / fit.unit) * point;
      fit.xx = fma(point.x, point.x, fit.xx);
      fit.xy = fma(point.x, point.y, fit.xy);
      fit.xz = fma(point.x, point.z, fit.xz);
      fit.yy = fma(point.y, point.y, fit.yy);
      fit.yz = fma(point.y, point.z, fit.yz);
      fit.zz = fma(point.z, point.z, fit.zz);
      fit.sum = fit.sum + point;
      fit.count += 1.0F;
    }
    return fit;
  }

  PMSP_HD static Vec3<float> solved(const Fit& fit) {
    const Vec3<float> x{fit.xx, fit.xy, fit.xz};
    const Vec3<float> y{fit.xy, fit.yy, fit.yz};
    const Vec3<float> z{fit.xz, fit.yz, fit.zz};
    const Vec3<float> yz = cross(y, z);
    const float determinant = dot(x, yz) * fit.unit;
    if (!(determinant > 0.0F)) return {0.0F, 0.0F, 0.0F};
    return (1.0F / determinant) * (fit.sum.x * yz + fit.sum.y * cross(z, x) + fit.sum.z * cross(x, y));
  }

  PMSP_HD float share_on(const Vec3<float>& plane) const {
    float on = 0.0F;
    float all = 0.0F;
    for (int i = 0; i < kSphereRows; ++i) {
      const int row = (2 * i + 1) * grid.height / (2 * kSphereRows);
      const float weight = grid.cos_lat[row];
      for (int k = 0; k < 2 * kSphereRows; ++k) {
        const Vec3<float> point = surfel_point(surfels, grid, (2 * k + 1) * grid.width / (4 * kSphereRows), row);
        on += off_plane(plane, point) < kOnPlane ? weight : 0.0F;
        all += weight;
      }
    }
    return on / all;
  }
};

PMSP_HD bool is_one_plane(const Vec3<float>& a, const Vec3<float>& b) {
  const float length_a = sqrt(dot(a, a));
  const float length_b = sqrt(dot(b, b));
  return dot(a, b) > kOnePlaneCos * length_a * length_b &&
         abs(length_a - length_b) < kOnePlaneDistance * max(length_a, length_b);
}

/// The planes that most lies on, each once; a stage of one pixel.
struct ChooseWidePlanes {
  static constexpr int kCounts = 0;

  const WidePlane* found;
  WidePlane* chosen;  ///< kMirrors

  PMSP_HD int width() const { return 1; }
  PMSP_HD int height() const { return 1; }

  PMSP_HD void operator()(const Place<float>& /*at*/, bool* /*counted*/) const {
    for (int m = 0; m < kMirrors; ++m) {
      WidePlane best{{0.0F, 0.0F, 0.0F}, kLeastOfSphere};
      for (int i = 0; i < kFields; ++i) {
        bool is_new = found[i].support > best.support;
        for (int other = 0; other < m && is_new; ++other) is_new = !is_one_plane(found[i].plane, chosen[other].plane);
        if (is_new) best = found[i];
      }
      chosen[m] = best;
    }
  }
};

PMSP_HD bool is_plane(const WidePlane& plane) { return dot(plane.plane, plane.plane) > 0.0F; }

template <class F>
PMSP_HD Vec3<F> plane_of(const WidePlane& plane) {
  return {F(plane.plane.x), F(plane.plane.y), F(plane.plane.z)};
}

/// What is known of a cell, for each plane a bit: its point lies behind the plane; it is the mirror image of what
/// others see.
PMSP_HD std::uint32_t behind_bit(int plane) { return 1U << static_cast<unsigned>(plane); }
PMSP_HD std::uint32_t mirrored_bit(int plane) { return 1U << static_cast<unsigned>(kMirrors + plane); }

template <class F>
PMSP_HD MaskOf<F> has_bit(const UIntOf<F>& word, std::uint32_t bit) {
  return from_uint<F>(UIntOf<F>(word & UIntOf<F>(bit))) > F(0);
}

/// Keyframes that can be asked: one bit each.
constexpr int kMaxViewers = 32;

/// A keyframe that may have looked through a point.
struct Viewer {
  SightView sight;
  Rigid other_from_first;  ///< from the first keyframe's unit of length into the other's: the rotation times `zoom`
  float zoom;              ///< the first keyframe's scale over the other's
};

/// Which cells' points lie behind a plane, and are mirror images; a stage over the cells.
struct FindMirrored {
  static constexpr int kCounts = 0;

  const std::uint32_t* surfels;
  GridView grid;  ///< of the pixels
  Viewer viewers[kMaxViewers];
  int count;
  SightLimits limits;
  const WidePlane* planes;
  std::uint32_t* evidence;
  std::uint32_t* confirmed;  ///< becomes 0

  PMSP_HD int width() const { return grid.width / kSightCell; }
  PMSP_HD int height() const { return grid.height / kSightCell; }

  template <class F>
  PMSP_HD void operator()(const Place<F>& at, MaskOf<F>* /*counted*/) const {
    using U = UIntOf<F>;
    const IntOf<F> column = at.column * IntOf<F>(kSightCell);
    const IntOf<F> row(at.row * kSightCell);
    const F depth = depth_of_surfel<F>(gather_words<F>(surfels, IntOf<F>(row * IntOf<F>(grid.width) + column)));
    const MaskOf<F> known = depth > F(0);
    const Vec3<F> point = select(known, depth, F(1)) * bearing_at<F>(grid, column, row);
    U word(0U);
    for (int p = 0; p < kMirrors && any(known); ++p) {
      const Vec3<F> plane = plane_of<F>(planes[p]);
      const F beyond = dot(plane, point);
      const MaskOf<F> behind = known & (beyond > F(kBehindMirror));
      if (!any(behind)) continue;
      const Vec3<F> image = fma(F(2) * (F(1) - beyond) / dot(plane, plane), plane, point);
      F confirm(0);
      F deny(0);
      for (int k = 0; k < count; ++k) {
        const Sight<F> seen = sight(image, viewers[k].sight, viewers[k].other_from_first, limits);
        confirm = confirm + select(seen.on_surface > F(0), F(1), F(0));
        deny = deny + select(seen.through > F(0), F(1), F(0));
      }
      const MaskOf<F> mirrored = behind & (confirm > F(1.5F)) & (confirm > deny);
      word = word | select_bits<F>(behind, U(behind_bit(p))) | select_bits<F>(mirrored, U(mirrored_bit(p)));
    }
    store<F>(word, evidence + at.first, at.count);
    store<F>(U(0U), confirmed + at.first, at.count);
  }
};

/// Where others have a plane's surface in front of what lies behind it; a stage over the cells of all viewers.
struct ConfirmMirrors {
  static constexpr int kCounts = 0;

  struct Witness {
    SightView sight;
    Rigid first_from_other;
  };
  GridView grid;  ///< of the pixels
  Witness viewers[kMaxViewers];
  int count;
  const WidePlane* planes;
  const std::uint32_t* evidence;
  std::uint32_t* confirmed;  ///< of a plane the bit that it has in `evidence` where something lies behind it

  PMSP_HD int cell_rows() const { return grid.height / kSightCell; }
  PMSP_HD int width() const { return grid.width / kSightCell; }
  PMSP_HD int height() const { return count * cell_rows(); }

  template <class F>
  PMSP_HD void operator()(const Place<F>& at, MaskOf<F>* /*counted*/) const {
    constexpr float kOneSurface = 1.1F;  // depths of a cell, at most
    using U = UIntOf<F>;
    using I = IntOf<F>;
    const Witness& viewer = viewers[at.row / cell_rows()];
    const int cell_row = at.row % cell_rows();
    const I cell = I(cell_row * width()) + at.column;
    const F nearest = gather<F>(viewer.sight.nearest, cell);
    const F farthest = gather<F>(viewer.sight.farthest, cell);
    const MaskOf<F> known = (nearest > F(0)) & (farthest <= F(kOneSurface) * nearest);
    if (!any(known)) return;
    // In the middle of the cell; as good as a unit vector.
    const I column = at.column * I(kSightCell);
    const I row(cell_row * kSightCell);
    const Vec3<F> bearing =
        F(0.5F) * (bearing_at<F>(grid, column, row) + bearing_at<F>(grid, I(column + I(1)), I(row + I(1))));
    const F depth = select(known, F(0.5F) * (nearest + farthest), F(1));
    const Vec3<F> point = transform(viewer.first_from_other, depth * bearing);
    U on(0U);
    for (int p = 0; p < kMirrors; ++p) {
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

/// How much of a field lies behind each plane, is a mirror image, and is one behind the mirror's surface; by solid
/// angle, in whole numbers.
struct MirrorCounts {
  int behind[kMirrors], mirrored[kMirrors], confirmed[kMirrors];
};

/// A stage over the fields.
struct CountMirrored {
  static constexpr int kCounts = 0;

  GridView grid;  ///< of the pixels
  const std::uint32_t* evidence;
  const std::uint32_t* confirmed;
  MirrorCounts* counts;

  PMSP_HD int width() const { return kFieldColumns; }
  PMSP_HD int height() const { return kFieldRows; }

  PMSP_HD void operator()(const Place<float>& at, bool* /*counted*/) const {
    const int columns = grid.width / kSightCell;
    const int rows = grid.height / kSightCell;
    MirrorCounts sums{};
    for (int row = at.row * rows / kFieldRows; row < (at.row + 1) * rows / kFieldRows; ++row) {
      const int weight = static_cast<int>(kWeight * grid.cos_lat[row * kSightCell]);
      for (int column = at.column * columns / kFieldColumns; column < (at.column + 1) * columns / kFieldColumns;
           ++column) {
        const std::uint32_t word = evidence[row * columns + column];
        const std::uint32_t in_front = confirmed[row * columns + column];
        for (int p = 0; p < kMirrors && word != 0; ++p) {
          const bool mirrored = (word & mirrored_bit(p)) != 0;
          sums.behind[p] += (word & behind_bit(p)) != 0 ? weight : 0;
          sums.mirrored[p] += mirrored ? weight : 0;
          sums.confirmed[p] += mirrored && (in_front & behind_bit(p)) != 0 ? weight : 0;
        }
      }
    }
    counts[at.index] = sums;
  }

  /// Of a cell at the equator.
  static constexpr float kWeight = 64.0F;
};

/// Leaves the planes that are mirrors; a stage over the planes.
struct ChooseMirrors {
  static constexpr int kCounts = 0;

  const MirrorCounts* counts;
  int cells;  ///< of the sphere
  WidePlane* planes;

  PMSP_HD int width() const { return kMirrors; }
  PMSP_HD int height() const { return 1; }

  PMSP_HD void operator()(const Place<float>& at, bool* /*counted*/) const {
    float behind = 0.0F;
    float mirrored = 0.0F;
    float confirmed = 0.0F;
    for (int i = 0; i < kFields; ++i) {
      behind += static_cast<float>(counts[i].behind[at.index]);
      mirrored += static_cast<float>(counts[i].mirrored[at.index]);
      confirmed += static_cast<float>(counts[i].confirmed[at.index]);
    }
    const float sphere = CountMirrored::kWeight * static_cast<float>(2.0 / kPi) * static_cast<float>(cells);
    const bool is_mirror = mirrored >= kLeastMirrored * behind && confirmed >= kLeastConfirmed * mirrored &&
                           confirmed >= kLeastMirror * sphere;
    if (!is_mirror) planes[at.index] = {{0.0F, 0.0F, 0.0F}, 0.0F};
  }
};

/// What is known of a keyframe's mirrors in the end.
struct MirrorView {
  const WidePlane* mirrors;  ///< kMirrors; nullptr = none are looked for
  const std::uint32_t* evidence;
  const std::uint32_t* confirmed;
};

/// Whether a keyframe's point is what a mirror shows. `at`: the pixel.
template <class F>
PMSP_HD MaskOf<F> is_mirrored(const MirrorView& view, const GridView& grid, const Place<F>& at, const Vec3<F>& point) {
  const GridView cells{grid.width / kSightCell, grid.height / kSightCell, nullptr, nullptr, nullptr, nullptr};
  MaskOf<F> found = F(0) > F(1);
  for (int p = 0; p < kMirrors; ++p) {
    if (!is_plane(view.mirrors[p])) continue;
    const MaskOf<F> behind = dot(plane_of<F>(view.mirrors[p]), point) > F(kBehindMirror);
    if (!any(behind)) continue;
    const IntOf<F> column = at.column >> 1;
    const int row = at.row / kSightCell;
    const UIntOf<F> own = gather_words<F>(view.evidence, IntOf<F>(IntOf<F>(row * cells.width) + column));
    found = found | (behind & has_bit<F>(own, mirrored_bit(p)));
    for (int dy = -kBesideConfirmed; dy <= kBesideConfirmed; ++dy) {
      if (row + dy < 0 || row + dy >= cells.height) continue;
      const float wider = 1.0F / max(grid.cos_lat[(row + dy) * kSightCell], 8.0F / static_cast<float>(cells.width));
      for (int dx = -kBesideConfirmed; dx <= kBesideConfirmed && any(behind & !found); ++dx) {
        const Beside<F> there = beside<F>(cells, column, row, static_cast<int>(static_cast<float>(dx) * wider), dy);
        const IntOf<F> index = there.row * IntOf<F>(cells.width) + there.column;
        const UIntOf<F> word = gather_words<F>(view.confirmed, index);
        found = found | (behind & has_bit<F>(word, behind_bit(p)));
      }
    }
  }
  return found;
}

}  // namespace pmsp::kernels
