// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <map>
#include <random>
#include <set>

#include <Eigen/Geometry>

#include "plan/missions.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

DensifierOptions set_options(Quality quality = Quality::kNormal) {
  DensifierOptions options = preset(quality);
  options.unordered = true;
  return options;
}

std::vector<PlanKeyframe> captures(std::uint32_t seed, int count = 120) {
  MissionRecipe recipe;
  recipe.seed = seed;
  recipe.keyframes = count;
  return photos(recipe);
}

int shared(const PlanKeyframe& a, const PlanKeyframe& b) {
  std::set<std::int64_t> ids;
  for (const Landmark& landmark : a.landmarks) ids.insert(landmark.id);
  int count = 0;
  for (const Landmark& landmark : b.landmarks) count += static_cast<int>(ids.count(landmark.id));
  return count;
}

}  // namespace

TEST_CASE("the order of a set has no effect", "[plan][unordered]") {
  for (std::uint32_t seed = 0; seed < 6; ++seed) {
    auto keyframes = captures(seed);
    const Plan plan = make_plan(keyframes, set_options());
    std::map<std::int64_t, PlanEntry> by_id;
    for (const PlanEntry& entry : plan.entries) by_id[entry.id] = entry;
    std::mt19937 random(seed);
    std::shuffle(keyframes.begin(), keyframes.end(), random);
    const Plan other = make_plan(keyframes, set_options());
    for (std::size_t i = 0; i < keyframes.size(); ++i) {
      CHECK(other.entries[i].id == keyframes[i].id);
      CHECK(other.entries[i] == by_id[keyframes[i].id]);
    }
  }
}

TEST_CASE("links of a set join keyframes with common landmarks", "[plan][unordered]") {
  const DensifierOptions options = set_options();
  const auto keyframes = captures(3);
  std::map<std::int64_t, const PlanKeyframe*> by_id;
  for (const PlanKeyframe& keyframe : keyframes) by_id[keyframe.id] = &keyframe;
  const Plan plan = make_plan(keyframes, options);
  int with_maps = 0;
  for (const PlanEntry& entry : plan.entries) {
    if (!entry.has_depth_map()) continue;
    ++with_maps;
    const PlanKeyframe& own = *by_id[entry.id];
    CHECK_FALSE(entry.first_planes);
    CHECK(entry.near.size() >= 2);
    CHECK(entry.near.size() <= 4);
    CHECK(entry.fusion.size() == 4);
    CHECK(entry.consistency.size() == 6);
    CHECK(entry.viewers.size() <= 20);
    for (const std::int64_t id : entry.near) CHECK(shared(own, *by_id[id]) > 0);
    int least = 1 << 30;
    for (const std::int64_t id : entry.consistency) least = std::min(least, shared(own, *by_id[id]));
    int more = 0;  // others that share more than any of the window does
    for (const PlanEntry& other : plan.entries) {
      const auto in_window = std::count(entry.consistency.begin(), entry.consistency.end(), other.id);
      if (other.id != entry.id && other.has_depth_map() && in_window == 0 && shared(own, *by_id[other.id]) > least)
        ++more;
    }
    CHECK(more == 0);
    for (const std::int64_t id : entry.fusion) CHECK(std::count(entry.viewers.begin(), entry.viewers.end(), id) == 1);
  }
  CHECK(with_maps == 120);
}

TEST_CASE("neighbours of a set lie in different directions", "[plan][unordered]") {
  // On a grid the nearest ones of a line would do for half of what is seen.
  const auto keyframes = captures(5);
  std::map<std::int64_t, const PlanKeyframe*> by_id;
  for (const PlanKeyframe& keyframe : keyframes) by_id[keyframe.id] = &keyframe;
  double widest = 0.0;
  const Plan plan = make_plan(keyframes, set_options(Quality::kOnline));
  for (const PlanEntry& entry : plan.entries) {
    REQUIRE(entry.near.size() == 2);
    const Eigen::Vector3d center = by_id[entry.id]->cam_from_world.center();
    const Eigen::Vector3d a = (by_id[entry.near[0]]->cam_from_world.center() - center).normalized();
    const Eigen::Vector3d b = (by_id[entry.near[1]]->cam_from_world.center() - center).normalized();
    widest += a.cross(b).norm() / static_cast<double>(keyframes.size());
  }
  CHECK(widest > 0.7);  // the mean of independent directions is 0.64
}

TEST_CASE("small pose changes of a set flip no decision", "[plan][unordered]") {
  for (std::uint32_t seed = 0; seed < 6; ++seed) {
    auto keyframes = captures(seed);
    const Plan plan = make_plan(keyframes, set_options());
    CHECK(make_plan(keyframes, set_options(), &plan) == plan);
    keyframes = jittered(std::move(keyframes), 0.004, seed);
    const Plan kept = make_plan(keyframes, set_options(), &plan);
    INFO(difference(plan, kept));
    CHECK(kept == plan);
  }
}

TEST_CASE("a blurred capture is skipped where another shows nearly the same", "[plan][unordered]") {
  auto keyframes = captures(2, 40);
  for (PlanKeyframe& keyframe : keyframes) keyframe.sharpness = sharpness(keyframe, 1.0F);
  keyframes.push_back(keyframes[20]);
  keyframes.back().id = 9000;
  keyframes.back().cam_from_world.translation.x() += 0.05;
  keyframes.back().sharpness = sharpness(keyframes.back(), 0.2F);
  const Plan plan = make_plan(keyframes, set_options());
  CHECK(plan.entries.back().use == KeyframeUse::kBlurred);
  for (std::size_t i = 0; i < 40; ++i) CHECK(plan.entries[i].used());
  for (const PlanEntry& entry : plan.entries) CHECK(std::count(entry.near.begin(), entry.near.end(), 9000) == 0);
  const Eigen::Vector3d center = keyframes.back().cam_from_world.center();
  const auto around = [&](const PlanKeyframe& other) {
    return other.id != 9000 && (other.cam_from_world.center() - center).norm() < 2.5;
  };
  keyframes.erase(std::remove_if(keyframes.begin(), keyframes.end(), around), keyframes.end());
  CHECK(make_plan(keyframes, set_options()).entries.back().used());  // better than a hole
}

TEST_CASE("two sets without common landmarks stay separate", "[plan][unordered]") {
  auto keyframes = captures(1, 30);
  const auto other = captures(2, 30);
  for (PlanKeyframe keyframe : other) {
    keyframe.id += 5000;
    keyframe.cam_from_world.translation -= keyframe.cam_from_world.rotation * Eigen::Vector3d(1000.0, 0.0, 0.0);
    for (Landmark& landmark : keyframe.landmarks) {
      landmark.id += 100000;
      landmark.position_world.x() += 1000.0;
    }
    keyframes.push_back(keyframe);
  }
  const Plan plan = make_plan(keyframes, set_options());
  for (const PlanEntry& entry : plan.entries) {
    for (const auto* list : {&entry.near, &entry.consistency, &entry.fusion, &entry.viewers}) {
      for (const std::int64_t id : *list) CHECK((id >= 5000) == (entry.id >= 5000));
    }
  }
}

TEST_CASE("Captures of another room are no neighbours beside two of the same room", "[plan]") {
  // Three captures in one room; two in the next one, which share a few landmarks through the door.
  std::vector<PlanKeyframe> keyframes(5);
  const auto sees = [&](int keyframe, int first, int count, double x) {
    for (int i = 0; i < count; ++i) {
      const double angle = 2.399963 * i;  // spread evenly
      const double y = 1.0 - 2.0 * (i + 0.5) / count;
      const double r = 3.0 * std::sqrt(1.0 - y * y);
      keyframes[static_cast<std::size_t>(keyframe)].landmarks.push_back(
          {first + i, {x + r * std::cos(angle), 3.0 * y, r * std::sin(angle)}});
    }
  };
  for (int i = 0; i < 5; ++i) {
    keyframes[static_cast<std::size_t>(i)].id = i;
    const bool next = i >= 3;
    const Eigen::Vector3d center(next ? 6.0 + 0.5 * (i - 3) : 0.5 * i, 0.0, 0.1 * i);
    keyframes[static_cast<std::size_t>(i)].cam_from_world.translation = -center;
    sees(i, next ? 1000 : 0, 400, next ? 6.0 : 0.0);
    sees(i, next ? 0 : 1000, 6, next ? 0.0 : 6.0);
  }
  for (const bool unordered : {true, false}) {
    DensifierOptions options = preset(Quality::kNormal);
    options.unordered = unordered;
    options.advanced.view_filter.enabled = false;
    const Plan plan = make_plan(keyframes, options);
    for (int i = 0; i < 3; ++i) {
      CAPTURE(unordered, i);
      const std::vector<std::int64_t>& near = plan.entries[static_cast<std::size_t>(i)].near;
      CHECK(near.size() == 2);
      CHECK(std::all_of(near.begin(), near.end(), [](std::int64_t id) { return id < 3; }));
    }
  }
}
