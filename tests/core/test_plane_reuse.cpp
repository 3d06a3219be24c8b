// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/small_missions.h"
#include "pipeline.h"
#include "plan/halo.h"
#include "planned_densifier.h"
#include "pmsp/error.h"

using namespace pmsp;
using namespace pmsp::test;
using Catch::Contains;

namespace {

using Ids = std::vector<std::int64_t>;
using Maps = std::map<std::int64_t, PlaneMap>;

struct Outcome {
  ResultsById results;
  Maps planes;
  std::int64_t depth_maps = 0;
};

using Ways = std::map<std::int64_t, PlaneReuse>;

PlaneReuses reuses_of(const Ways& keyframes, const Maps& planes) {
  return {keyframes, [&planes](std::int64_t id) { return planes.at(id); }};
}

constexpr PlaneReuse kKept{PlaneReuse::Planes::kStart, 0, false};
constexpr PlaneReuse kRefined{PlaneReuse::Planes::kStart, 1, false};
constexpr PlaneReuse kMoved{PlaneReuse::Planes::kStart, 2, true};

PlaneReuse result_of(const SmallMission& mission) {
  return {PlaneReuse::Planes::kResult, mission.options.advanced.patchmatch.geometric_passes + 1, false};
}

/// Runs a plan for some keyframes with the images that it requests.
Outcome run_with(const SmallMission& mission, const Plan& plan, const Ids& ids, const PlaneReuses& reuses,
                 const std::function<bool(std::int64_t keyframe_id)>& wants_planes = nullptr) {
  Outcome outcome;
  Recording recording;
  PlannedCallbacks callbacks = recording.callbacks();
  callbacks.raw_depth = nullptr;
  callbacks.planes = [&](const PlaneMap& map) { CHECK(outcome.planes.emplace(map.keyframe_id, map).second); };
  callbacks.wants_planes = wants_planes;
  PlannedDensifier densifier(mission.options, plan, ids, callbacks, reuses);
  for (const std::int64_t id : densifier.images()) densifier.add(keyframe_of(mission, id));
  densifier.flush();
  outcome.results = by_id(recording);
  outcome.depth_maps = densifier.stats().depth_maps;
  return outcome;
}

Ids with_depth_map(const Plan& plan) {
  Ids ids;
  for (const PlanEntry& entry : plan.entries) {
    if (entry.has_depth_map()) ids.push_back(entry.id);
  }
  return ids;
}

bool same_planes(const PlaneMap& a, const PlaneMap& b) {
  return a.x.pixels() == b.x.pixels() && a.y.pixels() == b.y.pixels() && a.z.pixels() == b.z.pixels() &&
         a.score.pixels() == b.score.pixels();
}

}  // namespace

TEST_CASE("an interrupted run resumes with its finished planes and gives the same result", "[densifier][reuse]") {
  std::mt19937 random(3);
  for (const SmallMission& mission : small_missions()) {
    INFO(mission.name);
    const Plan plan = plan_of(mission);
    const Ids all = with_depth_map(plan);
    const Outcome whole = run_with(mission, plan, all, {});
    REQUIRE(whole.planes.size() == all.size());
    for (int round = 0; round < (kSanitized ? 1 : 4); ++round) {
      Ways ways;
      ResultsById expected = whole.results;
      Ids missing;
      for (const std::int64_t id : all) {
        if (random() % 4 != 0) ways[id] = result_of(mission);
        if (random() % 2 == 0) {
          missing.push_back(id);
        } else {
          expected.clouds.erase(id);
          expected.filtered.erase(id);
        }
      }
      expected.raw.clear();
      const Outcome rest = run_with(mission, plan, missing, reuses_of(ways, whole.planes));
      CHECK(difference(rest.results, expected) == "");
      for (const auto& [id, planes] : rest.planes) {
        CHECK(ways.count(id) == 0);
        CHECK(same_planes(planes, whole.planes.at(id)));
      }
    }
  }
}

TEST_CASE("with all planes given nothing is matched and the points are the same", "[densifier][reuse]") {
  for (const SmallMission& mission : small_missions()) {
    INFO(mission.name);
    const Plan plan = plan_of(mission);
    const Ids all = with_depth_map(plan);
    const Outcome whole = run_with(mission, plan, all, {});
    Ways kept;
    for (const std::int64_t id : all) kept[id] = kKept;
    const Outcome again = run_with(mission, plan, all, reuses_of(kept, whole.planes));
    CHECK(again.depth_maps == 0);
    CHECK(again.planes.empty());
    CHECK(difference(again.results, whole.results) == "");
  }
}

TEST_CASE("planes are delivered for the requested keyframes without other effects", "[densifier]") {
  for (const SmallMission& mission : small_missions()) {
    INFO(mission.name);
    const Plan plan = plan_of(mission);
    const Ids all = with_depth_map(plan);
    const Outcome whole = run_with(mission, plan, all, {});
    Ids asked;
    const Outcome half = run_with(mission, plan, all, {}, [&](std::int64_t id) {
      asked.push_back(id);
      return id % 2 == 0;
    });
    CHECK(difference(half.results, whole.results) == "");
    CHECK(std::set<std::int64_t>(asked.begin(), asked.end()).size() == asked.size());
    CHECK(asked.size() == whole.planes.size());
    for (const auto& [id, map] : whole.planes) {
      INFO(id);
      CHECK(half.planes.count(id) == (id % 2 == 0 ? 1U : 0U));
      if (half.planes.count(id) != 0) CHECK(same_planes(half.planes.at(id), map));
    }
  }
}

TEST_CASE("requesting planes alone gives the same planes from fewer images", "[densifier][reuse]") {
  for (const SmallMission& mission : small_missions()) {
    if (mission.options.advanced.init.warp_previous && mission.options.advanced.init.chain_keyframes == 0) continue;
    INFO(mission.name);
    const Plan plan = plan_of(mission);
    const Ids all = with_depth_map(plan);
    const Outcome whole = run_with(mission, plan, all, {});
    const Ids ids(all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2), all.end());
    Maps planes;
    PlannedCallbacks callbacks;
    callbacks.planes = [&](const PlaneMap& map) { CHECK(planes.emplace(map.keyframe_id, map).second); };
    PlannedDensifier densifier(mission.options, plan, ids, callbacks);
    CHECK(densifier.images().size() <= find_halo(plan, ids, mission.options, Wanted::kDepthMaps).images.size());
    for (const std::int64_t id : densifier.images()) densifier.add(keyframe_of(mission, id));
    densifier.flush();
    CHECK(planes.size() >= ids.size());  // with a single pass, keyframes whose planes are warped are finished as well
    for (const auto& [id, map] : planes) CHECK(same_planes(map, whole.planes.at(id)));
    for (const std::int64_t id : ids) CHECK(planes.count(id) == 1);
  }
}

TEST_CASE("planes are kept or refined or computed again for any passes and task order", "[densifier][reuse]") {
  for (const SmallMission& mission : small_missions()) {
    const int passes = mission.options.advanced.patchmatch.geometric_passes;
    if (passes < 2) continue;
    INFO(mission.name);
    const Plan plan = plan_of(mission);
    const Ids all = with_depth_map(plan);
    const Outcome whole = run_with(mission, plan, all, {});
    const PlaneReuse kinds[] = {
        kKept, kRefined, kMoved, {PlaneReuse::Planes::kNone, 1, false}, {PlaneReuse::Planes::kNone, passes, false}};
    Ways ways;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (i % 6 == 5) continue;  // from the beginning, in all passes
      ways[all[i]] = kinds[i % 6];
      kept += i % 6 == 0;
    }
    const Outcome next = run_with(mission, plan, all, reuses_of(ways, whole.planes));
    CHECK(next.planes.size() == all.size() - kept);
    CHECK(next.results.clouds.size() == all.size());
    for (std::uint32_t seed = 0; seed < (kSanitized ? 1 : 4); ++seed) {
      std::mt19937 random(seed);
      Recording recording;
      PlannedCallbacks callbacks = recording.callbacks();
      callbacks.raw_depth = nullptr;
      Pipeline pipeline(mission.options, PlanPart(plan, all, mission.options, Wanted::kPoints, ways), callbacks,
                        [&](std::int64_t id) { return whole.planes.at(id); });
      pipeline.choose = [&](const std::vector<Task>& tasks) {
        return tasks.empty() ? std::nullopt : std::optional<Task>(tasks[random() % tasks.size()]);
      };
      for (const Keyframe& keyframe : mission.keyframes) pipeline.add(keyframe);
      pipeline.flush();
      CHECK(difference(by_id(recording), next.results) == "");
    }
    // A run with reused planes may also be interrupted.
    Ways resumed = ways;
    std::mt19937 random(5);
    Ids missing;
    ResultsById expected = next.results;
    for (const std::int64_t id : all) {
      const auto way = ways.find(id);
      const bool anew = way == ways.end() || way->second.planes == PlaneReuse::Planes::kNone;
      if (anew && random() % 3 != 0) {
        resumed[id] = {PlaneReuse::Planes::kResult, way == ways.end() ? passes + 1 : way->second.passes, false};
      }
      if (random() % 2 == 0) missing.push_back(id);
      if (missing.empty() || missing.back() != id) {
        expected.clouds.erase(id);
        expected.filtered.erase(id);
      }
    }
    Maps planes = whole.planes;
    for (const auto& [id, way] : resumed) {
      if (way.planes == PlaneReuse::Planes::kResult) planes.at(id) = next.planes.at(id);
    }
    CHECK(difference(run_with(mission, plan, missing, reuses_of(resumed, planes)).results, expected) == "");
  }
}

TEST_CASE("inconsistent reuse of planes is refused", "[densifier][reuse]") {
  const SmallMission mission{"", small_preset(Quality::kOnline), small_flight(10)};
  const Plan plan = plan_of(mission);
  const Ids all = with_depth_map(plan);
  const int passes = mission.options.advanced.patchmatch.geometric_passes;
  const auto load = [](std::int64_t id) {
    PlaneMap map(8, 4);
    map.keyframe_id = id;
    return map;
  };
  const auto refused = [&](std::int64_t id, const PlaneReuse& reuse) {
    CHECK_THROWS_AS(PlannedDensifier(mission.options, plan, all, {}, PlaneReuses{{{id, reuse}}, load}), InvalidInput);
  };
  refused(9999, kKept);
  refused(all[0], {PlaneReuse::Planes::kStart, passes + 1, false});
  refused(all[0], {PlaneReuse::Planes::kStart, -1, false});
  refused(all[0], {PlaneReuse::Planes::kNone, 0, false});
  refused(all[0], {PlaneReuse::Planes::kNone, passes + 2, false});
  refused(all[0], {PlaneReuse::Planes::kResult, 0, false});
  CHECK_THROWS_WITH(PlannedDensifier(mission.options, plan, all, {}, PlaneReuses{{{all[0], kKept}}, nullptr}),
                    Contains("no function to load planes"));
  CHECK_THROWS_WITH(run_with(mission, plan, all, {{{all[1], kKept}}, load}),
                    Contains("keyframe " + std::to_string(all[1]) + " are 8 x 4") && Contains("expected 32 x 16"));
}
