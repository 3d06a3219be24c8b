// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "plan/reach.h"
#include "schedule.h"

namespace pmsp {

/// Simulates the order of work on a sequence (see Pipeline), to count the keyframes that hold each artefact.
class MemorySimulation {
 public:
  /// Numbers of keyframes that hold an artefact.
  struct Held {
    double images = 0.0;
    double colors = 0.0;
    double planes = 0.0;    ///< of two successive passes
    double evidence = 0.0;  ///< evidence of the image, between passes
    double medians = 0.0;
    double filtered = 0.0;
    double range_maps = 0.0;
    double surfels = 0.0;
    double ranked = 0.0;      ///< of `surfels`: after the first round of duplicate removal
    double candidates = 0.0;  ///< of `ranked`: before the last round
  };

  /// `in_step`: as with several devices that share a sequence.
  explicit MemorySimulation(const DensifierOptions& options, bool in_step = false)
      : in_step_(in_step),
        passes_(options.advanced.patchmatch.geometric_passes),
        rounds_(duplicate_rounds(options)),
        has_evidence_(passes_ > 0 && options.advanced.patchmatch.plane_priors),
        schedule_(options, true),
        next_(schedule_.stages().size(), 0),
        kept_(schedule_.lifetimes().size(), 0) {}

  /// Simulates a number of keyframes; calls `look` with the counts after each change.
  template <class Look>
  void run(std::int64_t keyframes, const Look& look) {
    std::int64_t enough = 0;  // later keyframes only reuse released memory
    for (const Lifetime& lifetime : schedule_.lifetimes()) enough = std::max(enough, 2 * lifetime.keyframes);
    keyframes = std::min(keyframes, enough);
    for (end_ = 1; end_ <= keyframes; ++end_) {
      look(held());
      advance(false, look);
    }
    end_ = keyframes;
    advance(true, look);
  }

 private:
  Held held() const {
    const std::int64_t matched = through(Stage::Kind::kMatch, passes_);
    const std::int64_t filtered = through(Stage::Kind::kFilter);
    Held held;
    held.images = left(Artefact::kImage, end_);
    held.colors = left(Artefact::kColor, end_);
    const double between = passes_ > 0 ? left(Artefact::kPassPlanes, through(Stage::Kind::kMatch, 1)) -
                                             left(Artefact::kPassPlanes, matched)
                                       : 0.0;
    held.planes = left(Artefact::kPassPlanes, through(Stage::Kind::kMatch, 0)) + between;
    held.evidence = has_evidence_ ? between : 0.0;
    held.medians = left(Artefact::kFinalPlanes, matched);
    held.filtered = left(Artefact::kFiltered, filtered);
    held.range_maps = left(Artefact::kRangeMap, filtered);
    held.surfels = left(Artefact::kSurfels, through(Stage::Kind::kFuse));
    const std::int64_t ranked = through(Stage::Kind::kDuplicates, 1);
    held.ranked = left(Artefact::kSurfels, ranked);
    held.candidates = static_cast<double>(ranked - through(Stage::Kind::kDuplicates, rounds_));
    return held;
  }
  /// Returns the number of keyframes that completed a stage.
  std::int64_t through(Stage::Kind kind, int step = 0) const {
    for (std::size_t i = 0; i < next_.size(); ++i) {
      if (schedule_.stages()[i].kind == kind && schedule_.stages()[i].step == step) return next_[i];
    }
    return 0;
  }
  /// Returns how many of the first `made` keyframes still hold the artefact.
  double left(Artefact artefact, std::int64_t made) const {
    const Lifetime* const lifetime = schedule_.lifetime(artefact);
    if (lifetime == nullptr) return 0.0;
    const std::int64_t first = kept_[static_cast<std::size_t>(lifetime - schedule_.lifetimes().data())];
    return static_cast<double>(std::max<std::int64_t>(0, made - first));
  }
  template <class Look>
  void advance(bool last, const Look& look) {
    if (in_step_) return advance_in_step(last, look);
    for (std::size_t stage = next_.size(); stage-- > 0;) {
      if (!is_ready(stage, last)) continue;
      ++next_[stage];
      look(held());
      forget(last);
      stage = next_.size();  // from the last stage again
    }
  }
  template <class Look>
  void advance_in_step(bool last, const Look& look) {
    std::vector<std::size_t> ready;
    do {
      ready.clear();
      for (std::size_t stage = next_.size(); stage-- > 0;) {
        if (is_ready(stage, last)) ready.push_back(stage);
      }
      for (const std::size_t stage : ready) {
        ++next_[stage];
        look(held());
        forget(last);
      }
    } while (last && !ready.empty());
  }
  bool is_ready(std::size_t at, bool last) const {
    const Stage& stage = schedule_.stages()[at];
    const std::int64_t keyframe = next_[at];
    if (keyframe + (last ? 0 : stage.lead) >= end_) return false;
    return std::all_of(stage.needs.begin(), stage.needs.end(), [&](const Stage::Need& need) {
      const std::int64_t until = keyframe + need.ahead + 1 + (in_step_ ? 1 : 0);
      return next_[need.stage] >= (last ? std::min(until, end_) : until);
    });
  }
  void forget(bool last) {
    for (std::size_t k = 0; k < kept_.size(); ++k) {
      std::int64_t until = end_;
      for (const Lifetime::Reader& reader : schedule_.lifetimes()[k].readers) {
        const std::int64_t at = next_[reader.stage];
        if (!last || at < end_) until = std::min(until, at - reader.behind);
      }
      kept_[k] = std::max(kept_[k], until);
    }
  }

  bool in_step_;
  int passes_;
  int rounds_;
  bool has_evidence_;
  Schedule schedule_;
  std::vector<std::int64_t> next_;  ///< by stage: first keyframe not completed
  std::vector<std::int64_t> kept_;  ///< by lifetime: first keyframe that holds the artefact
  std::int64_t end_ = 0;
};

}  // namespace pmsp
