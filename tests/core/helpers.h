// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "pmsp/options.h"
#include "pmsp/stages.h"
#include "pmsp/types.h"
#include "support/sanitized.h"
#include "synth/mission.h"

namespace pmsp::test {

/// Instruction set where it does not matter: with a sanitizer's checks, plain code is up to eight times as fast as the
/// widest (GCC 12).
constexpr Simd kAnySimd = kSanitized ? Simd::kScalar : Simd::kAuto;

/// Width of images whose depths need not be good.
constexpr int width_of_any(int usual) { return kSanitized ? 48 : usual; }

/// Three keyframes of a ready-made mission, small enough for many runs.
synth::Recipe small_recipe(int width, int keyframes = 3);

/// For tests of one pass alone, which needs two iterations where no geometric pass follows. Their images are no finer
/// than the depth maps: so small a patch as the default's would hold too few of their pixels.
inline PatchMatchOptions single_pass() {
  PatchMatchOptions options;
  options.iterations = 2;
  options.fine_patch = 0.4;
  return options;
}

/// The filter of single outliers, which presets other than `paper` leave out.
inline MedianFilterOptions median_on() {
  MedianFilterOptions options;
  options.enabled = true;
  return options;
}

/// Inputs of a single PatchMatch run besides the mission.
struct MatchSetup {
  std::vector<std::size_t> neighbours = {};  ///< indices of frames; empty = the one before and the one after
  PatchMatchOptions options = single_pass();
  int first_iteration = 0;
  const DepthMap* start = nullptr;
  std::vector<const DepthMap*> neighbour_maps = {};
  std::uint64_t seed = 1;
  int threads = 0;
  Simd simd = Simd::kAuto;
};

struct MatchStats {
  std::int64_t pixels = 0;   ///< unmasked
  std::int64_t matched = 0;  ///< with a plane at the end
};

/// PatchMatch on one frame of a mission, starting from random planes and landmarks as in the Densifier.
DepthMap match(const synth::Mission& mission, std::size_t reference, const MatchSetup& setup = {},
               MatchStats* stats = nullptr);

/// The true depth map of a frame, as of a perfect PatchMatch.
DepthMap truth_map(const synth::Frame& frame, float confidence = 1.0F);
std::vector<DepthMap> truth_maps(const synth::Mission& mission, float confidence = 1.0F);

/// Whether all bytes are equal.
bool same(const Image<float>& a, const Image<float>& b);
bool same(const DepthMap& a, const DepthMap& b);

/// Share of the pixels with a depth in either image where both have one and `a` deviates by at most `relative` from
/// `b`.
double agreement(const Image<float>& a, const Image<float>& b, double relative);

/// Share of the pixels with a depth whose normal is within `degrees` of the truth.
double normals_within(const DepthMap& map, const synth::Frame& frame, double degrees);

/// Share of the pixels with a depth.
double filled(const Image<float>& depth);

Eigen::Vector3d bearing_of(const Image<float>& depth, int x, int y);

/// Makes a map see through the floor of synth::empty_room between two x and along three units of z: each pixel has the
/// depth of the mirror image or, if `deeper` is not 0, `deeper` times that of the floor. Returns the indices of the
/// pixels.
std::vector<std::size_t> look_through_floor(DepthMap& map, const synth::Scene& room, double left, double right,
                                            double deeper = 0.0);

/// Angle between a pixel's bearing and the nearer end of the line of flight, by the frames before and after.
double degrees_from_motion(const synth::Mission& mission, std::size_t reference, int x, int y);

/// Instruction sets that this machine and build have, the plain one first.
std::vector<Simd> available_simd();

}  // namespace pmsp::test
