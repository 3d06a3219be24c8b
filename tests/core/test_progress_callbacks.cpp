// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>

#include "core/small_missions.h"
#include "plan/missions.h"
#include "planned_densifier.h"

using namespace pmsp;
using namespace pmsp::test;

TEST_CASE("a Densifier reports the plan that it makes entry by entry", "[densifier]") {
  for (const SmallMission& mission : small_missions()) {
    INFO(mission.name);
    Plan told;
    PlannedCallbacks callbacks;
    callbacks.cloud = [](const KeyframeCloud&) {};
    callbacks.planned = [&](const PlanEntry& entry) { told.entries.push_back(entry); };
    PlannedDensifier densifier(mission.options, callbacks);
    fly_through(densifier, mission);
    CHECK(told == plan_of(mission));
  }
}

TEST_CASE("finished and remaining work give the progress of a mission", "[densifier]") {
  const SmallMission mission = small_missions().front();
  PlannedCallbacks callbacks;
  callbacks.cloud = [](const KeyframeCloud&) {};
  const Densifier* worker = nullptr;
  double before = 0.0;
  std::size_t calls = 0;
  bool is_ordered = true;
  callbacks.progress = [&] {
    const DensifierStats& stats = worker->stats();
    is_ordered = is_ordered && stats.work_done >= before && stats.work_remaining >= -1e-9;
    before = stats.work_done;
    ++calls;
  };
  PlannedDensifier densifier(mission.options, callbacks);
  worker = &densifier;
  fly_through(densifier, mission);
  CHECK(is_ordered);
  CHECK(calls >= static_cast<std::size_t>(densifier.stats().depth_maps) * 3);
  CHECK(densifier.stats().work_remaining == 0.0);
  // Each keyframe that was taken is matched once at least.
  CHECK(densifier.stats().work_done >= static_cast<double>(densifier.stats().keyframes_accepted));
}

TEST_CASE("the work of a part of a plan is that of the part", "[densifier]") {
  const SmallMission mission = small_missions().front();
  const Plan plan = plan_of(mission);
  std::vector<std::int64_t> one;
  for (const PlanEntry& entry : plan.entries) {
    if (entry.has_depth_map() && one.empty()) one.push_back(entry.id);
  }
  REQUIRE(one.size() == 1);
  const auto work = [&](const std::vector<std::int64_t>& ids) {
    PlannedCallbacks callbacks;
    callbacks.planes = [](const PlaneMap&) {};
    PlannedDensifier densifier(mission.options, plan, ids, callbacks);
    for (const std::int64_t id : densifier.images()) densifier.add(keyframe_of(mission, id));
    densifier.flush();
    return densifier.stats().work_done;
  };
  std::vector<std::int64_t> all;
  for (const PlanEntry& entry : plan.entries) {
    if (entry.has_depth_map()) all.push_back(entry.id);
  }
  CHECK(work({}) == 0.0);
  CHECK(work(one) > 0.0);
  CHECK(work(one) < work(all));
}
