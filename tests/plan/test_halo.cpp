// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <set>
#include <string>

#include "plan/halo.h"
#include "plan/missions.h"
#include "planned_densifier.h"
#include "pmsp/error.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

/// Dependencies of the points of keyframes, one artefact at a time.
class Naive {
 public:
  Naive(const Plan& plan, const DensifierOptions& options)
      : passes_(options.advanced.patchmatch.geometric_passes), whole_(options.advanced.free_space.whole_mission) {
    for (const PlanEntry& entry : plan.entries) entries_[entry.id] = &entry;
  }

  void points(std::int64_t i) {
    if (!at(i).has_depth_map()) return;
    cloud(i);
    decided(i, static_cast<int>(rounds()));
  }

  void depth_maps(std::int64_t i) {
    if (at(i).has_depth_map()) filtered(i);
  }

  std::size_t rounds() const { return whole_ ? 4 : 2; }
  std::map<std::string, std::set<std::int64_t>> needed;

 private:
  const PlanEntry& at(std::int64_t i) const { return *entries_.at(i); }
  bool seen(const std::string& artefact, std::int64_t i) { return !needed[artefact].insert(i).second; }

  void image(std::int64_t i) { seen("image", i); }
  void cloud(std::int64_t i) {
    if (seen("cloud", i)) return;
    filtered(i);
    image(i);
    for (const std::int64_t k : at(i).fusion) {
      filtered(k);
      image(k);
    }
  }
  void decided(std::int64_t i, int round) {
    if (seen("round" + std::to_string(round), i)) return;
    if (round == 0) return eligible(i);
    decided(i, round - 1);
    for (const std::int64_t v : at(i).duplicate_views) decided(v, round - 1);
  }
  void eligible(std::int64_t i) {
    if (seen("eligible", i)) return;
    filtered(i);
    for (const std::int64_t k : at(i).fusion) filtered(k);
    for (const std::int64_t v : at(i).viewers) ranges(v);
  }
  void ranges(std::int64_t i) {
    if (!seen("ranges", i)) filtered(i);
  }
  void filtered(std::int64_t i) {
    if (seen("filtered", i)) return;
    planes(i, passes_);
    for (const std::int64_t k : at(i).consistency) planes(k, passes_);
  }
  void planes(std::int64_t i, int pass) {
    if (!at(i).has_depth_map() || seen("planes" + std::to_string(pass), i)) return;
    image(i);
    for (const std::int64_t k : at(i).near) image(k);
    if (pass == 0) {
      if (at(i).first_planes) planes(*at(i).first_planes, 0);
      return;
    }
    planes(i, pass - 1);
    for (const std::int64_t k : at(i).near) planes(k, pass - 1);
  }

  int passes_;
  bool whole_;
  std::map<std::int64_t, const PlanEntry*> entries_;
};

std::set<std::int64_t> set_of(const std::vector<std::int64_t>& ids) { return {ids.begin(), ids.end()}; }

/// Each set of a halo is part of the next one.
void check_nested(const Halo& found) {
  std::vector<std::vector<std::int64_t>> sets{found.clouds};
  sets.insert(sets.end(), found.rounds.rbegin(), found.rounds.rend());
  sets.push_back(found.filtered);
  sets.insert(sets.end(), found.planes.rbegin(), found.planes.rend());
  sets.push_back(found.images);
  for (std::size_t k = 1; k < sets.size(); ++k) {
    const std::set<std::int64_t> inner = set_of(sets[k - 1]);
    const std::set<std::int64_t> outer = set_of(sets[k]);
    CHECK(std::includes(outer.begin(), outer.end(), inner.begin(), inner.end()));
  }
}

}  // namespace

TEST_CASE("a halo contains exactly the keyframes that the points need", "[plan][halo]") {
  MissionRecipe recipe;
  recipe.keyframes = 160;
  for (recipe.seed = 0; recipe.seed < 6; ++recipe.seed) {
    for (const Quality quality : {Quality::kOnline, Quality::kNormal}) {
      DensifierOptions options = preset(quality);
      options.advanced.free_space.history = 40;
      options.advanced.free_space.views = 6;
      options.advanced.consistency.enabled = recipe.seed % 3 != 0;
      options.advanced.patchmatch.geometric_passes = static_cast<int>(recipe.seed % 4);
      options.unordered = recipe.seed % 2 == 1;
      const auto keyframes = options.unordered ? photos(recipe) : walk(recipe);
      const Plan plan = make_plan(keyframes, options);
      for (const std::size_t from : {0, 70, 159}) {
        for (const std::size_t count : {1, 16}) {
          std::vector<std::int64_t> ids;
          for (std::size_t i = from; i < std::min(plan.entries.size(), from + count); ++i) {
            ids.push_back(plan.entries[i].id);
          }
          Naive naive(plan, options);
          for (const std::int64_t id : ids) naive.points(id);
          const Halo found = find_halo(plan, ids, options, Wanted::kPoints);
          CHECK(set_of(found.clouds) == naive.needed["cloud"]);
          REQUIRE(found.rounds.size() == naive.rounds() + 1);
          for (std::size_t round = 0; round < found.rounds.size(); ++round) {
            CHECK(set_of(found.rounds[round]) == naive.needed["round" + std::to_string(round)]);
          }
          CHECK(set_of(found.range_maps) == naive.needed["ranges"]);
          CHECK(set_of(found.filtered) == naive.needed["filtered"]);
          CHECK(set_of(found.images) == naive.needed["image"]);
          check_nested(found);
          REQUIRE(found.planes.size() == static_cast<std::size_t>(options.advanced.patchmatch.geometric_passes) + 1);
          for (std::size_t pass = 0; pass < found.planes.size(); ++pass) {
            CHECK(set_of(found.planes[pass]) == naive.needed["planes" + std::to_string(pass)]);
          }
        }
      }
    }
  }
}

TEST_CASE("depth maps alone need less", "[plan][halo]") {
  MissionRecipe recipe;
  recipe.keyframes = 160;
  for (const Quality quality : {Quality::kOnline, Quality::kNormal}) {
    const DensifierOptions options = preset(quality);
    const Plan plan = make_plan(corridor(recipe), options);
    const std::vector<std::int64_t> ids{plan.entries[70].id, plan.entries[71].id};
    REQUIRE(plan.entries[70].has_depth_map());
    Naive naive(plan, options);
    for (const std::int64_t id : ids) naive.depth_maps(id);
    const Halo found = find_halo(plan, ids, options, Wanted::kDepthMaps);
    CHECK(found.clouds.empty());
    CHECK(found.range_maps.empty());
    CHECK(found.rounds == std::vector<std::vector<std::int64_t>>(naive.rounds() + 1));
    CHECK(set_of(found.filtered) == naive.needed["filtered"]);
    for (std::size_t pass = 0; pass < found.planes.size(); ++pass) {
      CHECK(set_of(found.planes[pass]) == naive.needed["planes" + std::to_string(pass)]);
    }
    CHECK(set_of(found.images) == naive.needed["image"]);
    CHECK(found.images.size() < find_halo(plan, ids, options, Wanted::kPoints).images.size());
    check_nested(found);
  }
}

TEST_CASE("a pass over images alone needs no planes of neighbours", "[plan][halo]") {
  MissionRecipe recipe;
  recipe.keyframes = 80;
  const DensifierOptions options = preset(Quality::kOnline);
  const Plan plan = make_plan(corridor(recipe), options);
  std::vector<const PlanEntry*> with_map;
  for (const PlanEntry& entry : plan.entries) {
    if (entry.has_depth_map()) with_map.push_back(&entry);
  }
  const PlanEntry& entry = *with_map[with_map.size() / 2];
  const auto needs = [&](int passes, bool photometric_first) {
    return find_halo(plan, {entry.id}, options, Wanted::kPlanes,
                     {{entry.id, {PlaneReuse::Planes::kStart, passes, photometric_first}}});
  };
  const RunHalo alone = needs(1, true);
  std::size_t matched = 0;
  for (const std::vector<std::int64_t>& ids : alone.planes) matched += ids.size();
  CHECK(matched == 1);
  CHECK(alone.planes.back() == std::vector<std::int64_t>{entry.id});
  CHECK(alone.earlier == std::vector<std::int64_t>{entry.id});
  CHECK(alone.images.size() == 1 + entry.near.size());
  CHECK(needs(1, false).images.size() > alone.images.size());
  CHECK(needs(2, true).images.size() > alone.images.size());  // the second one looks at maps
}

TEST_CASE("the halo of a plan with a cycle of first planes is finite", "[plan][halo]") {
  MissionRecipe recipe;
  recipe.keyframes = 20;
  const DensifierOptions options = preset(Quality::kOnline);
  Plan plan = make_plan(corridor(recipe), options);
  for (std::size_t i = 0; i < plan.entries.size(); ++i) {
    plan.entries[i].first_planes = plan.entries[(i + 1) % plan.entries.size()].id;
  }
  CHECK(find_halo(plan, {plan.entries[3].id}, options, Wanted::kPoints).planes[0].size() == plan.entries.size());
}

TEST_CASE("the halo of a keyframe in a long flight is bounded", "[plan][halo]") {
  MissionRecipe recipe;
  recipe.keyframes = 600;
  const DensifierOptions options = preset(Quality::kOnline);
  const Plan shorter = make_plan(corridor(recipe), options);
  const std::int64_t middle = shorter.entries[300].id;
  REQUIRE(shorter.entries[300].has_depth_map());
  CHECK(find_halo(shorter, {middle}, options, Wanted::kPoints).images.size() < 150);
  CHECK(find_halo(shorter, {}, options, Wanted::kPoints).images.empty());
}

TEST_CASE("points of a keyframe without a depth map need nothing", "[plan][halo]") {
  MissionRecipe recipe;
  recipe.keyframes = 20;
  auto keyframes = corridor(recipe);
  keyframes[7].landmarks.clear();
  const DensifierOptions options = preset(Quality::kOnline);
  const Plan plan = make_plan(keyframes, options);
  const Halo none = find_halo(plan, {keyframes[7].id}, options, Wanted::kPoints);
  CHECK((none.clouds.empty() && none.images.empty() && none.planes[0].empty()));
  CHECK_THROWS_AS(find_halo(plan, {-1000}, options, Wanted::kPoints), InvalidInput);
}

TEST_CASE("the keyframes whose planes points depend on are the same one by one", "[plan]") {
  MissionRecipe recipe;
  recipe.keyframes = 90;
  for (const Quality quality : {Quality::kOnline, Quality::kNormal, Quality::kHigh}) {
    DensifierOptions options = preset(quality);
    options.advanced.free_space.history = 20;
    options.advanced.fusion.history = 8;
    const Plan plan = make_plan(corridor(recipe, 2), options);
    std::map<std::int64_t, PlaneReuse> kept;
    for (const PlanEntry& entry : plan.entries) {
      if (entry.has_depth_map()) kept[entry.id] = {PlaneReuse::Planes::kStart, 0, false};
    }
    const PointsHalo halo(plan, options);
    for (const auto& [id, reuse] : kept) {
      CHECK(halo.planes_of(id) == find_halo(plan, {id}, options, Wanted::kPoints, kept).earlier);
    }
  }
}

TEST_CASE("a chain through the whole mission has no halo", "[plan][halo]") {
  DensifierOptions options = preset(Quality::kPaper);
  CHECK_THROWS_AS(check_chain(options), InvalidOption);
  options.advanced.init.warp_previous = false;
  CHECK_NOTHROW(check_chain(options));
}
