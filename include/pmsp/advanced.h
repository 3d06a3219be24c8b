// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "pmsp/api.h"

namespace pmsp {

/// Decides which keyframes are worth a depth map (Surmann et al. 2022, section III).
struct PMSP_API ViewFilterOptions {
  bool enabled = true;
  double min_parallax_deg = 6.0;   ///< [deg], 0 to 180, below max_parallax_deg
  double max_parallax_deg = 60.0;  ///< [deg], 0 to 180
  /// Share of the landmarks in common with the newest accepted keyframe whose parallax must lie between the two angles,
  /// 0 to 1. Larger accepts fewer keyframes.
  double min_share = 0.15;
  /// Sharpness, relative to that of the last accepted keyframes, below which a keyframe is left out as blurred,
  /// 0 to 1; 0: never. Gradient energy around the landmarks in common. Sharp ones have 0.9 to 1.1; motion blur over 2.7
  /// pixels of the depth map makes it 0.55, over 7 pixels 0.2.
  double min_sharpness = 0.40;

  /// Throws InvalidOption.
  void validate() const;
};

/// Where PatchMatch starts from.
struct PMSP_API InitOptions {
  bool sparse_points = true;      ///< planes through the keyframe's landmarks, spread over their neighbourhood
  double sparse_radius_px = 6.0;  ///< how far one landmark spreads, in pixels of the depth map, 0 to 100
  bool warp_previous = true;      ///< planes of the previous keyframe's depth map, moved into this keyframe
  /// That chain begins anew wherever floor(id / chain_keyframes) changes, so that no keyframe depends on all before it,
  /// 0 to 100000; 0 = never.
  int chain_keyframes = 16;
  /// The depth range is that of the keyframe's landmarks (2nd to 98th percentile), widened by this factor at both ends,
  /// 1 to 1000. Random planes are drawn log-uniformly inside, none is kept outside.
  double range_margin = 3.0;

  void validate() const;  ///< throws InvalidOption
};

/// Red-black PatchMatch on the sphere.
struct PMSP_API PatchMatchOptions {
  /// Of the first pass, 1 to 100; each visits every pixel once. More of them find what has texture more exactly, the
  /// geometric passes what has none.
  int iterations = 3;
  int neighbours = 2;   ///< source keyframes per depth map, 1 to 8; cost grows in proportion
  int refinements = 3;  ///< random draws per pixel and iteration, 0 to 32
  /// Size of the patch of textured pixels, relative to that of others, 0.1 to 1; 1: all pixels count as textured.
  double fine_patch = 0.3;
  /// Images are compared at their own width, at most this many times that of the depth maps, 0.25 to 8. Finer images
  /// keep edges and thin things that a pixel of the depth map would average away, but noise as well.
  double image_scale = 2.0;
  double sigma_color = 20.0;  ///< bilateral weight: gray levels (0 to 255), 1 to 1000
  /// Where the surface around the pixel is smoother, sigma_color shrinks down to this, so that the edge of a near thing
  /// does not decide for the wall behind it, 1 to 1000; sigma_color or more: never.
  double min_sigma_color = 4.0;
  /// Before each geometric pass, planes through the reliable surface around are proposed to pixels without texture, and
  /// preferred there; see plane_priors (pmsp/stages.h).
  bool plane_priors = true;
  /// Further passes over the depth maps, in which planes score higher that agree with the depth maps of the neighbours,
  /// 0 to 8. Each needs those of the pass before first, so that results come later by as many keyframes as neighbours
  /// are looked for ahead. With few neighbours more of them are worth their time. A neighbour from which, by its map,
  /// something hides a textured pixel's plane has no say about that plane.
  int geometric_passes = 4;

  void validate() const;  ///< throws InvalidOption
};

/// Removes single outliers from a depth map, and sets its edges right.
struct PMSP_API MedianFilterOptions {
  bool enabled = false;
  double max_relative_deviation = 0.05;  ///< from the median of the 3 x 3 neighbourhood, 0 to 1; more is dropped
  /// Photometric score (NCC, what is negative taken for 0) below which a pixel is dropped, -1 to 1. 0 drops none: on
  /// bare walls it is low however right the plane is, and what is wrong the consistency filter finds.
  double min_score = 0.0;
  /// Then moves depth edges to where the image has them: see weighted_median_filter (pmsp/stages.h).
  bool weighted = true;

  void validate() const;  ///< throws InvalidOption
};

/// Keeps what several depth maps agree on.
struct PMSP_API ConsistencyFilterOptions {
  bool enabled = true;
  int window = 5;     ///< depth maps compared, the filtered one in the middle, odd, 3 to 15
  int min_views = 3;  ///< depth maps that must agree, the filtered one included, 1 to 15, `window` at most
  /// Deviation that still counts as agreement, 0 to 1; where the angle of a pixel [rad] is larger, that angle is.
  double max_relative_depth = 0.01;

  void validate() const;  ///< throws InvalidOption
};

/// Joins depth maps into a cloud without duplicates.
struct PMSP_API FusionOptions {
  int window = 5;                    ///< depth maps that are joined with each other, odd, 1 to 31
  double spacing_px = 0.3;           ///< points closer than this are one point; pixels of the nearer depth map, 0 to 4
  double max_relative_depth = 0.02;  ///< deviation up to which two depths are one surface, 0 to 1
  double max_normal_deg = 60.0;      ///< angle of normals up to which they are one surface [deg], 0 to 180
  double min_confidence = 0.1;       ///< points below are not written (see DepthMap::confidence), 0 to 1
  /// A pixel gives way to a clearly more confident one of its depth map whose surface lies within so many of the
  /// pixel's expected errors, 0 to 10; 0 = none does. More makes the cloud truer and sparser. Errors that are less than
  /// a pixel wide change nothing.
  double suppression = 0.0;
  /// With `free_space.whole_mission`: used keyframes that may make the point of a place in place of this one, half on
  /// either side, 1 to 100000. Each of four rounds waits for those ahead, with 11 bytes and more a pixel.
  int history = 100;

  void validate() const;  ///< throws InvalidOption
};

/// Removes points that other keyframes have looked through: floaters beside the edges of near things.
struct PMSP_API FreeSpaceOptions {
  bool enabled = true;
  int views = 16;                    ///< keyframes asked about each keyframe's points besides the fusion window, 1 to
                                     ///< 32; no more than 32 together
  double max_relative_depth = 0.02;  ///< deviation that still confirms a point, 0 to 1
  double min_relative_gap = 0.05;    ///< a surface this much farther away has been seen through the point, 0 to 1
  /// What may speak against a point, relative to what speaks for it, 0 to 100. Smaller removes more.
  double max_contradiction = 0.75;
  /// Leave out what mirrors show, such as polished floors: a wide plane of the keyframe is one where other keyframes
  /// have its surface in front of what lies behind it, and much of that is a mirror image of what they see before it.
  bool mirrors = true;
  /// Let keyframes to come have their say, too, and leave out points of places that any of `fusion.history` shows
  /// better, not only those of the fusion window. Points are held back until the end of the sequence, or until half of
  /// `history` and twice `fusion.history` keyframes later. For live use false.
  bool whole_mission = false;
  /// Used keyframes that may be asked, half on either side, 1 to 100000. Memory for each: two bytes a pixel of its
  /// depth map; with `whole_mission` 11 bytes and more a pixel for those ahead.
  int history = 100;

  void validate() const;  ///< throws InvalidOption
};

/// What the stages do, and how they run. `preset` sets it by Quality; few users change it.
struct AdvancedOptions {
  ViewFilterOptions view_filter;
  InitOptions init;
  PatchMatchOptions patchmatch;
  MedianFilterOptions median;
  ConsistencyFilterOptions consistency;
  FusionOptions fusion;
  FreeSpaceOptions free_space;
  /// CUDA: `add` returns before its work is done and results come with the next call, so that copies and kernels of
  /// successive keyframes overlap. The CPU ignores it.
  bool pipelined = true;
  /// How many keyframes will come; 0 = not known. With CUDA, backend and scratch folder are chosen by the memory that
  /// so many take, or else a long flight. It changes no byte of the result.
  std::int64_t expected_keyframes = 0;
};

}  // namespace pmsp
