// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "plan/missions.h"
#include "synth/rng.h"
#include "workspace/step.h"

using namespace pmsp;
using namespace pmsp::test;
using namespace pmsp::workspace;

namespace {

constexpr int kFull = 5;  ///< passes of `online`

StepInputs inputs_of(const std::vector<PlanKeyframe>& keyframes, Quality quality = Quality::kOnline) {
  StepInputs inputs;
  inputs.options = preset(quality);
  inputs.width = inputs.options.width;
  inputs.options_json = "{}";
  inputs.planes_options_json = "{}";
  inputs.engine = "a machine";
  for (const PlanKeyframe& keyframe : keyframes) {
    inputs.keyframes.push_back({keyframe, "image " + std::to_string(keyframe.id), 1920, 960, ""});
  }
  return inputs;
}

std::vector<PlanKeyframe> flight(int keyframes = 60) {
  MissionRecipe recipe;
  recipe.keyframes = keyframes;
  return corridor(recipe);
}

struct Counts {
  int maps = 0, kept = 0, further = 0, anew = 0, points_kept = 0;
};

Counts count(const Step& step) {
  Counts counts;
  for (const auto& [id, it] : step.keyframes) {
    ++counts.maps;
    counts.kept += it.has_planes && it.passes == 0;
    counts.further += it.has_planes && it.passes > 0;
    counts.anew += !it.has_planes;
    counts.points_kept += it.points_kept;
  }
  return counts;
}

Record after(const StepInputs& inputs, const Record& before = {}) {
  return record_of(plan_step(before, inputs), inputs, before);
}

/// A keyframe with a depth map in the middle, used as source view of others.
std::int64_t middle(const Step& step) { return std::next(step.keyframes.begin(), step.keyframes.size() / 2)->first; }

void move(StepInputs& inputs, std::int64_t id, double by) {
  for (StepKeyframe& it : inputs.keyframes) {
    if (it.keyframe.id == id) it.keyframe.cam_from_world.translation.x() += by;
  }
}

}  // namespace

TEST_CASE("a new mission is matched as without a workspace") {
  const std::vector<PlanKeyframe> keyframes = flight();
  const StepInputs inputs = inputs_of(keyframes);
  const Step step = plan_step({}, inputs);
  CHECK(difference(step.plan, make_plan(keyframes, inputs.options)) == "");
  const Counts counts = count(step);
  CHECK(counts.maps > 20);
  CHECK(counts.anew == counts.maps);
  CHECK(counts.points_kept == 0);
  CHECK(step.reuses(kFull - 1).empty());
  for (const auto& [id, it] : step.keyframes) CHECK((it.passes == kFull && it.pose.scale == 1.0));
}

TEST_CASE("an unchanged mission keeps all results in every further step") {
  const StepInputs inputs = inputs_of(flight());
  Record record = after(inputs);
  const Plan plan = record.plan;
  for (int round = 0; round < 3; ++round) {
    const Step step = plan_step(record, inputs);
    const Counts counts = count(step);
    CHECK(counts.kept == counts.maps);
    CHECK(counts.points_kept == counts.maps);
    CHECK(difference(step.plan, plan) == "");
    record = record_of(step, inputs, record);
  }
}

TEST_CASE("steps have names that are functions of record and inputs") {
  const StepInputs inputs = inputs_of(flight());
  const Record record = after(inputs);
  CHECK(plan_step({}, inputs).name == plan_step({}, inputs).name);
  CHECK(plan_step({}, inputs).name.size() == 16);
  CHECK(plan_step(record, inputs).name != plan_step({}, inputs).name);
  StepInputs moved = inputs;
  move(moved, moved.keyframes[3].keyframe.id, 1e-9);
  CHECK(plan_step({}, moved).name != plan_step({}, inputs).name);
}

TEST_CASE("a step's name differs for any difference of its inputs") {
  const StepInputs inputs = inputs_of(flight(24));
  const std::string name = plan_step({}, inputs).name;
  for (std::string StepInputs::*field : {&StepInputs::options_json, &StepInputs::engine, &StepInputs::mask}) {
    StepInputs other = inputs;
    other.*field = R"({"other":1})";
    CHECK(plan_step({}, other).name != name);
  }
  for (bool StepInputs::*field : {&StepInputs::recompute_points, &StepInputs::growing}) {
    StepInputs other = inputs;
    other.*field = true;
    CHECK(plan_step({}, other).name != name);
  }
  StepInputs other = inputs;
  other.keyframes[5].image = "another";
  CHECK(plan_step({}, other).name != name);
  other = inputs;
  for (StepKeyframe& it : other.keyframes) it.keyframe.sharpness = {};
  CHECK(step_name({}, other) == name);  // it follows from the images
}

TEST_CASE("a moved keyframe and its viewers are refined and distant ones are kept") {
  const StepInputs inputs = inputs_of(flight());
  const Record record = after(inputs);
  const std::int64_t id = middle(plan_step({}, inputs));
  StepInputs moved = inputs;
  move(moved, id, 1e-6);
  CHECK(count(plan_step(record, moved)).kept == count(plan_step(record, moved)).maps);
  move(moved, id, 0.01);  // about half a pixel at the corridor's width
  const Step step = plan_step(record, moved);
  const Counts counts = count(step);
  CHECK(step.keyframes.at(id).passes > 0);
  CHECK(step.keyframes.at(id).has_planes);
  CHECK(step.keyframes.at(id).reason == "moved");
  CHECK((counts.further > 1 && counts.further < 12));
  CHECK(counts.anew == 0);
  CHECK(counts.points_kept > 0);
  CHECK(counts.points_kept < counts.kept);
  move(moved, id, 0.2);
  CHECK_FALSE(plan_step(record, moved).keyframes.at(id).has_planes);
}

TEST_CASE("a move too small for planes recomputes the points that see it") {
  const StepInputs inputs = inputs_of(flight());
  const Record record = after(inputs);
  const std::int64_t id = middle(plan_step({}, inputs));
  StepInputs moved = inputs;
  move(moved, id, 0.0022);  // about an eighth of a pixel
  const Step step = plan_step(record, moved);
  const Counts counts = count(step);
  CHECK(counts.kept == counts.maps);
  CHECK_FALSE(step.keyframes.at(id).points_kept);
  CHECK((counts.points_kept > 0 && counts.points_kept < counts.maps));
}

TEST_CASE("small moves accumulate against the poses that planes were computed with") {
  StepInputs inputs = inputs_of(flight());
  Record record = after(inputs);
  const std::int64_t id = middle(plan_step({}, inputs));
  int matched = 0;
  for (int round = 0; round < 12; ++round) {
    move(inputs, id, 1e-3);
    const Step step = plan_step(record, inputs);
    matched += step.keyframes.at(id).passes > 0;
    record = record_of(step, inputs, record);
  }
  CHECK((matched > 0 && matched < 6));
}

TEST_CASE("a changed image or mask or options or engine recomputes planes from scratch") {
  const StepInputs inputs = inputs_of(flight());
  const Record record = after(inputs);
  const std::int64_t id = middle(plan_step({}, inputs));
  StepInputs changed = inputs;
  for (StepKeyframe& it : changed.keyframes) {
    if (it.keyframe.id == id) it.image = "another";
  }
  const Step step = plan_step(record, changed);
  CHECK(step.keyframes.at(id).reason == "its image has changed");
  CHECK((count(step).anew > 1 && count(step).anew < 8));
  CHECK(count(step).kept == count(step).maps - count(step).anew);
  for (std::string StepInputs::*field : {&StepInputs::planes_options_json, &StepInputs::mask, &StepInputs::engine}) {
    StepInputs other = inputs;
    other.*field = R"({"other":1})";
    CHECK(count(plan_step(record, other)).anew == count(plan_step(record, other)).maps);
  }
  StepInputs points_only = inputs;
  points_only.options_json = R"({"other":1})";
  CHECK(count(plan_step(record, points_only)).kept == count(plan_step(record, points_only)).maps);
  CHECK(count(plan_step(record, points_only)).points_kept == 0);
  StepInputs again = inputs;
  again.recompute_points = true;
  CHECK(count(plan_step(record, again)).points_kept == 0);
}

TEST_CASE("a growing mission computes only its end with fewer passes for the newest keyframes") {
  const std::vector<PlanKeyframe> keyframes = flight(90);
  Record record;
  int passes = 0;
  for (const std::size_t until : {50, 60, 70, 80, 90}) {
    StepInputs inputs = inputs_of({keyframes.begin(), keyframes.begin() + static_cast<std::ptrdiff_t>(until)});
    inputs.growing = until > 50;
    const Step step = plan_step(record, inputs);
    const Counts counts = count(step);
    CHECK((step.unfinished > 0) == inputs.growing);
    if (until > 50) {
      CHECK(counts.anew + counts.further < 36);
      CHECK(counts.points_kept > counts.maps / 2);
      CHECK(step.keyframes.rbegin()->second.passes < kFull);
    }
    for (const auto& [id, it] : step.keyframes) passes += it.passes;
    record = record_of(step, inputs, record);
  }
  const StepInputs all = inputs_of(keyframes);
  const Step end = plan_step(record, all);
  CHECK(end.unfinished == 0);
  for (const auto& [id, it] : end.keyframes) passes += it.passes;
  record = record_of(end, all, record);
  CHECK(passes < 1.2 * kFull * static_cast<double>(end.keyframes.size()));
  const Step last = plan_step(record, all);
  for (const auto& [id, it] : last.keyframes) {
    INFO(id << " " << it.reason);
    CHECK(it.passes == 0);
  }
}

TEST_CASE("in a growing mission each pass has the source depth maps of a full run and runs once") {
  const std::vector<PlanKeyframe> keyframes = flight(90);
  for (const Quality quality : {Quality::kOnline, Quality::kNormal, Quality::kHigh}) {
    const int full = preset(quality).advanced.patchmatch.geometric_passes + 1;
    Record record;
    int continued = 0;
    for (const std::size_t until : {40, 50, 60, 66, 70, 80, 90, 90}) {
      StepInputs inputs =
          inputs_of({keyframes.begin(), keyframes.begin() + static_cast<std::ptrdiff_t>(until)}, quality);
      inputs.growing = until != keyframes.size() || record.keyframes.size() != until;
      const Step step = plan_step(record, inputs);
      record = record_of(step, inputs, record);
      for (const PlanEntry& entry : step.plan.entries) {
        if (!entry.has_depth_map() || step.keyframes.at(entry.id).passes == 0) continue;
        const auto& it = step.keyframes.at(entry.id);
        const int had = record.keyframes.at(entry.id).planes->passes;
        CAPTURE(static_cast<int>(quality), until, entry.id, it.reason, had);
        if (it.reason == "had too few passes" && it.passes < had) {
          CHECK(had == full);  // a run counts the passes that continue from its last one
          ++continued;
        }
        for (const std::int64_t id : entry.near) {
          if (step.keyframes.count(id) != 0) CHECK(record.keyframes.at(id).planes->passes >= had - 1);
        }
      }
    }
    CHECK(continued > 0);
  }
}

TEST_CASE("in a growing mission small moves of the newest keyframes wait until these are matched again") {
  StepInputs inputs = inputs_of(flight());
  inputs.growing = true;
  const Step first = plan_step({}, inputs);
  const Record record = record_of(first, inputs, {});
  const std::int64_t newest = first.keyframes.rbegin()->first;
  const std::int64_t oldest = first.keyframes.begin()->first;
  CHECK(first.keyframes.at(newest).passes < kFull);
  CHECK(first.keyframes.at(oldest).passes == kFull);
  for (const std::int64_t id : {newest, oldest}) move(inputs, id, 0.01);  // about half a pixel at the corridor's width
  const Step moved = plan_step(record, inputs);
  CHECK(moved.keyframes.at(newest).passes == 0);
  CHECK(moved.keyframes.at(oldest).reason == "moved");
  inputs.growing = false;
  const Step end = plan_step(record, inputs);
  CHECK(end.keyframes.at(newest).reason == "had too few passes");
  CHECK_FALSE(end.keyframes.at(newest).has_planes);
  CHECK(end.keyframes.at(newest).passes == kFull);
}

TEST_CASE("in a growing mission the newest keyframes keep planes until their neighbours are stable") {
  const std::vector<PlanKeyframe> keyframes = flight(46);
  const Record record = after(inputs_of({keyframes.begin(), keyframes.begin() + 40}));
  StepInputs inputs = inputs_of(keyframes);
  inputs.options_json = R"({"other":1})";  // no preference for the previous plan
  const Step end = plan_step(record, inputs);
  inputs.growing = true;
  const Step grown = plan_step(record, inputs);
  int waiting = 0;
  for (const auto& [id, it] : end.keyframes) {
    if (it.reason != "other neighbours") continue;
    ++waiting;
    CHECK(grown.keyframes.at(id).passes == 0);
  }
  CHECK(waiting > 0);
}

TEST_CASE("a growing mission prefers decisions of the previous plan and ends with the plan of a run") {
  StepInputs inputs = inputs_of(flight());
  const Record record = after(inputs);
  std::vector<PlanKeyframe> moved;
  for (StepKeyframe& it : inputs.keyframes) {
    move(inputs, it.keyframe.id, 0.02 * std::sin(7.0 * static_cast<double>(moved.size())));
    moved.push_back(it.keyframe);
  }
  const Plan of_a_run = make_plan(moved, inputs.options);
  REQUIRE(difference(of_a_run, record.plan) != "");
  CHECK(difference(plan_step(record, inputs).plan, of_a_run) == "");
  inputs.growing = true;
  CHECK(difference(plan_step(record, inputs).plan, of_a_run) != "");
}

TEST_CASE("keyframes removed from the map are removed from the record") {
  std::vector<PlanKeyframe> keyframes = flight();
  const StepInputs inputs = inputs_of(keyframes);
  const Record record = after(inputs);
  const std::int64_t id = middle(plan_step({}, inputs));
  keyframes.erase(std::find_if(keyframes.begin(), keyframes.end(), [&](const auto& it) { return it.id == id; }));
  const StepInputs without = inputs_of(keyframes);
  const Step step = plan_step(record, without);
  CHECK(step.keyframes.count(id) == 0);
  CHECK(count(step).further > 0);
  CHECK(after(without, record).keyframes.count(id) == 0);
}

TEST_CASE("a loop closure's similarity is recovered and applied to planes") {
  constexpr double kScale = 1.3;
  const std::vector<PlanKeyframe> keyframes = flight(80);
  const StepInputs inputs = inputs_of(keyframes);
  const Record record = after(inputs);
  std::vector<PlanKeyframe> closed = keyframes;
  const Eigen::Vector3d fixed = closed[40].cam_from_world.center();
  for (std::size_t i = 41; i < closed.size(); ++i) {
    const Eigen::Vector3d center = fixed + kScale * (closed[i].cam_from_world.center() - fixed);
    closed[i].cam_from_world.translation = -(closed[i].cam_from_world.rotation * center);
    for (Landmark& at : closed[i].landmarks) at.position_world = fixed + kScale * (at.position_world - fixed);
  }
  const StepInputs now = inputs_of(closed);
  const Step step = plan_step(record, now);
  int kept = 0;
  for (std::size_t i = 55; i < 75; ++i) {
    const auto it = step.keyframes.find(closed[i].id);
    if (it == step.keyframes.end()) continue;
    CHECK(std::abs(it->second.pose.scale / kScale - 1.0) < 1e-3);
    CHECK(it->second.passes == 0);
    ++kept;
  }
  CHECK(kept > 5);
  const Step next = plan_step(record_of(step, now, record), now);
  CHECK(count(next).anew == 0);
}

TEST_CASE("a keyframe with unchanged landmark ranges keeps its scale under pose noise") {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    StepInputs inputs = inputs_of(flight(24));
    inputs.growing = true;
    const Record record = after(inputs);
    std::uint64_t counter = 0;
    for (StepKeyframe& it : inputs.keyframes) {
      for (int k = 0; k < 3; ++k) {
        it.keyframe.cam_from_world.translation[k] += 0.008 * synth::gaussian(seed, counter++);
      }
    }
    for (const auto& [id, it] : plan_step(record, inputs).keyframes) {
      CAPTURE(seed, id);
      CHECK(it.pose.scale == Approx(1.0).margin(0.005));
    }
  }
}
