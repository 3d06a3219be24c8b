// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "engine.h"
#include "filters/filter_setup.h"
#include "fusion/fusion_setup.h"
#include "fusion/mirrors.h"
#include "init.h"
#include "patchmatch/match_setup.h"
#include "plan/reach.h"
#include "priors/prior_setup.h"
#include "processor.h"
#include "sphere/cube_map.h"
#include "sphere/image_noise.h"
#include "spillable.h"
#include "util/eigen_kernels.h"
#include "util/inside.h"
#include "util/stopwatch.h"
#include "weighted_median.h"

namespace pmsp {

/// Stages of the pipeline on processors (processor.h): the artefacts that each reads and writes. Keyframes are assigned
/// to processors round-robin: processor d + 1 runs one stage behind processor d, so its inputs are ready. A stage runs
/// on the processor of its keyframe; artefacts of other keyframes are copied there once.
template <class Processor>
class StageEngine final : public Engine {
 public:
  StageEngine(const EngineContext& context, Executor executor)
      : Engine(context, std::move(executor)), queue_(context_) {
    for (int k = 0; k < Processor::number_of(context_); ++k) {
      processors_.push_back(std::make_unique<Processor>(context_, executor_, k, queue_));
    }
    great_circles_.resize(processors_.size());
  }
  ~StageEngine() override {
    for (const auto& on : processors_) on->synchronize();
  }
  StageEngine(const StageEngine&) = delete;
  StageEngine& operator=(const StageEngine&) = delete;

  std::unique_ptr<Frame> prepare(const Keyframe& keyframe) override {
    const DensifierOptions& options = context_.options;
    const std::size_t processor_index = prepared_++ % processors_.size();
    if (!scratch_ && !options.scratch_folder.empty()) scratch_ = std::make_unique<ScratchFile>(options.scratch_folder);
    auto frame = std::make_unique<StageFrame>(keyframe, *processors_[processor_index], processor_index, scratch_.get(),
                                              options.unordered ? scratch_.get() : nullptr);
    {
      const Stopwatch watch(context_.stats.seconds_prepare);
      const double scale = options.advanced.patchmatch.image_scale;
      const int compared = matching_size(keyframe.image.width, options.width, options.height, scale).width;
      frame->noise = image_noise(keyframe.image, keyframe.mask, options.width, compared, pool_of(executor_));
    }
    for (const auto& on : processors_) initialise(*on);
    frame->cubes.resize(processors_.size());
    prepare(keyframe, *frame);
    if (options.unordered && (scratch_ || context_.reload_image)) {
      release_images(*frame);
    } else if (processors_.size() > 1) {
      pack(*frame);
    }
    return frame;
  }

  void match(const MatchTask& task) override {
    Processor& on = processor_of(*task.reference);
    [[maybe_unused]] const auto scope = on.enter();
    if (!on.limit_results_in_flight()) return;
    StageFrame& reference = stage_frame(*task.reference);
    auto& pass_planes = reference.pass_planes[task.pass % 2];
    pass_planes.reset();
    Planes raw = on.planes();
    const Planes priors = run_pass(task, raw, on);
    reference.matched = !cancelled();
    if (!reference.matched) return;
    if (task.makes_final_planes) {
      finish_match(reference, raw, priors, task.skip_weighted_median, on);
    } else {
      pass_planes.put(std::move(raw), on.plane_numbers());
    }
  }

  void load_planes(Frame& frame, const PlaneMap& planes) override {
    Processor& on = processor_of(frame);
    [[maybe_unused]] const auto scope = on.enter();
    StageFrame& reference = stage_frame(frame);
    reference.final_planes.put(on.planes_of(planes), on.plane_numbers());
    reference.matched = true;
  }

  void reuse_planes(Frame& frame, int pass) override {
    Processor& on = processor_of(frame);
    [[maybe_unused]] const auto scope = on.enter();
    StageFrame& reference = stage_frame(frame);
    if (reference.final_planes.count() > 0)
      reference.pass_planes[pass % 2].put(reference.final_planes.get(), on.plane_numbers());
  }

  void filter(Frame& frame, const std::vector<const Frame*>& others) override {
    Processor& on = processor_of(frame);
    [[maybe_unused]] const auto scope = on.enter();
    if (!on.limit_results_in_flight()) return;
    StageFrame& reference = stage_frame(frame);
    const Planes planes = reference.final_planes.get();
    const bool is_wanted = context_.results.filtered_depth && reference.emits_results;
    auto confidence = on.template array<float>(pixels());
    const auto with_pose_error = is_wanted ? on.template array<float>(pixels()) : Array<float>{};
    auto stage =
        consistency_stage<ViewTypes>(on.map(planes), on.grid(), others.size(), context_.options.advanced.consistency,
                                     reference.pose_error, confidence.get(), with_pose_error.get());
    std::vector<Planes> held;
    for (std::size_t k = 0; k < others.size(); ++k) {
      held.push_back(stage_frame(*others[k]).final_planes.get(on));
      stage.others[k] = {on.map(held.back()),
                         relative_pose(others[k]->pose, reference.pose, lens_offset()).other_from_first};
    }
    on.counted(
        context_.stats.seconds_consistency, [&](Counts* counts) { on.launch(stage, counts); },
        [&stats = context_.stats](const std::int64_t* numbers) {
          stats.pixels_after_consistency += numbers[1];
          stats.pixels_far += numbers[2];
        });
    if (context_.results.cloud && context_.options.advanced.free_space.enabled) {
      find_ranges(reference, filtered(planes, confidence, on), on);
    }
    if (is_wanted) emit_depths(reference, planes, with_pose_error.get(), context_.results.filtered_depth, on);
    reference.confidence.put(std::move(confidence), pixels());
  }

  void fuse(Frame& frame, const std::vector<const Frame*>& window, std::size_t current) override {
    Processor& on = processor_of(frame);
    [[maybe_unused]] const auto scope = on.enter();
    if (!on.limit_results_in_flight()) return;
    StageFrame& reference = stage_frame(frame);
    struct Held {
      Planes planes;
      Array<float> confidence;
      Array<Color> color;
    };
    std::vector<Held> held;  // kept while the stage reads them
    const auto view = [&](const StageFrame& member) {
      const RelativePose to = relative_pose(member.pose, reference.pose, lens_offset());
      const Held& its =
          held.emplace_back(Held{member.final_planes.get(on), member.confidence.get(on), member.color.get(on)});
      return kernels::FusionView<ViewTypes>{filtered(its.planes, its.confidence, on), on.color(its.color),
                                            to.other_from_first, to.scale_ratio};
    };
    reference.window_ids.clear();
    kernels::FusePixels<ViewTypes> stage{};
    stage.grid = on.grid();
    stage.limits = fusion_limits(context_.options.advanced.fusion);
    stage.pose_error = static_cast<float>(reference.pose_error);
    stage.first = view(reference);
    for (std::size_t i = 0; i < window.size(); ++i) {
      if (i == current) continue;
      stage.others[stage.count++] = view(stage_frame(*window[i]));
      reference.window_ids.push_back(window[i]->id);
    }
    const int agree_bytes = pmsp::agree_bytes(context_.options.advanced.fusion);
    const std::size_t agree_size = pixels() * static_cast<std::size_t>(agree_bytes);
    auto surfels = on.template array<std::uint32_t>(pixels());
    auto details = on.template array<std::uint32_t>(pixels());
    auto statuses = on.template array<std::uint8_t>(pixels());
    auto agree = on.template array<std::uint8_t>(agree_size);
    stage.to = {surfels.get(), details.get(), statuses.get(), agree.get(), agree_bytes};
    on.counted(
        context_.stats.seconds_fusion, [&](Counts* counts) { on.launch(stage, counts); },
        [&stats = context_.stats,
         points_before_duplicates = reference.points_before_duplicates](const std::int64_t* numbers) {
          stats.points_fused += numbers[0];
          *points_before_duplicates = numbers[0];
        });
    reference.surfels.put(std::move(surfels), pixels());
    reference.details.put(std::move(details), pixels());
    reference.statuses[0].put(std::move(statuses), pixels());
    reference.agree.put(std::move(agree), agree_size);
  }

  void test_free_space(Frame& frame, const std::vector<const Frame*>& viewers) override {
    Processor& on = processor_of(frame);
    [[maybe_unused]] const auto scope = on.enter();
    if (!on.limit_results_in_flight()) return;
    StageFrame& reference = stage_frame(frame);
    const auto surfels = reference.surfels.get();
    const auto details = reference.details.get();
    auto statuses = on.template array<std::uint8_t>(pixels());
    std::vector<Array<float>> range_maps;  // kept while the stage reads them
    std::vector<kernels::Rigid> from_viewers;
    kernels::FreeSpaceTest stage{};
    stage.surfels = surfels.get();
    stage.details = details.get();
    stage.grid = on.grid();
    for (const Frame* other : viewers) {
      const StageFrame& viewer = stage_frame(*other);
      const RelativePose to = relative_pose(viewer.pose, reference.pose, lens_offset());
      const float* const nearest = range_maps.emplace_back(viewer.nearest.get(on)).get();
      const float* const farthest = range_maps.emplace_back(viewer.farthest.get(on)).get();
      stage.viewers[stage.count++] = {{nearest, farthest, context_.options.width / kernels::kRangeCell,
                                       context_.options.height / kernels::kRangeCell},
                                      to.other_from_first,
                                      to.scale_ratio};
      from_viewers.push_back(relative_pose(reference.pose, viewer.pose, lens_offset()).other_from_first);
    }
    stage.limits = free_space_limits(context_.options.advanced.free_space);
    stage.max_contradiction = static_cast<float>(context_.options.advanced.free_space.max_contradiction);
    stage.statuses = statuses.get();
    Mirrors mirrors;
    on.counted(
        context_.stats.seconds_free_space,
        [&](Counts* counts) {
          if (context_.options.advanced.free_space.mirrors) mirrors = find_mirrors(on, from_viewers, stage);
          on.launch(stage, counts);
        },
        [points_before_duplicates = reference.points_before_duplicates](const std::int64_t* numbers) {
          *points_before_duplicates = numbers[0];
        });
    reference.statuses[0].put(std::move(statuses), pixels());
    reference.candidates.reset();  // of a previous test
  }

  void remove_duplicates(Frame& frame, const std::vector<const Frame*>& others, int round) override {
    Processor& on = processor_of(frame);
    [[maybe_unused]] const auto scope = on.enter();
    if (!on.limit_results_in_flight()) return;
    StageFrame& reference = stage_frame(frame);
    struct Held {
      Array<std::uint32_t> surfels;
      Array<std::uint8_t> statuses;
    };
    std::vector<Held> held;
    const auto view = [&](const StageFrame& viewed) {
      const Held& its = held.emplace_back(Held{viewed.surfels.get(on), viewed.statuses[(round - 1) % 2].get(on)});
      return kernels::SurfelView{its.surfels.get(), its.statuses.get(), context_.options.width, context_.options.height,
                                 static_cast<float>(viewed.pose.scale)};
    };
    auto statuses = on.template array<std::uint8_t>(pixels());
    kernels::DuplicateRound stage{};
    stage.map = view(reference);
    stage.grid = on.grid();
    for (const Frame* other : others) {
      const StageFrame& frame_of_other = stage_frame(*other);
      const RelativePose to = relative_pose(frame_of_other.pose, reference.pose, lens_offset());
      stage.others[stage.count++] = {view(frame_of_other), to.other_from_first, to.scale_ratio,
                                     frame_of_other.id < reference.id};
    }
    stage.limits = duplicate_limits(context_.options.advanced.fusion);
    stage.statuses = statuses.get();
    DuplicateCandidates candidates{reference.candidates.get(), reference.candidates.count()};
    on.timed(context_.stats.seconds_duplicates, [&] { on.remove_duplicates(stage, candidates); });
    reference.statuses[round % 2].put(std::move(statuses), pixels());
    if (round == duplicate_rounds(context_.options)) return reference.candidates.reset();
    reference.candidates.put(std::move(candidates.bits), candidates.count, pixels());
  }

  void emit(Frame& frame) override {
    Processor& on = processor_of(frame);
    [[maybe_unused]] const auto scope = on.enter();
    const StageFrame& reference = stage_frame(frame);
    const auto surfels = reference.surfels.get();
    const auto details = reference.details.get();
    const auto statuses = reference.statuses[duplicate_rounds(context_.options) % 2].get();
    const auto agree = reference.agree.get();
    KeyframeCloud cloud;
    cloud.keyframe_id = reference.id;
    cloud.cam_from_world = reference.pose.cam_from_world;
    cloud.scale = reference.pose.scale;
    cloud.window_ids = reference.window_ids;
    on.emit_points({surfels.get(), details.get(), statuses.get(), agree.get(),
                    agree_bytes(context_.options.advanced.fusion), static_cast<float>(lens_offset())},
                   std::move(cloud), context_.stats.seconds_duplicates,
                   [this, points_before_duplicates = reference.points_before_duplicates](const KeyframeCloud& made) {
                     context_.stats.points_repeated +=
                         *points_before_duplicates - static_cast<std::int64_t>(made.points.size());
                     context_.results.cloud(made);
                   });
  }

  void release(Frame& frame, Artefact artefact) override {
    Processor& on = processor_of(frame);
    [[maybe_unused]] const auto scope = on.enter();
    StageFrame& done = stage_frame(frame);
    switch (artefact) {
      case Artefact::kImage:
        for (Cubes& cubes : done.cubes) cubes = {};
        done.packed.reset();
        break;
      case Artefact::kColor:
        done.color.reset();
        done.mask.reset();
        break;
      case Artefact::kLandmarks:
        break;
      case Artefact::kPassPlanes:
        for (auto& raw : done.pass_planes) raw.reset();
        done.prior_depth_planes.reset();
        done.evidence = {};
        break;
      case Artefact::kFinalPlanes:
        done.final_planes.reset();
        break;
      case Artefact::kFiltered:
        done.confidence.reset();
        break;
      case Artefact::kRangeMap:
        done.nearest.reset();
        done.farthest.reset();
        break;
      case Artefact::kSurfels:
        done.surfels.reset();
        done.details.reset();
        done.agree.reset();
        done.candidates.reset();
        for (auto& statuses : done.statuses) statuses.reset();
        break;
    }
  }

  void deliver(bool all) override { queue_.deliver(all); }

 private:
  using ViewTypes = typename Processor::ViewTypes;
  using Map = typename ViewTypes::Map;
  using Keys = typename Processor::Keys;
  using Planes = typename Processor::Planes;
  using Color = typename Processor::Color;
  using Cubes = typename Processor::Cubes;
  using Counts = typename Processor::Counts;
  using Pass = kernels::PatchMatchPass<ViewTypes>;

  /// Artefacts of a keyframe.
  struct StageFrame : Frame {
    /// `scratch`: file for long-lived arrays; `scratch_if_unordered`: for arrays that are short-lived in sequences;
    /// nullptr = memory.
    StageFrame(const Keyframe& keyframe, Processor& on, std::size_t at, ScratchFile* scratch,
               ScratchFile* scratch_if_unordered)
        : Frame(keyframe),
          processor(on),
          processor_index(at),
          packed(on, scratch_if_unordered),
          color(on, scratch_if_unordered),
          mask(on, scratch_if_unordered),
          pass_planes{{on, scratch_if_unordered}, {on, scratch_if_unordered}},
          final_planes(on, scratch_if_unordered),
          confidence(on, scratch_if_unordered),
          nearest(on, scratch),
          farthest(on, scratch),
          surfels(on, scratch),
          details(on, scratch),
          agree(on, scratch),
          statuses{{on, scratch}, {on, scratch}},
          candidates(on, scratch) {}

    template <class T>
    using SpillableArray = Spillable<Processor, T>;

    std::size_t bytes() const override {
      std::size_t sum = packed.bytes() + color.bytes() + mask.bytes() + pass_planes[0].bytes() +
                        pass_planes[1].bytes() + final_planes.bytes() + confidence.bytes() + nearest.bytes() +
                        farthest.bytes() + surfels.bytes() + details.bytes() + agree.bytes() + statuses[0].bytes() +
                        statuses[1].bytes() + candidates.bytes();
      for (const Cubes& its : cubes) sum += processor.bytes(its);
      if (evidence.variance) sum += 2 * sizeof(float) * color.count();
      return sum;
    }

    using Plane = typename Planes::element_type;
    Processor& processor;
    std::size_t processor_index;  ///< index of its processor
    float noise = 0.0F;           ///< of the image, see image_noise
    /// Images on each processor; empty if spilled, or not yet read there.
    mutable std::vector<Cubes> cubes;
    mutable SpillableArray<std::uint16_t> packed;  ///< `cubes` for other processors or later reads
    CubePacking packing;                           ///< layout of `packed`
    SpillableArray<Color> color;                   ///< of the size of the depth map
    SpillableArray<std::uint8_t> mask;             ///< of the size of the depth map; empty: see Processor::mask
    EvidenceMap evidence;  ///< of its texture (EvidenceMap), during its passes with plane priors
    Array<kernels::Vec3<float>> prior_depth_planes;  ///< see planes_from_prior_depth; empty without prior depth
    SpillableArray<Plane> pass_planes[2];            ///< after the last even and the last odd pass
    SpillableArray<Plane> final_planes;              ///< after the last pass and the median filter
    SpillableArray<float> confidence;                ///< after the consistency filter; 0 = no depth
    SpillableArray<float> nearest, farthest;         ///< see RangeMap
    SpillableArray<std::uint32_t> surfels, details;  ///< see SurfelMap
    SpillableArray<std::uint8_t> agree;              ///< see SurfelMap
    SpillableArray<std::uint8_t> statuses[2];  ///< after the last even and the last odd round of duplicate removal
    SpillableArray<std::uint32_t> candidates;  ///< see DuplicateCandidates
    std::vector<std::int64_t> window_ids;      ///< ids of the bits of `agree`
    std::shared_ptr<std::int64_t> points_before_duplicates =
        std::make_shared<std::int64_t>(0);  ///< before duplicate removal
  };
  static StageFrame& stage_frame(Frame& frame) { return static_cast<StageFrame&>(frame); }
  static const StageFrame& stage_frame(const Frame& frame) { return static_cast<const StageFrame&>(frame); }

  /// Mask of a keyframe, kept while a stage reads it.
  struct HeldMask {
    Array<Color> color;  ///< on processors with the mask in the colours
    Array<std::uint8_t> mask;
  };
  static HeldMask mask_of(const StageFrame& frame, Processor& on) {
    if constexpr (Processor::kMaskInColor) return {frame.color.get(on), nullptr};
    return {nullptr, frame.mask.get(on)};
  }
  static typename ViewTypes::Mask view_of(const HeldMask& held, const Processor& on) {
    return on.mask(held.color, held.mask);
  }

  /// Data behind the views of a pass.
  struct Sources {
    Cubes reference;
    std::vector<Cubes> neighbours;
    std::vector<Planes> maps;
    Planes previous_pass;  ///< map of the reference after the previous pass
    HeldMask mask;
    Array<kernels::SparsePoint> points;
    Array<std::uint64_t> landmark_keys, warped_keys;
    Planes landmarks, previous, warped, priors;
  };

  /// Returns the prior planes of the pass; empty for the first one.
  Planes run_pass(const MatchTask& task, const Planes& result, Processor& on) {
    DensifierStats& stats = context_.stats;
    Pass pass{};
    Sources sources;
    fetch(task, sources, on);
    if (cancelled()) return {};
    on.timed(stats.seconds_init, [&] {
      set_up_pass(task, pass, sources, on);
      if (task.pass == 0) {
        propose_first_planes(task, pass, sources, on);
      } else if (context_.options.advanced.patchmatch.plane_priors) {
        sources.priors = on.planes();
        StageFrame& reference = stage_frame(*task.reference);
        const kernels::Baselines baselines = baselines_of(pass.match_args);
        if (!reference.evidence.matches(baselines)) {
          reference.evidence = find_evidence(on, pass.match_args.reference, baselines);
        }
        find_plane_priors(on, great_circles_[reference.processor_index], reference.prior_depth_planes,
                          on.map(sources.previous_pass), pass.match_args.reference, reference.noise, reference.evidence,
                          pass.match_args.limits, on.to(sources.priors));
        pass.priors = on.map(sources.priors);
        if (task.makes_final_planes && !task.skip_weighted_median) reference.evidence = {};
      }
    });
    on.timed(stats.seconds_patchmatch, [&] {
      const Planes state = on.planes();
      pass.state = on.to(state);
      if (task.pass == 0) {
        on.start(pass);
      } else {
        on.launch(kernels::ReorderPlanes<ViewTypes>{on.map(sources.previous_pass), pass.state, false}, nullptr);
      }
      run_iterations(on, pass, iterations_of(context_.options.advanced.patchmatch, task.pass), task.pass > 0,
                     [&] { return cancelled(); });
      on.launch(kernels::ReorderPlanes<ViewTypes>{on.map(state), on.to(result), true}, nullptr);
    });
    return std::move(sources.priors);
  }

  /// Returns the map after the previous pass, or the final one if the passes of the keyframe are complete.
  static Planes previous_planes(const StageFrame& frame, int pass, Processor& on) {
    const auto& raw = frame.pass_planes[(pass - 1) % 2];
    return raw.count() > 0 ? raw.get(on) : frame.final_planes.get(on);
  }

  /// Fetches the images and maps of a pass.
  void fetch(const MatchTask& task, Sources& sources, Processor& on) {
    const StageFrame& reference = stage_frame(*task.reference);
    sources.reference = cubes_of(reference, on);
    sources.mask = mask_of(reference, on);
    if (task.pass > 0) sources.previous_pass = previous_planes(reference, task.pass, on);
    for (const Frame* frame : task.neighbours) {
      if (cancelled()) return;
      const StageFrame& neighbour = stage_frame(*frame);
      const bool has_planes = task.pass > 0 && sources.maps.size() < task.num_with_planes;
      sources.neighbours.push_back(cubes_of(neighbour, on));
      sources.maps.push_back(has_planes ? previous_planes(neighbour, task.pass, on) : Planes{});
    }
  }

  /// Returns empty cubes after cancel. Copies stay on `on` if the keyframe's own processor holds its
  /// cube maps.
  Cubes cubes_of(const StageFrame& frame, Processor& on) {
    Cubes& here = frame.cubes[on.number()];
    if (here.gray) return here;
    if (frame.packed.count() > 0) {
      Cubes cubes;
      on.timed(context_.stats.seconds_prepare, [&] { cubes = on.unpack(frame.packed.get(on), frame.packing); });
      if (frame.cubes[frame.processor_index].gray) {
        here = cubes;
        const auto is_there = [](const Cubes& its) { return its.gray != nullptr; };
        if (std::all_of(frame.cubes.begin(), frame.cubes.end(), is_there)) frame.packed.reset();
      }
      return cubes;
    }
    const auto reload = [&] {
      [[maybe_unused]] const auto scope = on.enter();  // restores the device, which the callback may change
      return context_.reload_image(frame.id);
    };
    const Keyframe keyframe_again = reload();
    if (cancelled()) return {};
    return on.prepare(keyframe_again, context_.stats.seconds_prepare).cubes;
  }

  /// Releases the cubes of a keyframe: spilled to the file, or made from the image again later.
  void release_images(StageFrame& frame) {
    if (scratch_) pack(frame);
    frame.cubes.assign(processors_.size(), {});
  }

  /// Packs the cubes for other processors or later reads.
  void pack(StageFrame& frame) {
    Processor& on = processor_of(frame);
    [[maybe_unused]] const auto scope = on.enter();
    const Cubes& cubes = frame.cubes[frame.processor_index];
    frame.packing = on.packing(cubes);
    frame.packed.put(on.pack(cubes), frame.packing.count);
  }

  /// Sets size and tables of a processor, with the first keyframe.
  void initialise(Processor& on) {
    [[maybe_unused]] const auto scope = on.enter();
    const DensifierOptions& options = context_.options;
    on.set_size(options.width, options.height);
    Array<int>& great_circles = great_circles_[on.number()];
    if (!great_circles && has_priors()) great_circles = on.upload(great_circle_table({options.width, options.height}));
  }
  bool has_priors() const {
    return context_.options.advanced.patchmatch.plane_priors &&
           context_.options.advanced.patchmatch.geometric_passes > 0;
  }

  /// Prepares image, colours, mask and prior depth of a keyframe.
  void prepare(const Keyframe& keyframe, StageFrame& frame) {
    Processor& on = processor_of(frame);
    [[maybe_unused]] const auto scope = on.enter();
    const DensifierOptions& options = context_.options;
    typename Processor::Prepared prepared = on.prepare(keyframe, context_.stats.seconds_prepare);
    frame.color.put(std::move(prepared.color), pixels());
    if (prepared.mask) frame.mask.put(std::move(prepared.mask), pixels());
    if (has_priors() && !keyframe.prior_depth.empty()) {
      frame.prior_depth_planes =
          on.upload(planes_from_prior_depth(keyframe.prior_depth, keyframe.scale, {options.width, options.height}));
    }
    frame.cubes[frame.processor_index] = std::move(prepared.cubes);
  }

  void set_up_pass(const MatchTask& task, Pass& pass, const Sources& sources, Processor& on) const {
    const DensifierOptions& options = context_.options;
    const StageFrame& reference = stage_frame(*task.reference);
    pass.grid = on.grid();
    pass.mask = view_of(sources.mask, on);
    pass.match_args = make_match_args(on.gray(sources.reference), reference.noise, options.advanced.patchmatch,
                                      options.width, task.range, options.seed, reference.id);
    for (std::size_t i = 0; i < task.neighbours.size(); ++i) {
      const Cubes& cubes = sources.neighbours[i];
      pass.match_args.views[pass.match_args.num_views++] = {
          on.gray(cubes), on.matchable(cubes),
          relative_pose(task.neighbours[i]->pose, reference.pose, lens_offset()).other_from_first,
          on.map(sources.maps[i])};
    }
  }

  /// Sets planes of landmarks, and planes warped from the previous keyframe.
  void propose_first_planes(const MatchTask& task, Pass& pass, Sources& sources, Processor& on) {
    const InitOptions& options = context_.options.advanced.init;
    if (options.sparse_points) {
      sources.landmark_keys = on.keys();
      const auto [points, count] = on.landmarks(*task.keyframe, lens_offset());
      sources.points = points;
      on.splat(
          kernels::SplatLandmarks<Keys>{
              points.get(), on.grid(), static_cast<float>(options.sparse_radius_px), {sources.landmark_keys.get()}},
          count);
      pass.landmarks =
          on.planes_of_keys(kernels::LandmarkPlanes{sources.landmark_keys.get(), points.get()}, sources.landmarks);
    }
    if (task.previous == nullptr) return;
    const StageFrame& previous = stage_frame(*task.previous);
    sources.previous = filtered_first_pass(previous, on);
    sources.warped_keys = on.keys();
    const Map map = on.map(sources.previous);
    on.launch(
        kernels::WarpPixels<ViewTypes, Keys>{
            map,
            on.grid(),
            relative_pose(task.reference->pose, previous.pose, lens_offset()).other_from_first,
            map.width,
            map.height,
            {sources.warped_keys.get()}},
        nullptr);
    pass.warped = on.planes_of_keys(
        kernels::WarpedPlanes<Map>{sources.warped_keys.get(), map,
                                   relative_pose(previous.pose, task.reference->pose, lens_offset()).other_from_first},
        sources.warped);
  }

  /// Returns the filtered planes after the first pass, on processor `on`.
  Planes filtered_first_pass(const StageFrame& frame, Processor& on) {
    if (frame.final_planes.count() > 0) return frame.final_planes.get(on);
    return median_of(frame, frame.pass_planes[0].get(on), nullptr, on);
  }

  Planes median_of(const StageFrame& frame, const Planes& raw, Counts* counts, Processor& on) {
    Planes filtered = on.planes();
    const HeldMask mask = mask_of(frame, on);
    on.launch(median_stage<ViewTypes>(on.map(raw), on.grid(), view_of(mask, on), context_.options.advanced.median,
                                      on.to(filtered)),
              counts);
    return filtered;
  }

  Planes weighted_median_of(const StageFrame& frame, const Planes& planes, Processor& on) {
    Planes moved = on.planes();
    const HeldMask mask = mask_of(frame, on);
    const Array<Color> color = frame.color.get(on);
    on.launch(
        kernels::WeightedMedian<ViewTypes>{on.map(planes), on.grid(), on.color(color), view_of(mask, on), on.to(moved)},
        nullptr);
    return moved;
  }

  void subtract_prior_bonus(const Planes& planes, const Planes& priors, const Planes& to, Processor& on) {
    on.launch(
        kernels::ScoresWithoutPriors<ViewTypes>{on.map(planes), on.map(priors), on.grid(), kPriorBonus, on.to(to)},
        nullptr);
  }

  /// Emits and filters the planes of the last pass, which have no other reader.
  void finish_match(StageFrame& reference, const Planes& raw, const Planes& priors, bool skip_weighted_median,
                    Processor& on) {
    if (context_.results.raw_depth && reference.emits_results) {
      const Planes photometric = priors ? on.planes() : Planes{};
      if (priors) subtract_prior_bonus(raw, priors, photometric, on);
      emit_depths(reference, priors ? photometric : raw, nullptr, context_.results.raw_depth, on);
    }
    Planes median;
    on.counted(
        context_.stats.seconds_median,
        [&](Counts* counts) {
          median = median_of(reference, raw, counts, on);
          if (skip_weighted_median) return;
          if (context_.options.advanced.median.weighted) median = weighted_median_of(reference, median, on);
          if (priors) subtract_prior_bonus(median, priors, median, on);
        },
        [&stats = context_.stats](const std::int64_t* numbers) {
          ++stats.depth_maps;
          stats.pixels += numbers[0];
          stats.pixels_matched += numbers[1];
          stats.pixels_after_median += numbers[2];
        });
    if (wants_planes(reference.id)) {
      on.emit_planes(reference.id, reference.pose, median, context_.results.planes);
    }
    reference.final_planes.put(std::move(median), on.plane_numbers());
  }

  bool wants_planes(std::int64_t id) const {
    const EngineResults& to = context_.results;
    return to.planes && !cancelled() && (!to.wants_planes || to.wants_planes(id));
  }

  void find_ranges(StageFrame& frame, const kernels::FilteredMap<Map>& map, Processor& on) {
    auto nearest = on.template array<float>(cells());
    auto farthest = on.template array<float>(cells());
    on.timed(context_.stats.seconds_free_space, [&] {
      on.launch(kernels::FindRanges<ViewTypes>{map, on.grid(), nearest.get(), farthest.get()}, nullptr);
    });
    frame.nearest.put(std::move(nearest), cells());
    frame.farthest.put(std::move(farthest), cells());
  }

  void emit_depths(const StageFrame& frame, const Planes& planes, const float* confidence,
                   const std::function<void(const DepthMap&)>& to, Processor& on) {
    on.emit_depths(frame.id, frame.pose, on.map(planes), confidence, to);
  }

  kernels::FilteredMap<Map> filtered(const Planes& planes, const Array<float>& confidence, Processor& on) const {
    return {on.map(planes), confidence.get(), context_.options.width, context_.options.height};
  }
  std::size_t pixels() const {
    return static_cast<std::size_t>(context_.options.width) * static_cast<std::size_t>(context_.options.height);
  }
  std::size_t cells() const { return pixels() / (kernels::kRangeCell * kernels::kRangeCell); }
  double lens_offset() const { return 0.5 * context_.options.lens_distance; }
  bool cancelled() const { return context_.cancel.load(std::memory_order_relaxed); }

  Processor& processor_of(const Frame& frame) { return *processors_[stage_frame(frame).processor_index]; }

  std::unique_ptr<ScratchFile> scratch_;  ///< if there is a scratch folder; declared before all users
  std::vector<std::unique_ptr<Processor>> processors_;
  typename Processor::Queue queue_;        ///< of all processors; destroyed before them, since it holds their data
  std::vector<Array<int>> great_circles_;  ///< by processor, see great_circle_table
  std::size_t prepared_ = 0;               ///< number of frames
};

}  // namespace pmsp
