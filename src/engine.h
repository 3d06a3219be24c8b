// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "planned_densifier.h"
#include "pmsp/stages.h"
#include "pmsp/types.h"
#include "schedule.h"

namespace pmsp {

/// Receives what is finished. Members that are not set are not called, and what only they need is not computed.
struct EngineResults {
  std::function<void(const DepthMap&)> raw_depth;       ///< after the last pass of PatchMatch
  std::function<void(const DepthMap&)> filtered_depth;  ///< after the consistency filter
  std::function<void(const PlaneMap&)> planes;          ///< after the last pass and the median filter, of those that
  std::function<bool(std::int64_t id)> wants_planes;    ///< names; not set: of all
  std::function<void(const KeyframeCloud&)> cloud;
};

/// What an engine works for: the Densifier that owns it.
struct EngineContext {
  const DensifierOptions& options;  ///< sizes may still be 0 before the first keyframe
  const EngineResults& results;
  DensifierStats& stats;
  const std::atomic<bool>& cancel;
  /// Gives a keyframe's image again that has been prepared before. Not set: what is needed of it is kept.
  const KeyframeSource& image_again;
};

/// Runs the stages, and holds what they work on, on one kind of processor. Work is asked for in an order that the
/// schedule allows (src/densifier.cpp); results reach the callbacks and the statistics in that order. An engine serves
/// one Densifier.
class Engine {
 public:
  /// An accepted keyframe on its way through the stages. Must not outlive the engine.
  struct Frame {
    explicit Frame(const Keyframe& keyframe)
        : id(keyframe.id), pose(keyframe.pose()), pose_error(keyframe.pose_error) {}
    virtual ~Frame() = default;

    std::int64_t id;
    KeyframePose pose;
    double pose_error;          ///< Keyframe's
    bool matched = false;       ///< has a depth map, if not of all passes
    bool emits_results = true;  ///< its results are handed out; else it serves others only
  };

  struct MatchTask {
    Frame* reference = nullptr;
    const Keyframe* keyframe = nullptr;  ///< the reference's, without image and mask
    std::vector<const Frame*> neighbours;
    std::size_t near = 0;  ///< the first so many of them lend their planes, too; the others their images only
    DepthRange range;      ///< [reference's unit]
    const Frame* previous = nullptr;  ///< whose planes are warped into the reference; nullptr = none
    /// 0 = photometric; others start from the map of the pass before and look at the near neighbours' ones. Of those
    /// that are through with their passes, that is the one that they have.
    int pass = 0;
    bool last = true;    ///< the map is complete: hand it out, median filter it
    bool draft = false;  ///< with `last`: another pass follows before anyone looks, the median by colours waits for it
  };

  virtual ~Engine() = default;

  /// Takes over what is needed of image and mask.
  virtual std::unique_ptr<Frame> prepare(const Keyframe& keyframe) = 0;

  /// A pass of PatchMatch: initialisation before the first, the median filter after the last.
  virtual void match(const MatchTask& task) = 0;

  /// Planes of an earlier run, of the depth maps' size, in place of those that passes make.
  virtual void load_planes(Frame& frame, const PlaneMap& planes) = 0;

  /// The frame makes no map in this pass, which is not the last one: those that look at it find the map that it has.
  virtual void reuse_planes(Frame& frame, int pass) = 0;

  /// Consistency filter against the other maps (all matched).
  virtual void filter(Frame& reference, const std::vector<const Frame*>& others) = 0;

  /// The points of the reference's pixels, joined with those of its window, `window[current]` being the reference
  /// itself (all matched and filtered).
  virtual void fuse(Frame& reference, const std::vector<const Frame*>& window, std::size_t current) = 0;

  /// Which of them nobody of the viewers has looked through; those (all filtered) keep their range maps. May be asked
  /// again, and what follows with it.
  virtual void test_free_space(Frame& reference, const std::vector<const Frame*>& viewers) = 0;

  /// Round 1, 2, ... of ownership among the points that are left. `others` are through the round before; some are
  /// through this one.
  virtual void remove_duplicates(Frame& reference, const std::vector<const Frame*>& others, int round) = 0;

  /// The points that the frame makes go to `results.cloud`.
  virtual void emit(Frame& reference) = 0;

  /// No stage will look at this artefact of the frame any more.
  virtual void release(Frame& frame, Artefact artefact) = 0;

  /// For what the host does itself.
  const Executor& executor() const { return executor_; }

  /// Called at the end of each Densifier::add (`all` = false) and flush (`all` = true): hands out what is finished.
  virtual void deliver(bool all) = 0;

 protected:
  Engine(const EngineContext& context, Executor executor) : context_(context), executor_(std::move(executor)) {}

  EngineContext context_;
  Executor executor_;
};

/// Frames by their distance from the reference, as a round of ownership asks them: who is near is the likeliest to own
/// a place, and whoever owns it ends the question.
std::vector<const Engine::Frame*> nearest_first(const Engine::Frame& reference,
                                                std::vector<const Engine::Frame*> frames);

}  // namespace pmsp
