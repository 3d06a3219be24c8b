// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdio>
#include <ctime>
#include <map>

#include "plan/halo.h"
#include "plan/missions.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

struct Sample {
  const char* name;
  std::vector<PlanKeyframe> keyframes;
  bool unordered;
};

std::vector<Sample> samples() {
  MissionRecipe recipe;
  recipe.keyframes = 1000;
  recipe.landmarks_seen = 200;
  recipe.density = 60.0;
  MissionRecipe set = recipe;
  set.keyframes = 500;
  MissionRecipe large = recipe;
  large.keyframes = 10000;
  std::vector<Sample> result;
  result.push_back({"corridor flight", corridor(recipe), false});
  result.push_back({"ten passes through one corridor", corridor(recipe, 10), false});
  result.push_back({"loop", loop(recipe), false});
  result.push_back({"photo set of 500", photos(set), true});
  result.push_back({"10,000 keyframes of a loop", loop(large), false});
  result.push_back({"10,000 keyframes in ten passes", corridor(large, 10), false});
  result.push_back({"photo set of 10,000", photos(large), true});
  return result;
}

std::size_t besides(const std::vector<std::int64_t>& ids, std::size_t own) {
  return ids.size() > own ? ids.size() - own : 0;
}

/// From the keyframe in the middle: a stretch of a set is what lies together.
void sort_by_distance(std::vector<std::int64_t>& ids, const std::vector<PlanKeyframe>& keyframes) {
  std::map<std::int64_t, Eigen::Vector3d> centers;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const PlanKeyframe& keyframe : keyframes) {
    centers[keyframe.id] = keyframe.cam_from_world.center();
    middle += centers[keyframe.id] / static_cast<double>(keyframes.size());
  }
  std::sort(ids.begin(), ids.end(), [&](std::int64_t a, std::int64_t b) {
    return (centers[a] - middle).norm() < (centers[b] - middle).norm();
  });
}

double cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

}  // namespace

TEST_CASE("sizes of halos, as a table", "[.table]") {
  for (Sample& sample : samples()) {
    for (const Quality quality : {Quality::kOnline, Quality::kNormal}) {
      DensifierOptions options = preset(quality);
      options.unordered = sample.unordered;
      const double start = cpu_seconds();
      const Plan plan = make_plan(sample.keyframes, options);
      const double seconds = cpu_seconds() - start;
      std::vector<std::int64_t> with_maps;
      for (const PlanEntry& entry : plan.entries) {
        if (entry.has_depth_map()) with_maps.push_back(entry.id);
      }
      std::printf("| %s, %s | %zu of %zu | %.1f s |\n", sample.name, quality == Quality::kOnline ? "online" : "normal",
                  with_maps.size(), plan.entries.size(), seconds);
      for (const std::size_t count : {1, 16}) {
        if (sample.unordered) sort_by_distance(with_maps, sample.keyframes);
        const auto from = sample.unordered ? with_maps.begin()
                                           : with_maps.begin() + static_cast<std::ptrdiff_t>(with_maps.size() / 2);
        const std::vector<std::int64_t> ids(from, from + static_cast<std::ptrdiff_t>(count));
        const Halo found = find_halo(plan, ids, options, Wanted::kPoints);
        std::printf("  | %zu | %zu | %zu | %zu |", count, besides(found.rounds[0], count), found.range_maps.size(),
                    besides(found.filtered, count));
        for (std::size_t pass = found.planes.size(); pass > 0; --pass) {
          std::printf(" %zu |", besides(found.planes[pass - 1], count));
        }
        std::printf(" %zu |\n", besides(found.images, count));
      }
    }
  }
}
