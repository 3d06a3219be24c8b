// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <vector>

#include "elementary.h"
#include "patchmatch/neighbours.h"
#include "plan/choices.h"

// Previous decisions are kept exactly while they are nearly as good.
using namespace pmsp;

namespace {

/// Landmarks on a ring around the origin.
std::vector<Landmark> ring(double radius) {
  std::vector<Landmark> landmarks;
  for (int i = 0; i < 40; ++i) {
    const double angle = 2.0 * kernels::kPi * i / 40;
    landmarks.push_back({i, {0.0, radius * std::sin(angle), radius * std::cos(angle)}});
  }
  return landmarks;
}

Keyframe keyframe_at(std::int64_t id, double x) {
  Keyframe keyframe;
  keyframe.id = id;
  keyframe.cam_from_world.translation = {-x, 0.0, 0.0};
  keyframe.landmarks = ring(4.0);
  return keyframe;
}

/// The near neighbours of the third of five keyframes in a row.
std::vector<std::size_t> near_of_third(const std::vector<double>& places, const std::vector<std::int64_t>& before) {
  std::vector<Keyframe> keyframes;
  for (std::size_t i = 0; i < places.size(); ++i) {
    keyframes.push_back(keyframe_at(static_cast<std::int64_t>(i), places[i]));
  }
  std::vector<const Keyframe*> sequence;
  for (const Keyframe& keyframe : keyframes) sequence.push_back(&keyframe);
  PlanEntry previous;
  previous.id = 2;
  previous.near = before;
  std::vector<std::size_t> near = choose_near(sequence, 2, 2, before.empty() ? nullptr : &previous);
  std::sort(near.begin(), near.end());
  return near;
}

}  // namespace

TEST_CASE("previous near neighbours stay while they are nearly as useful", "[plan][choices]") {
  using Near = std::vector<std::size_t>;
  const std::vector<double> even = {-1.4, -0.7, 0.0, 0.7, 1.4};      // the outer ones: twice the best parallax
  const std::vector<double> nearly = {-0.76, -0.7, 0.0, 0.7, 0.76};  // as good as the inner ones
  CHECK(near_of_third(even, {}) == Near{1, 3});
  CHECK(near_of_third(nearly, {}) == Near{1, 3});
  CHECK(near_of_third(even, {0, 4}) == Near{1, 3});
  CHECK(near_of_third(nearly, {0, 4}) == Near{0, 4});
  CHECK(near_of_third(nearly, {0, 1}) == Near{1, 3});  // all on one side
  CHECK(near_of_third(nearly, {0, 9}) == Near{1, 3});  // one is gone
}

TEST_CASE("a neighbour with few common landmarks is less useful", "[plan][choices]") {
  const Keyframe reference = keyframe_at(0, 0.0);
  Keyframe other = keyframe_at(1, 0.7);
  const double all = neighbour_usefulness(reference, other);
  CHECK(all > 0.9);  // ten degrees of parallax
  other.landmarks.resize(30);
  CHECK(neighbour_usefulness(reference, other) == Approx(all));
  other.landmarks.resize(15);
  CHECK(neighbour_usefulness(reference, other) == Approx(0.5 * all));
  other.landmarks.clear();
  CHECK(neighbour_usefulness(reference, other) == 0.0);
}

TEST_CASE("previous viewers stay while they are spread over the existing ones", "[plan][choices]") {
  PlanKeyframe given;
  given.id = 20;
  given.landmarks = ring(4.0);
  const PlanNode node(std::move(given), 0);
  const std::vector<std::int64_t> window = {19, 21};
  std::vector<ViewerCandidate> candidates;
  for (std::int64_t id = 0; id < 40; ++id) {
    if (id != 20) candidates.push_back({id, 0.1 * std::abs(static_cast<double>(id - 20))});
  }
  const auto choose = [&](const std::vector<std::int64_t>* before) {
    return choose_viewers(node, window, candidates, 8, before);
  };
  const std::vector<std::int64_t> fresh = choose(nullptr);
  REQUIRE(fresh.size() == 10);
  std::vector<std::int64_t> other = fresh;
  for (std::int64_t& id : other) id += id < 19 || id > 21 ? 1 : 0;
  REQUIRE(other != fresh);
  CHECK(choose(&other) == other);
  const std::vector<std::int64_t> crowded = {0, 1, 2, 3, 4, 5, 6, 7, 19, 21};
  CHECK(choose(&crowded) == fresh);
  const std::vector<std::int64_t> few = {2, 19, 21, 37};
  CHECK(choose(&few) == fresh);
  const std::vector<std::int64_t> without_window = {2, 7, 12, 17, 23, 28, 33, 38};
  CHECK(choose(&without_window) == fresh);
  for (ViewerCandidate& candidate : candidates) candidate.distance *= candidate.id > 30 ? 100.0 : 1.0;
  CHECK(choose(&other) != other);  // some have gone out of reach
}

TEST_CASE("a previous depth range stays while both of its ends hardly differ", "[plan][choices]") {
  const Keyframe keyframe = keyframe_at(0, 0.0);
  const DepthRange now = choose_range(keyframe, {}, nullptr);
  REQUIRE(now.max > now.min);
  const auto chosen = [&](double min_factor, double max_factor) {
    PlanEntry before;
    before.range = {now.min * min_factor, now.max * max_factor};
    const DepthRange range = choose_range(keyframe, {}, &before);
    return range.min == before.range.min && range.max == before.range.max;
  };
  CHECK(chosen(1.05, 0.95));
  CHECK_FALSE(chosen(1.2, 1.0));
  CHECK_FALSE(chosen(0.8, 1.0));
  CHECK_FALSE(chosen(1.0, 1.2));
  CHECK_FALSE(chosen(1.0, 0.8));
}
