// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/view_filter.h"

#include <algorithm>
#include <utility>

#include "util/eigen_kernels.h"
#include "util/median.h"
#include "view_filter/sharpness.h"
#include "view_filter/view_chain.h"

namespace pmsp {
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
  explicit Impl(const ViewFilterOptions& given) : options(given), chain(given) {}
  bool accept(const Keyframe& keyframe);

  ViewFilterOptions options;
  ViewChain chain;
  int width = 0;
  bool blurred = false;
};

bool ViewFilter::Impl::accept(const Keyframe& keyframe) {
  blurred = false;
  const Eigen::Vector3d center = keyframe.cam_from_world.center();
  ViewChain::Verdict verdict;
  if (options.enabled) verdict = chain.compare(keyframe.landmarks, center);
  if (verdict.use != KeyframeUse::kDepthMap) return false;
  if (options.enabled && options.min_sharpness > 0.0 && !keyframe.image.empty()) {
    std::vector<LandmarkSharpness> sharpness = landmark_sharpness(keyframe, width > 0 ? width : keyframe.image.width);
    blurred = verdict.dispensable && chain.is_blurred(sharpness);  // a blurred keyframe is better than a hole
    if (blurred) return false;
    chain.add_sharpness(std::move(sharpness));
  }
  chain.add(keyframe.landmarks, center);
  return true;
}

ViewFilter::ViewFilter(const ViewFilterOptions& options, int width) : impl_(std::make_unique<Impl>(options)) {
  options.validate();
  impl_->width = width;
}
ViewFilter::~ViewFilter() = default;
ViewFilter::ViewFilter(ViewFilter&&) noexcept = default;
ViewFilter& ViewFilter::operator=(ViewFilter&&) noexcept = default;

bool ViewFilter::accept(const Keyframe& keyframe) { return impl_->accept(keyframe); }
bool ViewFilter::blurred() const { return impl_->blurred; }

void ViewFilter::reset() {
  impl_->blurred = false;
  impl_->chain.clear();
}

}  // namespace pmsp
