// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "pmsp/options.h"

namespace pmsp {

/// What a stage leaves for a keyframe, and what of it others read.
enum class Artefact {
  kImage,        ///< prepared, for matching
  kColor,        ///< of the depth map's size, with the mask
  kLandmarks,    ///< of the keyframe
  kPassPlanes,   ///< of the passes of PatchMatch
  kFinalPlanes,  ///< planes after the last pass and the median filter
  kFiltered,     ///< confidence after the consistency filter
  kRangeMap,     ///< range map
  kSurfels,      ///< points of the pixels, and their standings
};

/// One step of every keyframe's way through the pipeline.
struct Stage {
  enum class Kind { kMatch, kFilter, kFuse, kFreeSpace, kDuplicates, kEmit };
  /// Another stage that must have been at all keyframes up to so many after this one's.
  struct Need {
    std::size_t stage;
    std::int64_t ahead;
  };

  Kind kind;
  int step = 0;             ///< pass of PatchMatch, or round of ownership from 1 on
  std::vector<Need> needs;  ///< of earlier stages
  std::int64_t lead = 0;    ///< keyframes that come after its own before it runs

  /// Of one keyframe, in passes of PatchMatch: what a share of the work and the time left are told from. From
  /// measurements on a CPU; other machines, sizes and scenes have others.
  double cost() const;
};

/// How long an artefact is kept: until these stages have been at all keyframes up to so many after its own.
struct Lifetime {
  struct Reader {
    std::size_t stage;
    std::int64_t behind;
  };

  Artefact artefact;
  std::vector<Reader> readers;
  std::int64_t keyframes = 0;  ///< that have it at the same time, at most, on one device
};

/// In which order a Densifier runs the stages and when it lets go of what they leave: a function of its options, and of
/// whether somebody takes the points. Numbers of keyframes count the used ones. In an unordered set every keyframe may
/// look at every other one: stage after stage runs over all of them at the end, and `lead`, `ahead`, `behind` and
/// `keyframes` hold for flights only.
class Schedule {
 public:
  Schedule(const DensifierOptions& options, bool points);

  /// A stage comes after those that it needs.
  const std::vector<Stage>& stages() const { return stages_; }
  const std::vector<Lifetime>& lifetimes() const { return lifetimes_; }

  /// nullptr where nobody asks for it.
  const Lifetime* lifetime(Artefact artefact) const;
  /// Keyframes that have an artefact at the same time, at most, on one device.
  std::int64_t keyframes_with(Artefact artefact) const;

 private:
  std::size_t add(Stage::Kind kind, int step, std::vector<Stage::Need> needs, std::int64_t plan_delay);
  void keep(Artefact artefact, std::int64_t made_at, std::vector<Lifetime::Reader> readers);

  std::vector<Stage> stages_;
  std::vector<Lifetime> lifetimes_;
};

}  // namespace pmsp
