// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <functional>
#include <map>
#include <set>

#include "plan/missions.h"
#include "plan/planner.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

using Keyframes = std::vector<PlanKeyframe>;

/// Changes one keyframe of a mission, or takes it out.
struct Change {
  const char* name;
  std::function<void(Keyframes&, std::size_t)> apply;
};

const std::vector<Change>& changes() {
  static const std::vector<Change> kChanges{
      {"moved",
       [](Keyframes& all, std::size_t i) { all[i].cam_from_world.translation += Eigen::Vector3d(0.3, 0.1, 0); }},
      {"far off", [](Keyframes& all, std::size_t i) { all[i].cam_from_world.translation.x() += 500.0; }},
      {"blurred", [](Keyframes& all, std::size_t i) { all[i].sharpness = sharpness(all[i], 0.1F); }},
      {"blind", [](Keyframes& all, std::size_t i) { all[i].landmarks.clear(); }},
      {"removed", [](Keyframes& all, std::size_t i) { all.erase(all.begin() + static_cast<std::ptrdiff_t>(i)); }},
  };
  return kChanges;
}

/// Index of each keyframe among the used keyframes of a plan, also of unused ones.
std::map<std::int64_t, int> places(const Plan& plan) {
  std::map<std::int64_t, int> result;
  int place = 0;
  for (const PlanEntry& entry : plan.entries) {
    result[entry.id] = place;
    if (entry.used()) ++place;
  }
  return result;
}

/// How far a keyframe is from the nearest of some others, in used keyframes.
int away(const std::map<std::int64_t, int>& places, std::int64_t id, const std::set<std::int64_t>& others) {
  int least = 1 << 30;
  for (const std::int64_t other : others) {
    const auto found = places.find(other);
    if (found != places.end()) least = std::min(least, std::abs(found->second - places.at(id)));
  }
  return least;
}

double p90_reach(const PlanKeyframe& keyframe) {
  std::vector<double> ranges;
  for (const Landmark& landmark : keyframe.landmarks) {
    ranges.push_back((landmark.position_world - keyframe.cam_from_world.center()).norm());
  }
  std::sort(ranges.begin(), ranges.end());
  return ranges.empty() ? 0.0 : 2.0 * ranges[ranges.size() * 9 / 10];
}

std::map<std::int64_t, const PlanKeyframe*> by_id(const Keyframes& keyframes) {
  std::map<std::int64_t, const PlanKeyframe*> result;
  for (const PlanKeyframe& keyframe : keyframes) result[keyframe.id] = &keyframe;
  return result;
}

}  // namespace

TEST_CASE("changing one keyframe of a flight changes entries near it only", "[plan][locality]") {
  int reached = 0;
  for (std::uint32_t seed = 0; seed < 4; ++seed) {
    MissionRecipe recipe;
    recipe.seed = seed;
    recipe.keyframes = 300;
    recipe.step = seed % 2 == 0 ? 0.35 : 0.12;  // the view filter has something to do
    Keyframes keyframes = seed % 4 < 2 ? walk(recipe) : corridor(recipe, 4);
    for (PlanKeyframe& keyframe : keyframes) keyframe.sharpness = sharpness(keyframe, 1.0F);
    DensifierOptions options = preset(seed % 3 == 0 ? Quality::kOnline : Quality::kNormal);
    options.advanced.free_space.history = 30;
    const Plan plan = make_plan(keyframes, options);
    const auto places_before = places(plan);
    Planner planner(options);
    const int reach = static_cast<int>(plan_reach(options).near);
    const int window = std::max(options.advanced.consistency.window, options.advanced.fusion.window) / 2;
    for (const Change& change : changes()) {
      for (const std::size_t at : {5, 61, 222, 299}) {
        Keyframes changed = keyframes;
        change.apply(changed, at);
        const std::int64_t id = keyframes[at].id;
        const std::int64_t block = floor_div(id, kViewBlock);
        const Plan after = make_plan(changed, options);
        const auto places_after = places(after);
        std::map<std::int64_t, const PlanEntry*> old;
        for (const PlanEntry& entry : plan.entries) old[entry.id] = &entry;
        const auto old_keyframes = by_id(keyframes);
        const auto new_keyframes = by_id(changed);

        std::set<std::int64_t> sources{id};  // where the view filter decides otherwise, and the keyframe itself
        std::set<std::int64_t> next_block;
        for (const PlanEntry& entry : after.entries) {
          if (entry.used() == old[entry.id]->used()) continue;
          sources.insert(entry.id);
          const std::int64_t own = floor_div(entry.id, kViewBlock);
          INFO(change.name << " " << id << ": " << entry.id);
          CHECK((own == block || own == block + 1));
          if (own == block + 1) next_block.insert(entry.id);
        }
        CHECK(next_block.size() <= 1);

        for (const PlanEntry& entry : after.entries) {
          const PlanEntry& before = *old[entry.id];
          if (entry == before) continue;
          INFO(change.name << " " << id << ": " << difference({{before}}, {{entry}}));
          const int far = std::min(away(places_before, entry.id, sources), away(places_after, entry.id, sources));
          reached = std::max(reached, far);
          if (entry.near != before.near || entry.first_planes != before.first_planes) CHECK(far <= reach + 1);
          if (entry.fusion != before.fusion || entry.consistency != before.consistency)
            CHECK(far <= reach + window + 1);
          if (entry.range.min != before.range.min || entry.range.max != before.range.max) {
            CHECK(sources.count(entry.id) == 1);
          }
          if (entry.viewers == before.viewers || far <= reach + window + 1) continue;
          CHECK(far <= options.advanced.free_space.history / 2 + reach + 1);
          if (sources.size() > 1) continue;
          // A list of viewers changes where the keyframe is within reach, or moves the end of the horizon.
          const auto within = [&](const std::map<std::int64_t, const PlanKeyframe*>& all) {
            if (all.count(id) == 0) return false;
            const PlanKeyframe& own = *all.at(entry.id);
            return (all.at(id)->cam_from_world.center() - own.cam_from_world.center()).norm() <= p90_reach(own);
          };
          const bool shifted = places_before.at(entry.id) - places_before.at(id) !=
                                   places_after.at(entry.id) - (places_after.count(id) ? places_after.at(id) : 0) ||
                               change.name == std::string("removed");
          CHECK((within(old_keyframes) || within(new_keyframes) || shifted));
        }
      }
    }
  }
  CHECK(reached > 3);  // otherwise the test would be weak
}

TEST_CASE("changing one keyframe of a set changes entries near it or sharing landmarks", "[plan][locality]") {
  for (std::uint32_t seed = 0; seed < 3; ++seed) {
    MissionRecipe recipe;
    recipe.seed = seed;
    recipe.keyframes = 200;
    recipe.sight = 4.0;
    Keyframes keyframes = photos(recipe);
    for (PlanKeyframe& keyframe : keyframes) keyframe.sharpness = sharpness(keyframe, 1.0F);
    DensifierOptions options = preset(Quality::kNormal);
    options.unordered = true;
    const Plan plan = make_plan(keyframes, options);
    std::map<std::int64_t, std::set<std::int64_t>> seen;  // landmarks of each keyframe
    for (const PlanKeyframe& keyframe : keyframes) {
      for (const Landmark& landmark : keyframe.landmarks) seen[keyframe.id].insert(landmark.id);
    }
    const auto share = [&](std::int64_t a, std::int64_t b) {
      return std::any_of(seen[a].begin(), seen[a].end(), [&](std::int64_t l) { return seen[b].count(l) != 0; });
    };
    const auto of_id = by_id(keyframes);
    int untouched = 0;
    for (const Change& change : changes()) {
      const std::size_t at = 47 * seed + 20;
      Keyframes changed = keyframes;
      change.apply(changed, at);
      const std::int64_t id = keyframes[at].id;
      const auto new_id = by_id(changed);
      const Plan after = make_plan(changed, options);
      std::map<std::int64_t, const PlanEntry*> old;
      for (const PlanEntry& entry : plan.entries) old[entry.id] = &entry;
      std::set<std::int64_t> sources{id};
      for (const PlanEntry& entry : after.entries) {
        if (entry.has_depth_map() != old[entry.id]->has_depth_map()) sources.insert(entry.id);
      }
      for (const PlanEntry& entry : after.entries) {
        const PlanEntry& before = *old[entry.id];
        if (entry == before) {
          ++untouched;
          continue;
        }
        INFO(change.name << " " << id << ": " << difference({{before}}, {{entry}}));
        const PlanKeyframe& own = *new_id.at(entry.id);
        const bool related = std::any_of(sources.begin(), sources.end(), [&](std::int64_t source) {
          const auto near = [&](const std::map<std::int64_t, const PlanKeyframe*>& all) {
            return all.count(source) != 0 &&
                   (all.at(source)->cam_from_world.center() - own.cam_from_world.center()).norm() <= p90_reach(own);
          };
          return source == entry.id || share(entry.id, source) || near(of_id) || near(new_id);
        });
        CHECK(related);
      }
    }
    CHECK(untouched > 300);
  }
}
