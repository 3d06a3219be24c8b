// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/densifier.h"

#include <algorithm>
#include <string>
#include <utility>

#include "densifier_checks.h"
#include "densifier_impl.h"
#include "make_engine.h"
#include "pmsp/error.h"
#include "pmsp/free_space.h"
#include "pmsp/plan.h"
#include "util/stopwatch.h"

namespace pmsp {

Densifier::Impl::Impl(const DensifierOptions& given, DensifierCallbacks to)
    : given_options(given), options(given), callbacks(std::move(to)), planner(given), revisits(given.fusion) {
  results.raw_depth = callbacks.raw_depth;
  if (callbacks.filtered_depth || keeps_sights()) results.filtered_depth = [this](const DepthMap& map) { take(map); };
  if (callbacks.cloud) results.cloud = [this](KeyframeCloud cloud) { hold(std::move(cloud)); };
  engine = make_engine({options, results, stats, cancel}, options, backend);
  next_match.assign(static_cast<std::size_t>(options.patchmatch.geometric_passes) + 1, 0);
}

bool Densifier::Impl::add(const Keyframe& keyframe) {
  ++stats.keyframes_added;
  ids.insert(keyframe.id);
  place_of[keyframe.id] = dropped + planner.entries().size();
  const bool used = planner.add(plan_keyframe(keyframe, given_options));
  if (!used) {
    ++stats.keyframes_rejected;
    if (!planner.entries().empty() && planner.entries().back().use == KeyframeUse::kBlurred) ++stats.keyframes_blurred;
    return false;
  }
  ++stats.keyframes_accepted;
  prepare(keyframe);
  advance(false);
  engine->deliver(false);
  return true;
}

void Densifier::Impl::flush() {
  planner.finish();
  advance(true);
  engine->deliver(true);
  if (!stopped()) hand_out(true);
  held.clear();
  fused.clear();
  sights.clear();
  sight_ids.clear();
  views.clear();
  index_of.clear();
  place_of.clear();
  dropped += planner.entries().size();
  planner.drop(planner.entries().size());
  first = first_active = first_matching = next_filter = next_fuse = 0;
  std::fill(next_match.begin(), next_match.end(), 0);
  revisits = RevisitFilter(options.fusion);
}

void Densifier::Impl::prepare(const Keyframe& keyframe) {
  if (options.width == 0 || options.height == 0) {  // only now is known how much memory it takes
    fill_in_size(options, keyframe.image.width, keyframe.image.height);
    options.backend = given_options.backend;
    engine = make_engine({options, results, stats, cancel}, options, backend);
  }
  index_of[keyframe.id] = end();
  views.push_back({keyframe, engine->prepare(keyframe), place_of.at(keyframe.id)});
  views.back().keyframe.image = {};
  views.back().keyframe.mask = {};
}

void Densifier::Impl::advance(bool last) {
  const auto reached = [&](std::int64_t next, std::int64_t ahead, std::int64_t ready) {
    return !stopped() && (last ? next < end() : next + ahead < ready);
  };
  std::int64_t ready = next_match.front();  // keyframes that the stage before is done with
  while (is_planned(ready, planner.matchable())) ++ready;
  for (std::size_t pass = 0; pass < next_match.size(); ++pass) {
    std::int64_t& next = next_match[pass];
    while (reached(next, pass == 0 ? 0 : match_ahead(), ready)) match(next++, static_cast<int>(pass));
    ready = next;
  }
  while (reached(next_filter, filter_ahead(), ready) && is_planned(next_filter, planner.windowed())) {
    filter(next_filter++);
  }
  while (reached(next_fuse, fuse_ahead(), next_filter)) fuse(next_fuse++);
  forget(last);
}

/// In the order of the sequence.
std::vector<Engine::Frame*> Densifier::Impl::matched_frames(const std::vector<std::int64_t>& keyframes) {
  std::vector<std::int64_t> indices;
  for (const std::int64_t id : keyframes) indices.push_back(index_of.at(id));
  std::sort(indices.begin(), indices.end());
  std::vector<Engine::Frame*> frames;
  for (const std::int64_t i : indices) {
    if (view(i).frame->matched) frames.push_back(view(i).frame.get());
  }
  return frames;
}

/// One pass of PatchMatch. Passes after the first one start from the map of the pass before and look at the near
/// neighbours' maps of the pass before, never at newer ones: what comes out does not depend on the order of work.
void Densifier::Impl::match(std::int64_t i, int pass) {
  View& reference = view(i);
  const PlanEntry& entry = entry_at(reference.place);
  if (pass == 0 && entry.use == KeyframeUse::kNoNeighbour) ++stats.keyframes_without_neighbour;
  if (pass == 0 && entry.use == KeyframeUse::kNoRange) ++stats.keyframes_without_range;
  if (!entry.has_depth_map()) return;
  Engine::MatchTask task;
  task.reference = reference.frame.get();
  task.keyframe = &reference.keyframe;
  for (const std::int64_t id : entry.near) task.neighbours.push_back(frame_of(id));
  for (const std::int64_t id : entry.far) task.neighbours.push_back(frame_of(id));
  task.near = entry.near.size();
  task.range = entry.range;
  if (pass == 0 && entry.first_planes && frame_of(*entry.first_planes)->matched) {
    task.previous = frame_of(*entry.first_planes);
  }
  task.pass = pass;
  task.last = pass == options.patchmatch.geometric_passes;
  engine->match(task);
}

void Densifier::Impl::filter(std::int64_t i) {
  Engine::Frame& reference = *view(i).frame;
  if (!reference.matched) return;
  const std::vector<Engine::Frame*> others = matched_frames(entry_at(view(i).place).consistency);
  engine->filter(reference, {others.begin(), others.end()});
}

void Densifier::Impl::fuse(std::int64_t i) {
  Engine::Frame* const reference = view(i).frame.get();
  if (!reference->matched || !callbacks.cloud) return;
  std::vector<std::int64_t> window = entry_at(view(i).place).fusion;
  window.push_back(reference->id);
  const std::vector<Engine::Frame*> frames = matched_frames(window);
  const auto current = std::find(frames.begin(), frames.end(), reference);
  fused.push_back(reference->id);
  engine->fuse(frames, static_cast<std::size_t>(current - frames.begin()));
}

bool Densifier::Impl::keeps_sights() const { return options.free_space.enabled && callbacks.cloud; }

/// A depth map after the consistency filter.
void Densifier::Impl::take(const DepthMap& map) {
  if (keeps_sights()) {
    const Stopwatch watch(stats.seconds_free_space);
    sights.emplace(map.keyframe_id, sight_map(map, engine->executor()));
    sight_ids.push_back(map.keyframe_id);
  }
  if (callbacks.filtered_depth) callbacks.filtered_depth(map);
}

/// Points wait until the keyframes that are asked about them have been filtered.
void Densifier::Impl::hold(KeyframeCloud cloud) {
  stats.points_fused += static_cast<std::int64_t>(cloud.points.size());
  held.push_back(std::move(cloud));
  hand_out(false);
}

bool Densifier::Impl::viewers_are_there(const PlanEntry& entry) const {
  return !keeps_sights() || std::all_of(entry.viewers.begin(), entry.viewers.end(),
                                        [&](std::int64_t id) { return sights.count(id) != 0; });
}

/// Lets go of the oldest clouds that wait, and of what only they needed.
void Densifier::Impl::hand_out(bool last) {
  while (!stopped() && !held.empty()) {
    const std::size_t place = place_of.at(held.front().keyframe_id);
    const bool complete = place - dropped < planner.complete();
    if (!complete || !(last || viewers_are_there(entry_at(place)))) return;
    KeyframeCloud cloud = std::move(held.front());
    held.pop_front();
    check_and_hand_out(std::move(cloud), entry_at(place));
    fused.pop_front();
    forget_sights_before(planner.entries()[place - dropped].id);
  }
}

/// What floats is removed first: it must not stand for points of keyframes to come.
void Densifier::Impl::check_and_hand_out(KeyframeCloud cloud, const PlanEntry& entry) {
  {
    const Stopwatch watch(stats.seconds_free_space);
    std::vector<const SightMap*> viewers;
    for (const std::int64_t id : entry.viewers) {
      const auto sight = sights.find(id);
      if (sight != sights.end()) viewers.push_back(&sight->second);
    }
    free_space_filter(cloud, viewers, options.free_space, engine->executor());
  }
  {
    const Stopwatch watch(stats.seconds_revisits);
    FilterStats filtered;
    revisits.filter(cloud, options.width, engine->executor(), &filtered);
    stats.points_repeated += filtered.before - filtered.after;
  }
  stats.points += static_cast<std::int64_t>(cloud.points.size());
  callbacks.cloud(cloud);
}

/// Lets go of what no stage will look at again: of the maps of keyframes that are done with, and of all of those that
/// are too old to be matched with.
void Densifier::Impl::forget(bool last) {
  if (options.unordered && !last) return;
  const std::int64_t matched = next_match.back() - match_ahead();
  for (; first_matching < matched && first_matching < end(); ++first_matching) {
    engine->release_planes(*view(first_matching).frame);
  }
  const std::int64_t keep = std::min({matched, next_filter - filter_ahead(), next_fuse - fuse_ahead()});
  for (; first_active < keep && first_active < end(); ++first_active) {
    engine->release_maps(*view(first_active).frame);
    view(first_active).keyframe.landmarks = {};
  }
  const std::int64_t remembered = options.patchmatch.revisits > 0 ? options.patchmatch.history : 0;
  for (; first < first_active - remembered; ++first) {
    index_of.erase(views.front().keyframe.id);
    views.pop_front();
  }
  const std::size_t active = first_active < end() ? view(first_active).place : dropped + planner.entries().size();
  const std::size_t keep_entries = std::min(active, fused.empty() ? active : place_of.at(fused.front()));
  for (; dropped < keep_entries && planner.complete() > 0; ++dropped) {
    place_of.erase(planner.entries().front().id);
    planner.drop(1);
  }
}

/// Of the sight maps from before a keyframe, those stay that keyframes after it may ask for.
void Densifier::Impl::forget_sights_before(std::int64_t id) {
  if (options.unordered) return;
  const auto own = std::find(sight_ids.begin(), sight_ids.end(), id);
  const auto before = static_cast<std::int64_t>(own - sight_ids.begin());
  const std::int64_t asked = std::max(options.free_space.history, options.fusion.window) / 2;
  for (std::int64_t k = asked; k < before; ++k) {
    sights.erase(sight_ids.front());
    sight_ids.pop_front();
  }
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
  DensifierOptions sized = impl_->options;
  fill_in_size(sized, keyframe.image.width, keyframe.image.height);  // throws before anything has changed
  return impl_->or_cancel([&] { return impl_->add(keyframe); });
}

void Densifier::flush() {
  impl_->or_cancel([&] { impl_->flush(); });
}

void Densifier::cancel() noexcept { impl_->cancel.store(true, std::memory_order_relaxed); }
bool Densifier::cancelled() const noexcept { return impl_->stopped(); }
const DensifierStats& Densifier::stats() const { return impl_->stats; }
const DensifierOptions& Densifier::options() const { return impl_->options; }
const std::string& Densifier::backend() const { return impl_->backend; }

}  // namespace pmsp
