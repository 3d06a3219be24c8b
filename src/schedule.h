// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "pmsp/options.h"

namespace pmsp {

/// Data that a stage produces for a keyframe.
enum class Artefact {
  kImage,  ///< prepared, for matching
  kColor,  ///< of the size of the depth map, with the mask
  kLandmarks,
  kPassPlanes,   ///< after passes of PatchMatch
  kFinalPlanes,  ///< after the last pass and the median filter
  kFiltered,     ///< confidence after the consistency filter
  kRangeMap,
  kSurfels,  ///< points of the pixels, with their status
};

/// Stage of the pipeline, for each keyframe.
struct Stage {
  enum class Kind { kMatch, kFilter, kFuse, kFreeSpace, kDuplicates, kEmit };
  /// Prerequisite: `stage` must have completed all keyframes up to i + `ahead`.
  struct Prerequisite {
    std::size_t stage;
    std::int64_t ahead;
  };

  Kind kind;
  int step = 0;                     ///< pass of PatchMatch, or round of duplicate removal from 1
  std::vector<Prerequisite> needs;  ///< earlier stages
  std::int64_t lookahead = 0;       ///< number of later keyframes that must have been added

  /// Returns the approximate time per keyframe on a CPU [passes of PatchMatch], for progress and remaining time.
  double cost() const;
};

/// Lifetime of an artefact: until each reader has completed all keyframes up to i + `behind`.
struct Lifetime {
  struct Reader {
    std::size_t stage;
    std::int64_t behind;
  };

  Artefact artefact;
  std::vector<Reader> readers;
  std::int64_t keyframes = 0;  ///< maximum number that hold it at the same time, on one device
};

/// Order of the stages and lifetimes of their artefacts: a function of the options and of whether points are requested.
/// Counts are of accepted keyframes. In an unordered set any keyframe may depend on any other: stage after stage runs
/// over all of them at the end, and `lookahead`, `ahead`, `behind` and `keyframes` do not apply.
class Schedule {
 public:
  Schedule(const DensifierOptions& options, bool points);

  /// Prerequisites come before the stages that need them.
  const std::vector<Stage>& stages() const { return stages_; }
  const std::vector<Lifetime>& lifetimes() const { return lifetimes_; }

  /// Returns nullptr if no stage reads it.
  const Lifetime* lifetime(Artefact artefact) const;

 private:
  /// `plan_lookahead`: later keyframes after which the plan of the stage is decided.
  std::size_t add(Stage::Kind kind, int step, std::vector<Stage::Prerequisite> needs, std::int64_t plan_lookahead);
  void add_lifetime(Artefact artefact, std::int64_t produced, std::vector<Lifetime::Reader> readers);

  std::vector<Stage> stages_;
  std::vector<Lifetime> lifetimes_;
};

}  // namespace pmsp
