// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/densifier.h"

#include <algorithm>
#include <string>
#include <utility>

#include "densifier_checks.h"
#include "densifier_impl.h"
#include "make_engine.h"
#include "patchmatch/neighbours.h"
#include "pmsp/error.h"
#include "pmsp/free_space.h"
#include "pmsp/initialiser.h"
#include "util/stopwatch.h"

namespace pmsp {
namespace {

/// Number of the block of `size` ids that an id lies in: the quotient, rounded down.
std::int64_t block_of(std::int64_t id, std::int64_t size) { return id >= 0 ? id / size : -1 - (-1 - id) / size; }

}  // namespace

Densifier::Impl::Impl(const DensifierOptions& given, DensifierCallbacks to)
    : options(given),
      callbacks(std::move(to)),
      view_filter(given.view_filter, given.width > 0 ? given.width : 2 * given.height),
      revisits(given.fusion) {
  requested = given.backend;
  results.raw_depth = callbacks.raw_depth;
  if (callbacks.filtered_depth || keeps_sights()) results.filtered_depth = [this](const DepthMap& map) { take(map); };
  if (callbacks.cloud) results.cloud = [this](KeyframeCloud cloud) { hold(std::move(cloud)); };
  engine = make_engine({options, results, stats, cancel}, options, backend);
  next_match.assign(static_cast<std::size_t>(options.patchmatch.geometric_passes) + 1, 0);
}

void Densifier::Impl::prepare(const Keyframe& keyframe) {
  if (options.width == 0 || options.height == 0) {  // only now is known how much memory it takes
    fill_in_size(options, keyframe.image.width, keyframe.image.height);
    options.backend = requested;
    engine = make_engine({options, results, stats, cancel}, options, backend);
  }
  views.push_back(
      {keyframe, engine->prepare(keyframe), options.patchmatch.revisits > 0 ? Outlook(keyframe) : Outlook(), {}, 0, {}});
  views.back().keyframe.image = {};
  views.back().keyframe.mask = {};
}

void Densifier::Impl::advance(bool last) {
  std::int64_t ready = end();  // keyframes that the stage before is done with
  for (std::size_t pass = 0; pass < next_match.size(); ++pass) {
    std::int64_t& next = next_match[pass];
    while (!stopped() && (last ? next < end() : next + match_ahead() < ready)) match(next++, static_cast<int>(pass));
    ready = next;
  }
  while (!stopped() && (last ? next_filter < end() : next_filter + filter_ahead() < ready)) filter(next_filter++);
  while (!stopped() && (last ? next_fuse < end() : next_fuse + fuse_ahead() < next_filter)) fuse(next_fuse++);
  forget();
}

/// Chooses, once for all passes, what a keyframe is matched with; none or an empty range where it cannot be.
void Densifier::Impl::choose(std::int64_t i) {
  const std::int64_t from = std::max(first, i - match_ahead());
  const std::int64_t to = std::min(end(), i + match_ahead() + 1);
  std::vector<const Keyframe*> sequence;
  for (std::int64_t k = from; k < to; ++k) sequence.push_back(&view(k).keyframe);
  View& reference = view(i);
  for (const std::size_t k :
       choose_neighbours(sequence, static_cast<std::size_t>(i - from), options.patchmatch.neighbours)) {
    reference.neighbours.push_back(from + static_cast<std::int64_t>(k));
  }
  reference.near = reference.neighbours.size();
  add_revisits(i);
  reference.range = depth_range(reference.keyframe, options.init);
  if (reference.neighbours.empty()) {
    ++stats.keyframes_without_neighbour;
  } else if (!(reference.range.max > reference.range.min)) {
    ++stats.keyframes_without_range;
  }
}

/// Adds keyframes from before the sequence around a keyframe, where the same place is passed again.
void Densifier::Impl::add_revisits(std::int64_t i) {
  const int count = options.patchmatch.revisits;
  const std::int64_t end_of_past = i - match_ahead();
  const std::int64_t start_of_past = std::max(first, i - options.patchmatch.history);
  if (count == 0 || start_of_past >= end_of_past) return;
  View& reference = view(i);
  std::vector<Eigen::Vector3d> chosen;
  std::vector<const Outlook*> past;
  for (const std::int64_t k : reference.neighbours) chosen.push_back(view(k).keyframe.cam_from_world.center());
  for (std::int64_t k = start_of_past; k < end_of_past; ++k) past.push_back(&view(k).outlook);
  for (const std::size_t k : choose_revisits(reference.outlook, chosen, past, count)) {
    reference.neighbours.push_back(start_of_past + static_cast<std::int64_t>(k));
  }
}

/// Whether the planes of the keyframe before are moved into this one.
bool Densifier::Impl::starts_from_previous(std::int64_t i) {
  if (!options.init.warp_previous || i == first || !view(i - 1).frame->matched) return false;
  const int chain = options.init.chain_keyframes;
  return chain == 0 || block_of(view(i).keyframe.id, chain) == block_of(view(i - 1).keyframe.id, chain);
}

/// One pass of PatchMatch. Passes after the first one start from the map of the pass before and look at the near
/// neighbours' maps of the pass before, never at newer ones: what comes out does not depend on the order of work.
void Densifier::Impl::match(std::int64_t i, int pass) {
  if (pass == 0) choose(i);
  View& reference = view(i);
  if (reference.neighbours.empty() || !(reference.range.max > reference.range.min)) return;
  Engine::MatchTask task;
  task.reference = reference.frame.get();
  task.keyframe = &reference.keyframe;
  for (const std::int64_t k : reference.neighbours) task.neighbours.push_back(view(k).frame.get());
  task.range = reference.range;
  task.near = reference.near;
  if (pass == 0 && starts_from_previous(i)) task.previous = view(i - 1).frame.get();
  task.pass = pass;
  task.last = pass == options.patchmatch.geometric_passes;
  engine->match(task);
}

void Densifier::Impl::filter(std::int64_t i) {
  Engine::Frame& reference = *view(i).frame;
  if (!reference.matched) return;
  std::vector<const Engine::Frame*> others;
  for (std::int64_t k = std::max(first, i - filter_ahead()); k <= std::min(end() - 1, i + filter_ahead()); ++k) {
    if (k != i && view(k).frame->matched) others.push_back(view(k).frame.get());
  }
  engine->filter(reference, others);
}

void Densifier::Impl::fuse(std::int64_t i) {
  if (!view(i).frame->matched || !callbacks.cloud) return;
  std::vector<Engine::Frame*> window;
  std::size_t current = 0;
  for (std::int64_t k = std::max(first, i - fuse_ahead()); k <= std::min(end() - 1, i + fuse_ahead()); ++k) {
    if (k == i) current = window.size();
    if (view(k).frame->matched) window.push_back(view(k).frame.get());
  }
  engine->fuse(window, current);
}

bool Densifier::Impl::keeps_sights() const { return options.free_space.enabled && callbacks.cloud; }

/// A depth map after the consistency filter.
void Densifier::Impl::take(const DepthMap& map) {
  if (keeps_sights()) {
    const Stopwatch watch(stats.seconds_free_space);
    sights.push_back(sight_map(map, engine->executor()));
    if (sights.size() > static_cast<std::size_t>(options.free_space.history)) sights.pop_front();
  }
  if (callbacks.filtered_depth) callbacks.filtered_depth(map);
}

/// Points wait until the keyframes that may look through them are known.
void Densifier::Impl::hold(KeyframeCloud cloud) {
  stats.points_fused += static_cast<std::int64_t>(cloud.points.size());
  held.push_back(std::move(cloud));
  const bool waits = keeps_sights() && options.free_space.whole_mission;
  const std::size_t keep = waits ? static_cast<std::size_t>(options.free_space.history) : 0;
  while (held.size() > keep) hand_out();
}

/// Checks the oldest cloud that waits against what has been seen so far, and lets go of it. What floats is removed
/// first: it must not stand for points of keyframes to come.
void Densifier::Impl::hand_out() {
  KeyframeCloud cloud = std::move(held.front());
  held.pop_front();
  {
    const Stopwatch watch(stats.seconds_free_space);
    std::vector<const SightMap*> others;
    for (const SightMap& sight : sights) {
      if (sight.keyframe_id != cloud.keyframe_id) others.push_back(&sight);
    }
    free_space_filter(cloud, others, options.free_space, engine->executor());
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
void Densifier::Impl::forget() {
  const std::int64_t keep =
      std::min({next_match.back() - match_ahead(), next_filter - filter_ahead(), next_fuse - fuse_ahead()});
  for (; first_active < keep && first_active < end(); ++first_active) {
    engine->release_maps(*view(first_active).frame);
    view(first_active).keyframe.landmarks = {};
  }
  const std::int64_t remembered = options.patchmatch.revisits > 0 ? options.patchmatch.history : 0;
  for (; first < first_active - remembered; ++first) views.pop_front();
}

bool Densifier::Impl::add(const Keyframe& keyframe) {
  ++stats.keyframes_added;
  ids.insert(keyframe.id);
  if (!view_filter.accept(keyframe)) {
    ++stats.keyframes_rejected;
    if (view_filter.blurred()) ++stats.keyframes_blurred;
    return false;
  }
  ++stats.keyframes_accepted;
  prepare(keyframe);
  advance(false);
  engine->deliver(false);
  return true;
}

void Densifier::Impl::flush() {
  advance(true);
  engine->deliver(true);
  while (!stopped() && !held.empty()) hand_out();
  held.clear();
  sights.clear();
  views.clear();
  first = first_active = next_filter = next_fuse = 0;
  std::fill(next_match.begin(), next_match.end(), 0);
  view_filter.reset();
  revisits = RevisitFilter(options.fusion);
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
