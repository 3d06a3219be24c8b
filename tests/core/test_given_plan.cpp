// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "core/small_missions.h"
#include "plan/halo.h"
#include "planned_densifier.h"
#include "pmsp/error.h"

using namespace pmsp;
using namespace pmsp::test;
using Catch::Contains;

namespace {

using Ids = std::vector<std::int64_t>;

SmallMission flight(Quality quality = Quality::kOnline) { return {"", small_preset(quality), small_flight(16)}; }

/// All statistics except times.
std::vector<std::int64_t> counts(const DensifierStats& stats) {
  return {stats.keyframes_added,
          stats.keyframes_accepted,
          stats.keyframes_rejected,
          stats.keyframes_blurred,
          stats.depth_maps,
          stats.keyframes_without_neighbour,
          stats.keyframes_without_range,
          stats.pixels,
          stats.pixels_matched,
          stats.pixels_after_median,
          stats.pixels_after_consistency,
          stats.points_fused,
          stats.points_repeated,
          stats.points};
}

/// Recording and statistics must be those of a Densifier that makes its own plan.
void check_whole(const SmallMission& mission) {
  Recording streamed;
  Densifier densifier(mission.options, streamed.callbacks());
  fly_through(densifier, mission);
  Recording given;
  PlannedDensifier other(mission.options, plan_of(mission), ids_of(mission.keyframes), given.callbacks());
  fly_through(other, mission);
  CHECK(difference(streamed, given).empty());
  CHECK(counts(densifier.stats()) == counts(other.stats()));
}

struct Mistake {
  const char* name;
  std::function<void(Plan&, std::size_t)>
      make;  ///< in the entry with this index, which has a depth map and others around
  const char* complaint;
};

const std::vector<Mistake>& mistakes() {
  static const std::vector<Mistake> kMistakes = {
      {"an id twice", [](Plan& p, std::size_t i) { p.entries[i].id = p.entries[i + 1].id; }, "more than once"},
      {"a neighbour that is not there", [](Plan& p, std::size_t i) { p.entries[i].near[0] = 9999; }, "9999"},
      {"itself", [](Plan& p, std::size_t i) { p.entries[i].viewers[0] = p.entries[i].id; }, "itself"},
      {"a viewer twice", [](Plan& p, std::size_t i) { p.entries[i].viewers[0] = p.entries[i].viewers[1]; }, "twice"},
      {"no neighbours", [](Plan& p, std::size_t i) { p.entries[i].near.clear(); }, "near"},
      {"too many neighbours", [](Plan& p, std::size_t i) { p.entries[i].near.resize(9, p.entries[i + 1].id); },
       "at most"},
      {"too many viewers", [](Plan& p, std::size_t i) { p.entries[i].viewers.resize(33, 9999); }, "viewers"},
      {"too many duplicate views", [](Plan& p, std::size_t i) { p.entries[i].duplicate_views.resize(33, 9999); },
       "duplicate_views"},
      {"too wide a window", [](Plan& p, std::size_t i) { p.entries[i].consistency.resize(31, 9999); }, "consistency"},
      {"a keyframe too far away", [](Plan& p, std::size_t i) { p.entries[i].fusion[0] = p.entries.back().id; },
       "used keyframes after it"},
      {"first planes of the next one", [](Plan& p, std::size_t i) { p.entries[i].first_planes = p.entries[i + 1].id; },
       "first_planes"},
      {"one that gets no depth map", [](Plan& p, std::size_t i) { p.entries[i + 1].use = KeyframeUse::kNoRange; },
       "no depth map"},
      {"one that is not used", [](Plan& p, std::size_t i) { p.entries[i + 1].use = KeyframeUse::kBlurred; }, ""},
      {"no range", [](Plan& p, std::size_t i) { p.entries[i].range = {}; }, "range is 0 to 0"},
      {"a range that is no number",
       [](Plan& p, std::size_t i) { p.entries[i].range.max = std::numeric_limits<double>::quiet_NaN(); }, "range"},
  };
  return kMistakes;
}

/// An entry with a depth map, between others.
std::size_t middle(const Plan& plan) {
  for (std::size_t i = 5; i + 5 < plan.entries.size(); ++i) {
    if (plan.entries[i].has_depth_map() && plan.entries[i + 1].has_depth_map()) return i;
  }
  return 0;
}

}  // namespace

TEST_CASE("a mission with its own plan given has the same results and statistics", "[densifier][plan]") {
  for (const SmallMission& mission : small_missions()) {
    INFO(mission.name);
    check_whole(mission);
  }
}

TEST_CASE("a plan of the paper preset runs as a whole and its parts are refused", "[densifier][plan]") {
  SmallMission mission = flight();
  const DensifierOptions small = mission.options;
  mission.options = preset(Quality::kPaper);
  mission.options.width = small.width;
  mission.options.height = small.height;
  mission.options.advanced.patchmatch.iterations = 1;
  check_whole(mission);
  const Plan plan = plan_of(mission);
  CHECK_THROWS_AS(PlannedDensifier(mission.options, plan, {mission.keyframes[3].id}, {}), InvalidOption);
}

TEST_CASE("an inconsistent plan is refused by keyframe and list", "[densifier][plan]") {
  SmallMission mission = flight(Quality::kNormal);
  const Plan plan = plan_of(mission);
  const std::size_t at = middle(plan);
  REQUIRE(at > 0);
  REQUIRE(plan.entries[at].viewers.size() > 1);
  const Ids ids = {plan.entries[at].id};
  CHECK_NOTHROW(PlannedDensifier(mission.options, plan, ids, {}));
  for (const Mistake& mistake : mistakes()) {
    Plan broken = plan;
    mistake.make(broken, at);
    INFO(mistake.name);
    CHECK_THROWS_AS(PlannedDensifier(mission.options, broken, ids, {}), InvalidInput);
    CHECK_THROWS_WITH(PlannedDensifier(mission.options, broken, ids, {}),
                      Contains("the plan's keyframe") && Contains(mistake.complaint));
  }
  CHECK_THROWS_WITH(PlannedDensifier(mission.options, plan, {9999}, {}), Contains("9999"));
  DensifierOptions bad = mission.options;
  bad.advanced.patchmatch.iterations = 0;
  CHECK_THROWS_AS(PlannedDensifier(bad, plan, ids, {}), InvalidOption);
}

TEST_CASE("a plan made with other options is refused where it is detectable", "[densifier][plan]") {
  const SmallMission mission = flight(Quality::kNormal);
  const Plan plan = plan_of(mission);
  const Ids ids = ids_of(mission.keyframes);
  const std::function<void(DensifierOptions&)> changes[] = {
      [](DensifierOptions& o) { o.advanced.patchmatch.neighbours = 2; },
      [](DensifierOptions& o) { o.advanced.consistency.enabled = false; },
      [](DensifierOptions& o) { o.advanced.consistency.window = 3; },
      [](DensifierOptions& o) { o.advanced.fusion.window = 3; },
      [](DensifierOptions& o) { o.advanced.free_space.whole_mission = false; },
      [](DensifierOptions& o) { o.advanced.free_space.views = 1; },
      [](DensifierOptions& o) { o.advanced.init.warp_previous = false; },
  };
  int refused = 0;
  for (const auto& change : changes) {
    DensifierOptions options = mission.options;
    change(options);
    INFO(refused);
    CHECK_THROWS_WITH(PlannedDensifier(options, plan, ids, {}), Contains("was the plan made with others?"));
    ++refused;
  }
  DensifierOptions fits = mission.options;
  fits.seed = 7;
  fits.width = 64;
  fits.height = 32;
  CHECK_NOTHROW(PlannedDensifier(fits, plan, ids, {}));
}

TEST_CASE("a part of a mission uses only the keyframes it needs", "[densifier][plan]") {
  const SmallMission mission = flight();
  const Plan plan = plan_of(mission);
  const Ids ids = {plan.entries[2].id};
  const Halo needed_by = find_halo(plan, ids, mission.options, Wanted::kPoints);
  const Ids& images = needed_by.images;
  REQUIRE(images.size() < mission.keyframes.size());
  Recording recording;
  PlannedDensifier densifier(mission.options, plan, ids, recording.callbacks());
  for (Keyframe keyframe : mission.keyframes) {
    const bool needed = std::find(images.begin(), images.end(), keyframe.id) != images.end();
    if (!needed) keyframe.image = {};
    CHECK(densifier.add(keyframe) == needed);
    CHECK_THROWS_WITH(densifier.add(keyframe), Contains("was added before"));
  }
  densifier.flush();
  CHECK(recording.order == std::vector<std::pair<char, std::int64_t>>{{'r', ids[0]}, {'f', ids[0]}, {'c', ids[0]}});
  const DensifierStats& stats = densifier.stats();
  CHECK(stats.keyframes_added == static_cast<std::int64_t>(mission.keyframes.size()));
  CHECK(stats.keyframes_rejected > 0);                                                   // by the plan
  CHECK(stats.depth_maps == static_cast<std::int64_t>(needed_by.planes.back().size()));  // the halo's, no others
  CHECK(stats.depth_maps > 1);
  CHECK(stats.points == static_cast<std::int64_t>(recording.points()));
  densifier.flush();
  CHECK(recording.order.size() == 3);
}

TEST_CASE("keyframes missing or out of the plan's order are named", "[densifier][plan]") {
  const SmallMission mission = flight();
  const Plan plan = plan_of(mission);
  const Ids images = find_halo(plan, {plan.entries[2].id}, mission.options, Wanted::kPoints).images;
  const auto keyframe_of = [&](std::int64_t id) {
    return *std::find_if(mission.keyframes.begin(), mission.keyframes.end(),
                         [&](const Keyframe& keyframe) { return keyframe.id == id; });
  };
  Recording recording;
  PlannedDensifier densifier(mission.options, plan, {plan.entries[2].id}, recording.callbacks());
  Keyframe unknown = keyframe_of(images[0]);
  unknown.id = 9999;
  CHECK_THROWS_WITH(densifier.add(unknown), Contains("the plan has no keyframe 9999"));
  CHECK_THROWS_AS(densifier.add(keyframe_of(images[1])), InvalidInput);
  CHECK_THROWS_WITH(densifier.add(keyframe_of(images[1])), Contains("before keyframe " + std::to_string(images[0])));
  CHECK_THROWS_WITH(densifier.flush(), Contains("keyframe " + std::to_string(images[0])));
  for (std::size_t k = 0; k + 1 < images.size(); ++k) CHECK(densifier.add(keyframe_of(images[k])));
  CHECK_THROWS_AS(densifier.flush(), InvalidInput);
  CHECK_THROWS_WITH(densifier.flush(), Contains("keyframe " + std::to_string(images.back())));
  CHECK(densifier.add(keyframe_of(images.back())));  // as if that flush had not been called
  densifier.flush();
  CHECK(recording.clouds.size() == 1);
}

TEST_CASE("no requested keyframes give no work", "[densifier][plan]") {
  const SmallMission mission = flight();
  Recording recording;
  PlannedDensifier densifier(mission.options, plan_of(mission), {}, recording.callbacks());
  for (const Keyframe& keyframe : mission.keyframes) CHECK_FALSE(densifier.add(keyframe));
  densifier.flush();
  CHECK(recording.order.empty());
  PlannedDensifier empty(mission.options, Plan{}, {}, recording.callbacks());
  empty.flush();
  CHECK_THROWS_AS(empty.add(mission.keyframes[0]), InvalidInput);
}

TEST_CASE("a cancelled part requests no more keyframes", "[densifier][plan]") {
  const SmallMission mission = flight();
  Recording recording;
  PlannedDensifier densifier(mission.options, plan_of(mission), ids_of(mission.keyframes), recording.callbacks());
  CHECK(densifier.add(mission.keyframes[0]));
  densifier.cancel();
  CHECK_FALSE(densifier.add(mission.keyframes[5]));
  CHECK_NOTHROW(densifier.flush());
  CHECK(recording.order.empty());
}
