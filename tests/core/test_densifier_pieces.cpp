// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <map>
#include <vector>

#include "core/recording.h"
#include "pmsp/plan.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

constexpr std::size_t kKeyframes = 40;
constexpr std::size_t kPiece = 3;

/// Short halos, so that pieces of a short flight have ends: one geometric pass, chains of three ids, few viewers.
DensifierOptions local_options() {
  DensifierOptions options = fast_options(kTinyWidth);
  options.view_filter.enabled = false;  // a piece would begin its chain elsewhere
  options.patchmatch.geometric_passes = 1;
  options.init.chain_keyframes = 3;
  options.consistency.window = options.fusion.window = 3;
  options.consistency.min_views = 2;
  options.free_space.history = 6;
  options.free_space.views = 8;  // all of them: who is left out changes places in the sequence, and so the windows
  return options;
}

/// Out and back through a room, with some ids missing, as culled keyframes leave them.
const std::vector<Keyframe>& flight() {
  static const synth::Mission kRoom = synth::empty_room(small_recipe(kTinyWidth, 10));
  static const std::vector<Keyframe> kFlight = [] {
    std::vector<Keyframe> keyframes;
    std::int64_t id = -5;
    for (std::size_t i = 0; i < kKeyframes; ++i) {
      const std::size_t at = i % 18;
      keyframes.push_back(synth::keyframe_of(kRoom, at < 10 ? at : 18 - at));
      id += i % 7 == 3 ? 2 : 1;
      keyframes.back().id = id;
    }
    return keyframes;
  }();
  return kFlight;
}

struct Results {
  std::map<std::int64_t, DepthMap> raw, filtered;
  std::map<std::int64_t, KeyframeCloud> clouds;
};

Results results_of(const std::vector<Keyframe>& keyframes, const DensifierOptions& options) {
  Results results;
  DensifierCallbacks callbacks;
  callbacks.raw_depth = [&](const DepthMap& map) { results.raw.emplace(map.keyframe_id, map); };
  callbacks.filtered_depth = [&](const DepthMap& map) { results.filtered.emplace(map.keyframe_id, map); };
  callbacks.cloud = [&](const KeyframeCloud& cloud) { results.clouds.emplace(cloud.keyframe_id, cloud); };
  Densifier densifier(options, callbacks);
  for (const Keyframe& keyframe : keyframes) densifier.add(keyframe);
  densifier.flush();
  return results;
}

Plan plan_of(const std::vector<Keyframe>& keyframes, const DensifierOptions& options) {
  std::vector<PlanKeyframe> records;
  for (const Keyframe& keyframe : keyframes) records.push_back(plan_keyframe(keyframe, options));
  return make_plan(records, options);
}

/// Cuts the flight everywhere, or at every so many keyframes, and compares each piece with the whole flight.
void check_pieces(const DensifierOptions& options, std::size_t every) {
  const Results whole = results_of(flight(), options);
  REQUIRE(whole.filtered.size() == kKeyframes);
  const Plan plan = plan_of(flight(), options);
  std::size_t left_out = 0;
  std::size_t points = 0;
  for (std::size_t first = 0; first + kPiece <= kKeyframes; first += every) {
    std::vector<std::int64_t> ids;
    for (std::size_t i = first; i < first + kPiece; ++i) ids.push_back(flight()[i].id);
    const Halo needed = halo(plan, ids, options);
    // Without gaps, since a piece's own plan counts places in the sequence.
    std::vector<Keyframe> piece;
    for (const Keyframe& keyframe : flight()) {
      const bool inside = keyframe.id >= needed.images.front() && keyframe.id <= needed.images.back();
      if (inside) piece.push_back(keyframe);
    }
    left_out += kKeyframes - piece.size();
    const Results results = results_of(piece, options);
    for (const std::int64_t id : ids) {
      INFO("seed " << options.seed << ", piece from keyframe " << ids.front() << ", keyframe " << id);
      CHECK(same(results.raw.at(id), whole.raw.at(id)));
      CHECK(same(results.filtered.at(id), whole.filtered.at(id)));
      CHECK(same(results.clouds.at(id), whole.clouds.at(id)));
      points += whole.clouds.at(id).points.size();
    }
  }
  CHECK(left_out > kKeyframes / 2);  // or nothing was cut
  CHECK(points > 0);
}

}  // namespace

TEST_CASE("results of a piece with its halo are those of the whole flight, wherever it is cut", "[densifier]") {
  for (const std::uint64_t seed : {1U, 2U}) {
    if (kSanitized && seed > 1) break;  // a sanitizer's errors do not depend on it
    DensifierOptions options = local_options();
    options.seed = seed;
    check_pieces(options, kSanitized ? 17 : seed == 1 ? 1 : 5);
  }
}

TEST_CASE("so they are where the whole mission is asked", "[densifier]") {
  DensifierOptions options = local_options();
  options.free_space.whole_mission = true;
  options.free_space.history = 4;
  check_pieces(options, kSanitized ? 23 : 3);
}
