// SPDX-License-Identifier: BSD-2-Clause
#include <cstddef>

#include "equirect.h"
#include "live/live_builder.h"
#include "pmsp/calibration.h"

// Lens distance and rig mask, from the first used keyframes of a live mission.
namespace pmsp {
namespace {

/// Number of used keyframes after which an estimate is final, the same as in runs of complete missions.
constexpr std::size_t kEnoughKeyframes = 24;
/// Minimum number for an estimate while no more keyframes are expected.
constexpr std::size_t kFewestKeyframes = 8;

}  // namespace

/// Adds a keyframe to the estimators. `keyframe`: of `node`, with image.
void LiveBuilder::collect_for_calibration(const LiveNode& node, const Keyframe& keyframe) {
  if (node.map_id != calibration_map_) {  // poses of different maps are not comparable
    if (lenses_) begin_with_lenses();
    if (rig_) begin_with_rig();
    calibration_map_ = node.map_id;
  }
  if (lenses_) lenses_->add(keyframe);
  if (rig_) rig_->add(keyframe, engine_->executor());
}

/// Whether an estimate from `count` keyframes is due: there are enough, or new ones since the last estimate from
/// `previous` and no more are expected.
bool LiveBuilder::is_estimate_due(std::size_t count, std::size_t previous) const {
  return count >= kEnoughKeyframes || (finishing_ && pending() == 0 && count >= kFewestKeyframes && count != previous);
}

template <class Estimator>
void LiveBuilder::update_poses(Estimator& estimator) const {
  for (const auto& [id, node] : nodes_) {
    if (node.used()) estimator.move(node.keyframe());
  }
}

void LiveBuilder::estimate_rig() {
  update_poses(*rig_);
  rig_keyframes_ = rig_->keyframes();
  const bool enough = rig_->keyframes() >= kEnoughKeyframes;
  RigMask found = rig_->estimate(engine_->executor());
  if (enough || !found.mask.empty()) rig_.reset();
  if (found.mask.empty()) return;
  stats_.rig = found.share;
  rig_mask_ = std::move(found.mask);
  mask_.reset();
  for (auto& [id, node] : nodes_) invalidate(node, LiveCause::kRig);
}

/// Returns the mask of images of this size: the caller's mask with the rig; nullptr = none.
std::shared_ptr<const Image<std::uint8_t>> LiveBuilder::mask_for(int width, int height) {
  if (rig_mask_.empty()) return options_.mask;
  if (mask_ && mask_->width() == width && mask_->height() == height) return mask_;
  Image<std::uint8_t> mask = options_.mask ? *options_.mask : Image<std::uint8_t>(width, height, 255);
  hide_rig(rig_mask_, mask);
  return mask_ = std::make_shared<const Image<std::uint8_t>>(std::move(mask));
}

/// Publishes points, except those on the rig: keyframes matched before its estimate contain some.
void LiveBuilder::publish_cloud(const KeyframeCloud& cloud, std::uint64_t serial, bool preliminary) const {
  if (rig_mask_.empty()) return publish_(cloud, serial, preliminary);
  KeyframeCloud kept = cloud;
  std::size_t count = 0;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const Eigen::Vector3f& p = cloud.points[i].position;
    const int at =
        kernels::pixel_index(kernels::Vec3<float>{p.x(), p.y(), p.z()}, rig_mask_.width(), rig_mask_.height());
    if (rig_mask_.pixels()[static_cast<std::size_t>(at)] == 0) continue;
    kept.points[count] = cloud.points[i];
    if (!cloud.pixels.empty()) kept.pixels[count] = cloud.pixels[i];
    if (!cloud.agree.empty()) kept.agree[count] = cloud.agree[i];
    ++count;
  }
  kept.points.resize(count);
  if (!cloud.pixels.empty()) kept.pixels.resize(count);
  if (!cloud.agree.empty()) kept.agree.resize(count);
  publish_(kept, serial, preliminary);
}

void LiveBuilder::begin_with_rig() {
  rig_.emplace();
  rig_keyframes_ = 0;
}

void LiveBuilder::begin_with_lenses() {
  lenses_.emplace();
  lens_keyframes_ = 0;
}

void LiveBuilder::estimate_lenses() {
  update_poses(*lenses_);
  lens_keyframes_ = lenses_->keyframes();
  const bool enough = lenses_->keyframes() >= kEnoughKeyframes;
  const LensDistance found = lenses_->estimate(engine_->executor());
  if (found.significant) {
    lenses_.reset();
    set_lens_distance(found.distance);
  } else if (enough && found.standard_error == 0.0) {
    begin_with_lenses();  // too few landmarks were seen by both lenses: tries again with later keyframes
  } else if (enough) {
    lenses_.reset();
  }
}

void LiveBuilder::set_lens_distance(double distance) {
  densifier_.lens_distance = distance;
  if (preview_) preview_->set_lens_distance(distance);
  for (auto& [id, node] : nodes_) invalidate(node, LiveCause::kLenses);
}

}  // namespace pmsp
