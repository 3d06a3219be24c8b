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

constexpr std::size_t kKeyframes = 30;
constexpr std::size_t kPiece = 3;

/// Short halos, so that pieces of a short flight have ends: one geometric pass, chains of three ids, no far viewers.
DensifierOptions local_options() {
  DensifierOptions options = fast_options(kTinyWidth);
  options.view_filter.enabled = false;  // a piece would begin its chain elsewhere
  options.patchmatch.geometric_passes = 1;
  options.init.chain_keyframes = 3;
  options.free_space.enabled = false;
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

struct Maps {
  std::map<std::int64_t, DepthMap> raw, filtered;
};

Maps maps_of(const std::vector<Keyframe>& keyframes, const DensifierOptions& options) {
  Maps maps;
  DensifierCallbacks callbacks;
  callbacks.raw_depth = [&](const DepthMap& map) { maps.raw.emplace(map.keyframe_id, map); };
  callbacks.filtered_depth = [&](const DepthMap& map) { maps.filtered.emplace(map.keyframe_id, map); };
  Densifier densifier(options, callbacks);
  for (const Keyframe& keyframe : keyframes) densifier.add(keyframe);
  densifier.flush();
  return maps;
}

Plan plan_of(const std::vector<Keyframe>& keyframes, const DensifierOptions& options) {
  std::vector<PlanKeyframe> records;
  for (const Keyframe& keyframe : keyframes) records.push_back(plan_keyframe(keyframe, options));
  return make_plan(records, options);
}

}  // namespace

TEST_CASE("depth maps of a piece with its halo are those of the whole flight, wherever it is cut", "[densifier]") {
  for (const std::uint64_t seed : {1U, 2U}) {
    DensifierOptions options = local_options();
    options.seed = seed;
    const Maps whole = maps_of(flight(), options);
    REQUIRE(whole.filtered.size() == kKeyframes);
    const Plan plan = plan_of(flight(), options);
    std::size_t left_out = 0;
    for (std::size_t first = 0; first + kPiece <= kKeyframes; first += kSanitized ? 11 : seed == 1 ? 1 : 5) {
      std::vector<std::int64_t> ids;
      for (std::size_t i = first; i < first + kPiece; ++i) ids.push_back(flight()[i].id);
      const Halo needed = halo(plan, ids, options);
      std::vector<Keyframe> piece;
      for (const Keyframe& keyframe : flight()) {
        const auto& images = needed.images;
        if (std::find(images.begin(), images.end(), keyframe.id) != images.end()) piece.push_back(keyframe);
      }
      left_out += kKeyframes - piece.size();
      const Maps maps = maps_of(piece, options);
      for (const std::int64_t id : ids) {
        INFO("seed " << seed << ", piece from keyframe " << ids.front() << ", keyframe " << id);
        CHECK(same(maps.raw.at(id), whole.raw.at(id)));
        CHECK(same(maps.filtered.at(id), whole.filtered.at(id)));
      }
    }
    CHECK(left_out > kKeyframes);  // or nothing was cut
  }
}
