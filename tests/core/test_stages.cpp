// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <map>
#include <vector>

#include "core/recording.h"
#include "patchmatch/match_setup.h"
#include "plan/plan.h"
#include "plan/reach.h"
#include "planned_densifier.h"
#include "pmsp/stages.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

/// A mission through the functions of pmsp/stages.h, in the order of its plan. Ids count from 0.
class Composed {
 public:
  Composed(const std::vector<Keyframe>& keyframes, const std::map<std::int64_t, PlanEntry>& plan,
           const DensifierOptions& options)
      : keyframes_(keyframes), plan_(plan), options_(options), stages_(options.advanced), executor_(1, options.simd) {
    for (const Keyframe& keyframe : keyframes_) {
      panoramas_.emplace_back(keyframe.image, keyframe.mask, options_.width, options_.height, executor_,
                              stages_.patchmatch.image_scale);
    }
  }

  void run(Recording& to) {
    match(to);
    filter(to);
    fuse(to);
  }

 private:
  MatchInput input_of(const Keyframe& keyframe, const PlanEntry& entry) const {
    MatchInput input;
    input.keyframe_id = keyframe.id;
    input.reference = {&panoramas_[index(keyframe.id)], keyframe.pose()};
    for (const std::int64_t id : entry.near) {
      input.neighbours.push_back({&panoramas_[index(id)], keyframes_[index(id)].pose()});
    }
    input.range = entry.range;
    input.lens_distance = options_.lens_distance;
    return input;
  }

  PlaneMap first_planes(const Keyframe& keyframe, const PlanEntry& entry) const {
    MatchInput input = input_of(keyframe, entry);
    const PlaneMap landmarks = planes_from_landmarks(keyframe, options_.width, options_.height, stages_.init, executor_,
                                                     options_.lens_distance);
    input.landmarks = &landmarks;
    PlaneMap warped;
    if (entry.first_planes) {
      const PlaneMap before = median_filter(planes_[index(*entry.first_planes)], stages_.median, executor_);
      warped = warp_planes(before, keyframe.pose(), options_.width, options_.height, executor_, options_.lens_distance);
      input.warped = &warped;
    }
    return patchmatch(input, stages_.patchmatch, options_.seed, executor_);
  }

  PlaneMap next_planes(const Keyframe& keyframe, const PlanEntry& entry, int pass, PlaneMap& prior) const {
    MatchInput input = input_of(keyframe, entry);
    input.start = &planes_[index(keyframe.id)];
    std::vector<KeyframePose> poses;
    for (const std::int64_t id : entry.near) {
      poses.push_back(keyframes_[index(id)].pose());
      input.neighbour_maps.push_back(&planes_[index(id)]);
    }
    prior = plane_priors(*input.start, *input.reference.panorama, poses, input.range, executor_, keyframe.prior_depth,
                         options_.lens_distance);
    input.prior = &prior;
    const Iterations iterations = iterations_of(stages_.patchmatch, pass);
    PatchMatchOptions options = stages_.patchmatch;
    options.iterations = iterations.count;
    input.first_iteration = iterations.first;
    return patchmatch(input, options, options_.seed, executor_);
  }

  void match(Recording& to) {
    for (const Keyframe& keyframe : keyframes_) {
      planes_.push_back(first_planes(keyframe, plan_.at(keyframe.id)));
    }
    priors_.resize(keyframes_.size());
    for (int pass = 1; pass <= stages_.patchmatch.geometric_passes; ++pass) {
      std::vector<PlaneMap> next;
      for (const Keyframe& keyframe : keyframes_) {
        next.push_back(next_planes(keyframe, plan_.at(keyframe.id), pass, priors_[index(keyframe.id)]));
      }
      planes_ = next;
    }
    for (std::size_t i = 0; i < planes_.size(); ++i) {
      to.raw.push_back(depth_map_of(subtract_priors(planes_[i], priors_[i], executor_), nullptr, executor_));
    }
  }

  void filter(Recording& to) {
    for (std::size_t i = 0; i < planes_.size(); ++i) {
      PlaneMap filtered = median_filter(planes_[i], stages_.median, executor_);
      if (stages_.median.weighted) filtered = weighted_median_filter(filtered, panoramas_[i], executor_);
      planes_[i] = subtract_priors(filtered, priors_[i], executor_);
    }
    for (std::size_t i = 0; i < planes_.size(); ++i) {
      std::vector<const PlaneMap*> others;
      for (const std::int64_t id : plan_.at(keyframes_[i].id).consistency) others.push_back(&planes_[index(id)]);
      const auto confidence = [&](double pose_error) {
        return consistency_filter(planes_[i], others, stages_.consistency, executor_, nullptr, pose_error,
                                  options_.lens_distance);
      };
      confidences_.push_back(confidence(0.0));
      const Image<float> reported = confidence(keyframes_[i].pose_error);
      to.filtered.push_back(depth_map_of(planes_[i], &reported, executor_));
      ranges_.push_back(range_map(planes_[i], confidences_[i], executor_));
    }
  }

  void fuse(Recording& to) {
    std::vector<SurfelMap> surfels;
    for (const Keyframe& keyframe : keyframes_) {
      const PlanEntry& entry = plan_.at(keyframe.id);
      std::vector<std::int64_t> ids = entry.fusion;
      ids.push_back(keyframe.id);
      std::sort(ids.begin(), ids.end());
      std::vector<FusionMap> window;
      std::size_t current = 0;
      for (const std::int64_t id : ids) {
        if (id == keyframe.id) current = window.size();
        const std::size_t i = index(id);
        window.push_back(
            {&planes_[i], &confidences_[i], &panoramas_[i].color(), keyframes_[i].pose(), keyframes_[i].pose_error});
      }
      surfels.push_back(fuse_pixels(window, current, stages_.fusion, executor_, options_.lens_distance));
      std::vector<PosedRangeMap> viewers;
      for (const std::int64_t id : entry.viewers)
        viewers.push_back({&ranges_[index(id)], keyframes_[index(id)].pose()});
      surfels.back().statuses = free_space_filter(surfels.back(), keyframe.pose(), viewers, stages_.free_space,
                                                  executor_, options_.lens_distance);
    }
    std::vector<std::vector<std::uint32_t>> candidates(surfels.size());
    for (int round = 0; round < duplicate_rounds(options_); ++round) {
      std::vector<Image<std::uint8_t>> statuses;
      for (std::size_t i = 0; i < surfels.size(); ++i) {
        std::vector<std::int64_t> ids = plan_.at(keyframes_[i].id).duplicate_views;
        std::vector<PosedSurfels> duplicate_views;
        for (const std::int64_t id : ids) duplicate_views.push_back(points_of(surfels, index(id)));
        statuses.push_back(duplicate_round(points_of(surfels, i), candidates[i], duplicate_views, stages_.fusion,
                                           executor_, options_.lens_distance));
      }
      for (std::size_t i = 0; i < surfels.size(); ++i) surfels[i].statuses = statuses[i];
    }
    for (std::size_t i = 0; i < surfels.size(); ++i) {
      to.clouds.push_back(extract_points(points_of(surfels, i), options_.lens_distance));
    }
  }

  PosedSurfels points_of(const std::vector<SurfelMap>& surfels, std::size_t i) const {
    return {&surfels[i], &surfels[i].statuses, keyframes_[i].pose()};
  }

  static std::size_t index(std::int64_t id) { return static_cast<std::size_t>(id); }

  const std::vector<Keyframe>& keyframes_;
  const std::map<std::int64_t, PlanEntry>& plan_;
  const DensifierOptions& options_;
  const AdvancedOptions& stages_;
  Executor executor_;
  std::vector<Panorama> panoramas_;
  std::vector<PlaneMap> planes_;  ///< of the newest pass
  std::vector<PlaneMap> priors_;
  std::vector<Image<float>> confidences_;
  std::vector<RangeMap> ranges_;
};

}  // namespace

TEST_CASE("the stages one by one give the bytes of the Densifier") {
  const Quality quality = GENERATE(Quality::kOnline, Quality::kNormal);
  synth::Recipe recipe = small_recipe(2 * kTinyWidth, 5);
  recipe.mission.render.lens_distance = 0.03;
  const synth::Mission mission = synth::textured_room(recipe);
  std::vector<Keyframe> keyframes;
  for (std::size_t i = 0; i < mission.frames.size(); ++i) {
    keyframes.push_back(keyframe_of(mission, i));
    keyframes.back().pose_error = 0.0004;
  }
  keyframes[2].prior_depth = mission.frames[2].depth.view();

  DensifierOptions options = preset(quality);
  options.width = kTinyWidth;
  options.height = kTinyWidth / 2;
  options.simd = kAnySimd;
  options.backend = Backend::kCpu;
  options.lens_distance = 0.03;
  options.advanced.view_filter.min_parallax_deg = 1.0;
  options.advanced.fusion.spacing_px = 0.75;
  Recording whole;
  std::map<std::int64_t, PlanEntry> plan;
  PlannedCallbacks callbacks = whole.callbacks();
  callbacks.planned = [&](const PlanEntry& entry) { plan[entry.id] = entry; };
  PlannedDensifier densifier(options, callbacks);
  ViewFilter views(options.advanced.view_filter, options.width);
  for (const Keyframe& keyframe : keyframes) CHECK(densifier.add(keyframe) == views.accept(keyframe));
  densifier.flush();
  REQUIRE(whole.clouds.size() == keyframes.size());
  REQUIRE(densifier.stats().points_repeated > 0);

  Recording composed;
  Composed(keyframes, plan, options).run(composed);
  whole.order.clear();
  CHECK(whole.points() > 500);
  CHECK(difference(by_kind(whole), by_kind(composed)) == "");
}
