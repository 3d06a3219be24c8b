// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cstddef>
#include <random>
#include <utility>
#include <vector>

#include "core/small_missions.h"
#include "pipeline.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

using Ids = std::vector<std::int64_t>;

}  // namespace

TEST_CASE("pieces of a mission give on the device what it gives as a whole", "[cuda][pieces]") {
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

TEST_CASE("any order of the tasks that are ready gives the same bytes on the device", "[cuda][pieces]") {
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
