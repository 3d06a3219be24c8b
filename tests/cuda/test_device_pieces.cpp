// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cstddef>
#include <random>
#include <utility>
#include <vector>

#include "core/small_missions.h"
#include "pipeline.h"
#include "planned_densifier.h"
#include "support/temp_dir.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

using Ids = std::vector<std::int64_t>;

}  // namespace

TEST_CASE("parts of a mission give the results of the whole mission on the device", "[cuda][pieces]") {
  for (SmallMission& mission : small_missions()) {
    mission.options.backend = Backend::kCuda;
    const ResultsById whole = by_id(whole_run(mission));
    const Plan plan = plan_of(mission);
    const Ids ids = ids_of(mission.keyframes);
    for (std::size_t cut = 1; cut < ids.size(); cut += 6) {
      const auto at = ids.begin() + static_cast<std::ptrdiff_t>(cut);
      ResultsById merged;
      merged.add(run_part(mission, plan, Ids(at, ids.end())));
      merged.add(run_part(mission, plan, Ids(ids.begin(), at)));
      INFO(mission.name << ", cut at " << cut);
      CHECK(difference(merged, whole) == "");
    }
  }
}

TEST_CASE("any order of the ready tasks gives the same bytes on the device", "[cuda][pieces]") {
  for (SmallMission& mission : small_missions()) {
    mission.options.backend = Backend::kCuda;
    const ResultsById whole = by_id(whole_run(mission));
    for (std::uint32_t seed = 0; seed < 3; ++seed) {
      std::mt19937 random(seed);
      Recording recording;
      bool flushing = false;
      Pipeline pipeline(mission.options, std::nullopt, recording.callbacks());
      pipeline.choose = [&](const std::vector<Task>& tasks) -> std::optional<Task> {
        if (tasks.empty() || (!flushing && random() % 8 == 0)) return std::nullopt;
        return tasks[random() % tasks.size()];
      };
      for (const Keyframe& keyframe : mission.keyframes) pipeline.add(keyframe);
      flushing = true;
      pipeline.flush();
      INFO(mission.name << ", seed " << seed);
      CHECK(difference(by_id(recording), whole) == "");
    }
  }
}

TEST_CASE("images requested again or spilled to disk give the same results on the device", "[cuda][pieces]") {
  const pmsp_test::TempDir dir;
  for (SmallMission& mission : small_missions()) {
    if (!mission.options.unordered) continue;
    mission.options.backend = Backend::kCuda;
    INFO(mission.name);
    const ResultsById expected = by_id(whole_run(mission));
    Recording recording;
    PlannedDensifier densifier(mission.options, plan_of(mission), ids_of(mission.keyframes), recording.callbacks());
    densifier.run([&](std::int64_t id) { return keyframe_of(mission, id); });
    CHECK(difference(by_id(recording), expected) == "");
    mission.options.scratch_folder = dir.path().string();  // missions do not spill if device memory suffices
    CHECK(difference(by_id(whole_run(mission)), expected) == "");
  }
}

TEST_CASE("keyframes of different scales give the same surfaces on the device", "[cuda][pieces]") {
  for (SmallMission& mission : small_missions()) {
    mission.options.backend = Backend::kCuda;
    const ResultsById plain = by_id(whole_run(mission));
    give_scales(mission);
    INFO(mission.name);
    CHECK(difference(in_scene_units(by_id(whole_run(mission))), plain) == "");
  }
}
