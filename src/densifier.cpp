// SPDX-License-Identifier: BSD-2-Clause
#include "planned_densifier.h"

#include <algorithm>
#include <string>
#include <utility>

#include "densifier_checks.h"
#include "make_engine.h"
#include "pipeline.h"
#include "plan/plan.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

Wanted wanted_by(const PlannedCallbacks& callbacks) {
  if (callbacks.cloud) return Wanted::kPoints;
  return callbacks.planes && !callbacks.filtered_depth ? Wanted::kPlanes : Wanted::kDepthMaps;
}

}  // namespace

Pipeline::Pipeline(const DensifierOptions& given, std::optional<PlanPart> part, PlannedCallbacks to,
                   std::function<PlaneMap(std::int64_t id)> load)
    : given_options_(given),
      options_(given),
      callbacks_(std::move(to)),
      planner_(given),
      part_(std::move(part)),
      load_planes_(std::move(load)),
      order_(given, callbacks_.cloud != nullptr) {
  results_.raw_depth = callbacks_.raw_depth;
  results_.filtered_depth = callbacks_.filtered_depth;
  results_.planes = callbacks_.planes;
  results_.wants_planes = callbacks_.wants_planes;
  if (callbacks_.cloud) {
    results_.cloud = [this](const KeyframeCloud& cloud) {
      stats_.points += static_cast<std::int64_t>(cloud.points.size());
      callbacks_.cloud(cloud);
    };
  }
  make_engine();
}

void Pipeline::make_engine() {
  engine_ = pmsp::make_engine({options_, results_, stats_, cancel_, reload_image_}, options_, backend_);
  order_.set_multi_device(options_.backend == Backend::kCuda && options_.devices.size() > 1);
}

bool Pipeline::add(const Keyframe& keyframe) {
  if (stopped()) return false;
  const bool wanted = takes_part(keyframe.id);
  if (wanted) check_keyframe(keyframe);
  if (ids_.count(keyframe.id) != 0) {
    throw InvalidInput("keyframe " + std::to_string(keyframe.id) + " was added before; expected each id once");
  }
  if (wanted) {
    DensifierOptions sized = options_;
    fill_in_size(sized, keyframe.image.width, keyframe.image.height);  // throws before any change
  }
  return stop_on_exception([&] { return take(keyframe); });
}

void Pipeline::flush() {
  if (part_ && !stopped()) check_complete();
  stop_on_exception([&] { finish(); });
}

void Pipeline::run(const KeyframeSource& keyframes) {
  if (!part_) throw InvalidInput("run: no plan; expected a Densifier with a given plan");
  if (!keyframes) throw InvalidInput("run: the keyframe source is empty");
  const auto pull = [&](std::int64_t id) {
    Keyframe keyframe = keyframes(id);
    if (keyframe.id == id || stopped()) return keyframe;
    throw InvalidInput("run: the keyframe source returned keyframe " + std::to_string(keyframe.id) +
                       "; expected keyframe " + std::to_string(id));
  };
  struct ResetOnReturn {
    KeyframeSource& source;
    ~ResetOnReturn() { source = nullptr; }
  };
  const ResetOnReturn reset{reload_image_};
  reload_image_ = [&](std::int64_t id) {
    Keyframe keyframe = pull(id);
    if (!stopped()) check_keyframe(keyframe);
    return keyframe;
  };
  stop_on_exception([&] {
    while (!stopped() && taken_ < part_->required().size()) {
      add(pull(part_->entry(part_->required()[taken_]).id));
    }
    flush();
  });
}

std::vector<std::int64_t> Pipeline::images() const {
  std::vector<std::int64_t> ids;
  if (!part_) return ids;
  for (const std::size_t entry_index : part_->required()) ids.push_back(part_->entry(entry_index).id);
  return ids;
}

/// Whether the keyframe takes part. Throws InvalidInput if it does, but not in the order of the given plan.
bool Pipeline::takes_part(std::int64_t id) const {
  if (!part_) return true;
  const std::size_t entry_index = part_->entry_index_of(id);
  if (!part_->takes_part(entry_index) || ids_.count(id) != 0) return false;
  const std::size_t expected = part_->required()[taken_];
  if (entry_index == expected) return true;
  throw InvalidInput("keyframe " + std::to_string(id) + " comes before keyframe " +
                     std::to_string(part_->entry(expected).id) +
                     ", which the results depend on, too; expected the order of the plan");
}

/// Throws InvalidInput if required keyframes of the given plan are missing.
void Pipeline::check_complete() const {
  if (taken_ == part_->required().size()) return;
  throw InvalidInput("keyframe " + std::to_string(part_->entry(part_->required()[taken_]).id) +
                     " has not come, which the results depend on; expected all images of the halo");
}

bool Pipeline::take(const Keyframe& keyframe) {
  ids_.insert(keyframe.id);
  const std::size_t entry_index = part_ ? part_->entry_index_of(keyframe.id) : planner_keyframes_++;
  const KeyframeUse use = part_ ? part_->entry(entry_index).use : decide_use(keyframe);
  const bool used = use <= KeyframeUse::kNoRange;
  ++stats_.keyframes_added;
  ++(used ? stats_.keyframes_accepted : stats_.keyframes_rejected);
  if (use == KeyframeUse::kBlurred) ++stats_.keyframes_blurred;
  count_without_depth_map(use);
  const bool taken = part_ ? part_->takes_part(entry_index) : used;
  if (taken) {
    prepare(keyframe, entry_index);
    advance(false);
  }
  engine_->deliver(false);
  return taken;
}

/// Returns the use as far as known: used keyframes may turn out to get no depth map.
KeyframeUse Pipeline::decide_use(const Keyframe& keyframe) {
  if (planner_.add(plan_keyframe(keyframe, given_options_, &engine_->executor()))) return KeyframeUse::kDepthMap;
  return planner_.entries().empty() ? KeyframeUse::kNoLandmarks : planner_.entries().back().use;
}

void Pipeline::finish() {
  planner_.finish();
  advance(true);
  engine_->deliver(true);
  used_.clear();
  index_of_.clear();
  dropped_ = planner_keyframes_;
  drop_entries(planner_.entries().size());
  first_ = 0;
  stats_.work_remaining = 0.0;  // removes rounding errors
  order_.clear();
}

void Pipeline::prepare(const Keyframe& keyframe, std::size_t entry_index) {
  if (options_.width == 0 || options_.height == 0) {  // the required memory depends on the size
    fill_in_size(options_, keyframe.image.width, keyframe.image.height);
    options_.backend = given_options_.backend;
    options_.scratch_folder = given_options_.scratch_folder;
    make_engine();
  }
  index_of_[keyframe.id] = order_.end();
  order_.add_keyframe();
  used_.push_back({keyframe, engine_->prepare(keyframe), entry_index});
  used_.back().frame->emits_results = !part_ || part_->emits(entry_index);
  for (const Stage& stage : order_.schedule().stages()) {
    if (runs(stage, used_.back())) stats_.work_remaining += stage.cost();
  }
  used_.back().keyframe.image = {};
  used_.back().keyframe.mask = {};
  used_.back().keyframe.prior_depth = {};
  ++taken_;
}

void Pipeline::advance(bool last) {
  const auto may = [&](const Task& task) { return may_run(task, last); };
  const auto run = [&](const Task& task) {
    if (stopped()) return false;
    run_task(task, last);
    return true;
  };
  if (!choose) return order_.advance(last, may, run);
  while (!stopped()) {
    const std::optional<Task> task = choose(order_.all_ready(last, may));
    if (!task || !run(*task)) return;
  }
}

void Pipeline::run_task(const Task& task, bool last) {
  const Stage& stage = order_.schedule().stages()[task.stage];
  const double cost = runs(stage, used(task.keyframe)) ? stage.cost() : 0.0;
  run(stage, task.keyframe);
  order_.mark(task);
  release(last);
  stats_.work_done += cost;
  stats_.work_remaining -= cost;
  if (callbacks_.progress) callbacks_.progress();
}

/// Returns whether all inputs of the task are planned, and the first pass of the keyframe that it warps from is done.
bool Pipeline::may_run(const Task& task, bool last) {
  if (!last && !is_planned(task)) return false;
  const Stage& stage = order_.schedule().stages()[task.stage];
  const UsedKeyframe& reference = used(task.keyframe);
  const std::optional<std::int64_t>& from = entry_of(reference).first_planes;
  const bool starts = stage.kind == Stage::Kind::kMatch && stage.step == 0 && runs(stage, reference);
  return !starts || !from || order_.is_done({task.stage, index_of_.at(*from)});
}

/// Whether the inputs of the task are decided, and their keyframes have been added.
bool Pipeline::is_planned(const Task& task) {
  const Stage& stage = order_.schedule().stages()[task.stage];
  if (part_) return !options_.unordered && task.keyframe + stage.lookahead < order_.end();
  return used(task.keyframe).entry_index - dropped_ < planned_for(stage.kind);
}

/// Returns the number of the planner's entries that are decided for stages of a kind.
std::size_t Pipeline::planned_for(Stage::Kind kind) const {
  if (kind == Stage::Kind::kMatch) return planner_.matchable();
  return kind == Stage::Kind::kFilter || kind == Stage::Kind::kFuse ? planner_.windowed() : planner_.complete();
}

/// Returns the matched frames, in the order of `keyframes`.
std::vector<const Engine::Frame*> Pipeline::matched_frames(const std::vector<std::int64_t>& keyframes) {
  std::vector<const Engine::Frame*> frames;
  for (const std::int64_t id : keyframes) {
    const Engine::Frame* const frame = frame_of(id);
    if (frame->matched) frames.push_back(frame);
  }
  return frames;
}

void Pipeline::run(const Stage& stage, std::int64_t i) {
  const UsedKeyframe& reference = used(i);
  const PlanEntry& entry = entry_of(reference);
  if (stage.kind == Stage::Kind::kMatch) {
    load_earlier_planes(reference, stage.step);
    const bool skips_pass =
        part_ && part_->reuse(reference.entry_index) && stage.step < options_.advanced.patchmatch.geometric_passes;
    if (skips_pass && !runs(stage, reference)) engine_->reuse_planes(*reference.frame, stage.step);
  }
  if (!runs(stage, reference)) return;
  if (stage.kind == Stage::Kind::kMatch) return match(reference, stage.step);
  Engine::Frame& frame = *reference.frame;
  if (!frame.matched) return;
  switch (stage.kind) {
    case Stage::Kind::kMatch:
      break;
    case Stage::Kind::kFilter:
      return engine_->filter(frame, matched_frames(entry.consistency));
    case Stage::Kind::kFuse:
      return fuse(reference);
    case Stage::Kind::kFreeSpace:
      return engine_->test_free_space(frame, matched_frames(entry.viewers));
    case Stage::Kind::kDuplicates:
      return engine_->remove_duplicates(frame, nearest_first(frame, matched_frames(entry.duplicate_views)), stage.step);
    case Stage::Kind::kEmit:
      return engine_->emit(frame);
  }
}

PassRange Pipeline::passes_of(const UsedKeyframe& view) const {
  const PlaneReuse* reuse = nullptr;
  if (part_ && part_->reuse(view.entry_index)) reuse = &*part_->reuse(view.entry_index);
  return pass_range(reuse, options_.advanced.patchmatch.geometric_passes);
}

/// Loads planes of an earlier run before the first pass that reads them; results of the last pass, at that pass.
void Pipeline::load_earlier_planes(const UsedKeyframe& reference, int pass) {
  if (!part_ || !part_->needs_earlier(reference.entry_index)) return;
  const bool is_result = part_->reuse(reference.entry_index)->planes == PlaneReuse::Planes::kResult;
  if (pass != (is_result ? passes_of(reference).last : 0)) return;
  const PlaneMap planes = load_planes_(reference.keyframe.id);
  if (planes.width() != options_.width || planes.height() != options_.height) {
    throw InvalidInput("planes of keyframe " + std::to_string(reference.keyframe.id) + " are " +
                       std::to_string(planes.width()) + " x " + std::to_string(planes.height()) + "; expected " +
                       std::to_string(options_.width) + " x " + std::to_string(options_.height));
  }
  engine_->load_planes(*reference.frame, planes);
}

/// Runs a pass of PatchMatch. Passes after the first one read maps of the previous pass, never newer ones, so that
/// results do not depend on the order of work.
void Pipeline::match(const UsedKeyframe& reference, int pass) {
  const PlanEntry& entry = entry_of(reference);
  if (pass == 0 && !part_) count_without_depth_map(entry.use);
  if (!entry.has_depth_map()) return;
  Engine::MatchTask task;
  task.reference = reference.frame.get();
  task.keyframe = &reference.keyframe;
  for (const std::int64_t id : entry.near) task.neighbours.push_back(frame_of(id));
  const PassRange passes = passes_of(reference);
  const bool photometric = part_ && part_->reuse(reference.entry_index) &&
                           part_->reuse(reference.entry_index)->photometric_first && pass == passes.first;
  task.num_with_planes = photometric ? 0 : entry.near.size();
  const double scale = reference.keyframe.scale;
  task.range = {std::clamp(entry.range.min / scale, kMinDepth, kMaxDepth),
                std::clamp(entry.range.max / scale, kMinDepth, kMaxDepth)};
  if (!(task.range.max > task.range.min)) return;
  if (pass == 0 && entry.first_planes && frame_of(*entry.first_planes)->matched) {
    task.previous = frame_of(*entry.first_planes);
  }
  task.pass = pass;
  task.makes_final_planes = pass == passes.last;
  engine_->match(task);
}

/// Orders the window as the sequence, so that sums are rounded reproducibly.
void Pipeline::fuse(const UsedKeyframe& reference) {
  std::vector<const Engine::Frame*> window = matched_frames(entry_of(reference).fusion);
  window.push_back(reference.frame.get());
  std::sort(window.begin(), window.end(),
            [&](const Engine::Frame* a, const Engine::Frame* b) { return index_of_.at(a->id) < index_of_.at(b->id); });
  const auto current = std::find(window.begin(), window.end(), reference.frame.get());
  engine_->fuse(*reference.frame, window, static_cast<std::size_t>(current - window.begin()));
}

/// Artefacts, views and entries that no task will read again.
void Pipeline::release(bool last) {
  order_.release(last, [&](Artefact artefact, std::int64_t keyframe) {
    UsedKeyframe& released = used(keyframe);
    if (artefact == Artefact::kLandmarks) std::vector<Landmark>().swap(released.keyframe.landmarks);
    engine_->release(*released.frame, artefact);
  });
  const std::int64_t keep = order_.first_in_use();
  for (; first_ < keep; ++first_) {
    index_of_.erase(used_.front().keyframe.id);
    used_.pop_front();
  }
  const std::size_t needed = used_.empty() ? planner_keyframes_ : used_.front().entry_index;
  for (; dropped_ < needed && planner_.complete() > 0; ++dropped_) drop_entries(1);
}

/// `count`: of complete entries.
void Pipeline::drop_entries(std::size_t count) {
  for (std::size_t i = 0; i < count && callbacks_.planned; ++i) callbacks_.planned(planner_.entries()[i]);
  planner_.drop(count);
}

void Pipeline::count_without_depth_map(KeyframeUse use) {
  if (use == KeyframeUse::kNoNeighbour) ++stats_.keyframes_without_neighbour;
  if (use == KeyframeUse::kNoRange) ++stats_.keyframes_without_range;
}

struct Densifier::Impl : Pipeline {
  using Pipeline::Pipeline;
};

Densifier::Densifier(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Densifier::Densifier(const DensifierOptions& options, DensifierCallbacks callbacks) {
  options.validate();
  impl_ = std::make_unique<Impl>(options, std::nullopt, std::move(callbacks));
}
PlannedDensifier::PlannedDensifier(const DensifierOptions& options, PlannedCallbacks callbacks) : Densifier(nullptr) {
  options.validate();
  impl_ = std::make_unique<Impl>(options, std::nullopt, std::move(callbacks));
}
PlannedDensifier::PlannedDensifier(const DensifierOptions& options, const Plan& plan,
                                   const std::vector<std::int64_t>& ids, PlannedCallbacks callbacks, PlaneReuses reuses)
    : Densifier(nullptr) {
  options.validate();
  PlanPart part(plan, ids, options, wanted_by(callbacks), reuses.keyframes);
  for (const auto& [id, reuse] : reuses.keyframes) {
    if (reuses.load || reuse.planes == PlaneReuse::Planes::kNone) continue;
    throw InvalidInput("no function to load planes; required for keyframe " + std::to_string(id));
  }
  impl_ = std::make_unique<Impl>(options, std::move(part), std::move(callbacks), std::move(reuses.load));
}
Densifier::~Densifier() = default;
Densifier::Densifier(Densifier&&) noexcept = default;
Densifier& Densifier::operator=(Densifier&&) noexcept = default;

bool Densifier::add(const Keyframe& keyframe) { return impl_->add(keyframe); }
void Densifier::flush() { impl_->flush(); }
void PlannedDensifier::run(const KeyframeSource& keyframes) { impl_->run(keyframes); }
void Densifier::cancel() noexcept { impl_->stop(); }
bool Densifier::cancelled() const noexcept { return impl_->stopped(); }
const DensifierStats& Densifier::stats() const { return impl_->stats(); }
std::vector<std::int64_t> PlannedDensifier::images() const { return impl_->images(); }
const DensifierOptions& Densifier::options() const { return impl_->options(); }
const std::string& Densifier::backend() const { return impl_->backend(); }

}  // namespace pmsp
