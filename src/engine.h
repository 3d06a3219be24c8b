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

/// Receivers of results. Unset members are not called, and results needed only by them are not computed.
struct EngineResults {
  std::function<void(const DepthMap&)> raw_depth;       ///< after the last pass of PatchMatch
  std::function<void(const DepthMap&)> filtered_depth;  ///< after the consistency filter
  std::function<void(const PlaneMap&)> planes;          ///< after the last pass and the median filter
  std::function<bool(std::int64_t id)> wants_planes;    ///< filter of `planes`; unset = all
  std::function<void(const KeyframeCloud&)> cloud;
};

/// Data of the owner of an engine; must outlive it.
struct EngineContext {
  const DensifierOptions& options;  ///< sizes may be 0 before the first keyframe
  const EngineResults& results;
  DensifierStats& stats;
  const std::atomic<bool>& cancel;
  /// Returns the image of a prepared keyframe again. Unset: the engine retains prepared images.
  const KeyframeSource& reload_image;
};

/// Runs the stages on one kind of processor and holds their data. Each stage requires the results of earlier ones, see
/// the members; results reach callbacks and statistics in the order of calls. That is the schedule (src/schedule.h) for
/// Densifier; LiveBuilder and LivePreview choose their own.
class Engine {
 public:
  /// Accepted keyframe with its artefacts. Must not outlive the engine.
  struct Frame {
    explicit Frame(const Keyframe& keyframe)
        : id(keyframe.id), pose(keyframe.pose()), pose_error(keyframe.pose_error) {}
    virtual ~Frame() = default;

    /// Memory of its artefacts, of the device if there is one [bytes].
    virtual std::size_t bytes() const = 0;

    std::int64_t id;
    KeyframePose pose;
    double pose_error;          ///< see Keyframe
    bool matched = false;       ///< has a depth map, possibly before its last pass
    bool emits_results = true;  ///< false: the results serve other keyframes only
  };

  struct MatchTask {
    Frame* reference = nullptr;
    const Keyframe* keyframe = nullptr;  ///< the reference view, without image, mask and prior depth
    std::vector<const Frame*> neighbours;
    std::size_t num_with_planes = 0;  ///< number of neighbours, the first ones, that also provide planes
    DepthRange range;                 ///< [reference's unit]
    const Frame* previous = nullptr;  ///< its planes are warped into the reference view; nullptr = none
    /// 0 = photometric, else geometric: starts from the map of the previous pass and is compared with those of the
    /// first `num_with_planes` neighbours. Neighbours with complete passes provide their final map.
    int pass = 0;
    bool makes_final_planes = true;  ///< filtered and stored as final planes; emitted
    /// With `makes_final_planes`, if another pass follows before the map is used: without the weighted median filter,
    /// and with the prior bonuses in the scores.
    bool skip_weighted_median = false;
  };

  virtual ~Engine() = default;

  /// Copies the required data of image and mask.
  virtual std::unique_ptr<Frame> prepare(const Keyframe& keyframe) = 0;

  /// Runs a pass of PatchMatch, with initialisation before the first and median filter after the last one.
  virtual void match(const MatchTask& task) = 0;

  /// Sets planes of an earlier run, of the size of the depth maps, instead of matching.
  virtual void load_planes(Frame& frame, const PlaneMap& planes) = 0;

  /// Skips a pass other than the last: the existing map serves as its result.
  virtual void reuse_planes(Frame& frame, int pass) = 0;

  /// Runs the consistency filter against other maps (all matched).
  virtual void filter(Frame& reference, const std::vector<const Frame*>& others) = 0;

  /// Computes the points of the reference, averaged over its window; `window[current]` is the reference (all matched
  /// and filtered).
  virtual void fuse(Frame& reference, const std::vector<const Frame*>& window, std::size_t current) = 0;

  /// Runs the free-space test with the range maps of the viewers (all filtered). May be repeated, with the stages that
  /// follow.
  virtual void test_free_space(Frame& reference, const std::vector<const Frame*>& viewers) = 0;

  /// Runs round 1, 2, ... of duplicate removal. `others` have completed the previous round, some also this one.
  virtual void remove_duplicates(Frame& reference, const std::vector<const Frame*>& others, int round) = 0;

  /// Passes the kept points to `results.cloud`.
  virtual void emit(Frame& reference) = 0;

  /// Releases an artefact that no later stage reads.
  virtual void release(Frame& frame, Artefact artefact) = 0;

  /// For work on the host.
  const Executor& executor() const { return executor_; }

  /// Delivers finished results. `all`: waits for those in flight.
  virtual void deliver(bool all) = 0;

 protected:
  Engine(const EngineContext& context, Executor executor) : context_(context), executor_(std::move(executor)) {}

  EngineContext context_;
  Executor executor_;
};

/// Returns the frames by distance from the reference, the order of search in a round of duplicate removal: near frames
/// are the most likely to have a kept duplicate, which ends the search.
std::vector<const Engine::Frame*> nearest_first(const Engine::Frame& reference,
                                                std::vector<const Engine::Frame*> frames);

}  // namespace pmsp
