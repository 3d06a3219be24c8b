// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "core/small_missions.h"
#include "pipeline.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

/// Choice of the next ready task.
enum class Choice { kRandom, kLastStage, kLastKeyframe, kRandomStage };

class Chooser {
 public:
  Chooser(Choice how, std::uint32_t seed) : how_(how), random_(seed) {}

  std::optional<Task> operator()(const std::vector<Task>& tasks) {
    if (tasks.empty() || (!flushing && random_() % 8 == 0)) return std::nullopt;  // for later
    most_ = std::max(most_, tasks.size());
    switch (how_) {
      case Choice::kRandom:
        return tasks[random_() % tasks.size()];
      case Choice::kLastStage:
        return tasks.back();
      case Choice::kLastKeyframe:
        return *std::max_element(tasks.begin(), tasks.end(),
                                 [](const Task& a, const Task& b) { return a.keyframe < b.keyframe; });
      case Choice::kRandomStage:
        break;
    }
    const std::size_t stage = tasks[random_() % tasks.size()].stage;
    std::vector<Task> some;
    for (const Task& task : tasks) {
      if (task.stage == stage) some.push_back(task);
    }
    return some[random_() % some.size()];
  }

  bool flushing = false;
  std::size_t most() const { return most_; }

 private:
  Choice how_;
  std::mt19937 random_;
  std::size_t most_ = 0;
};

/// Results of a mission with its tasks in another order, with the plan of the mission or of a part.
ResultsById run_in_order_of(Chooser& chooser, const SmallMission& mission, std::optional<PlanPart> part) {
  Recording recording;
  chooser.flushing = false;
  Pipeline pipeline(mission.options, std::move(part), recording.callbacks());
  pipeline.choose = [&](const std::vector<Task>& tasks) { return chooser(tasks); };
  for (const Keyframe& keyframe : mission.keyframes) pipeline.add(keyframe);
  chooser.flushing = true;
  pipeline.flush();
  return by_id(recording);
}

}  // namespace

TEST_CASE("any order of the ready tasks gives the same bytes", "[densifier][order]") {
  for (SmallMission& mission : small_missions()) {
    const ResultsById whole = by_id(whole_run(mission));
    for (const Choice how : {Choice::kRandom, Choice::kLastStage, Choice::kLastKeyframe, Choice::kRandomStage}) {
      for (std::uint32_t seed = 0; seed < (kSanitized ? 1 : 4); ++seed) {
        if (kSanitized && how != Choice::kRandom) break;
        if (seed > 0 && (how == Choice::kLastStage || how == Choice::kLastKeyframe)) break;
        mission.options.threads = 1 + static_cast<int>(seed % 3);
        Chooser chooser(how, seed);
        INFO(mission.name << ", choice " << static_cast<int>(how) << ", seed " << seed);
        CHECK(difference(run_in_order_of(chooser, mission, std::nullopt), whole) == "");
        CHECK(chooser.most() > 2);  // several tasks were ready
      }
    }
  }
}

TEST_CASE("any order of the ready tasks of a part gives the same bytes", "[densifier][order]") {
  for (SmallMission& mission : small_missions()) {
    const Plan plan = plan_of(mission);
    const std::vector<std::int64_t> all = ids_of(mission.keyframes);
    const std::vector<std::int64_t> ids(all.begin() + 2, all.begin() + 6);
    const ResultsById part = by_id(run_part(mission, plan, ids));
    for (std::uint32_t seed = 0; seed < (kSanitized ? 1 : 3); ++seed) {
      Chooser chooser(Choice::kRandom, seed);
      INFO(mission.name << ", seed " << seed);
      CHECK(difference(run_in_order_of(chooser, mission, PlanPart(plan, ids, mission.options, Wanted::kPoints)),
                       part) == "");
    }
  }
}

TEST_CASE("tasks done in any order reach the same final state", "[densifier][order]") {
  TaskOrder order(DensifierOptions(), true);
  for (const std::int64_t keyframe : {3, 1, 0, 4}) order.mark({1, keyframe});
  CHECK(order.next(0) == 0);
  CHECK(order.next(1) == 2);
  CHECK_FALSE(order.is_done({1, 2}));
  for (const std::int64_t keyframe : {0, 1, 3, 4}) CHECK(order.is_done({1, keyframe}));
  order.mark({1, 2});
  CHECK(order.next(1) == 5);
  CHECK_FALSE(order.is_done({1, 5}));
}
