// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/view_filter.h"

#include <algorithm>
#include <deque>
#include <utility>

#include "util/eigen_kernels.h"
#include "util/median.h"
#include "view_filter/sharpness.h"

namespace pmsp {
namespace {

constexpr std::size_t kRecent = 3;        ///< accepted keyframes that sharpness is compared with
constexpr double kSharedToSkip = 0.5;     ///< of the newest keyframe's landmarks, and
constexpr double kParallaxToSkip = 0.25;  ///< of the largest parallax: until then a keyframe can be done without

}  // namespace

CommonParallax common_parallax(const std::vector<Landmark>& a, const Eigen::Vector3d& center_a,
                               const std::vector<Landmark>& b, const Eigen::Vector3d& center_b, double min_deg,
                               double max_deg) {
  std::vector<std::int64_t> in_a;
  in_a.reserve(a.size());
  for (const Landmark& landmark : a) in_a.push_back(landmark.id);
  if (!std::is_sorted(in_a.begin(), in_a.end())) std::sort(in_a.begin(), in_a.end());
  CommonParallax result;
  std::vector<double> angles;
  angles.reserve(b.size());
  auto next = in_a.begin();  // ids mostly come in order: then it only moves on
  for (const Landmark& landmark : b) {
    if (next == in_a.end() || *next > landmark.id) next = in_a.begin();
    if (next != in_a.end() && *next < landmark.id) next = std::lower_bound(next, in_a.end(), landmark.id);
    if (next == in_a.end() || *next != landmark.id) continue;
    const double angle = angle_deg(landmark.position_world - center_a, landmark.position_world - center_b);
    angles.push_back(angle);
    if (angle >= min_deg && angle <= max_deg) ++result.in_range;
  }
  result.landmarks = static_cast<int>(angles.size());
  if (angles.empty()) return result;
  result.median_deg = median(angles);
  return result;
}

struct ViewFilter::Impl {
  bool accept(const Keyframe& keyframe);
  bool is_blurred(const std::vector<LandmarkSharpness>& sharpness) const;

  ViewFilterOptions options;
  int width = 0;
  bool blurred = false;
  bool has_newest = false;
  std::vector<Landmark> newest_landmarks;
  Eigen::Vector3d newest_center = Eigen::Vector3d::Zero();
  std::deque<std::vector<LandmarkSharpness>> recent;  ///< of the last accepted keyframes
};

/// Less sharp than the last keyframes have it in the median: one that is blurred itself does not hide the next.
bool ViewFilter::Impl::is_blurred(const std::vector<LandmarkSharpness>& sharpness) const {
  if (recent.empty()) return false;
  std::vector<double> relative;
  for (const auto& other : recent) relative.push_back(relative_sharpness(sharpness, other));
  return median(relative) < options.min_sharpness;
}

bool ViewFilter::Impl::accept(const Keyframe& keyframe) {
  blurred = false;
  const Eigen::Vector3d center = keyframe.cam_from_world.center();
  bool dispensable = false;  // a blurred keyframe is better than a hole
  if (has_newest && options.enabled) {
    const CommonParallax common = common_parallax(newest_landmarks, newest_center, keyframe.landmarks, center,
                                                  options.min_parallax_deg, options.max_parallax_deg);
    // With nothing in common a SLAM has lost its way and found another: from there on it is a new flight.
    if (keyframe.landmarks.empty() || common.in_range < options.min_share * common.landmarks) return false;
    dispensable = common.landmarks >= kSharedToSkip * static_cast<double>(newest_landmarks.size()) &&
                  common.median_deg <= kParallaxToSkip * options.max_parallax_deg;
  }
  if (options.enabled && options.min_sharpness > 0.0 && !keyframe.image.empty()) {
    std::vector<LandmarkSharpness> sharpness = landmark_sharpness(keyframe, width > 0 ? width : keyframe.image.width);
    blurred = dispensable && is_blurred(sharpness);
    if (blurred) return false;
    recent.push_back(std::move(sharpness));
    if (recent.size() > kRecent) recent.pop_front();
  }
  has_newest = true;
  newest_landmarks = keyframe.landmarks;
  newest_center = center;
  return true;
}

ViewFilter::ViewFilter(const ViewFilterOptions& options, int width) : impl_(std::make_unique<Impl>()) {
  options.validate();
  impl_->options = options;
  impl_->width = width;
}
ViewFilter::~ViewFilter() = default;
ViewFilter::ViewFilter(ViewFilter&&) noexcept = default;
ViewFilter& ViewFilter::operator=(ViewFilter&&) noexcept = default;

bool ViewFilter::accept(const Keyframe& keyframe) { return impl_->accept(keyframe); }
bool ViewFilter::blurred() const { return impl_->blurred; }

void ViewFilter::reset() {
  impl_->blurred = impl_->has_newest = false;
  impl_->newest_landmarks.clear();
  impl_->recent.clear();
}

}  // namespace pmsp
