// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <map>
#include <vector>

#include <malloc.h>

#include "core/recording.h"
#include "cost.h"
#include "plan/reach.h"
#include "pmsp/error.h"
#include "schedule.h"
#include "support/temp_dir.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

/// A flight of `length` keyframes through the schedule: each stage runs as soon as it may. Reports how many keyframes
/// have an artefact at a time, and counts accesses to missing ones.
class MemorySimulation {
 public:
  MemorySimulation(const Schedule& schedule, std::int64_t plan_delay, std::int64_t length)
      : schedule_(schedule), next_(schedule.stages().size(), 0) {
    for (std::int64_t come = 1; come <= length; ++come) {
      for (std::size_t s = 0; s < next_.size(); ++s) {
        while (may_run(s, come, plan_delay)) {
          count(come, s);
          ++next_[s];
        }
      }
    }
  }

  std::map<Artefact, std::int64_t> most;
  std::vector<std::int64_t> done() const { return next_; }

 private:
  bool may_run(std::size_t s, std::int64_t come, std::int64_t plan_delay) const {
    const Stage& stage = schedule_.stages()[s];
    if (next_[s] + std::min(plan_delay, stage.lookahead) >= come) return false;
    return std::all_of(stage.needs.begin(), stage.needs.end(),
                       [&](const Stage::Prerequisite& need) { return next_[s] + need.ahead < next_[need.stage]; });
  }

  /// While a stage works on its next keyframe.
  void count(std::int64_t come, std::size_t working) {
    for (const Lifetime& lifetime : schedule_.lifetimes()) {
      std::int64_t first = come;
      for (const Lifetime::Reader& reader : lifetime.readers) {
        first = std::min(first, next_[reader.stage] - reader.behind);
      }
      std::int64_t made = come;  // images come with the keyframe, the others from the stage that makes them
      if (lifetime.artefact == Artefact::kPassPlanes) made = next_.front() + (working == 0 ? 1 : 0);
      if (lifetime.artefact == Artefact::kFinalPlanes) made = made_by(Stage::Kind::kMatch, working);
      if (lifetime.artefact == Artefact::kFiltered) made = made_by(Stage::Kind::kFilter, working);
      if (lifetime.artefact == Artefact::kRangeMap) made = made_by(Stage::Kind::kFilter, working);
      if (lifetime.artefact == Artefact::kSurfels) made = made_by(Stage::Kind::kFuse, working);
      std::int64_t& count = most[lifetime.artefact];
      count = std::max(count, made - std::max<std::int64_t>(first, 0));
    }
  }

  std::int64_t made_by(Stage::Kind kind, std::size_t working) const {
    std::int64_t made = 0;
    for (std::size_t s = 0; s < next_.size(); ++s) {
      if (schedule_.stages()[s].kind == kind) made = next_[s] + (s == working ? 1 : 0);  // by the last of its kind
    }
    return made;
  }

  const Schedule& schedule_;
  std::vector<std::int64_t> next_;
};

std::vector<DensifierOptions> small_presets() {
  std::vector<DensifierOptions> all;
  for (const Quality quality : {Quality::kOnline, Quality::kNormal, Quality::kHigh, Quality::kPaper}) {
    all.push_back(preset(quality));
    all.back().width = 640;
    all.back().height = 320;
  }
  return all;
}

}  // namespace

TEST_CASE("the number of keyframes that hold an artefact is bounded for missions of any length", "[schedule]") {
  for (const Quality quality : {Quality::kPaper, Quality::kOnline, Quality::kNormal, Quality::kHigh}) {
    for (const bool points : {false, true}) {
      const DensifierOptions options = preset(quality);
      const Schedule schedule(options, points);
      const PlanReach reach = plan_reach(options);
      const std::int64_t plan_delay = reach.near + std::max(reach.windows, reach.viewers_after);
      const MemorySimulation flight(schedule, plan_delay, 700);
      for (const auto& [artefact, count] : flight.most) {
        CAPTURE(static_cast<int>(quality), points, static_cast<int>(artefact));
        REQUIRE(schedule.lifetime(artefact) != nullptr);
        CHECK(count == schedule.lifetime(artefact)->keyframes);
      }
      for (std::size_t s = 0; s < schedule.stages().size(); ++s) {
        CHECK(flight.done()[s] ==
              700 - schedule.stages()[s].lookahead);  // results come with the documented delay at most
      }
    }
  }
}

TEST_CASE("without points no artefacts are kept for them", "[schedule]") {
  const Schedule maps(preset(Quality::kNormal), false);
  CHECK(maps.lifetime(Artefact::kSurfels) == nullptr);
  CHECK(maps.lifetime(Artefact::kRangeMap) == nullptr);
  CHECK(maps.stages().back().kind == Stage::Kind::kFilter);
  DensifierOptions alone = preset(Quality::kOnline);
  alone.advanced.fusion.spacing_px = 0.0;  // every pixel makes a point: keyframes are not compared
  alone.advanced.free_space.enabled = false;
  CHECK(Schedule(alone, true).lifetime(Artefact::kSurfels)->keyframes == 1);
}

// Sanitizers replace the allocator that this test queries.
TEST_CASE("memory does not grow with the length of a mission", "[schedule][densifier]" PMSP_ACCURACY) {
  const pmsp_test::TempDir dir;
  for (const bool scratch : {false, true}) {
    DensifierOptions options = fast_options(kTinyWidth);
    options.advanced.patchmatch.geometric_passes = 1;
    options.advanced.free_space.whole_mission = true;
    options.advanced.free_space.history = 4;
    if (scratch) options.scratch_folder = dir.path().string();
    std::size_t points = 0;
    DensifierCallbacks callbacks;
    callbacks.cloud = [&](const KeyframeCloud& cloud) { points += cloud.points.size(); };
    Densifier densifier(options, callbacks);
    const auto fly = [&](std::int64_t first, std::int64_t count) {
      for (std::int64_t i = first; i < first + count; ++i) {
        const std::int64_t at = i % 12;  // there and back
        Keyframe keyframe = synth::keyframe_of(test_flight(), static_cast<std::size_t>(at < 7 ? at : 12 - at));
        keyframe.id = i;
        densifier.add(keyframe);
      }
      return mallinfo2().uordblks;
    };
    const std::size_t before = fly(0, 48);
    const std::size_t after = fly(48, 48);
    CAPTURE(scratch, before, after);
    constexpr std::size_t kFrame = kTinyWidth * kTinyWidth / 2 * 100;  // what a keyframe holds while it is matched
    CHECK(after < before + kFrame / 4);
    CHECK(points > 0);
  }
}

TEST_CASE("memory on the CPU grows with a mission up to a bound") {
  for (DensifierOptions options : small_presets()) {
    for (const char* folder : {"", "somewhere"}) {
      options.scratch_folder = folder;
      const HostMemory few = host_memory_needed(options, 5);
      const HostMemory many = host_memory_needed(options, 1000);
      const HostMemory most = host_memory_needed(options, 1000000);
      CHECK(few.memory < many.memory);
      CHECK(many.memory == most.memory);
      CHECK(many.scratch == most.scratch);
      CHECK((many.scratch > 0.0) == (options.scratch_folder != ""));
    }
  }
}

TEST_CASE("device memory is less for a short mission and that of a long one for unknown length") {
  for (DensifierOptions options : small_presets()) {
    for (const char* folder : {"", "somewhere"}) {
      options.scratch_folder = folder;
      const auto needed = [&](std::int64_t keyframes) {
        options.advanced.expected_keyframes = keyframes;
        return device_memory_needed(options);
      };
      std::size_t before = 0;
      for (const std::int64_t keyframes : {1, 2, 5, 10, 30, 100, 1000}) {
        const std::size_t now = needed(keyframes);
        CHECK(now >= before);
        before = now;
      }
      CHECK(needed(5) < needed(30));
      CHECK(needed(1000) == needed(1000000));
      CHECK(needed(0) == needed(1000000));
    }
  }
  DensifierOptions options;
  options.advanced.expected_keyframes = -1;
  CHECK_THROWS_AS(options.validate(), InvalidOption);
}

TEST_CASE("devices that share a mission each take more than half and less than twice the memory of one") {
  for (DensifierOptions options : small_presets()) {
    for (const char* folder : {"", "somewhere"}) {
      options.scratch_folder = folder;
      options.devices = {1};
      const std::size_t one = device_memory_needed(options);
      options.devices = {0, 1};
      const std::size_t two = device_memory_needed(options);
      options.devices = {0, 1, 2, 3};
      CHECK(two > one / 2);
      CHECK(two < 2 * one);
      CHECK(device_memory_needed(options) <= two);
      if (!options.scratch_folder.empty()) CHECK(two > one);  // no results wait on a shared device
    }
  }
}
