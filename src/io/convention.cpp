// SPDX-License-Identifier: BSD-2-Clause
#include "io/convention.h"
#include "machine.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "pmsp/camera.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"
#include "pose_convention.h"
#include "util/median_of.h"
#include "util/text.h"
#include "util/thread_pool.h"

namespace pmsp {
namespace {

constexpr std::size_t kFewest = 100;
constexpr std::size_t kMostOfKeyframe = 200;
constexpr std::size_t kMost = 20000;      ///< enough for a verdict
constexpr double kClearErrorRatio = 0.4;  ///< maximum ratio of median errors for another convention to be named
constexpr double kStillFits = 0.01;       ///< maximum median error of a convention that fits [image width]
constexpr double kHalf = 0.5;
constexpr double kHalfTolerance = 0.15;  ///< [px]
constexpr double kStandardErrors = 6.0;

/// Observation with its landmark's position and its camera.
struct Sample {
  const MapKeyframe* keyframe;
  const MapCamera* camera;
  Eigen::Vector3d world;
  Eigen::Vector2d pixel;
};

/// Observations of all keyframes, evenly subsampled.
std::vector<Sample> samples_of(const SlamMap& map) {
  std::vector<Sample> samples;
  const std::size_t most = std::min(kMostOfKeyframe, kMost / std::max<std::size_t>(map.keyframes.size(), 1) + 1);
  for (const MapKeyframe& keyframe : map.keyframes) {
    const std::vector<MapObservation>& all = keyframe.observations;
    const std::size_t step = all.size() / most + 1;
    for (std::size_t i = 0; i < all.size(); i += step) {
      const MapLandmark* const landmark = map.find_landmark(all[i].landmark_id);
      if (landmark == nullptr) continue;
      samples.push_back({&keyframe, &map.cameras[static_cast<std::size_t>(keyframe.camera)], landmark->position_world,
                         all[i].pixel.cast<double>()});
    }
  }
  return samples;
}

/// From projection to observation, across the seam if shorter [px].
Eigen::Vector2d residual(const Sample& sample, const RigidTransform& pose) {
  const Eigen::Vector3d point = pose * sample.world;
  if (!(point.norm() > 0.0)) return {sample.camera->width, sample.camera->height};
  Eigen::Vector2d off = sample.pixel - pixel_from_bearing(point, sample.camera->width, sample.camera->height);
  off.x() -= sample.camera->width * std::round(off.x() / sample.camera->width);
  return off;
}

double median_error(const std::vector<Sample>& samples, const map_detail::PoseConvention* convention) {
  std::vector<double> errors;
  errors.reserve(samples.size());
  for (const Sample& sample : samples) {
    const RigidTransform& pose = sample.keyframe->cam_from_world;
    errors.push_back(residual(sample, convention != nullptr ? convention->of(pose) : pose).norm());
  }
  return median(errors);
}

/// Median offset of observations along one axis, tested for half a pixel.
struct Shift {
  double at = 0.0;
  double uncertainty = 0.0;

  bool is_half() const {
    return std::abs(std::abs(at) - kHalf) <= kHalfTolerance && kStandardErrors * uncertainty < std::abs(at);
  }
};

Shift shift_of(std::vector<double> offsets) {
  const auto count = static_cast<double>(offsets.size());
  Shift shift;
  shift.at = median(offsets);
  for (double& offset : offsets) offset = std::abs(offset - shift.at);
  shift.uncertainty = 1.4826 * median(offsets) * 1.25 / std::sqrt(count);
  return shift;
}

/// Half a pixel horizontally contradicts the convention, since poses absorb a program's own rule. Half a row remains in
/// the points of programs with pixel centres at whole numbers, and is harmless.
void check_half_pixel(const SlamMap& map, const std::vector<Sample>& samples, ConventionCheck& check) {
  std::vector<double> across;
  std::vector<double> down;
  for (const Sample& sample : samples) {
    const Eigen::Vector2d off = residual(sample, sample.keyframe->cam_from_world);
    across.push_back(off.x());
    down.push_back(off.y());
  }
  const Shift x = shift_of(across);
  const Shift y = shift_of(down);
  if (!x.is_half()) {
    if (y.is_half() && !map.pixel_centers_at_integers) {
      check.remark = std::string("observations lie half a pixel ") + (y.at > 0.0 ? "below" : "above") +
                     " their landmarks: the program of the map has other pixel centres";
    }
    return;
  }
  const double dx = std::copysign(kHalf, x.at);
  const double dy = y.is_half() ? std::copysign(kHalf, y.at) : 0.0;
  std::vector<double> errors;
  for (std::size_t i = 0; i < samples.size(); ++i) errors.push_back(std::hypot(across[i] - dx, down[i] - dy));
  check.better_error_px = median(errors);
  check.fits_better =
      format("pixel coordinates shifted by half a pixel (%+.1f px across, %+.1f px down: other pixel centres)", dx, dy);
}

}  // namespace

ConventionCheck check_convention(const SlamMap& map) {
  ConventionCheck check;
  if (!map.observations_are_measured) return check;
  const std::vector<Sample> samples = samples_of(map);
  if (samples.size() < kFewest) return check;
  check.observations = samples.size();
  const std::vector<map_detail::PoseConvention> others = map_detail::other_conventions();
  std::vector<double> errors(others.size() + 1);
  ThreadPool(std::min(usable_cpus(), static_cast<int>(errors.size())))
      .for_each(static_cast<int>(errors.size()), [&](int number) {
        const auto i = static_cast<std::size_t>(number);
        errors[i] = median_error(samples, i < others.size() ? &others[i] : nullptr);
      });
  check.median_error_px = errors.back();
  double width = 0.0;
  for (const MapCamera& camera : map.cameras) width = std::max(width, static_cast<double>(camera.width));
  double best = std::min(kClearErrorRatio * check.median_error_px, kStillFits * width);
  for (std::size_t i = 0; i < others.size(); ++i) {
    if (errors[i] >= best) continue;
    best = check.better_error_px = errors[i];
    check.fits_better = others[i].what;
  }
  if (check.fits_better.empty()) check_half_pixel(map, samples, check);
  return check;
}

ConventionCheck require_convention(const SlamMap& map) {
  ConventionCheck check = check_convention(map);
  if (check.fits_better.empty()) return check;
  const std::string errors =
      format("median error %.3g px instead of %.3g px", check.better_error_px, check.median_error_px);
  throw InvalidInput(map.path.string() + ": points and observations fit another convention clearly better: " +
                     check.fits_better + ", " + errors + "; correct the export, a cloud of this map would be wrong");
}

}  // namespace pmsp
