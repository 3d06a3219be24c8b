// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <utility>
#include <vector>

#include "plan/plan.h"
#include "pmsp/densifier.h"
#include "pmsp/stages.h"

namespace pmsp {

/// Results beside those of a Densifier.
struct PlannedCallbacks : DensifierCallbacks {
  PlannedCallbacks(DensifierCallbacks callbacks = {})  // NOLINT(google-explicit-constructor)
      : DensifierCallbacks(std::move(callbacks)) {}

  /// After the last pass and the median filter, for Shortcuts: of all keyframes that are matched, those too that a
  /// given plan's results merely depend on. In the order in which they are made.
  std::function<void(const PlaneMap&)> planes;
  /// Whether `planes` is to be called for this keyframe, whose planes are about to be made. Not set: for each.
  std::function<bool(std::int64_t keyframe_id)> wants_planes;
  /// What each keyframe is used for, and which others its results depend on, once nothing changes it any more. Not with
  /// a given plan.
  std::function<void(const PlanEntry&)> planned;
};

/// How a run of a given plan matches a keyframe in less than all passes.
struct Shortcut {
  /// What there is of an earlier run (DensifierCallbacks::planes).
  enum class Planes {
    kNone,    ///< nothing
    kStart,   ///< planes that others look at, and that passes begin with
    kResult,  ///< what this run would make: the earlier one ran the same plan with the same shortcuts, and was
              ///< interrupted
  };
  Planes planes = Planes::kNone;
  /// Of PatchMatch, `patchmatch.geometric_passes` + 1 at most. With kStart the last ones, all geometric: 0 = the planes
  /// are kept. Else the first ones, 1 at least: others look at what they make in place of what the missing ones would.
  int passes = 0;
  bool images_first = false;  ///< kStart: the first of them looks at images alone, as planes of before a move agree
};

/// What is known beforehand of a run of a given plan.
struct Shortcuts {
  std::map<std::int64_t, Shortcut> keyframes;     ///< all others are matched in all passes
  std::function<PlaneMap(std::int64_t id)> load;  ///< planes of an earlier run, once at most for each, when needed
};

/// Gives a keyframe by its id. What its views point to stays until the next call, or until `run` returns. May call what
/// callbacks may; after `cancel` it may return anything.
using KeyframeSource = std::function<Keyframe(std::int64_t id)>;

/// A Densifier that shows its plan, or runs part of a given one: of a workspace, a shard, or depth maps from elsewhere.
/// With a given plan `stats` are of all that was worked on, the halo included; `points` and `points_repeated` are of
/// those handed out, `keyframes_*` of all that were added.
///
/// With a given plan, `add` returns whether the results asked for depend on the keyframe's image. Others are counted,
/// but nothing else of them is looked at. It throws InvalidInput, too, when the plan has no such keyframe, or one that
/// comes before it in the plan and whose image is needed has not come. `flush` throws InvalidInput when an image is
/// missing that is needed, naming the first such keyframe: all is as if the call had not been made.
class PMSP_API PlannedDensifier : public Densifier {
 public:
  /// Makes the plan (see make_plan) while keyframes come. Throws as Densifier.
  PlannedDensifier(const DensifierOptions& options, PlannedCallbacks callbacks);

  /// Runs part of a given plan: what the results of the keyframes `ids` depend on. Callbacks come for these only, in
  /// the order of the plan, and give what a run of the whole plan gives, byte for byte, on the same backend. No ids, no
  /// results. `add` takes the keyframes of `halo(plan, ids, options, callbacks.cloud != nullptr).images`, all of them,
  /// in the order of the plan, with the poses and landmarks that the plan was made from. Fewer do where planes are
  /// asked for but neither clouds nor filtered depth maps: `images` names them.
  ///
  /// `options`: those that the plan was made with; with another seed, backend, size or number of threads it fits, too.
  /// Where images differ in size, give width and height: 0 follows the first one that comes. Throws InvalidInput where
  /// the plan lacks one of `ids`, or makes no sense with these options: a keyframe is there twice, or names others that
  /// are not there, lack what they should lend, are too many or lie too far away; a depth map lacks its neighbours or
  /// depth range. Throws InvalidOption, BackendUnavailable, and InvalidOption as `halo` does unless `ids` name all
  /// keyframes with a depth map.
  ///
  /// `shortcuts`: Throws InvalidInput where they name a keyframe that the plan lacks or a number of passes that does
  /// not fit, or there is nobody to load planes. What `load` gives must have the size of the depth maps, else
  /// InvalidInput comes out of `add`, `flush` and `run`.
  PlannedDensifier(const DensifierOptions& options, const Plan& plan, const std::vector<std::int64_t>& ids,
                   PlannedCallbacks callbacks, Shortcuts shortcuts = {});

  /// Runs a given plan to its end: asks for the keyframes that it needs, one at a time and in the order of the plan, in
  /// place of `add`, and flushes. Without a scratch folder it asks again for images of unordered sets, so that they
  /// take no memory meanwhile: in each pass over the keyframe itself and over each that is matched with it. An id
  /// stands for the same keyframe each time. Throws InvalidInput when there is no given plan, and all is as it was;
  /// else what `add`, `flush` and `keyframes` throw, and InvalidInput when another keyframe comes than was asked for:
  /// after any of these the Densifier is as after `cancel`.
  void run(const KeyframeSource& keyframes);

  /// With a given plan: the keyframes that `add` needs, in the order of the plan. Without: none.
  std::vector<std::int64_t> images() const;
};

}  // namespace pmsp
