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
  float max;        ///< for exact agreement
  float max_far;    ///< for exact agreement with a far prior
  float tolerance;  ///< relative depth difference from which on the bonus is 0
};
template <class F>
PMSP_HD F prior_score(const F& prior, const F& inverse_depth, const PriorBonus& bonus) {
  const auto known = prior > F(0);
  const F off = abs(inverse_depth / select(known, prior, F(1)) - F(1)) * F(1.0F / bonus.tolerance);
  return select(known, select(is_far(prior), F(bonus.max_far), F(bonus.max)) * max(F(1) - off, F(0)), F(0));
}

/// Input common to all pixels of a keyframe.
template <class Cube>
struct MatchArgs {
  Cube reference;
  SourceView<Cube> views[kMaxViews];
  int num_views;
  PatchParams params;
  PlaneLimits limits;
  float log_depth_span;  ///< ln(largest depth / smallest depth)
  RandomKey random;
  int refinements;  ///< random hypotheses per pixel and iteration
  PriorBonus bonus;
};

/// Data of a pixel in one iteration, common to all hypotheses.
template <class F, class Patch = ReferencePatch<F>>
struct PixelContext {
  PatchFrame<F> frame;
  Patch patch;
  ViewWeights<F> weights;
  F prior;  ///< inverse depth of the prior plane; 0 = none
};

/// Chooses the fine patch, which keeps edges in place, if its variance suffices, else the coarse one.
template <class F, class Patch, class Cube>
PMSP_HD void load_context(PixelContext<F, Patch>& context, const MatchArgs<Cube>& m, const F& sin_lon, const F& cos_lon,
                          const F& sin_lat, const F& cos_lat) {
  const F fine_spacing(m.params.fine_spacing);
  const MaskOf<F> all_fine = fine_spacing > F(0);
  context.frame = patch_frame(sin_lon, cos_lon, sin_lat, cos_lat, fine_spacing);
  load_patch(context.patch, m.reference, context.frame, m.params, all_fine);
  const MaskOf<F> textured = context.patch.variance > F(m.params.fine_variance);
  if (!all(textured)) {
    const F spacing = select(textured, fine_spacing, F(m.params.spacing));
    context.frame = patch_frame(sin_lon, cos_lon, sin_lat, cos_lat, spacing);
    load_patch(context.patch, m.reference, context.frame, m.params, textured);
  }
}

/// Scores a plane and keeps it if it is allowed and better. `weigh`: it is the pixel's current plane, which determines
/// the weights of the views.
template <class F, class Patch, class Cube>
PMSP_HD void propose(Hypothesis<F>& best, const Vec3<F>& plane, PixelContext<F, Patch>& context,
                     const MatchArgs<Cube>& m, bool weigh) {
  const auto allowed = is_allowed(plane, context.frame.bearing, m.limits);
  if (!any(allowed)) return;
  const F score =
      plane_score(context.patch, context.frame, m.views, m.num_views, plane, m.params, context.weights, weigh) +
      prior_score(context.prior, dot(plane, context.frame.bearing), m.bonus);
  if (weigh && !all(allowed)) keep_weights_where(context.weights, allowed);
  const auto better = allowed & (score > best.score);
  best.plane = select(better, plane, best.plane);
  best.score = select(better, score, best.score);
}

/// Number of random numbers per proposal.
constexpr std::uint32_t kDrawsPerProposal = 4;

/// Random initial plane of a pixel.
template <class F, class Cube>
PMSP_HD Vec3<F> random_start(const UIntOf<F>& pixel, const Vec3<F>& bearing, const MatchArgs<Cube>& m) {
  return random_plane<F>(m.random, pixel, 0, bearing, m.limits, m.log_depth_span);
}

/// Random search around the current plane: proposal number `draw` (0 to m.refinements - 1) of an iteration. Steps
/// shrink from draw to draw, and over the first iterations.
template <class F, class Cube>
PMSP_HD Vec3<F> refined(const Hypothesis<F>& best, const UIntOf<F>& pixel, int iteration, int draw,
                        const Vec3<F>& bearing, const MatchArgs<Cube>& m) {
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

/// Number of neighbours' planes tested per iteration: the better one of each opposite pair (Xu and Tao 2019).
constexpr int kPropagatedPlanes = kNeighbourOffsets / 2;

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
template <class ViewTypes>
struct ReorderPlanes {
  static constexpr int kCounts = 0;

  typename ViewTypes::Map from;
  typename ViewTypes::Planes to;
  bool to_rows;

  PMSP_HD int width() const { return from.width; }
  PMSP_HD int height() const { return from.height; }

  PMSP_HD void operator()(const RowPixels<float>& at, bool* /*counted*/) const {
    const std::size_t in_rows = static_cast<std::size_t>(at.index);
    const std::size_t in_colours = checkerboard_index(from.width, at.column, at.row);
    const int source = static_cast<int>(to_rows ? in_colours : in_rows);
    put(to, to_rows ? in_rows : in_colours, 1,
        Hypothesis<float>{plane_at<float>(from, source), score_at<float>(from, source)});
  }
};

/// Subtracts the prior bonus from the scores (pmsp::subtract_priors). A stage; `to` may be `map`.
template <class ViewTypes>
struct ScoresWithoutPriors {
  static constexpr int kCounts = 0;

  typename ViewTypes::Map map;
  typename ViewTypes::Map priors;
  GridView grid;
  PriorBonus bonus;
  typename ViewTypes::Planes to;

  PMSP_HD int width() const { return grid.width; }
  PMSP_HD int height() const { return grid.height; }

  template <class F>
  PMSP_HD void operator()(const RowPixels<F>& at, MaskOf<F>* /*counted*/) const {
    const Vec3<F> bearing = bearing_at(grid, at);
    const Vec3<F> plane = plane_at<F>(map, at.index);
    const F added = prior_score(dot(plane_at<F>(priors, at.index), bearing), dot(plane, bearing), bonus);
    put(to, static_cast<std::size_t>(at.first), at.count,
        Hypothesis<F>{plane, min(max(score_at<F>(map, at.index) - added, F(0)), F(1))});
  }
};

/// Consecutive pixels of a ring (grid_view.h), one per lane.
template <class F>
struct PixelBatch {
  int y, colour, k;
  int count;               ///< pixels from k to the end of the ring
  std::size_t ring;        ///< index of the ring's first pixel, in checkerboard order
  IntOf<F> column, index;  ///< in row order; lanes beyond the end repeat the last pixel
};

/// Pass of PatchMatch over a keyframe. `State`: its pixels in checkerboard order (grid_view.h).
template <class ViewTypes>
struct PatchMatchPass {
  MatchArgs<typename ViewTypes::Cube> match_args;
  GridView grid;
  typename ViewTypes::State state;
  typename ViewTypes::Mask mask;
  typename ViewTypes::Map priors;           ///< prior planes; empty = none
  typename ViewTypes::Landmarks landmarks;  ///< initial planes; empty = none
  typename ViewTypes::Warped warped;

  /// Initial planes: random ones, those of landmarks, and those of the previous keyframe.
  template <class F, class Patch>
  PMSP_HD void start(PixelContext<F, Patch>& context, const PixelBatch<F>& batch) const {
    Hypothesis<F> best{{F(0), F(0), F(0)}, F(-1)};
    const MaskOf<F> unmasked = is_unmasked<F>(mask, batch.index);
    if (any(unmasked)) {
      begin(context, batch);
      const Vec3<F> first = random_start<F>(as_uint<F>(batch.index), context.frame.bearing, match_args);
      PMSP_ROLL
      for (int kind = 0; kind < 3; ++kind) {
        propose(best,
                kind == 0   ? first
                : kind == 1 ? proposed(landmarks, batch)
                            : proposed(warped, batch),
                context, match_args, false);
      }
    }
    keep(best, unmasked, batch);
  }

  /// Propagation and refinement. The pixel's current plane comes first, since it determines the weights of the views.
  /// `rescore`: scores are from the previous pass, with other depth maps and priors: recompute them.
  template <class F, class Patch>
  PMSP_HD void iterate(PixelContext<F, Patch>& context, const PixelBatch<F>& batch, int iteration, bool rescore) const {
    const MaskOf<F> unmasked = is_unmasked<F>(mask, batch.index);
    if (!any(unmasked)) return;
    begin(context, batch);
    const int half = grid.width / 2;
    const auto neighbour_at = [&](const NeighbourOffset& offset) {
      const NeighbourRing from = neighbour_ring(grid.width, grid.height, batch.y, batch.colour, offset.dx, offset.dy);
      return in_ring<F>(state, ring_index(grid.width, from.y, 1 - batch.colour), batch.k + from.shift, half);
    };
    const Hypothesis<F> before = in_ring<F>(state, batch.ring, batch.k, half);
    const bool rescores_current = rescore || match_args.num_views >= kMinWeightedViews;
    Hypothesis<F> best = before;
    if (rescores_current) best = {{F(0), F(0), F(0)}, F(-1)};
    constexpr int kCurrentPlane = -2, kPriorPlane = -1;
    PMSP_ROLL
    for (int i = rescores_current ? kCurrentPlane : 0; i < kPropagatedPlanes + match_args.refinements; ++i) {
      if (i == kPriorPlane && !rescore) continue;
      Vec3<F> plane;
      if (i < 0) {
        plane = i == kCurrentPlane ? before.plane : proposed(priors, batch);
      } else if (i < kPropagatedPlanes) {
        plane = neighbour_plane<F>(i, neighbour_at);
      } else {
        plane =
            refined(best, as_uint<F>(batch.index), iteration, i - kPropagatedPlanes, context.frame.bearing, match_args);
      }
      propose(best, plane, context, match_args, i == kCurrentPlane);
    }
    keep(best, unmasked, batch);
  }

 private:
  /// Returns the proposed plane; zero = none.
  template <class F, class Planes>
  PMSP_HD static Vec3<F> proposed(const Planes& planes, const PixelBatch<F>& batch) {
    if (is_empty(planes)) return {F(0), F(0), F(0)};
    return plane_at<F>(planes, batch.index);
  }

  template <class F, class Patch>
  PMSP_HD void begin(PixelContext<F, Patch>& context, const PixelBatch<F>& batch) const {
    load_context(context, match_args, gather<F>(grid.sin_lon, batch.column), gather<F>(grid.cos_lon, batch.column),
                 F(grid.sin_lat[batch.y]), F(grid.cos_lat[batch.y]));
    set_equal_weights(context.weights);
    context.prior = dot(proposed(priors, batch), context.frame.bearing);
  }

  template <class F>
  PMSP_HD void keep(const Hypothesis<F>& best, const MaskOf<F>& unmasked, const PixelBatch<F>& batch) const {
    const Vec3<F> none{F(0), F(0), F(0)};
    put(state, batch.ring + static_cast<std::size_t>(batch.k), batch.count,
        Hypothesis<F>{select(unmasked, best.plane, none), select(unmasked, best.score, F(-1))});
  }
};

}  // namespace pmsp::kernels
