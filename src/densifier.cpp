// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/densifier.h"

#include <algorithm>
#include <string>
#include <utility>

#include "densifier_checks.h"
#include "densifier_impl.h"
#include "make_engine.h"
#include "plan/reach.h"
#include "pmsp/error.h"
#include "pmsp/plan.h"

namespace pmsp {

Densifier::Impl::Impl(const DensifierOptions& given, DensifierCallbacks to)
    : given_options(given),
      options(given),
      callbacks(std::move(to)),
      schedule(given, callbacks.cloud != nullptr),
      planner(given),
      next(schedule.stages().size(), 0),
      kept(schedule.lifetimes().size(), 0) {
  results.raw_depth = callbacks.raw_depth;
  results.filtered_depth = callbacks.filtered_depth;
  if (callbacks.cloud) {
    results.cloud = [this](const KeyframeCloud& cloud) {
      stats.points += static_cast<std::int64_t>(cloud.points.size());
      callbacks.cloud(cloud);
    };
  }
  engine = make_engine({options, results, stats, cancel}, options, backend);
}

bool Densifier::Impl::add(const Keyframe& keyframe) {
  ++stats.keyframes_added;
  ++places;
  ids.insert(keyframe.id);
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
  views.clear();
  index_of.clear();
  dropped = places;
  planner.drop(planner.entries().size());
  first = 0;
  std::fill(next.begin(), next.end(), 0);
  std::fill(kept.begin(), kept.end(), 0);
}

void Densifier::Impl::prepare(const Keyframe& keyframe) {
  if (options.width == 0 || options.height == 0) {  // only now is known how much memory it takes
    fill_in_size(options, keyframe.image.width, keyframe.image.height);
    options.backend = given_options.backend;
    options.scratch_folder = given_options.scratch_folder;
    engine = make_engine({options, results, stats, cancel}, options, backend);
  }
  index_of[keyframe.id] = end();
  views.push_back({keyframe, engine->prepare(keyframe), places - 1});
  views.back().keyframe.image = {};
  views.back().keyframe.mask = {};
}

void Densifier::Impl::advance(bool last) {
  for (std::size_t stage = 0; stage < next.size(); ++stage) {
    while (may_run(stage, last)) {
      run(schedule.stages()[stage], next[stage]++);
      forget(last);
    }
  }
}

/// Whether the stage can go on to its next keyframe. At the end of the sequence the stages before are through.
bool Densifier::Impl::may_run(std::size_t stage, bool last) {
  const std::int64_t i = next[stage];
  if (stopped() || i >= end()) return false;
  if (last) return true;
  const auto there = [&](const Stage::Need& need) { return i + need.ahead < next[need.stage]; };
  const std::vector<Stage::Need>& needs = schedule.stages()[stage].needs;
  return view(i).place - dropped < planned_for(schedule.stages()[stage].kind) &&
         std::all_of(needs.begin(), needs.end(), there);
}

/// Number of the plan's entries that know what stages of a kind look at.
std::size_t Densifier::Impl::planned_for(Stage::Kind kind) const {
  if (kind == Stage::Kind::kMatch) return planner.matchable();
  return kind == Stage::Kind::kFilter || kind == Stage::Kind::kFuse ? planner.windowed() : planner.complete();
}

/// In the order of the plan's list.
std::vector<const Engine::Frame*> Densifier::Impl::matched_frames(const std::vector<std::int64_t>& keyframes) {
  std::vector<const Engine::Frame*> frames;
  for (const std::int64_t id : keyframes) {
    const Engine::Frame* const frame = frame_of(id);
    if (frame->matched) frames.push_back(frame);
  }
  return frames;
}

/// Who is near is the likeliest to own a place, and whoever owns it ends the question.
std::vector<const Engine::Frame*> Densifier::Impl::nearest_first(const Engine::Frame& reference,
                                                                 std::vector<const Engine::Frame*> frames) {
  const Eigen::Vector3d center = reference.cam_from_world.center();
  const auto distance = [&](const Engine::Frame* frame) { return (frame->cam_from_world.center() - center).norm(); };
  std::stable_sort(frames.begin(), frames.end(),
                   [&](const Engine::Frame* a, const Engine::Frame* b) { return distance(a) < distance(b); });
  return frames;
}

void Densifier::Impl::run(const Stage& stage, std::int64_t i) {
  const View& reference = view(i);
  const PlanEntry& entry = entry_of(reference);
  if (stage.kind == Stage::Kind::kMatch) return match(reference, stage.step);
  Engine::Frame& frame = *reference.frame;
  if (!frame.matched) return;
  switch (stage.kind) {
    case Stage::Kind::kMatch:
      break;
    case Stage::Kind::kFilter:
      return engine->filter(frame, matched_frames(entry.consistency));
    case Stage::Kind::kFuse:
      return fuse(reference);
    case Stage::Kind::kJudge:
      return engine->judge(frame, matched_frames(entry.viewers));
    case Stage::Kind::kRound:
      return engine->round(frame, nearest_first(frame, matched_frames(entry.owners)), stage.step);
    case Stage::Kind::kHandOut:
      return engine->hand_out(frame);
  }
}

/// One pass of PatchMatch. Passes after the first one start from the map of the pass before and look at the near
/// neighbours' maps of the pass before, never at newer ones: what comes out does not depend on the order of work.
void Densifier::Impl::match(const View& reference, int pass) {
  const PlanEntry& entry = entry_of(reference);
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

/// The window in the order of the sequence, so that sums are rounded in one way.
void Densifier::Impl::fuse(const View& reference) {
  std::vector<const Engine::Frame*> window = matched_frames(entry_of(reference).fusion);
  window.push_back(reference.frame.get());
  std::sort(window.begin(), window.end(),
            [&](const Engine::Frame* a, const Engine::Frame* b) { return index_of.at(a->id) < index_of.at(b->id); });
  const auto current = std::find(window.begin(), window.end(), reference.frame.get());
  engine->fuse(*reference.frame, window, static_cast<std::size_t>(current - window.begin()));
}

/// Lets go of what no stage will look at again.
void Densifier::Impl::forget(bool last) {
  std::int64_t keep = next.back();
  for (std::size_t k = 0; k < kept.size(); ++k) {
    const Lifetime& lifetime = schedule.lifetimes()[k];
    std::int64_t until = end();
    for (const Lifetime::Reader& reader : lifetime.readers) {
      const std::int64_t at = next[reader.stage];
      if (last && at == end()) continue;  // it is through
      until = std::min(until, options.unordered ? 0 : at - reader.behind);
    }
    for (; kept[k] < until; ++kept[k]) {
      View& released = view(kept[k]);
      if (lifetime.artefact == Artefact::kLandmarks) released.keyframe.landmarks = {};
      engine->release(*released.frame, lifetime.artefact);
    }
    keep = std::min(keep, kept[k]);
  }
  for (; first < keep; ++first) {
    index_of.erase(views.front().keyframe.id);
    views.pop_front();
  }
  const std::size_t needed = views.empty() ? places : views.front().place;
  for (; dropped < needed && planner.complete() > 0; ++dropped) planner.drop(1);
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
