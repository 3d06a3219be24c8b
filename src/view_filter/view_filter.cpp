// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/view_filter.h"

#include <algorithm>
#include <unordered_map>

#include "equirect.h"

namespace pmsp {
namespace {

double angle_deg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return kernels::angle_between({a.x(), a.y(), a.z()}, {b.x(), b.y(), b.z()}) * 180.0 / kernels::kPi;
}

}  // namespace

CommonParallax common_parallax(const std::vector<Landmark>& a, const Eigen::Vector3d& center_a,
                               const std::vector<Landmark>& b, const Eigen::Vector3d& center_b, double min_deg,
                               double max_deg) {
  std::unordered_map<std::int64_t, const Landmark*> in_a;
  in_a.reserve(a.size());
  for (const Landmark& landmark : a) in_a.emplace(landmark.id, &landmark);
  CommonParallax result;
  std::vector<double> angles;
  for (const Landmark& landmark : b) {
    if (in_a.count(landmark.id) == 0) continue;
    const double angle = angle_deg(landmark.position_world - center_a, landmark.position_world - center_b);
    angles.push_back(angle);
    if (angle >= min_deg && angle <= max_deg) ++result.in_range;
  }
  result.landmarks = static_cast<int>(angles.size());
  if (angles.empty()) return result;
  const auto middle = angles.begin() + static_cast<std::ptrdiff_t>(angles.size() / 2);
  std::nth_element(angles.begin(), middle, angles.end());
  result.median_deg = *middle;
  return result;
}

ViewFilter::ViewFilter(const ViewFilterOptions& options) : options_(options) { options_.validate(); }

bool ViewFilter::accept(const Keyframe& keyframe) {
  const Eigen::Vector3d center = keyframe.cam_from_world.center();
  if (has_newest_ && options_.enabled) {
    const CommonParallax common = common_parallax(newest_landmarks_, newest_center_, keyframe.landmarks, center,
                                                  options_.min_parallax_deg, options_.max_parallax_deg);
    if (common.landmarks == 0 || common.in_range < options_.min_share * common.landmarks) return false;
  }
  has_newest_ = true;
  newest_landmarks_ = keyframe.landmarks;
  newest_center_ = center;
  return true;
}

void ViewFilter::reset() {
  has_newest_ = false;
  newest_landmarks_.clear();
}

}  // namespace pmsp
