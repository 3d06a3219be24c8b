// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <map>
#include <set>

#include "plan/missions.h"
#include "plan/planner.h"
#include "pmsp/error.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

/// Of a preset, with horizons that are short for tests.
DensifierOptions short_options(Quality quality) {
  DensifierOptions options = preset(quality);
  options.advanced.free_space.history = 40;
  options.advanced.free_space.views = 8;
  return options;
}

std::vector<PlanKeyframe> mission_of(std::uint32_t seed, int keyframes = 150) {
  MissionRecipe recipe;
  recipe.seed = seed;
  recipe.keyframes = keyframes;
  recipe.first_id = static_cast<std::int64_t>(seed % 5) * 37 - 60;  // some are negative
  if (seed % 3 == 0) return corridor(recipe, 3);
  return seed % 3 == 1 ? walk(recipe) : loop(recipe);
}

std::vector<std::int64_t> used_ids(const Plan& plan) {
  std::vector<std::int64_t> result;
  for (const PlanEntry& entry : plan.entries) {
    if (entry.used()) result.push_back(entry.id);
  }
  return result;
}

/// Invariants of every plan of a flight.
void check_valid(const Plan& plan, const DensifierOptions& options) {
  std::map<std::int64_t, const PlanEntry*> by_id;
  std::map<std::int64_t, std::ptrdiff_t> place;  // among the used ones
  for (const PlanEntry& entry : plan.entries) {
    by_id[entry.id] = &entry;
    if (entry.used()) place.emplace(entry.id, static_cast<std::ptrdiff_t>(place.size()));
  }
  REQUIRE(by_id.size() == plan.entries.size());
  for (const PlanEntry& entry : plan.entries) {
    INFO("keyframe " << entry.id);
    const auto check = [&](const std::vector<std::int64_t>& ids, int most, bool with_maps) {
      CHECK(static_cast<int>(ids.size()) <= most);
      CHECK(std::set<std::int64_t>(ids.begin(), ids.end()).size() == ids.size());
      for (const std::int64_t id : ids) {
        CHECK(id != entry.id);
        REQUIRE(by_id.count(id) == 1);
        CHECK(by_id[id]->used());
        if (with_maps) CHECK(by_id[id]->has_depth_map());
      }
    };
    check(entry.near, options.advanced.patchmatch.neighbours, false);
    check(entry.consistency, options.advanced.consistency.window - 1, true);
    check(entry.fusion, options.advanced.fusion.window - 1, true);
    check(entry.viewers, options.advanced.free_space.views + options.advanced.fusion.window - 1, true);
    if (entry.has_depth_map()) {
      const auto window = [&](int size) {
        std::vector<std::int64_t> ids;
        for (const PlanEntry& other : plan.entries) {
          const bool is_near = other.has_depth_map() && std::abs(place[other.id] - place[entry.id]) <= size / 2;
          if (is_near && other.id != entry.id) ids.push_back(other.id);
        }
        return ids;
      };
      CHECK(entry.consistency == window(options.advanced.consistency.window));
      CHECK(entry.fusion == window(options.advanced.fusion.window));
    }
    for (const std::int64_t id : entry.fusion) {
      CHECK(std::count(entry.viewers.begin(), entry.viewers.end(), id) == 1);
    }
    for (const std::int64_t id : entry.viewers) {
      const std::ptrdiff_t away = place[id] - place[entry.id];
      const int ahead = options.advanced.free_space.whole_mission ? options.advanced.free_space.history / 2
                                                                  : options.advanced.fusion.window / 2;
      CHECK(away <= ahead);
      CHECK(-away <= std::max(options.advanced.free_space.history / 2, options.advanced.fusion.window / 2));
    }
    for (const std::int64_t id : entry.duplicate_views) {
      const bool whole = options.advanced.free_space.whole_mission;
      const int reach = whole ? std::max(options.advanced.fusion.history, options.advanced.fusion.window) / 2
                              : options.advanced.fusion.window / 2;
      CHECK(std::abs(place[id] - place[entry.id]) <= reach);
      CHECK(by_id[id]->has_depth_map());
    }
    CHECK(entry.duplicate_views.size() <= 32);
    if (!entry.used()) {
      CHECK((entry.near.empty() && entry.viewers.empty() && !entry.first_planes));
    }
    CHECK(entry.has_depth_map() == (entry.used() && !entry.near.empty() && entry.range.max > entry.range.min));
  }
}

}  // namespace

TEST_CASE("a plan is the same for the same input and refers to existing keyframes only", "[plan]") {
  for (std::uint32_t seed = 0; seed < 12; ++seed) {
    const auto keyframes = mission_of(seed);
    for (const Quality quality : {Quality::kPaper, Quality::kOnline, Quality::kNormal, Quality::kHigh}) {
      const DensifierOptions options = short_options(quality);
      const Plan plan = make_plan(keyframes, options);
      check_valid(plan, options);
      CHECK(plan == make_plan(keyframes, options));
      REQUIRE(plan.entries.size() == keyframes.size());
      for (std::size_t i = 0; i < keyframes.size(); ++i) CHECK(plan.entries[i].id == keyframes[i].id);
      CHECK(used_ids(plan).size() > keyframes.size() / 3);
    }
  }
}

TEST_CASE("a plan made incrementally is that of all keyframes at every prefix", "[plan]") {
  for (std::uint32_t seed = 0; seed < 6; ++seed) {
    const auto keyframes = mission_of(seed, 90);
    for (const Quality quality : {Quality::kOnline, Quality::kNormal}) {
      const DensifierOptions options = short_options(quality);
      const Plan whole = make_plan(keyframes, options);
      Planner planner(options);
      std::vector<PlanKeyframe> prefix;
      for (std::size_t n = 0; n < keyframes.size(); ++n) {
        CHECK(planner.add(keyframes[n]) == whole.entries[n].used());
        for (std::size_t i = 0; i < planner.complete(); ++i) CHECK(planner.entries()[i] == whole.entries[i]);
        for (std::size_t i = 0; i < planner.matchable(); ++i) {
          CHECK(planner.entries()[i].near == whole.entries[i].near);
          CHECK(planner.entries()[i].first_planes == whole.entries[i].first_planes);
          CHECK(planner.entries()[i].use == whole.entries[i].use);
        }
        prefix.push_back(keyframes[n]);
        if (n % 7 != 0) continue;
        Planner ended = planner;
        ended.finish();
        const Plan plan{{ended.entries().begin(), ended.entries().end()}};
        INFO(difference(plan, make_plan(prefix, options)));
        CHECK(plan == make_plan(prefix, options));
      }
    }
  }
}

TEST_CASE("entries are complete after a documented number of used keyframes", "[plan]") {
  for (const Quality quality : {Quality::kOnline, Quality::kNormal}) {
    const DensifierOptions options = short_options(quality);
    const auto keyframes = mission_of(4);
    const Plan whole = make_plan(keyframes, options);
    Planner planner(options);
    const PlanReach reach = plan_reach(options);
    const std::int64_t delay = reach.near + std::max(reach.windows, reach.viewers_after);
    CHECK(reach.near == (quality == Quality::kOnline ? 2 : 3));
    CHECK(delay == (quality == Quality::kOnline ? 4 : 23));
    std::size_t dropped = 0;
    std::int64_t used = 0;
    for (const PlanKeyframe& keyframe : keyframes) {
      if (planner.add(keyframe)) ++used;
      std::int64_t before = 0;
      for (const PlanEntry& entry : whole.entries) {
        if (!entry.used() || ++before <= used - delay) continue;
        const std::size_t i = static_cast<std::size_t>(&entry - whole.entries.data());
        CHECK(dropped + planner.complete() >= std::min(i, dropped + planner.entries().size()));
        break;
      }
      for (std::size_t i = 0; i < planner.complete(); ++i) CHECK(planner.entries()[i] == whole.entries[dropped + i]);
      dropped += planner.complete();
      planner.drop(planner.complete());
      CHECK(planner.entries().size() <= 200);
    }
    planner.finish();
    CHECK(planner.complete() == planner.entries().size());
    CHECK(dropped + planner.entries().size() == keyframes.size());
  }
}

TEST_CASE("after the end of a sequence a new one begins", "[plan]") {
  const DensifierOptions options = short_options(Quality::kNormal);
  const auto first = mission_of(1, 40);
  auto second = mission_of(2, 40);
  for (PlanKeyframe& keyframe : second) keyframe.id += 1000;
  Planner planner(options);
  for (const PlanKeyframe& keyframe : first) planner.add(keyframe);
  planner.finish();
  for (const PlanKeyframe& keyframe : second) planner.add(keyframe);
  planner.finish();
  Plan both = make_plan(first, options);
  for (PlanEntry& entry : make_plan(second, options).entries) both.entries.push_back(std::move(entry));
  CHECK(Plan{{planner.entries().begin(), planner.entries().end()}} == both);
}

TEST_CASE("the chain of first planes restarts where the block of ids changes", "[plan]") {
  for (std::uint32_t seed = 0; seed < 6; ++seed) {
    const auto keyframes = mission_of(seed);
    DensifierOptions options = short_options(Quality::kOnline);
    const auto block = [&](std::int64_t id) { return floor_div(id, options.advanced.init.chain_keyframes); };
    const PlanEntry* last = nullptr;
    int links = 0;
    const Plan plan = make_plan(keyframes, options);
    for (const PlanEntry& entry : plan.entries) {
      if (!entry.used()) continue;
      const bool linked =
          last != nullptr && last->has_depth_map() && entry.has_depth_map() && block(last->id) == block(entry.id);
      CHECK(entry.first_planes.has_value() == linked);
      if (linked) CHECK(*entry.first_planes == last->id);
      links += linked ? 1 : 0;
      last = &entry;
    }
    CHECK(links > 50);
    options.advanced.init.warp_previous = false;
    for (const PlanEntry& entry : make_plan(keyframes, options).entries) CHECK_FALSE(entry.first_planes);
    options.advanced.init.warp_previous = true;
    options.advanced.init.chain_keyframes = 0;
    int unlinked = 0;
    for (const PlanEntry& entry : make_plan(keyframes, options).entries) {
      if (entry.has_depth_map() && !entry.first_planes) ++unlinked;
    }
    CHECK(unlinked < 3);
  }
  CHECK(floor_div(-1, 16) == -1);
  CHECK(floor_div(-16, 16) == -1);
  CHECK(floor_div(-17, 16) == -2);
  CHECK(floor_div(15, 16) == 0);
}

TEST_CASE("small pose changes flip no decision where the previous plan is given", "[plan]") {
  int flipped_without = 0;
  for (std::uint32_t seed = 0; seed < 12; ++seed) {
    for (const Quality quality : {Quality::kOnline, Quality::kNormal}) {
      const DensifierOptions options = short_options(quality);
      auto keyframes = mission_of(seed);
      const Plan plan = make_plan(keyframes, options);
      CHECK(make_plan(keyframes, options, &plan) == plan);
      keyframes = jittered(std::move(keyframes), 0.004, seed + 100);
      const Plan kept = make_plan(keyframes, options, &plan);
      INFO(difference(plan, kept));
      CHECK(kept == plan);
      Plan fresh = make_plan(keyframes, options);
      for (std::size_t i = 0; i < fresh.entries.size(); ++i) fresh.entries[i].range = plan.entries[i].range;
      if (!(fresh == plan)) ++flipped_without;
    }
  }
  CHECK(flipped_without > 12);
}

TEST_CASE("a previous plan does not keep invalid decisions", "[plan]") {
  for (std::uint32_t seed = 0; seed < 6; ++seed) {
    const DensifierOptions options = short_options(Quality::kNormal);
    const auto keyframes = mission_of(seed);
    const Plan other = make_plan(mission_of(seed + 1), options);
    const Plan plan = make_plan(keyframes, options, &other);
    check_valid(plan, options);
    const std::vector<PlanKeyframe> half(keyframes.begin(), keyframes.begin() + 75);
    const Plan before = make_plan(half, options);
    const Plan grown = make_plan(keyframes, options, &before);
    const Plan fresh = make_plan(keyframes, options);
    check_valid(grown, options);
    // Keyframes after the end of the previous plan affect the entries near that end.
    for (std::size_t i = 0; i < keyframes.size(); ++i) {
      CHECK(grown.entries[i].fusion == fresh.entries[i].fusion);
      CHECK(grown.entries[i].near.size() == fresh.entries[i].near.size());
    }
  }
}

TEST_CASE("the view filter of a plan decides like that of a stream within a block", "[plan]") {
  for (std::uint32_t seed = 0; seed < 6; ++seed) {
    MissionRecipe recipe;
    recipe.seed = seed;
    recipe.keyframes = 50;
    recipe.skipped_ids = 0.0;
    recipe.step = 0.2;
    const auto keyframes = walk(recipe);
    const DensifierOptions options = preset(Quality::kOnline);
    ViewFilter filter(options.advanced.view_filter);
    const Plan plan = make_plan(keyframes, options);
    for (std::size_t i = 0; i < keyframes.size(); ++i) {
      Keyframe keyframe;
      keyframe.cam_from_world = keyframes[i].cam_from_world;
      keyframe.landmarks = keyframes[i].landmarks;
      CHECK(filter.accept(keyframe) == plan.entries[i].used());
    }
  }
}

TEST_CASE("unused keyframes have a reason", "[plan]") {
  MissionRecipe recipe;
  recipe.keyframes = 30;
  recipe.skipped_ids = 0.0;
  auto keyframes = corridor(recipe);
  for (PlanKeyframe& keyframe : keyframes) keyframe.sharpness = sharpness(keyframe, 1.0F);
  const DensifierOptions options = preset(Quality::kOnline);
  REQUIRE(used_ids(make_plan(keyframes, options)).size() == keyframes.size());
  keyframes[10].sharpness = sharpness(keyframes[10], 0.2F);
  keyframes[15].cam_from_world = keyframes[14].cam_from_world;
  keyframes[20].landmarks.clear();
  const Plan plan = make_plan(keyframes, options);
  CHECK(plan.entries[10].use == KeyframeUse::kBlurred);
  CHECK(plan.entries[15].use == KeyframeUse::kTooLittleParallax);
  CHECK(plan.entries[20].use == KeyframeUse::kNoLandmarks);
  CHECK(used_ids(plan).size() == keyframes.size() - 3);
  for (const PlanEntry& entry : plan.entries) CHECK(keyframe_use_from_name(name_of(entry.use)) == entry.use);
  CHECK_THROWS_AS(keyframe_use_from_name("useless"), InvalidInput);
}

TEST_CASE("hovering costs one keyframe a block and no more", "[plan]") {
  MissionRecipe recipe;
  recipe.keyframes = 300;
  recipe.skipped_ids = 0.0;
  recipe.step = 0.0;
  const Plan plan = make_plan(corridor(recipe), preset(Quality::kOnline));
  CHECK(used_ids(plan) == std::vector<std::int64_t>{0, 64, 128, 192, 256});
}

TEST_CASE("hovering after a flight costs one keyframe a block, too", "[plan]") {
  MissionRecipe recipe;
  recipe.keyframes = 300;
  recipe.skipped_ids = 0.0;
  std::vector<PlanKeyframe> keyframes = corridor(recipe);
  for (std::size_t i = 64; i < keyframes.size(); ++i) {
    keyframes[i].cam_from_world = keyframes[63].cam_from_world;
    keyframes[i].landmarks = keyframes[63].landmarks;
  }
  const std::vector<std::int64_t> used = used_ids(make_plan(keyframes, preset(Quality::kOnline)));
  REQUIRE(used.size() > 23);
  CHECK(std::vector<std::int64_t>(used.end() - 3, used.end()) == std::vector<std::int64_t>{128, 192, 256});
  CHECK(used[used.size() - 4] < 64);  // the last place of the flight is known
}

TEST_CASE("plans of no keyframes and of one keyframe and of keyframes without landmarks", "[plan]") {
  MissionRecipe recipe;
  recipe.keyframes = 20;
  for (const bool unordered : {false, true}) {
    DensifierOptions options = short_options(Quality::kNormal);
    options.unordered = unordered;
    CHECK(make_plan({}, options).entries.empty());
    auto keyframes = corridor(recipe);
    const Plan one = make_plan({keyframes[0]}, options);
    REQUIRE(one.entries.size() == 1);
    CHECK(one.entries[0].use == KeyframeUse::kNoNeighbour);
    for (PlanKeyframe& keyframe : keyframes) keyframe.landmarks.clear();
    for (const PlanEntry& entry : make_plan(keyframes, options).entries) CHECK_FALSE(entry.has_depth_map());
    auto twice = corridor(recipe);
    twice[3].id = twice[7].id;
    CHECK_THROWS_AS(make_plan(twice, options), InvalidInput);
    options.advanced.patchmatch.neighbours = 0;
    CHECK_THROWS_AS(make_plan({}, options), InvalidOption);
  }
}
