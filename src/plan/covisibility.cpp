// SPDX-License-Identifier: BSD-2-Clause
#include "plan/covisibility.h"

#include <algorithm>
#include <cmath>

#include "equirect.h"
#include "patchmatch/neighbours.h"
#include "util/eigen_kernels.h"

namespace pmsp {
namespace {

constexpr int kColumns = 24;  ///< number of cells; those near the poles have less weight
constexpr int kCellRows = 12;

/// Minimum gain in usefulness, averaged over the solid angle with landmarks, of a further keyframe.
constexpr double kMinGain = 0.03;

/// Ratio to the range of the farthest landmark in the same direction beyond which a point counts as hidden.
constexpr float kMaxBeyond = 1.1F;

std::size_t cell_of(const Eigen::Vector3f& p) {
  return static_cast<std::size_t>(kernels::pixel_index(to_vec3(p), kColumns, kCellRows));
}

double cell_solid_angle(std::size_t cell) {
  const int row = static_cast<int>(cell) / kColumns;
  return std::cos((0.5 - (row + 0.5) / kCellRows) * kernels::kPi);
}

/// Returns the usefulness of a candidate for matching a point of the reference; 0 if hidden.
double usefulness(const Covisibility& candidate, const Eigen::Vector3d& point, const Eigen::Vector3d& center) {
  const Eigen::Vector3f p = (candidate.cam_from_world * point).cast<float>();
  if (!(p.squaredNorm() > 0.0F) || p.norm() > kMaxBeyond * candidate.farthest[cell_of(p)]) return 0.0;
  return parallax_usefulness(angle_deg(point - center, point - candidate.cam_from_world.center()));
}

}  // namespace

Covisibility::Covisibility(const Keyframe& keyframe)
    : cam_from_world(keyframe.cam_from_world), farthest(static_cast<std::size_t>(kColumns) * kCellRows, 0.0F) {
  struct Seen {
    float range;
    const Landmark* landmark;
  };
  std::vector<std::vector<Seen>> cells(farthest.size());
  for (const Landmark& landmark : keyframe.landmarks) {
    const Eigen::Vector3f p = (cam_from_world * landmark.position_world).cast<float>();
    if (p.squaredNorm() > 0.0F) cells[cell_of(p)].push_back({p.norm(), &landmark});
  }
  double total = 0.0;
  for (std::size_t cell = 0; cell < cells.size(); ++cell) {
    std::vector<Seen>& seen = cells[cell];
    if (seen.empty()) continue;
    std::sort(seen.begin(), seen.end(), [](const Seen& a, const Seen& b) {
      return a.range != b.range ? a.range < b.range : a.landmark->id < b.landmark->id;
    });
    farthest[cell] = seen.back().range;
    samples.push_back({seen[seen.size() / 2].landmark->position_world, cell_solid_angle(cell)});
    total += samples.back().solid_angle;
  }
  for (Sample& sample : samples) sample.solid_angle /= total;
}

double covisible_usefulness(const Covisibility& reference, const std::vector<const Covisibility*>& sources) {
  const Eigen::Vector3d center = reference.cam_from_world.center();
  double result = 0.0;
  for (const Covisibility::Sample& sample : reference.samples) {
    double best = 0.0;
    for (const Covisibility* source : sources)
      best = std::max(best, usefulness(*source, sample.position_world, center));
    result += sample.solid_angle * best;
  }
  return result;
}

std::vector<std::size_t> choose_covisible(const Covisibility& reference,
                                          const std::vector<const Covisibility*>& candidates, int count) {
  const Eigen::Vector3d center = reference.cam_from_world.center();
  const std::size_t samples = reference.samples.size();
  std::vector<double> best(samples, 0.0);                   // by sample, so far
  std::vector<double> useful(candidates.size() * samples);  // one row per candidate
  double* value = useful.data();
  for (const Covisibility* candidate : candidates) {
    for (const Covisibility::Sample& sample : reference.samples) {
      *value++ = usefulness(*candidate, sample.position_world, center);
    }
  }
  std::vector<std::size_t> result;
  while (result.size() < static_cast<std::size_t>(count)) {
    double most = kMinGain;
    std::size_t taken = candidates.size();
    for (std::size_t k = 0; k < candidates.size(); ++k) {
      const double* row = useful.data() + k * samples;
      double gain = 0.0;
      for (std::size_t i = 0; i < samples; ++i) {
        gain += reference.samples[i].solid_angle * std::max(0.0, row[i] - best[i]);
      }
      if (gain <= most) continue;
      most = gain;
      taken = k;
    }
    if (taken == candidates.size()) break;
    result.push_back(taken);
    for (std::size_t i = 0; i < samples; ++i) best[i] = std::max(best[i], useful[taken * samples + i]);
  }
  return result;
}

}  // namespace pmsp
