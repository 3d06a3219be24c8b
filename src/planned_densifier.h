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

/// Additional results of a Densifier.
struct PlannedCallbacks : DensifierCallbacks {
  PlannedCallbacks(DensifierCallbacks callbacks = {})  // NOLINT(google-explicit-constructor)
      : DensifierCallbacks(std::move(callbacks)) {}

  /// Planes after the last pass and the median filter, for PlaneReuses: of all matched keyframes, with a given plan
  /// also of those that only serve others. In the order of computation.
  std::function<void(const PlaneMap&)> planes;
  /// Whether to call `planes` for a keyframe, queried before its planes are made. Unset: always.
  std::function<bool(std::int64_t keyframe_id)> wants_planes;
  /// Entry of the plan, once final. Not called with a given plan.
  std::function<void(const PlanEntry&)> planned;
};

/// Matching of a keyframe with fewer passes, in a run of a given plan.
struct PlaneReuse {
  /// Available planes of an earlier run (PlannedCallbacks::planes).
  enum class Planes {
    kNone,
    kStart,   ///< initial planes of the passes, also read by other keyframes
    kResult,  ///< result of this run: of an interrupted run of the same plan with the same reuses
  };
  Planes planes = Planes::kNone;
  /// Number of passes, at most `patchmatch.geometric_passes` + 1. kStart: the last ones are run; 0 = the planes
  /// are kept. Else the first ones, at least 1: others read their result instead of that of the missing ones.
  int passes = 0;
  /// kStart: the first pass is photometric, since planes from before a pose change agree with each other.
  bool photometric_first = false;
};

/// Reuses of all keyframes in a run of a given plan.
struct PlaneReuses {
  std::map<std::int64_t, PlaneReuse> keyframes;  ///< others are matched in all passes
  std::function<PlaneMap(std::int64_t id)>
      load;  ///< returns planes of an earlier run; called when needed, once per keyframe at most
};

/// Returns a keyframe by id. Its views must stay valid until the next call or the return of `run`. May call the
/// functions allowed in callbacks; ignored after `cancel`.
using KeyframeSource = std::function<Keyframe(std::int64_t id)>;

/// Densifier that reports its plan or runs part of a given plan: for workspaces, shards, or external depth maps.
///
/// With a given plan, `stats` cover all processed keyframes, the halo included, but `points` and `points_repeated` only
/// emitted ones, and `keyframes_*` all added ones. `add` returns whether the requested results depend on the keyframe's
/// image; other keyframes are counted and ignored. It also throws InvalidInput if the plan lacks the keyframe, or a
/// required keyframe before it in the plan is missing. `flush` throws InvalidInput, naming the first missing keyframe,
/// with no effect, if required images are missing.
class PMSP_API PlannedDensifier : public Densifier {
 public:
  /// Makes the plan (see make_plan) incrementally. Throws as Densifier.
  PlannedDensifier(const DensifierOptions& options, PlannedCallbacks callbacks);

  /// Runs part of a given plan: all that the results of the keyframes `ids` depend on. Callbacks are called for these
  /// only, in the order of the plan, with the same bytes as in a run of the whole plan on the same backend; without
  /// ids, there are no results. `add` requires all keyframes of `halo(plan, ids, options, callbacks.cloud !=
  /// nullptr).images` in the order of the plan, with the poses and landmarks of the plan. For planes alone, without
  /// clouds and filtered depth maps, fewer are required: see `images`.
  ///
  /// `options`: those of the plan; seed, backend, size and number of threads may differ. If images differ in size,
  /// width and height must be set: 0 follows the first image. Throws InvalidInput if the plan lacks one of `ids` or
  /// does not fit the options: duplicate keyframes; references to keyframes that are missing, lack the required data,
  /// are too many or too distant; depth maps without neighbours or depth range. Throws InvalidOption,
  /// BackendUnavailable; InvalidOption as `halo`, unless `ids` are all keyframes with a depth map.
  ///
  /// `reuses`: throws InvalidInput for keyframes that the plan lacks, unsuitable numbers of passes, or a missing
  /// `load`. If loaded planes differ in size from the depth maps, `add`, `flush` and `run` throw InvalidInput.
  PlannedDensifier(const DensifierOptions& options, const Plan& plan, const std::vector<std::int64_t>& ids,
                   PlannedCallbacks callbacks, PlaneReuses reuses = {});

  /// Runs a given plan completely: queries the required keyframes, one at a time in the order of the plan, instead of
  /// `add`, and flushes. Without a scratch folder, images of unordered sets are queried again in each pass that reads
  /// them, instead of being held in memory; an id must denote the same keyframe each time. Throws InvalidInput, with no
  /// effect, without a given plan. Also throws as `add`, `flush` and `keyframes`, and InvalidInput if a wrong keyframe
  /// is returned: the Densifier is then in the state after `cancel`.
  void run(const KeyframeSource& keyframes);

  /// Returns the keyframes required by `add`, in the order of the plan; none without a given plan.
  std::vector<std::int64_t> images() const;
};

}  // namespace pmsp
