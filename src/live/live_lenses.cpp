// SPDX-License-Identifier: BSD-2-Clause
#include <cstddef>

#include "live/live_builder.h"
#include "pmsp/lens_distance.h"

// The distance of the camera's two lenses, which the first used keyframes of a live mission tell.
namespace pmsp {
namespace {

/// After so many used keyframes it is fixed: as many as a run from a file looks at.
constexpr std::size_t kEnough = 24;
/// Where no more come for now, so many may tell it, too.
constexpr std::size_t kFewest = 8;

}  // namespace

/// `keyframe`: the node's, with image.
void LiveBuilder::collect_for_lenses(const LiveNode& node, const Keyframe& keyframe) {
  if (!lenses_) return;
  if (lenses_->keyframes() > 0 && node.map_id != lenses_map_) begin_with_lenses();  // places of two maps do not compare
  lenses_map_ = node.map_id;
  lenses_->add(keyframe);
}

void LiveBuilder::begin_with_lenses() {
  lenses_.emplace();
  lenses_looked_at_ = 0;
}

/// Estimates it when there are enough keyframes, or no more come for now. Returns whether there was anything to do.
bool LiveBuilder::look_at_lenses() {
  if (!lenses_) return false;
  const std::size_t count = lenses_->keyframes();
  const bool enough = count >= kEnough;
  const bool last = finishing_ && undecided_.empty() && count >= kFewest && count != lenses_looked_at_;
  if (!enough && !last) return false;
  lenses_looked_at_ = count;
  for (const auto& [id, node] : nodes_) {
    if (node.used) lenses_->move(node.keyframe());
  }
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

/// All that was made of a camera with one centre is made anew.
void LiveBuilder::use_lenses(double distance) {
  densifier_.lens_distance = distance;
  if (preview_) preview_->set_lens_distance(distance);
  for (auto& [id, node] : nodes_) {
    if (!node.has_map()) continue;
    node.filtered_made = node.fused_made = 0;
    node.points_due = true;
    if (!can_match(node)) continue;
    node.anew = false;  // those that come wait for it
    node.had_in_between = false;
    node.passes = 0;
    node.moved_px = node.owed_px = 0.0;
  }
}

}  // namespace pmsp
