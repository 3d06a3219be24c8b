// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/cost.h"

#include <algorithm>
#include <vector>

#include "fusion/fusion_setup.h"
#include "schedule.h"
#include "sphere/cube_map.h"

namespace pmsp {
namespace {

constexpr double kPlanes = 16.0;  // bytes of a pixel: x, y, z and score

/// The order of work of a flight (see Pipeline), without the work: how many keyframes have what at a time.
class Rehearsal {
 public:
  explicit Rehearsal(const DensifierOptions& options)
      : schedule_(options, true), next_(schedule_.stages().size(), 0), kept_(schedule_.lifetimes().size(), 0) {}

  /// Of so many keyframes; `look` is called whenever something has changed.
  template <class Look>
  void run(std::int64_t keyframes, const Look& look) {
    for (end_ = 1; end_ <= keyframes; ++end_) {
      look();
      advance(false, look);
    }
    end_ = keyframes;
    advance(true, look);
  }

  std::int64_t come() const { return end_; }
  /// How many keyframes have been through a stage.
  std::int64_t through(Stage::Kind kind, int step = 0) const {
    for (std::size_t i = 0; i < next_.size(); ++i) {
      if (schedule_.stages()[i].kind == kind && schedule_.stages()[i].step == step) return next_[i];
    }
    return 0;
  }
  /// Of `made` keyframes, the first ones, those that still have the artefact.
  double left(Artefact artefact, std::int64_t made) const {
    for (std::size_t k = 0; k < kept_.size(); ++k) {
      if (schedule_.lifetimes()[k].artefact == artefact) {
        return static_cast<double>(std::max<std::int64_t>(0, made - kept_[k]));
      }
    }
    return 0.0;
  }

 private:
  template <class Look>
  void advance(bool last, const Look& look) {
    for (std::size_t stage = next_.size(); stage-- > 0;) {
      if (!is_ready(stage, last)) continue;
      ++next_[stage];
      look();
      forget(last);
      stage = next_.size();  // the last one that has something to do
    }
  }
  bool is_ready(std::size_t at, bool last) const {
    const Stage& stage = schedule_.stages()[at];
    const std::int64_t keyframe = next_[at];
    if (keyframe + (last ? 0 : stage.lead) >= end_) return false;
    return std::all_of(stage.needs.begin(), stage.needs.end(), [&](const Stage::Need& need) {
      return next_[need.stage] >= std::min(end_, keyframe + need.ahead + 1);
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

  Schedule schedule_;
  std::vector<std::int64_t> next_;  ///< by stage
  std::vector<std::int64_t> kept_;  ///< by lifetime, the first keyframe that has the artefact
  std::int64_t end_ = 0;
};

}  // namespace

HostMemory host_memory_needed(const DensifierOptions& options, std::int64_t used, int image_width) {
  const double pixels = static_cast<double>(options.width) * options.height;
  const double side =
      cube_size_for(compared_size(image_width, options.width, options.height, options.patchmatch.image_scale).width);
  const double texels = 6.0 * side * side;  // 8 bytes each in a cube map that is matched with, 2 in one put away
  const int passes = options.patchmatch.geometric_passes;
  const double surfel = 2.0 * 4.0 + 2.0 + agree_bytes(options.fusion) + 4.0;  // and who is still to be asked
  const bool waits_in_file = !options.scratch_folder.empty();
  const Schedule schedule(options, true);
  std::int64_t enough = 0;  // later keyframes find what those before have let go of
  for (const Lifetime& lifetime : schedule.lifetimes()) enough = std::max(enough, 2 * lifetime.keyframes);

  HostMemory needed;
  // One stage's own: planes of a pass and keys, or what it looks at of others where that is in the file, and points on
  // their way out.
  const double matching = (4.0 * kPlanes + 2.0 * 8.0) * pixels;
  const double asking = (waits_in_file ? 5.0 * options.free_space.views : 0.0) * pixels;
  constexpr double kMirrors = 2.0;         // two words for each cell of four pixels
  const double cube_nodes = 8.0 * texels;  // of the last image
  needed.memory = std::max(matching, asking + (20.0 + kMirrors) * pixels) + cube_nodes;
  if (options.unordered) {  // all wait for all
    const double each = pixels * (4.0 + 2.0 * kPlanes + kPlanes + 4.0 + 2.0 + surfel);
    (waits_in_file ? needed.scratch : needed.memory) += static_cast<double>(used) * (each + 2.0 * texels);
    return needed;
  }
  using Kind = Stage::Kind;
  double most_held = 0.0;
  Rehearsal flight(options);
  flight.run(std::min(used, enough), [&] {
    const std::int64_t matched = flight.through(Kind::kMatch, passes);
    const double images = flight.left(Artefact::kImage, flight.come());
    // Planes of the last two passes; those of the last one are the median filter's.
    const double between = passes > 0 ? flight.left(Artefact::kPlanes, flight.through(Kind::kMatch, 1)) -
                                            flight.left(Artefact::kPlanes, matched)
                                      : 0.0;
    const double planes = flight.left(Artefact::kPlanes, flight.through(Kind::kMatch, 0)) + between;
    const double evidence = options.patchmatch.plane_priors ? 8.0 * between : 0.0;
    const std::int64_t filtered = flight.through(Kind::kFilter);
    const double waiting = pixels * (2.0 * flight.left(Artefact::kRangeMap, filtered) +
                                     surfel * flight.left(Artefact::kSurfels, flight.through(Kind::kFuse)));
    const double held =
        8.0 * texels * images +
        pixels * (4.0 * flight.left(Artefact::kColor, flight.come()) + kPlanes * planes + evidence +
                  kPlanes * flight.left(Artefact::kMedian, matched) + 4.0 * flight.left(Artefact::kFiltered, filtered));
    most_held = std::max(most_held, held + (waits_in_file ? 0.0 : waiting));
    needed.scratch = std::max(needed.scratch, waits_in_file ? waiting : 0.0);
  });
  needed.memory += most_held;
  return needed;
}

}  // namespace pmsp
