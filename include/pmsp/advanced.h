// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "pmsp/api.h"

namespace pmsp {

/// Selection of keyframes that get a depth map (Surmann et al. 2022, section III).
struct PMSP_API ViewFilterOptions {
  bool enabled = true;
  double min_parallax_deg = 6.0;   ///< minimum useful parallax [deg], 0 to 180, below max_parallax_deg
  double max_parallax_deg = 60.0;  ///< maximum useful parallax [deg], 0 to 180
  /// Minimum share of useful parallaxes among landmarks in common with the newest accepted keyframe, 0 to 1. Larger
  /// values accept fewer keyframes.
  double min_share = 0.15;
  /// Minimum sharpness (gradient energy around common landmarks) relative to the last accepted keyframes, 0 to 1; 0 =
  /// no rejection of blurred keyframes.
  double min_sharpness = 0.40;

  void validate() const;  ///< throws InvalidOption
};

/// Initial planes of PatchMatch.
struct PMSP_API InitOptions {
  bool sparse_points = true;      ///< planes through the landmarks of the keyframe
  double sparse_radius_px = 6.0;  ///< radius around a landmark that gets its plane [px of the depth map], 0 to 100
  bool warp_previous = true;      ///< warped plane map of the previous keyframe
  /// Length of chains of warped plane maps [ids], 0 to 100000; 0 = unlimited. Chains restart where floor(id /
  /// chain_keyframes) changes, so that no keyframe depends on all previous ones.
  int chain_keyframes = 16;
  /// Factor, 1 to 1000, that widens the depth range of the landmarks (2nd to 98th percentile) at both ends. Random
  /// planes are log-uniform in this range; planes beyond it are discarded.
  double range_margin = 3.0;

  void validate() const;  ///< throws InvalidOption
};

/// Red-black PatchMatch on the sphere.
struct PMSP_API PatchMatchOptions {
  /// Iterations of the first pass, 1 to 100. They improve textured surfaces, geometric passes untextured ones.
  int iterations = 3;
  int neighbours = 2;   ///< source views per depth map, 1 to 8; time is proportional
  int refinements = 3;  ///< random hypotheses per pixel and iteration, 0 to 32
  /// Patch size at textured pixels relative to that at others, 0.1 to 1; 1 = one size, all pixels count as textured.
  double fine_patch = 0.3;
  /// Maximum width of images relative to the depth map, 0.25 to 8. Larger values preserve thin structures, and noise.
  double image_scale = 2.0;
  double sigma_color = 20.0;  ///< maximum standard deviation of the bilateral weights [gray levels], 1 to 1000
  /// Minimum standard deviation, where the patch is smooth, so that foreground edges do not dominate [gray levels], 1
  /// to 1000; if at least sigma_color, the deviation is sigma_color everywhere.
  double min_sigma_color = 4.0;
  /// Adds prior planes to the hypotheses of untextured pixels before each geometric pass, with a score bonus; see
  /// plane_priors (pmsp/stages.h).
  bool plane_priors = true;
  /// Passes in which disagreement with the depth maps of source views lowers the score, 0 to 8; views in which a
  /// textured pixel is hidden are ignored. Each delays results by the reach of source views; more pay off with few
  /// source views.
  int geometric_passes = 4;

  void validate() const;  ///< throws InvalidOption
};

/// Removal of outliers and correction of depth edges.
struct PMSP_API MedianFilterOptions {
  bool enabled = false;                  ///< removal of outliers
  double max_relative_deviation = 0.05;  ///< maximum deviation from the median of 3 x 3 pixels, 0 to 1
  /// Minimum photometric score (NCC, clamped to 0), -1 to 1; 0 = none. Untextured surfaces have low scores.
  double min_score = 0.0;
  bool weighted = true;  ///< then move depth edges to image edges, see weighted_median_filter (pmsp/stages.h)

  void validate() const;  ///< throws InvalidOption
};

/// Agreement of depth maps.
struct PMSP_API ConsistencyFilterOptions {
  bool enabled = true;
  int window = 5;     ///< depth maps compared, including the filtered one in the middle, odd, 3 to 15
  int min_views = 3;  ///< depth maps that must agree, including the filtered one, 1 to 15, at most `window`
  /// Maximum relative depth difference for agreement, 0 to 1; at least the angle of a pixel [rad].
  double max_relative_depth = 0.01;

  void validate() const;  ///< throws InvalidOption
};

/// Fusion of depth maps into points, and duplicate removal.
struct PMSP_API FusionOptions {
  int window = 5;           ///< depth maps averaged into a point, odd, 1 to 31
  double spacing_px = 0.3;  ///< minimum distance of points [px of the dropped one], 0 to 4; 0 = keep duplicates
  double max_relative_depth = 0.02;  ///< maximum relative depth difference on one surface, 0 to 1
  double max_normal_deg = 60.0;      ///< maximum angle between normals on one surface [deg], 0 to 180
  double min_confidence = 0.1;       ///< minimum confidence of a point (see DepthMap::confidence), 0 to 1
  /// Suppression by clearly more confident pixels within this number of expected errors, 0 to 10; 0 = none. Larger
  /// values give more accurate and sparser clouds. Errors below a pixel have no effect.
  double suppression = 0.0;
  /// With `free_space.whole_mission`: used keyframes checked for duplicates, half on either side, 1 to 100000. Each of
  /// the four rounds waits for the following half, with at least 11 bytes per pixel of each.
  int history = 100;

  void validate() const;  ///< throws InvalidOption
};

/// Removal of points that other depth maps see through, such as floaters at depth edges.
struct PMSP_API FreeSpaceOptions {
  bool enabled = true;
  int views = 16;                    ///< viewers besides the fusion window, 1 to 32; at most 32 in total
  double max_relative_depth = 0.02;  ///< maximum relative depth difference that confirms a point, 0 to 1
  double min_relative_gap = 0.05;    ///< minimum relative distance behind a point of a surface seen through it, 0 to 1
  /// Maximum weight of contradictions relative to that of confirmations, 0 to 100. Smaller values remove more points.
  double max_contradiction = 0.75;
  /// Removes mirror images, as in polished floors. A wide plane is a mirror if other keyframes see its surface in front
  /// of points behind it, and many of these are mirror images of surfaces in front of it.
  bool mirrors = true;
  /// Uses later keyframes as viewers, and removes duplicates beyond the fusion window, see `fusion.history`. Points are
  /// delivered at the end, or half of `history` plus twice `fusion.history` keyframes later; by LiveDensifier without
  /// delay.
  bool whole_mission = false;
  /// Accepted keyframes from which viewers are chosen, half on either side, 1 to 100000. Memory: two bytes per pixel of
  /// each depth map; with `whole_mission` at least 11 for following ones.
  int history = 100;

  void validate() const;  ///< throws InvalidOption
};

/// Options of the stages and the pipeline, set by `preset`.
struct AdvancedOptions {
  ViewFilterOptions view_filter;
  InitOptions init;
  PatchMatchOptions patchmatch;
  MedianFilterOptions median;
  ConsistencyFilterOptions consistency;
  FusionOptions fusion;
  FreeSpaceOptions free_space;
  /// CUDA: copies and kernels of successive keyframes overlap; `add` returns before its work is done, and results are
  /// delivered in the next call.
  bool pipelined = true;
  /// Expected number of keyframes, by which backend and scratch folder are chosen with CUDA; 0 = unknown, as for a long
  /// mission. Does not change results.
  std::int64_t expected_keyframes = 0;
};

}  // namespace pmsp
