// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <random>
#include <vector>

#include "core/small_missions.h"
#include "plan/halo.h"
#include "planned_densifier.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

using Ids = std::vector<std::int64_t>;

/// A mission, its plan, and the results of the whole mission.
struct Sample {
  explicit Sample(SmallMission given)
      : mission(std::move(given)), plan(plan_of(mission)), whole(by_id(whole_run(mission))) {
    REQUIRE(whole.clouds.size() >= mission.keyframes.size() / 2);
    REQUIRE(whole.points() > 0);
  }

  SmallMission mission;
  Plan plan;
  ResultsById whole;
};

/// Computes each part with its halo only, in this order, and compares the combined results with those of the whole
/// mission. Returns the number of images used.
std::size_t check_pieces(const Sample& sample, const std::vector<Ids>& pieces) {
  ResultsById merged;
  std::size_t images = 0;
  for (const Ids& ids : pieces) merged.add(run_part(sample.mission, sample.plan, ids, &images));
  INFO(sample.mission.name << ", seed " << sample.mission.options.seed << ", " << pieces.size()
                           << " pieces, the first of " << pieces.front().size() << " keyframes");
  CHECK(difference(merged, sample.whole) == "");
  return images;
}

/// A random partition of the mission: into ranges, or by single keyframes.
std::vector<Ids> dealt_out(const Ids& ids, std::size_t pieces, bool stretches, std::mt19937& random) {
  std::vector<Ids> result(pieces);
  std::size_t piece = 0;
  for (const std::int64_t id : ids) {
    if (!stretches || random() % (ids.size() / pieces) == 0) piece = random() % pieces;
    result[piece].push_back(id);
  }
  for (Ids& part : result) std::shuffle(part.begin(), part.end(), random);  // their order has no effect
  return result;
}

}  // namespace

TEST_CASE("a mission cut in two anywhere gives the results of the whole mission", "[densifier][pieces]") {
  for (SmallMission& mission : small_missions()) {
    const Sample sample(std::move(mission));
    const Ids ids = ids_of(sample.mission.keyframes);
    const std::size_t every = kSanitized ? 20 : sample.mission.name == "high" ? 5 : 1;
    std::size_t left_out = 0;
    for (std::size_t cut = kSanitized ? 4 : 0; cut <= ids.size(); cut += every) {
      const auto at = ids.begin() + static_cast<std::ptrdiff_t>(cut);
      left_out += 2 * ids.size() - check_pieces(sample, {Ids(at, ids.end()), Ids(ids.begin(), at)});
    }
    if (!kSanitized) CHECK(left_out > ids.size() * ids.size() / every / 4);  // otherwise nothing was cut
  }
}

// Many runs: too slow with sanitizers; the other tests cover the same code.
TEST_CASE("a mission partitioned at random gives the results of the whole mission",
          "[densifier][pieces]" PMSP_ACCURACY) {
  for (const std::uint64_t seed : {2U, 3U}) {
    std::mt19937 random(static_cast<std::uint32_t>(seed));
    for (SmallMission& mission : small_missions(seed)) {
      mission.options.threads = 1 + static_cast<int>(random() % 3);
      const Sample sample(std::move(mission));
      const Ids ids = ids_of(sample.mission.keyframes);
      for (const bool stretches : {true, false}) check_pieces(sample, dealt_out(ids, 5, stretches, random));
    }
  }
}

TEST_CASE("one keyframe with its halo gives its results in the whole mission", "[densifier][pieces]" PMSP_ACCURACY) {
  for (SmallMission& mission : small_missions()) {
    const Sample sample(std::move(mission));
    for (std::size_t i = 0; i < sample.mission.keyframes.size(); i += 4) {
      const std::int64_t id = sample.mission.keyframes[i].id;
      const ResultsById part = by_id(run_part(sample.mission, sample.plan, {id}));
      INFO(sample.mission.name << ", keyframe " << id);
      CHECK(part.clouds.size() == sample.whole.clouds.count(id));
      CHECK(part.raw.size() == sample.whole.raw.count(id));
      CHECK(part.filtered.size() == sample.whole.filtered.count(id));
      if (part.clouds.empty()) continue;
      CHECK(same(part.raw.at(id), sample.whole.raw.at(id)));
      CHECK(same(part.filtered.at(id), sample.whole.filtered.at(id)));
      CHECK(same(part.clouds.at(id), sample.whole.clouds.at(id)));
    }
  }
}

TEST_CASE("depth maps of a piece need the images of their own halo only", "[densifier][pieces]" PMSP_ACCURACY) {
  for (SmallMission& mission : small_missions()) {
    const Sample sample(std::move(mission));
    const Ids all = ids_of(sample.mission.keyframes);
    const Ids ids(all.begin() + 2, all.begin() + 6);
    const Ids images = find_halo(sample.plan, ids, sample.mission.options, Wanted::kDepthMaps).images;
    Recording recording;
    DensifierCallbacks callbacks = recording.callbacks();
    callbacks.cloud = nullptr;
    PlannedDensifier densifier(sample.mission.options, sample.plan, ids, callbacks);
    for (const Keyframe& keyframe : sample.mission.keyframes) {
      if (std::find(images.begin(), images.end(), keyframe.id) != images.end()) CHECK(densifier.add(keyframe));
    }
    densifier.flush();
    INFO(sample.mission.name);
    if (!kSanitized) CHECK(images.size() < all.size());
    REQUIRE(!recording.filtered.empty());
    for (const DepthMap& map : recording.raw) CHECK(same(map, sample.whole.raw.at(map.keyframe_id)));
    for (const DepthMap& map : recording.filtered) CHECK(same(map, sample.whole.filtered.at(map.keyframe_id)));
  }
}
