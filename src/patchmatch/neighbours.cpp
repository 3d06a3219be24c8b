// SPDX-License-Identifier: BSD-2-Clause
#include "patchmatch/neighbours.h"

#include <algorithm>
#include <cmath>

#include "pmsp/stages.h"

namespace pmsp {
namespace {

/// Parallax for the best accuracy without too different patches [deg].
constexpr double kBestParallaxDeg = 10.0;

/// Minimum number of landmarks in common, over that of the best candidate: views with fewer, such as those of other
/// rooms, impair matching; they are used only if there are fewer than kFewest others.
constexpr double kMinShared = 0.25;
constexpr std::size_t kFewest = 2;

struct Candidate {
  std::size_t index;
  bool after;
  int landmarks;  ///< in common with the reference
  double usefulness;
};

struct Use {
  int landmarks;
  double usefulness;
};

Use use_of(const Keyframe& reference, const Keyframe& other) {
  const CommonParallax common = common_parallax(reference.landmarks, reference.cam_from_world.center(), other.landmarks,
                                                other.cam_from_world.center(), 0.0, 180.0);
  if (common.landmarks == 0) return {0, 0.0};
  return {common.landmarks, parallax_usefulness(common.median_deg) * std::min(1.0, common.landmarks / 30.0)};
}

}  // namespace

double neighbour_usefulness(const Keyframe& reference, const Keyframe& other) {
  return use_of(reference, other).usefulness;
}

double parallax_usefulness(double parallax_deg) {
  if (!(parallax_deg > 0.0)) return 0.0;
  const double ratio = std::log(parallax_deg / kBestParallaxDeg);
  return std::exp(-ratio * ratio);
}

std::vector<std::size_t> choose_neighbours(const std::vector<const Keyframe*>& sequence, std::size_t reference,
                                           int count) {
  std::vector<Candidate> candidates;
  int most = 0;
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    if (i == reference) continue;
    const double baseline =
        (sequence[i]->cam_from_world.center() - sequence[reference]->cam_from_world.center()).norm();
    if (!(baseline > 0.0)) continue;
    const Use use = use_of(*sequence[reference], *sequence[i]);
    candidates.push_back({i, i > reference, use.landmarks, use.usefulness});
    most = std::max(most, use.landmarks);
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.usefulness > b.usefulness; });
  std::vector<std::size_t> chosen;
  std::size_t per_side[2] = {0, 0};
  const std::size_t wanted = static_cast<std::size_t>(count);
  for (int round = 0; round < 2; ++round) {  // first the best of each side, then the best of the rest
    for (const Candidate& candidate : candidates) {
      const bool known = std::find(chosen.begin(), chosen.end(), candidate.index) != chosen.end();
      if (known || chosen.size() >= wanted) continue;
      if (chosen.size() >= kFewest && candidate.landmarks < kMinShared * most) continue;
      const bool enough = per_side[candidate.after ? 1 : 0] >= (wanted + 1) / 2;
      if (round == 0 && (enough || !(candidate.usefulness > 0.0))) continue;
      ++per_side[candidate.after ? 1 : 0];
      chosen.push_back(candidate.index);
    }
  }
  return chosen;
}

int neighbour_reach(int count) { return count <= 2 ? 2 : (count + 1) / 2 + 1; }

}  // namespace pmsp
