// SPDX-License-Identifier: BSD-2-Clause
#include "patchmatch/neighbours.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <Eigen/Geometry>

#include "equirect.h"
#include "pmsp/view_filter.h"
#include "util/eigen_kernels.h"

namespace pmsp {
namespace {

/// Parallax that gives accuracy without changing what patches look like too much.
constexpr double kBestParallaxDeg = 10.0;

/// Least gain in usefulness, averaged over the solid angle with landmarks, for which a place that is passed again is
/// matched with.
constexpr double kMinGain = 0.03;

/// A point this much farther away than the farthest landmark in its direction counts as hidden.
constexpr double kMaxBeyond = 1.1;

struct Candidate {
  std::size_t index;
  bool after;
  double usefulness;
};

double usefulness(double parallax_deg) {
  if (!(parallax_deg > 0.0)) return 0.0;
  const double ratio = std::log(parallax_deg / kBestParallaxDeg);
  return std::exp(-ratio * ratio);
}

double usefulness(const Keyframe& reference, const Keyframe& other) {
  const CommonParallax common = common_parallax(reference.landmarks, reference.cam_from_world.center(), other.landmarks,
                                                other.cam_from_world.center(), 0.0, 180.0);
  if (common.landmarks == 0) return 0.0;
  return usefulness(common.median_deg) * std::min(1.0, common.landmarks / 30.0);
}

double parallax_deg(const Eigen::Vector3d& point, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const Eigen::Vector3d from_a = point - a;
  const Eigen::Vector3d from_b = point - b;
  return std::atan2(from_a.cross(from_b).norm(), from_a.dot(from_b)) * 180.0 / kernels::kPi;
}

/// A landmark of the reference: its share of the solid angle with landmarks, and the best usefulness so far.
struct Sample {
  const Landmark* landmark;
  double share;
  double best;
};

// Cells of a coarse panorama; those near the poles weigh less.
constexpr int kColumns = 24;
constexpr int kRows = 12;

std::size_t cell_of(const Eigen::Vector3d& p) {
  return static_cast<std::size_t>(kernels::pixel_index(to_vec3(Eigen::Vector3f(p.cast<float>())), kColumns, kRows));
}

/// Range of the farthest landmark in each cell, 0 where there is none: that far the keyframe is known to see.
std::vector<double> farthest_landmarks(const Keyframe& keyframe) {
  std::vector<double> farthest(kColumns * kRows, 0.0);
  for (const Landmark& landmark : keyframe.landmarks) {
    const Eigen::Vector3d p = keyframe.cam_from_world * landmark.position_world;
    double& range = farthest[cell_of(p)];
    range = std::max(range, p.norm());
  }
  return farthest;
}

std::vector<Sample> samples_of(const Keyframe& reference, const std::vector<const Keyframe*>& chosen) {
  std::vector<int> count(kColumns * kRows, 0);
  std::vector<std::size_t> cells;
  for (const Landmark& landmark : reference.landmarks) {
    cells.push_back(cell_of(reference.cam_from_world * landmark.position_world));
    ++count[cells.back()];
  }
  std::vector<Sample> samples;
  double total = 0.0;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const Landmark& landmark = reference.landmarks[i];
    const int row = static_cast<int>(cells[i]) / kColumns;
    const double share = std::cos((0.5 - (row + 0.5) / kRows) * kernels::kPi) / count[cells[i]];
    double best = 0.0;
    for (const Keyframe* other : chosen) {
      best = std::max(best, usefulness(parallax_deg(landmark.position_world, reference.cam_from_world.center(),
                                                    other->cam_from_world.center())));
    }
    samples.push_back({&landmark, share, best});
    total += share;
  }
  for (Sample& sample : samples) sample.share /= total;
  return samples;
}

}  // namespace

std::vector<std::size_t> choose_neighbours(const std::vector<const Keyframe*>& sequence, std::size_t reference,
                                           int count) {
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    if (i == reference) continue;
    const double baseline =
        (sequence[i]->cam_from_world.center() - sequence[reference]->cam_from_world.center()).norm();
    if (!(baseline > 0.0)) continue;
    candidates.push_back({i, i > reference, usefulness(*sequence[reference], *sequence[i])});
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.usefulness > b.usefulness; });
  std::vector<std::size_t> chosen;
  std::size_t per_side[2] = {0, 0};
  const std::size_t wanted = static_cast<std::size_t>(count);
  for (int round = 0; round < 2; ++round) {  // first the best of each side, then whatever is left
    for (const Candidate& candidate : candidates) {
      const bool known = std::find(chosen.begin(), chosen.end(), candidate.index) != chosen.end();
      if (known || chosen.size() >= wanted) continue;
      if (round == 0 && per_side[candidate.after ? 1 : 0] >= (wanted + 1) / 2) continue;
      ++per_side[candidate.after ? 1 : 0];
      chosen.push_back(candidate.index);
    }
  }
  return chosen;
}

std::vector<std::size_t> choose_revisits(const Keyframe& reference, const std::vector<const Keyframe*>& chosen,
                                         const std::vector<const Keyframe*>& candidates, int count) {
  std::vector<std::size_t> result;
  if (reference.landmarks.empty()) return result;
  std::vector<Sample> samples = samples_of(reference, chosen);
  const Eigen::Vector3d center = reference.cam_from_world.center();
  std::vector<std::vector<double>> reach;
  for (const Keyframe* candidate : candidates) reach.push_back(farthest_landmarks(*candidate));
  const auto useful = [&](const Sample& sample, std::size_t k) {
    const Eigen::Vector3d& point = sample.landmark->position_world;
    const Eigen::Vector3d p = candidates[k]->cam_from_world * point;
    if (p.norm() > kMaxBeyond * reach[k][cell_of(p)]) return 0.0;
    return usefulness(parallax_deg(point, center, candidates[k]->cam_from_world.center()));
  };
  while (result.size() < static_cast<std::size_t>(count)) {
    double best_gain = kMinGain;
    std::size_t best = candidates.size();
    for (std::size_t k = 0; k < candidates.size(); ++k) {
      double gain = 0.0;
      for (const Sample& sample : samples) gain += sample.share * std::max(0.0, useful(sample, k) - sample.best);
      if (gain > best_gain) {
        best_gain = gain;
        best = k;
      }
    }
    if (best == candidates.size()) break;
    result.push_back(best);
    for (Sample& sample : samples) sample.best = std::max(sample.best, useful(sample, best));
  }
  return result;
}

int neighbour_reach(int count) { return count <= 2 ? 2 : (count + 1) / 2 + 1; }

}  // namespace pmsp
