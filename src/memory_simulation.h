// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "plan/reach.h"
#include "task_order.h"

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

  /// `multi_device`: as with several devices that share a sequence.
  explicit MemorySimulation(const DensifierOptions& options, bool multi_device = false)
      : passes_(options.advanced.patchmatch.geometric_passes),
        rounds_(duplicate_rounds(options)),
        has_evidence_(passes_ > 0 && options.advanced.patchmatch.plane_priors),
        order_(options, true) {
    order_.set_multi_device(multi_device);
  }

  /// Simulates a number of keyframes; calls `look` with the counts after each change.
  template <class Look>
  void run(std::int64_t keyframes, const Look& look) {
    std::int64_t enough = 0;  // later keyframes only reuse released memory
    for (const Lifetime& lifetime : schedule().lifetimes()) enough = std::max(enough, 2 * lifetime.keyframes);
    keyframes = std::min(keyframes, enough);
    for (std::int64_t i = 0; i < keyframes; ++i) {
      order_.add_keyframe();
      look(held());
      advance(false, look);
    }
    advance(true, look);
  }

 private:
  Held held() const {
    const std::int64_t matched = through(Stage::Kind::kMatch, passes_);
    const std::int64_t filtered = through(Stage::Kind::kFilter);
    Held held;
    held.images = left(Artefact::kImage, order_.end());
    held.colors = left(Artefact::kColor, order_.end());
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
    for (std::size_t i = 0; i < schedule().stages().size(); ++i) {
      if (schedule().stages()[i].kind == kind && schedule().stages()[i].step == step) return order_.next(i);
    }
    return 0;
  }
  /// Returns how many of the first `made` keyframes still hold the artefact.
  double left(Artefact artefact, std::int64_t made) const {
    const Lifetime* const lifetime = schedule().lifetime(artefact);
    if (lifetime == nullptr) return 0.0;
    const std::int64_t first = order_.first_with(static_cast<std::size_t>(lifetime - schedule().lifetimes().data()));
    return static_cast<double>(std::max<std::int64_t>(0, made - first));
  }
  template <class Look>
  void advance(bool last, const Look& look) {
    const auto is_planned = [&](const Task& task) {
      return last || task.keyframe + schedule().stages()[task.stage].lookahead < order_.end();
    };
    order_.advance(last, is_planned, [&](const Task& task) {
      order_.mark(task);
      look(held());
      order_.release(last, [](Artefact, std::int64_t) {});
      return true;
    });
  }
  const Schedule& schedule() const { return order_.schedule(); }

  int passes_;
  int rounds_;
  bool has_evidence_;
  TaskOrder order_;
};

}  // namespace pmsp
