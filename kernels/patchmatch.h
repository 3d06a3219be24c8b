// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "equirect.h"
#include "patch.h"

// One pixel's share of red-black PatchMatch (Barnes 2009; Galliani 2015; Surmann 2022). A pixel's state is its best
// plane and that plane's score. Every step proposes planes; a proposal that is allowed and scores higher replaces the
// state.
namespace pmsp::kernels {

template <class F>
struct Hypothesis {
  Vec3<F> plane;
  F score;
};

/// What is fixed for a whole keyframe.
struct Matching {
  CubeView reference;
  const SourceView* views;
  int num_views;
  PatchLayout layout;
  PlaneLimits limits;
  float log_depth_span;  ///< ln(largest depth / smallest depth)
  RandomKey random;
  int refinements;  ///< random draws per visit
};

/// What is fixed for one visit to a pixel: computed once, used by all proposals.
template <class F>
struct Visit {
  PatchFrame<F> frame;
  RotatedFrame<F> turned[kMaxViews];
  ReferencePatch<F> patch;
};

/// A fine patch keeps edges where they are; a coarse one is needed where there is little texture. Each pixel gets the
/// fine one if that varies enough.
template <class F>
PMSP_HD void begin_visit(Visit<F>& visit, const Matching& m, const F& sin_lon, const F& cos_lon, const F& sin_lat,
                         const F& cos_lat) {
  const Vec3<F> right = tangent_right(sin_lon, cos_lon);
  const Vec3<F> down = tangent_down(sin_lon, cos_lon, sin_lat, cos_lat);
  const F fine(m.layout.fine_spacing);
  visit.frame = {bearing(sin_lon, cos_lon, sin_lat, cos_lat), fine * right, fine * down};
  visit.patch = reference_patch(m.reference, visit.frame, m.layout);
  const auto textured = visit.patch.variance > F(m.layout.fine_variance);
  if (!all(textured)) {
    const F spacing = select(textured, fine, F(m.layout.spacing));
    visit.frame.right = spacing * right;
    visit.frame.down = spacing * down;
    visit.patch = reference_patch(m.reference, visit.frame, m.layout);
  }
  for (int view = 0; view < m.num_views; ++view) visit.turned[view] = rotated(visit.frame, m.views[view]);
}

/// Scores a plane and keeps it where it is allowed and better.
template <class F>
PMSP_HD void propose(Hypothesis<F>& best, const Vec3<F>& plane, const Visit<F>& visit, const Matching& m) {
  const auto allowed = is_allowed(plane, visit.frame.bearing, m.limits);
  if (!any(allowed)) return;
  const F score = plane_score(visit.patch, visit.frame, visit.turned, m.views, m.num_views, plane, m.layout);
  const auto better = allowed & (score > best.score);
  best.plane = select(better, plane, best.plane);
  best.score = select(better, score, best.score);
}

/// Number of draws that one proposal of random numbers takes.
constexpr std::uint32_t kDrawsPerProposal = 4;

/// Starts a pixel: a random plane, whatever it scores.
template <class F>
PMSP_HD Hypothesis<F> start(const UIntOf<F>& pixel, const Visit<F>& visit, const Matching& m) {
  Hypothesis<F> best{{F(0), F(0), F(0)}, F(-1)};
  propose(best, random_plane<F>(m.random, pixel, 0, visit.frame.bearing, m.limits, m.log_depth_span), visit, m);
  return best;
}

/// Random search around the present plane. The steps shrink from draw to draw; the first iterations reach further.
template <class F>
PMSP_HD void refine(Hypothesis<F>& best, const UIntOf<F>& pixel, int iteration, const Visit<F>& visit,
                    const Matching& m) {
  const float reach = iteration == 0 ? 1.0F : 1.0F / static_cast<float>(1 << (iteration < 3 ? iteration : 3));
  float depth_step = 0.06F * reach;
  float normal_step = 0.9F * reach;
  std::uint32_t draw = kDrawsPerProposal * (1U + static_cast<std::uint32_t>(iteration * m.refinements));
  for (int i = 0; i < m.refinements; ++i) {
    const auto has_plane = dot(best.plane, best.plane) > F(0);
    const Vec3<F> from = select(has_plane, best.plane, F(m.limits.min_inverse_depth) * visit.frame.bearing);
    propose(best, perturbed(from, m.random, pixel, draw, visit.frame.bearing, F(depth_step), F(normal_step)), visit, m);
    draw += kDrawsPerProposal;
    depth_step *= 0.5F;
    normal_step *= 0.7F;
  }
}

/// The neighbours whose planes a pixel tries: distances 1 and 3 along the four directions. Their sum of coordinates is
/// odd, so they all have the other colour.
struct NeighbourOffset {
  int dx, dy;
};
constexpr int kNeighbours = 8;
PMSP_HD NeighbourOffset neighbour_offset(int i) {
  const int distance = i < 4 ? 1 : 3;
  const int dx = (i & 3) == 0 ? distance : (i & 3) == 1 ? -distance : 0;
  const int dy = (i & 3) == 2 ? distance : (i & 3) == 3 ? -distance : 0;
  return {dx, dy};
}

/// Where the neighbour (dx, dy) of a pixel lies in checkerboard order (src/sphere/grid.h): its row, and how many places
/// to the right of the pixel's own among that row's pixels of the other colour, which close to a ring. Beyond a pole
/// the row comes back on the opposite meridian; there one column more or less is no angle to speak of, and is chosen so
/// that the neighbour has the other colour.
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

}  // namespace pmsp::kernels
