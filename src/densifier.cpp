// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/densifier.h"

#include <algorithm>
#include <string>
#include <utility>

#include "densifier_checks.h"
#include "densifier_impl.h"
#include "patchmatch/neighbours.h"
#include "pmsp/error.h"
#include "pmsp/filters.h"
#include "pmsp/free_space.h"
#include "pmsp/fusion.h"
#include "pmsp/initialiser.h"
#include "pmsp/patchmatch.h"
#include "util/stopwatch.h"

namespace pmsp {

void Densifier::Impl::prepare(const Keyframe& keyframe) {
  const Stopwatch watch(stats.seconds_prepare);
  fill_in_size(options, keyframe.image.width, keyframe.image.height);
  Panorama panorama(keyframe.image, keyframe.mask, options.width, options.height, executor);
  views.push_back({keyframe, std::move(panorama), {}, {}, {}});
  views.back().keyframe.image = {};
  views.back().keyframe.mask = {};
}

void Densifier::Impl::advance(bool last) {
  while (!stopped() && (last ? next_match < end() : next_match + match_ahead() < end())) match(next_match++);
  while (!stopped() && (last ? next_filter < end() : next_filter + filter_ahead() < next_match)) filter(next_filter++);
  while (!stopped() && (last ? next_fuse < end() : next_fuse + fuse_ahead() < next_filter)) fuse_view(next_fuse++);
  forget();
}

void Densifier::Impl::match(std::int64_t i) {
  const std::int64_t from = std::max(first, i - match_ahead());
  const std::int64_t to = std::min(end(), i + match_ahead() + 1);
  std::vector<const Keyframe*> sequence;
  for (std::int64_t k = from; k < to; ++k) sequence.push_back(&view(k).keyframe);
  View& reference = view(i);
  MatchInput input{reference.keyframe.id, {&reference.panorama, reference.keyframe.cam_from_world}, {}, {}, {}};
  for (const std::size_t k :
       choose_neighbours(sequence, static_cast<std::size_t>(i - from), options.patchmatch.neighbours)) {
    const View& neighbour = view(from + static_cast<std::int64_t>(k));
    input.neighbours.push_back({&neighbour.panorama, neighbour.keyframe.cam_from_world});
  }
  input.range = depth_range(reference.keyframe, options.init);
  if (input.neighbours.empty() || !(input.range.max > input.range.min)) return;
  PlaneImage sparse;
  PlaneImage warped;
  {
    const Stopwatch watch(stats.seconds_init);
    if (options.init.sparse_points) {
      sparse = planes_from_landmarks(reference.keyframe, options.width, options.height, options.init);
      input.candidates.push_back(&sparse);
    }
    if (options.init.warp_previous && i > first && !view(i - 1).median.depth.empty()) {
      warped = warp_planes(view(i - 1).median, reference.keyframe.cam_from_world, executor);
      input.candidates.push_back(&warped);
    }
  }
  PatchMatchStats matched;
  {
    const Stopwatch watch(stats.seconds_patchmatch);
    reference.median = patchmatch(input, options.patchmatch, options.seed, executor, &matched, &cancel);
  }
  if (stopped()) return;
  if (callbacks.raw_depth) callbacks.raw_depth(reference.median);
  const Stopwatch watch(stats.seconds_median);
  FilterStats filtered;
  median_filter(reference.median, options.median, executor, &filtered);
  ++stats.depth_maps;
  stats.pixels += matched.pixels;
  stats.pixels_matched += matched.matched;
  stats.pixels_after_median += filtered.after;
}

void Densifier::Impl::filter(std::int64_t i) {
  const Stopwatch watch(stats.seconds_consistency);
  View& reference = view(i);
  if (reference.median.depth.empty()) return;
  reference.map = reference.median;
  std::vector<const DepthMap*> others;
  for (std::int64_t k = std::max(first, i - filter_ahead()); k <= std::min(end() - 1, i + filter_ahead()); ++k) {
    if (k != i && !view(k).median.depth.empty()) others.push_back(&view(k).median);
  }
  FilterStats filtered;
  consistency_filter(reference.map, others, options.consistency, executor, &filtered);
  stats.pixels_after_consistency += filtered.after;
  reference.covered.assign(reference.map.depth.size(), 0);
  if (options.free_space.enabled) {
    sights.push_back(sight_map(reference.map));
    if (sights.size() > static_cast<std::size_t>(options.free_space.history)) sights.pop_front();
  }
  if (callbacks.filtered_depth) callbacks.filtered_depth(reference.map);
}

void Densifier::Impl::fuse_view(std::int64_t i) {
  if (view(i).map.depth.empty()) return;
  std::vector<FusionInput> window;
  std::size_t current = 0;
  for (std::int64_t k = std::max(first, i - fuse_ahead()); k <= std::min(end() - 1, i + fuse_ahead()); ++k) {
    if (k == i) current = window.size();
    View& member = view(k);
    if (!member.map.depth.empty()) window.push_back({&member.map, &member.panorama.color(), &member.covered});
  }
  {
    const Stopwatch watch(stats.seconds_fusion);
    held.push_back(fuse(window, current, options.fusion, executor));
  }
  stats.points_fused += static_cast<std::int64_t>(held.back().points.size());
  const std::size_t keep = options.free_space.whole_mission ? static_cast<std::size_t>(options.free_space.history) : 0;
  while (held.size() > keep) hand_out();
}

/// Checks the oldest cloud that waits against what has been seen so far, and lets go of it.
void Densifier::Impl::hand_out() {
  KeyframeCloud cloud = std::move(held.front());
  held.pop_front();
  {
    const Stopwatch watch(stats.seconds_free_space);
    std::vector<const SightMap*> others;
    for (const SightMap& sight : sights) {
      if (sight.keyframe_id != cloud.keyframe_id) others.push_back(&sight);
    }
    free_space_filter(cloud, others, options.free_space, executor);
  }
  stats.points += static_cast<std::int64_t>(cloud.points.size());
  if (callbacks.cloud) callbacks.cloud(cloud);
}

/// Lets go of keyframes that no stage will look at again.
void Densifier::Impl::forget() {
  const std::int64_t keep =
      std::min({next_match - match_ahead(), next_filter - filter_ahead(), next_fuse - fuse_ahead()});
  for (; first < keep && !views.empty(); ++first) views.pop_front();
}

Densifier::Densifier(const DensifierOptions& options, DensifierCallbacks callbacks) {
  options.validate();
  impl_ = std::make_unique<Impl>(options, std::move(callbacks));
}
Densifier::~Densifier() = default;
Densifier::Densifier(Densifier&&) noexcept = default;
Densifier& Densifier::operator=(Densifier&&) noexcept = default;

bool Densifier::add(const Keyframe& keyframe) {
  check_keyframe(keyframe);
  if (impl_->ids.count(keyframe.id) != 0) {
    throw InvalidInput("keyframe " + std::to_string(keyframe.id) + " was added before; expected each id once");
  }
  if (impl_->stopped()) return false;
  ++impl_->stats.keyframes_added;
  impl_->ids.insert(keyframe.id);
  if (!impl_->view_filter.accept(keyframe)) {
    ++impl_->stats.keyframes_rejected;
    return false;
  }
  ++impl_->stats.keyframes_accepted;
  impl_->prepare(keyframe);
  impl_->advance(false);
  return true;
}

void Densifier::flush() {
  impl_->advance(true);
  while (!impl_->stopped() && !impl_->held.empty()) impl_->hand_out();
  impl_->held.clear();
  impl_->sights.clear();
  impl_->views.clear();
  impl_->first = impl_->next_match = impl_->next_filter = impl_->next_fuse = 0;
  impl_->view_filter.reset();
}

void Densifier::cancel() noexcept { impl_->cancel.store(true, std::memory_order_relaxed); }
bool Densifier::cancelled() const noexcept { return impl_->stopped(); }
const DensifierStats& Densifier::stats() const { return impl_->stats; }
const DensifierOptions& Densifier::options() const { return impl_->options; }

}  // namespace pmsp
