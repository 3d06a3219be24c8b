// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/alignment.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "elementary.h"
#include "export/fit_similarity.h"
#include "pmsp-eval/statistics.h"
#include "pmsp/error.h"
#include "util/text.h"

namespace pmsp::eval {
namespace {

using Points = std::vector<Eigen::Vector3d>;

int nearest_in_time(const std::vector<TimedPose>& truth, double time) {
  const auto after = std::lower_bound(truth.begin(), truth.end(), time,
                                      [](const TimedPose& pose, double t) { return pose.timestamp < t; });
  if (after == truth.begin()) return 0;
  const auto before = after - 1;
  const bool take_before = after == truth.end() || time - before->timestamp <= after->timestamp - time;
  return static_cast<int>((take_before ? before : after) - truth.begin());
}

std::string seconds(double value) { return number_text(value, "%.3f"); }

[[noreturn]] void throw_too_few(const std::vector<TimedPose>& keyframes, const std::vector<TimedPose>& truth,
                                const AlignmentOptions& options, const Alignment& result) {
  double first = keyframes.front().timestamp;
  double last = first;
  for (const TimedPose& keyframe : keyframes) {
    first = std::min(first, keyframe.timestamp);
    last = std::max(last, keyframe.timestamp);
  }
  std::string message = std::to_string(result.matched) + " of " + std::to_string(keyframes.size()) +
                        " keyframes have a true pose within " + seconds(options.time_tolerance) +
                        " s, expected at least 3. Keyframes: " + seconds(first) + " to " + seconds(last) +
                        " s, time offset " + seconds(options.time_offset) +
                        " s, truth: " + seconds(truth.front().timestamp) + " to " + seconds(truth.back().timestamp) +
                        " s.";
  if (result.shared_timestamps > 0) {
    message += " " + std::to_string(result.shared_timestamps) + " keyframes with equal timestamps were ignored.";
  }
  throw InvalidInput(message +
                     " Shift the keyframes' time with --time-offset; if both begin together it is --time-offset=" +
                     seconds(truth.front().timestamp - first) + ".");
}

void match_by_time(const std::vector<TimedPose>& keyframes, const std::vector<TimedPose>& truth,
                   const AlignmentOptions& options, Alignment& result) {
  std::map<double, int> uses;
  for (const TimedPose& keyframe : keyframes) ++uses[keyframe.timestamp];
  result.truth_row.assign(keyframes.size(), -1);
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    // Some SLAM front ends repeat a timestamp: at most one of these keyframes is right, which one is unknown.
    if (uses[keyframes[k].timestamp] > 1) {
      ++result.shared_timestamps;
      continue;
    }
    const double time = keyframes[k].timestamp + options.time_offset;
    const int row = nearest_in_time(truth, time);
    if (std::abs(truth[static_cast<std::size_t>(row)].timestamp - time) > options.time_tolerance) continue;
    result.truth_row[k] = row;
    ++result.matched;
  }
}

double angle_deg(const Eigen::Matrix3d& rotation) {
  return std::acos(std::clamp((rotation.trace() - 1.0) / 2.0, -1.0, 1.0)) * 180.0 / kernels::kPi;
}

void measure_residuals(const std::vector<TimedPose>& keyframes, const std::vector<TimedPose>& truth,
                       Alignment& result) {
  std::vector<double> angles;
  double square_sum = 0.0;
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    if (result.truth_row[k] < 0) continue;
    const RigidTransform& actual = truth[static_cast<std::size_t>(result.truth_row[k])].world_from_cam;
    const RigidTransform aligned = result.truth_from_map * keyframes[k].world_from_cam;
    const double distance = (aligned.translation - actual.translation).norm();
    square_sum += distance * distance;
    result.position_max_m = std::max(result.position_max_m, distance);
    angles.push_back(angle_deg(actual.rotation.transpose() * aligned.rotation));
  }
  result.position_rmse_m = std::sqrt(square_sum / static_cast<double>(angles.size()));
  result.rotation_max_deg = *std::max_element(angles.begin(), angles.end());
  result.rotation_median_deg = percentile(angles, 50.0);
}

}  // namespace

Alignment align(const std::vector<TimedPose>& keyframes, const std::vector<TimedPose>& truth,
                const AlignmentOptions& options) {
  if (keyframes.empty() || truth.empty()) throw InvalidInput("nothing to align: no keyframes or no true poses");
  Alignment result;
  match_by_time(keyframes, truth, options, result);
  if (result.matched < 3) throw_too_few(keyframes, truth, options, result);

  Points source;
  Points target;
  Eigen::Matrix3d turn = Eigen::Matrix3d::Zero();
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    if (result.truth_row[k] < 0) continue;
    const RigidTransform& actual = truth[static_cast<std::size_t>(result.truth_row[k])].world_from_cam;
    source.push_back(keyframes[k].world_from_cam.translation);
    target.push_back(actual.translation);
    turn += actual.rotation * keyframes[k].world_from_cam.rotation.transpose();
  }
  if (!options.enabled) {
    result.method = "none";
  } else if (is_a_line(target)) {
    result.method = "positions and orientations";
    result.truth_from_map = with_rotation(nearest_rotation(turn), source, target);
  } else {
    result.method = "positions";
    result.truth_from_map = umeyama(source, target);
  }
  measure_residuals(keyframes, truth, result);
  return result;
}

Alignment align_with_itself(const std::vector<TimedPose>& keyframes) {
  Alignment result;
  result.method = "map is truth";
  result.matched = static_cast<int>(keyframes.size());
  result.truth_row.resize(keyframes.size());
  std::iota(result.truth_row.begin(), result.truth_row.end(), 0);
  return result;
}

}  // namespace pmsp::eval
