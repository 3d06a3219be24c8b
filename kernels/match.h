// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "equirect.h"
#include "patch.h"
#include "stage.h"

// Red-black PatchMatch (Barnes 2009; Galliani 2015; Surmann 2022) for one pixel. Its state is the best hypothesis so
// far. Every step proposes planes; an allowed plane with a higher score replaces the state.
namespace pmsp::kernels {

/// Score bonus for agreement with a prior plane. Without texture, photometric scores are noise and highest for an
/// arbitrary plane; with texture, the bonus is too small to hide a wrong prior.
struct PriorBonus {
  float most;       ///< for exact agreement
  float far;        ///< for exact agreement with a far prior
  float tolerance;  ///< relative depth difference from which on the bonus is 0
};
template <class F>
PMSP_HD F prior_score(const F& prior, const F& inverse_depth, const PriorBonus& bonus) {
  const auto known = prior > F(0);
  const F off = abs(inverse_depth / select(known, prior, F(1)) - F(1)) * F(1.0F / bonus.tolerance);
  return select(known, select(is_far(prior), F(bonus.far), F(bonus.most)) * max(F(1) - off, F(0)), F(0));
}

/// Input common to all pixels of a keyframe.
template <class Cube>
struct Matching {
  Cube reference;
  SourceView<Cube> views[kMaxViews];
  int num_views;
  PatchLayout layout;
  PlaneLimits limits;
  float log_depth_span;  ///< ln(largest depth / smallest depth)
  RandomKey random;
  int refinements;  ///< random proposals per visit
  PriorBonus bonus;
};

/// Data of one visit to a pixel, computed once for all proposals.
template <class F, class Patch = ReferencePatch<F>>
struct Visit {
  PatchFrame<F> frame;
  Patch patch;
  ViewWeights<F> weights;
  F prior;  ///< inverse depth of the prior plane; 0 = none
};

/// Chooses the fine patch, which keeps edges in place, if its variance suffices, else the coarse one.
template <class F, class Patch, class Cube>
PMSP_HD void begin_visit(Visit<F, Patch>& visit, const Matching<Cube>& m, const F& sin_lon, const F& cos_lon,
                         const F& sin_lat, const F& cos_lat) {
  const F fine(m.layout.fine_spacing);
  visit.frame = patch_frame(sin_lon, cos_lon, sin_lat, cos_lat, fine);
  take_patch(visit.patch, m.reference, visit.frame, m.layout, fine > F(0));
  const MaskOf<F> textured = visit.patch.variance > F(m.layout.fine_variance);
  if (!all(textured)) {
    const F spacing = select(textured, fine, F(m.layout.spacing));
    visit.frame = patch_frame(sin_lon, cos_lon, sin_lat, cos_lat, spacing);
    take_patch(visit.patch, m.reference, visit.frame, m.layout, textured);
  }
}

/// Scores a plane and keeps it if it is allowed and better. `weigh`: it is the pixel's current plane, which determines
/// the weights of the views.
template <class F, class Patch, class Cube>
PMSP_HD void propose(Hypothesis<F>& best, const Vec3<F>& plane, Visit<F, Patch>& visit, const Matching<Cube>& m,
                     bool weigh) {
  const auto allowed = is_allowed(plane, visit.frame.bearing, m.limits);
  if (!any(allowed)) return;
  const F score = plane_score(visit.patch, visit.frame, m.views, m.num_views, plane, m.layout, visit.weights, weigh) +
                  prior_score(visit.prior, dot(plane, visit.frame.bearing), m.bonus);
  if (weigh && !all(allowed)) weigh_only(visit.weights, allowed);
  const auto better = allowed & (score > best.score);
  best.plane = select(better, plane, best.plane);
  best.score = select(better, score, best.score);
}

/// Number of random numbers per proposal.
constexpr std::uint32_t kDrawsPerProposal = 4;

/// Random initial plane of a pixel.
template <class F, class Cube>
PMSP_HD Vec3<F> random_start(const UIntOf<F>& pixel, const Vec3<F>& bearing, const Matching<Cube>& m) {
  return random_plane<F>(m.random, pixel, 0, bearing, m.limits, m.log_depth_span);
}

/// Random search around the current plane: proposal number `draw` (0 to m.refinements - 1) of an iteration. Steps
/// shrink from draw to draw, and over the first iterations.
template <class F, class Cube>
PMSP_HD Vec3<F> refined(const Hypothesis<F>& best, const UIntOf<F>& pixel, int iteration, int draw,
                        const Vec3<F>& bearing, const Matching<Cube>& m) {
  float depth_step = 0.06F / static_cast<float>(1 << (iteration < 3 ? iteration : 3));
  float normal_step = 15.0F * depth_step;
  for (int i = 0; i < draw; ++i) {
    depth_step *= 0.5F;
    normal_step *= 0.7F;
  }
  const std::uint32_t first = kDrawsPerProposal * (1U + static_cast<std::uint32_t>(iteration * m.refinements + draw));
  const auto has_plane = dot(best.plane, best.plane) > F(0);
  const Vec3<F> from = select(has_plane, best.plane, F(m.limits.min_inverse_depth) * bearing);
  return perturbed(from, m.random, pixel, first, bearing, F(depth_step), F(normal_step));
}

/// Offsets of distance 1 and 3 in four directions, opposite ones consecutive. Their sum of coordinates is odd, so that
/// all have the other colour.
struct NeighbourOffset {
  int dx, dy;
};
constexpr int kNeighbourOffsets = 8;
PMSP_HD NeighbourOffset neighbour_offset(int i) {
  const int distance = i < 4 ? 1 : 3;
  const int dx = (i & 3) == 0 ? distance : (i & 3) == 1 ? -distance : 0;
  const int dy = (i & 3) == 2 ? distance : (i & 3) == 3 ? -distance : 0;
  return {dx, dy};
}

/// Number of neighbours' planes per visit: of each opposite pair the better one (after Xu and Tao 2019). Testing more
/// of them gains less than more iterations.
constexpr int kNeighbours = kNeighbourOffsets / 2;

/// Candidate i. `at(offset)`: hypothesis of the neighbour.
template <class F, class At>
PMSP_HD Vec3<F> neighbour_plane(int i, const At& at) {
  const Hypothesis<F> one = at(neighbour_offset(2 * i));
  const Hypothesis<F> other = at(neighbour_offset(2 * i + 1));
  return select(other.score > one.score, other.plane, one.plane);
}

/// Position of the neighbour (dx, dy) in checkerboard order (grid_view.h): row, and shift to the right in the ring of
/// that row's pixels of the other colour. Beyond a pole the row is continued on the opposite meridian; there one column
/// more is a negligible angle, and is added if needed for the other colour.
struct NeighbourRing {
  int y;
  int shift;
};
PMSP_HD NeighbourRing neighbour_ring(int width, int height, int y, int colour, int dx, int dy) {
  int row = y + dy;
  int columns = dx;
  if (row < 0 || row >= height) {
    row = row < 0 ? -1 - row : 2 * height - 1 - row;
    columns = width / 2;
    if (((columns + row - y) & 1) == 0) ++columns;
  }
  const int parity = (y + colour) & 1;
  const int other_parity = (row + 1 - colour) & 1;
  return {row, (parity + columns - other_parity) / 2};
}

/// Reorders planes from row order to checkerboard order (grid_view.h), or back; a stage.
template <class Views>
struct ReorderPlanes {
  static constexpr int kCounts = 0;

  typename Views::Map from;
  typename Views::Planes to;
  bool to_rows;

  PMSP_HD int width() const { return from.width; }
  PMSP_HD int height() const { return from.height; }

  PMSP_HD void operator()(const Place<float>& at, bool* /*counted*/) const {
    const std::size_t in_rows = static_cast<std::size_t>(at.index);
    const std::size_t in_colours = checkerboard_index(from.width, at.column, at.row);
    const int source = static_cast<int>(to_rows ? in_colours : in_rows);
    put(to, to_rows ? in_rows : in_colours, 1,
        Hypothesis<float>{plane_at<float>(from, source), score_at<float>(from, source)});
  }
};

/// Subtracts the bonus of priors from the scores (pmsp::subtract_priors): maps that agree with a prior share its
/// error, and their scores must not hide a lack of image evidence. A stage; `to` may be `map`.
template <class Views>
struct ScoresWithoutPriors {
  static constexpr int kCounts = 0;

  typename Views::Map map;
  typename Views::Map priors;
  GridView grid;
  PriorBonus bonus;
  typename Views::Planes to;

  PMSP_HD int width() const { return grid.width; }
  PMSP_HD int height() const { return grid.height; }

  template <class F>
  PMSP_HD void operator()(const Place<F>& at, MaskOf<F>* /*counted*/) const {
    const Vec3<F> bearing = bearing_at(grid, at);
    const Vec3<F> plane = plane_at<F>(map, at.index);
    const F added = prior_score(dot(plane_at<F>(priors, at.index), bearing), dot(plane, bearing), bonus);
    put(to, static_cast<std::size_t>(at.first), at.count,
        Hypothesis<F>{plane, min(max(score_at<F>(map, at.index) - added, F(0)), F(1))});
  }
};

/// Pixel of one colour in a visit; for a batch, the first of consecutive pixels of the row's ring.
template <class F>
struct PixelBatch {
  int y, colour, k;
  int count;               ///< pixels from k to the end of the ring
  std::size_t ring;        ///< index of the ring's first pixel, in checkerboard order
  IntOf<F> column, index;  ///< in row order; lanes beyond the end repeat the last pixel
};

/// Pass of PatchMatch over a keyframe. `State`: its pixels in checkerboard order (grid_view.h).
template <class Views>
struct PatchMatchPass {
  Matching<typename Views::Cube> matching;
  GridView grid;
  typename Views::State state;
  typename Views::Mask mask;
  typename Views::Map priors;           ///< prior planes; empty = none
  typename Views::Landmarks landmarks;  ///< initial planes; empty = none
  typename Views::Warped warped;

  /// Initial planes: random ones, those of landmarks, and those of the previous keyframe.
  template <class F, class Patch>
  PMSP_HD void start(Visit<F, Patch>& visit, const PixelBatch<F>& batch) const {
    Hypothesis<F> best{{F(0), F(0), F(0)}, F(-1)};
    const MaskOf<F> usable = is_usable<F>(mask, batch.index);
    if (any(usable)) {
      begin(visit, batch);
      const Vec3<F> first = random_start<F>(as_uint<F>(batch.index), visit.frame.bearing, matching);
      PMSP_ROLL
      for (int kind = 0; kind < 3; ++kind) {
        propose(best,
                kind == 0   ? first
                : kind == 1 ? proposed(landmarks, batch)
                            : proposed(warped, batch),
                visit, matching, false);
      }
    }
    keep(best, usable, batch);
  }

  /// Propagation and refinement. The pixel's current plane comes first, since it determines the weights of the views.
  /// `rescore`: the planes have no valid scores yet.
  template <class F, class Patch>
  PMSP_HD void iterate(Visit<F, Patch>& visit, const PixelBatch<F>& batch, int iteration, bool rescore) const {
    const MaskOf<F> usable = is_usable<F>(mask, batch.index);
    if (!any(usable)) return;
    begin(visit, batch);
    const int half = grid.width / 2;
    const auto neighbour_at = [&](const NeighbourOffset& offset) {
      const NeighbourRing from = neighbour_ring(grid.width, grid.height, batch.y, batch.colour, offset.dx, offset.dy);
      return in_ring<F>(state, ring_index(grid.width, from.y, 1 - batch.colour), batch.k + from.shift, half);
    };
    const Hypothesis<F> before = in_ring<F>(state, batch.ring, batch.k, half);
    const bool own = rescore || matching.num_views >= kLeastWeighedViews;
    Hypothesis<F> best = before;
    if (own) best = {{F(0), F(0), F(0)}, F(-1)};
    PMSP_ROLL
    for (int i = own ? -2 : 0; i < kNeighbours + matching.refinements; ++i) {
      if (i == -1 && !rescore) continue;
      Vec3<F> plane;
      if (i < 0) {
        plane = i == -2 ? before.plane : proposed(priors, batch);
      } else if (i < kNeighbours) {
        plane = neighbour_plane<F>(i, neighbour_at);
      } else {
        plane = refined(best, as_uint<F>(batch.index), iteration, i - kNeighbours, visit.frame.bearing, matching);
      }
      propose(best, plane, visit, matching, i == -2);
    }
    keep(best, usable, batch);
  }

 private:
  /// The zero plane is no proposal.
  template <class F, class Planes>
  PMSP_HD static Vec3<F> proposed(const Planes& planes, const PixelBatch<F>& batch) {
    if (is_empty(planes)) return {F(0), F(0), F(0)};
    return plane_at<F>(planes, batch.index);
  }

  template <class F, class Patch>
  PMSP_HD void begin(Visit<F, Patch>& visit, const PixelBatch<F>& batch) const {
    begin_visit(visit, matching, gather<F>(grid.sin_lon, batch.column), gather<F>(grid.cos_lon, batch.column),
                F(grid.sin_lat[batch.y]), F(grid.cos_lat[batch.y]));
    weigh_alike(visit.weights);
    visit.prior = dot(proposed(priors, batch), visit.frame.bearing);
  }

  template <class F>
  PMSP_HD void keep(const Hypothesis<F>& best, const MaskOf<F>& usable, const PixelBatch<F>& batch) const {
    const Vec3<F> none{F(0), F(0), F(0)};
    put(state, batch.ring + static_cast<std::size_t>(batch.k), batch.count,
        Hypothesis<F>{select(usable, best.plane, none), select(usable, best.score, F(-1))});
  }
};

}  // namespace pmsp::kernels
