// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/stages.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "util/eigen_kernels.h"
#include "view_filter/sharpness.h"
#include "view_filter/view_chain.h"

namespace pmsp {
namespace {

/// Returns the first id that is not less, usually one of the next few.
std::vector<std::int64_t>::const_iterator from_id(std::vector<std::int64_t>::const_iterator next,
                                                  std::vector<std::int64_t>::const_iterator end, std::int64_t id) {
  constexpr int kFew = 8;
  for (int i = 0; i < kFew; ++i, ++next) {
    if (next == end || *next >= id) return next;
  }
  return std::lower_bound(next, end, id);
}

}  // namespace

CommonParallax common_parallax(const std::vector<Landmark>& a, const Eigen::Vector3d& center_a,
                               const std::vector<Landmark>& b, const Eigen::Vector3d& center_b, double min_deg,
                               double max_deg) {
  std::vector<std::int64_t> in_a;
  in_a.reserve(a.size());
  for (const Landmark& landmark : a) in_a.push_back(landmark.id);
  if (!std::is_sorted(in_a.begin(), in_a.end())) std::sort(in_a.begin(), in_a.end());
  // Cosines have the order of angles and are cheaper; only the median's angle is computed.
  struct Common {
    double cosine;
    const Landmark* landmark;
  };
  std::vector<Common> common;
  common.reserve(std::min(a.size(), b.size()));
  constexpr double kRounding = 1e-15;
  const double most = std::cos(min_deg * kernels::kPi / 180.0) + kRounding;
  const double least = std::cos(max_deg * kernels::kPi / 180.0) - kRounding;
  CommonParallax result;
  auto next = in_a.cbegin();
  std::int64_t before = std::numeric_limits<std::int64_t>::min();
  for (const Landmark& landmark : b) {
    if (landmark.id < before) next = in_a.cbegin();  // ids are usually ascending: `next` only advances
    before = landmark.id;
    next = from_id(next, in_a.cend(), landmark.id);
    if (next == in_a.cend() || *next != landmark.id) continue;
    const Eigen::Vector3d from_a = landmark.position_world - center_a;
    const Eigen::Vector3d from_b = landmark.position_world - center_b;
    double cosine = from_a.dot(from_b) / std::sqrt(from_a.squaredNorm() * from_b.squaredNorm());
    if (!std::isfinite(cosine)) cosine = 1.0;  // at a camera, or overflow
    common.push_back({cosine, &landmark});
    if (cosine <= most && cosine >= least) ++result.in_range;
  }
  result.landmarks = static_cast<int>(common.size());
  if (common.empty()) return result;
  const auto smaller_angle = [](const Common& x, const Common& y) { return x.cosine > y.cosine; };
  const auto middle = common.begin() + static_cast<std::ptrdiff_t>(common.size() / 2);
  std::nth_element(common.begin(), middle, common.end(), smaller_angle);
  const Eigen::Vector3d& position = middle->landmark->position_world;
  result.median_deg = angle_deg(position - center_a, position - center_b);
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
    blurred = verdict.redundant && chain.is_blurred(sharpness);  // blurred keyframes are better than gaps
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
