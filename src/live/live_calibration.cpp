// SPDX-License-Identifier: BSD-2-Clause
#include <cstddef>

#include "equirect.h"
#include "live/live_builder.h"
#include "pmsp/calibration.h"

// Lens distance and rig mask, from the first used keyframes of a live mission.
namespace pmsp {
namespace {

/// After so many used keyframes it is fixed: as many as a run from a file looks at.
constexpr std::size_t kEnough = 24;
/// Where no more come for now, so many may tell it, too.
constexpr std::size_t kFewest = 8;

}  // namespace

/// `keyframe`: the node's, with image.
void LiveBuilder::collect_for_calibration(const LiveNode& node, const Keyframe& keyframe) {
  if (node.map_id != calibration_map_) {  // places of two maps do not compare
    if (lenses_) begin_with_lenses();
    if (rig_) begin_with_rig();
    calibration_map_ = node.map_id;
  }
  if (lenses_) lenses_->add(keyframe);
  if (rig_) rig_->add(keyframe, engine_->executor());
}

/// Whether there are enough keyframes, or no more come for now and some are new. Then they get their newest poses.
template <class Estimator>
bool LiveBuilder::is_time_for(Estimator& estimator, std::size_t& looked_at) const {
  const std::size_t count = estimator.keyframes();
  const bool last = finishing_ && undecided_.empty() && count >= kFewest && count != looked_at;
  if (count < kEnough && !last) return false;
  looked_at = count;
  for (const auto& [id, node] : nodes_) {
    if (node.used) estimator.move(node.keyframe());
  }
  return true;
}

/// Finds the rig when it is time. Returns whether there was anything to do.
bool LiveBuilder::estimate_rig() {
  if (!rig_ || !is_time_for(*rig_, rig_keyframes_)) return false;
  const bool enough = rig_->keyframes() >= kEnough;
  RigMask found = rig_->estimate(engine_->executor());
  if (enough || !found.mask.empty()) rig_.reset();
  if (found.mask.empty()) return true;
  stats_.rig = found.share;
  rig_mask_ = std::move(found.mask);
  mask_.reset();
  for (auto& [id, node] : nodes_) {
    if (node.has_map()) node.points_due = true;
  }
  return true;
}

/// Of an image of that size: the caller's mask and the rig; null = none.
std::shared_ptr<const Image<std::uint8_t>> LiveBuilder::mask_for(int width, int height) {
  if (rig_mask_.empty()) return options_.mask;
  if (mask_ && mask_->width() == width && mask_->height() == height) return mask_;
  Image<std::uint8_t> mask = options_.mask ? *options_.mask : Image<std::uint8_t>(width, height, 255);
  hide_rig(rig_mask_, mask);
  return mask_ = std::make_shared<const Image<std::uint8_t>>(std::move(mask));
}

/// Without points on the rig, which keyframes matched before it was found still have.
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

/// Estimates their distance when it is time. Returns whether there was anything to do.
bool LiveBuilder::estimate_lenses() {
  if (!lenses_ || !is_time_for(*lenses_, lens_keyframes_)) return false;
  const bool enough = lenses_->keyframes() >= kEnough;
  const LensDistance found = lenses_->estimate(engine_->executor());
  if (found.significant) {
    lenses_.reset();
    use_lenses(found.distance);
  } else if (enough && found.standard_error == 0.0) {
    begin_with_lenses();  // hardly a landmark was seen by both lenses: those to come may tell more
  } else if (enough) {
    lenses_.reset();
  }
  return true;
}

/// Discards what was made for a camera with one centre.
void LiveBuilder::use_lenses(double distance) {
  densifier_.lens_distance = distance;
  if (preview_) preview_->set_lens_distance(distance);
  for (auto& [id, node] : nodes_) {
    if (!node.has_map()) continue;
    node.filtered_made = node.fused_made = 0;
    node.points_due = true;
    if (!can_match(node)) continue;
    node.restarted = false;  // those that come wait for it
    node.had_in_between = false;
    node.passes = 0;
    node.moved_px = node.deferred_px = 0.0;
  }
}

}  // namespace pmsp
