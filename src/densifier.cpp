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
      schedule_(given, callbacks_.cloud != nullptr),
      planner_(given),
      part_(std::move(part)),
      load_planes_(std::move(load)),
      progress_(schedule_.stages().size()),
      kept_(schedule_.lifetimes().size(), 0) {
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
  engine_ = make_engine({options_, results_, stats_, cancel_, image_again_}, options_, backend_);
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
  return or_stop([&] { return take(keyframe); });
}

void Pipeline::flush() {
  if (part_ && !stopped()) check_all_there();
  or_stop([&] { finish(); });
}

void Pipeline::run(const KeyframeSource& keyframes) {
  if (!part_) throw InvalidInput("run: there is no plan that says which keyframes to ask for; expected a given plan");
  if (!keyframes) throw InvalidInput("run: there is nobody to ask for keyframes");
  const auto pull = [&](std::int64_t id) {
    Keyframe keyframe = keyframes(id);
    if (keyframe.id == id || stopped()) return keyframe;
    throw InvalidInput("keyframe " + std::to_string(id) + " was asked for, keyframe " + std::to_string(keyframe.id) +
                       " came");
  };
  struct UntilTheEnd {
    KeyframeSource& source;
    ~UntilTheEnd() { source = nullptr; }
  };
  const UntilTheEnd asking{image_again_};
  image_again_ = [&](std::int64_t id) {
    Keyframe keyframe = pull(id);
    if (!stopped()) check_keyframe(keyframe);
    return keyframe;
  };
  or_stop([&] {
    while (!stopped() && taken_ < part_->taking_part().size()) {
      add(pull(part_->entry(part_->taking_part()[taken_]).id));
    }
    flush();
  });
}

std::vector<std::int64_t> Pipeline::images() const {
  std::vector<std::int64_t> ids;
  if (!part_) return ids;
  for (const std::size_t place : part_->taking_part()) ids.push_back(part_->entry(place).id);
  return ids;
}

/// Whether the keyframe takes part. Throws InvalidInput if it does, but not in the order of the given plan.
bool Pipeline::takes_part(std::int64_t id) const {
  if (!part_) return true;
  const std::size_t place = part_->place_of(id);
  if (!part_->takes_part(place) || ids_.count(id) != 0) return false;
  const std::size_t expected = part_->taking_part()[taken_];
  if (place == expected) return true;
  throw InvalidInput("keyframe " + std::to_string(id) + " comes before keyframe " +
                     std::to_string(part_->entry(expected).id) +
                     ", which the results depend on, too; expected the order of the plan");
}

/// Throws InvalidInput if required keyframes of the given plan are missing.
void Pipeline::check_all_there() const {
  if (taken_ == part_->taking_part().size()) return;
  throw InvalidInput("keyframe " + std::to_string(part_->entry(part_->taking_part()[taken_]).id) +
                     " has not come, which the results depend on; expected all images of the halo");
}

bool Pipeline::take(const Keyframe& keyframe) {
  ids_.insert(keyframe.id);
  const std::size_t place = part_ ? part_->place_of(keyframe.id) : places_++;
  const KeyframeUse use = part_ ? part_->entry(place).use : decide_use(keyframe);
  const bool used = use <= KeyframeUse::kNoRange;
  ++stats_.keyframes_added;
  ++(used ? stats_.keyframes_accepted : stats_.keyframes_rejected);
  if (use == KeyframeUse::kBlurred) ++stats_.keyframes_blurred;
  count_without_depth_map(use);
  const bool taken = part_ ? part_->takes_part(place) : used;
  if (taken) {
    prepare(keyframe, place);
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
  views_.clear();
  index_of_.clear();
  dropped_ = places_;
  drop_entries(planner_.entries().size());
  first_ = 0;
  stats_.work_to_come = 0.0;  // removes rounding errors
  progress_ = Progress(schedule_.stages().size());
  std::fill(kept_.begin(), kept_.end(), 0);
}

void Pipeline::prepare(const Keyframe& keyframe, std::size_t place) {
  if (options_.width == 0 || options_.height == 0) {  // the required memory depends on the size
    fill_in_size(options_, keyframe.image.width, keyframe.image.height);
    options_.backend = given_options_.backend;
    options_.scratch_folder = given_options_.scratch_folder;
    engine_ = make_engine({options_, results_, stats_, cancel_, image_again_}, options_, backend_);
  }
  index_of_[keyframe.id] = end();
  views_.push_back({keyframe, engine_->prepare(keyframe), place});
  views_.back().frame->emits_results = !part_ || part_->emits(place);
  for (const Stage& stage : schedule_.stages()) {
    if (runs(stage, views_.back())) stats_.work_to_come += stage.cost();
  }
  views_.back().keyframe.image = {};
  views_.back().keyframe.mask = {};
  views_.back().keyframe.prior_depth = {};
  ++taken_;
}

void Pipeline::advance(bool last) {
  if (goes_in_step()) return advance_in_step(last);
  while (const std::optional<Task> task = next_task(last)) {
    run_task(*task, last);
  }
}

void Pipeline::run_task(const Task& task, bool last) {
  const Stage& stage = schedule_.stages()[task.stage];
  const double cost = runs(stage, view(task.keyframe)) ? stage.cost() : 0.0;
  run(stage, task.keyframe);
  progress_.mark(task.stage, task.keyframe);
  forget(last);
  stats_.work_done += cost;
  stats_.work_to_come -= cost;
  if (callbacks_.worked) callbacks_.worked();
}

/// Runs one task of each stage, independent of each other, so that processors hardly wait for work just begun on
/// another one (see is_ready).
void Pipeline::advance_in_step(bool last) {
  std::vector<Task> tasks;
  do {
    tasks.clear();
    for (std::size_t stage = schedule_.stages().size(); stage-- > 0;) {
      const Task task{stage, progress_.next(stage)};
      if (task.keyframe < end() && is_ready(task, last)) tasks.push_back(task);
    }
    for (const Task& task : tasks) {
      if (stopped()) return;
      run_task(task, last);
    }
  } while (last && !tasks.empty());
}

/// Returns a task of the last stage that has any, so that keyframes wait for others as briefly as possible.
std::optional<Task> Pipeline::next_task(bool last) {
  if (stopped()) return std::nullopt;
  if (choose) return choose(ready_tasks(last));
  for (std::size_t stage = schedule_.stages().size(); stage-- > 0;) {
    const Task task{stage, progress_.next(stage)};
    if (task.keyframe < end() && is_ready(task, last)) return task;
  }
  return std::nullopt;
}

std::vector<Task> Pipeline::ready_tasks(bool last) {
  std::vector<Task> tasks;
  for (std::size_t stage = 0; stage < schedule_.stages().size(); ++stage) {
    for (std::int64_t i = progress_.next(stage); i < end(); ++i) {
      if (!progress_.done(stage, i) && is_ready({stage, i}, last)) tasks.push_back({stage, i});
    }
  }
  return tasks;
}

/// Required stages must have completed all keyframes up to the last one that the task may read, not only those that it
/// reads: then none of these is more than one pass or round ahead, and their artefacts still exist. With several
/// devices, one more keyframe, which is on another device: then only the first pass, which starts from the previous
/// keyframe, waits for work just begun.
bool Pipeline::is_ready(const Task& task, bool last) {
  if (!last && !is_planned(task)) return false;
  const Stage& stage = schedule_.stages()[task.stage];
  for (const Stage::Need& need : stage.needs) {
    std::int64_t until = options_.unordered ? end() : task.keyframe + need.ahead + 1 + (goes_in_step() ? 1 : 0);
    if (last) until = std::min(until, end());
    if (progress_.next(need.stage) < until) return false;
  }
  const View& reference = view(task.keyframe);
  const std::optional<std::int64_t>& from = entry_of(reference).first_planes;
  const bool starts = stage.kind == Stage::Kind::kMatch && stage.step == 0 && runs(stage, reference);
  return !starts || !from || progress_.done(task.stage, index_of_.at(*from));
}

/// Whether the inputs of the task are decided, and their keyframes have been added.
bool Pipeline::is_planned(const Task& task) {
  const Stage& stage = schedule_.stages()[task.stage];
  if (part_) return !options_.unordered && task.keyframe + stage.lead < end();
  return view(task.keyframe).place - dropped_ < planned_for(stage.kind);
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
  const View& reference = view(i);
  const PlanEntry& entry = entry_of(reference);
  if (stage.kind == Stage::Kind::kMatch) {
    take_earlier(reference, stage.step);
    const bool rests =
        part_ && part_->shortcut(reference.place) && stage.step < options_.advanced.patchmatch.geometric_passes;
    if (rests && !runs(stage, reference)) engine_->reuse_planes(*reference.frame, stage.step);
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

PassRange Pipeline::passes_of(const View& view) const {
  const Shortcut* shortcut = nullptr;
  if (part_ && part_->shortcut(view.place)) shortcut = &*part_->shortcut(view.place);
  return pass_range(shortcut, options_.advanced.patchmatch.geometric_passes);
}

/// Loads planes of an earlier run before the first pass that reads them; results of the last pass, at that pass.
void Pipeline::take_earlier(const View& reference, int pass) {
  if (!part_ || !part_->needs_earlier(reference.place)) return;
  const bool is_result = part_->shortcut(reference.place)->planes == Shortcut::Planes::kResult;
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
void Pipeline::match(const View& reference, int pass) {
  const PlanEntry& entry = entry_of(reference);
  if (pass == 0 && !part_) count_without_depth_map(entry.use);
  if (!entry.has_depth_map()) return;
  Engine::MatchTask task;
  task.reference = reference.frame.get();
  task.keyframe = &reference.keyframe;
  for (const std::int64_t id : entry.near) task.neighbours.push_back(frame_of(id));
  const PassRange passes = passes_of(reference);
  const bool images_alone = part_ && part_->shortcut(reference.place) &&
                            part_->shortcut(reference.place)->images_first && pass == passes.first;
  task.near = images_alone ? 0 : entry.near.size();
  const double scale = reference.keyframe.scale;
  task.range = {std::clamp(entry.range.min / scale, kMinDepth, kMaxDepth),
                std::clamp(entry.range.max / scale, kMinDepth, kMaxDepth)};
  if (!(task.range.max > task.range.min)) return;
  if (pass == 0 && entry.first_planes && frame_of(*entry.first_planes)->matched) {
    task.previous = frame_of(*entry.first_planes);
  }
  task.pass = pass;
  task.last = pass == passes.last;
  engine_->match(task);
}

/// Orders the window as the sequence, so that sums are rounded reproducibly.
void Pipeline::fuse(const View& reference) {
  std::vector<const Engine::Frame*> window = matched_frames(entry_of(reference).fusion);
  window.push_back(reference.frame.get());
  std::sort(window.begin(), window.end(),
            [&](const Engine::Frame* a, const Engine::Frame* b) { return index_of_.at(a->id) < index_of_.at(b->id); });
  const auto current = std::find(window.begin(), window.end(), reference.frame.get());
  engine_->fuse(*reference.frame, window, static_cast<std::size_t>(current - window.begin()));
}

/// Releases artefacts that no stage will read.
void Pipeline::forget(bool last) {
  std::int64_t keep = progress_.next(schedule_.stages().size() - 1);
  for (std::size_t k = 0; k < kept_.size(); ++k) {
    const Lifetime& lifetime = schedule_.lifetimes()[k];
    std::int64_t until = end();
    for (const Lifetime::Reader& reader : lifetime.readers) {
      const std::int64_t at = progress_.next(reader.stage);
      if (last && at == end()) continue;  // the stage is complete
      until = std::min(until, options_.unordered ? 0 : at - reader.behind);
    }
    for (; kept_[k] < until; ++kept_[k]) {
      View& released = view(kept_[k]);
      if (lifetime.artefact == Artefact::kLandmarks) std::vector<Landmark>().swap(released.keyframe.landmarks);
      engine_->release(*released.frame, lifetime.artefact);
    }
    keep = std::min(keep, kept_[k]);
  }
  for (; first_ < keep; ++first_) {
    index_of_.erase(views_.front().keyframe.id);
    views_.pop_front();
  }
  const std::size_t needed = views_.empty() ? places_ : views_.front().place;
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
                                   const std::vector<std::int64_t>& ids, PlannedCallbacks callbacks,
                                   Shortcuts shortcuts)
    : Densifier(nullptr) {
  options.validate();
  PlanPart part(plan, ids, options, wanted_by(callbacks), shortcuts.keyframes);
  for (const auto& [id, shortcut] : shortcuts.keyframes) {
    if (shortcuts.load || shortcut.planes == Shortcut::Planes::kNone) continue;
    throw InvalidInput("there is nobody to load planes of keyframe " + std::to_string(id));
  }
  impl_ = std::make_unique<Impl>(options, std::move(part), std::move(callbacks), std::move(shortcuts.load));
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
