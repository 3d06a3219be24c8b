// SPDX-License-Identifier: BSD-2-Clause
#include "workspace/step.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <unordered_map>
#include <utility>

#include "plan/halo.h"
#include "plan/moves.h"
#include "plan/planner.h"
#include "plan/reach.h"
#include "plan/scale_recovery.h"
#include "util/median_of.h"
#include "workspace/fingerprint.h"

namespace pmsp::workspace {
namespace {

void add(Fingerprint& to, const RigidTransform& pose) {
  to.add(pose.rotation.data(), 9 * sizeof(double)).add(pose.translation.data(), 3 * sizeof(double));
}

void add(Fingerprint& to, const StepKeyframe& it) {
  to.add(it.keyframe.id).add(it.image);
  add(to, it.keyframe.cam_from_world);
  to.add(it.keyframe.landmarks.size());
  for (const Landmark& landmark : it.keyframe.landmarks) {
    to.add(landmark.id).add(landmark.position_world.data(), 3 * sizeof(double));
  }
}

void add(Fingerprint& to, const std::vector<std::int64_t>& ids) {
  to.add(ids.size()).add(ids.data(), ids.size() * sizeof(std::int64_t));
}

/// While a mission grows, the newest kStable used keyframes get kUnstablePasses passes only and are matched again
/// later. For older ones the number of passes increases in steps of the reach of source views, up to all: then each
/// pass has the same inputs as in a run of the whole mission, and none is repeated.
constexpr int kStable = 12;
constexpr int kUnstablePasses = 1;
/// Minimum number of keyframes due for all passes before these are made.
constexpr int kBatch = 6;
/// Passes after a move, the first of them photometric.
constexpr int kMovedPasses = 3;

/// Returns the ranges of all landmarks or, if many, of every fourth by id, so that steps select the same ones.
std::vector<RecordedRange> ranges_of(const PlanKeyframe& keyframe) {
  constexpr std::size_t kMany = 128;
  constexpr std::int64_t kStride = 4;
  std::vector<RecordedRange> ranges;
  for (const Landmark& landmark : keyframe.landmarks) {
    if (keyframe.landmarks.size() > kMany && landmark.id % kStride != 0) continue;
    const double range = (keyframe.cam_from_world * landmark.position_world).norm();
    if (std::isfinite(range)) ranges.push_back({landmark.id, range});
  }
  std::sort(ranges.begin(), ranges.end(),
            [](const RecordedRange& a, const RecordedRange& b) { return a.landmark < b.landmark; });
  return ranges;
}

class StepPlanner {
 public:
  StepPlanner(const Record& record, const StepInputs& inputs) : record_(record), inputs_(inputs) {
    for (const StepKeyframe& it : inputs.keyframes) now_.emplace(it.keyframe.id, &it);
    find_poses();
  }

  Step plan() {
    Step step;
    step.name = step_name(record_, inputs_);
    const bool grows = inputs_.growing && record_.options == inputs_.options_json;  // else as without a record
    step.ranges = std::move(landmark_ranges_);
    Planner planner(inputs_.options, grows ? &record_.plan : nullptr);  // releases landmarks of long missions
    for (const StepKeyframe& it : inputs_.keyframes) planner.add(it.keyframe);
    planner.finish();
    step.plan.entries.assign(planner.entries().begin(), planner.entries().end());
    if (inputs_.growing) choose_passes_due(step.plan);
    for (const PlanEntry& entry : step.plan.entries) {
      if (entry.has_depth_map()) plan_planes(step, entry);
    }
    const PointsHalo halo(step.plan, inputs_.options);
    for (const PlanEntry& entry : step.plan.entries) {
      if (entry.has_depth_map()) plan_points(step, halo, entry.id);
    }
    return step;
  }

 private:
  const RecordedKeyframe* recorded(std::int64_t id) const {
    const auto found = record_.keyframes.find(id);
    return found == record_.keyframes.end() ? nullptr : &found->second;
  }

  /// Sets current poses, with the scales of existing planes.
  void find_poses() {
    std::vector<MovedKeyframe> moved;
    std::vector<std::int64_t> ids;
    bool any = false;
    for (const StepKeyframe& it : inputs_.keyframes) {
      const PlanKeyframe& keyframe = it.keyframe;
      poses_[keyframe.id] = {keyframe.cam_from_world, 1.0};
      std::vector<double> ranges;
      for (const Landmark& landmark : keyframe.landmarks) {
        ranges.push_back((keyframe.cam_from_world * landmark.position_world).norm());
      }
      ranges_[keyframe.id] = ranges.empty() ? 0.0 : median(ranges);
      const std::vector<RecordedRange>& now = landmark_ranges_[keyframe.id] = ranges_of(keyframe);
      const RecordedKeyframe* const before = recorded(keyframe.id);
      if (before == nullptr) continue;
      moved.push_back({before->pose, keyframe.cam_from_world, {}, {}, 0});
      compare_ranges(before->ranges, now, moved.back());
      ids.push_back(keyframe.id);
      any = any || before->pose.scale != 1.0 ||
            before->pose.cam_from_world.translation != keyframe.cam_from_world.translation;
    }
    if (!any) return;
    const std::vector<double> scales = recover_scales(moved);
    for (std::size_t i = 0; i < ids.size(); ++i) poses_[ids[i]].scale = scales[i];
  }

  /// Returns the displacement of one keyframe's view in the other: in its image or, to compare results, also in its
  /// unit.
  double moved_by(std::int64_t id, const KeyframePose& then, KeyframePose then_other, std::int64_t other,
                  bool in_image) const {
    const KeyframePose& pose = poses_.at(id);
    KeyframePose pose_other = poses_.at(other);
    if (in_image) {
      then_other.scale = then.scale;
      pose_other.scale = pose.scale;
    }
    return moved_px({then_other, then}, {pose_other, pose}, ranges_.at(id) / pose.scale, inputs_.width);
  }

  void plan_planes(Step& step, const PlanEntry& entry) {
    StepKeyframePlan& it = step.keyframes[entry.id];
    it.own = planes_inputs(inputs_, now_.at(entry.id)->image);
    choose_passes(entry, it);
    it.pose = poses_.at(entry.id);
    if (!it.has_planes) it.pose.scale = poses_[entry.id].scale = 1.0;
    const int had = it.has_planes ? recorded(entry.id)->planes->passes : 0;
    step.unfinished += had + it.passes < full_passes();
    it.planes_file = it.passes == 0 ? recorded(entry.id)->planes->file : planes_name(entry.id, step.name);
  }

  /// Selects the number of passes of a keyframe and their start.
  void choose_passes(const PlanEntry& entry, StepKeyframePlan& it) const {
    const int full = full_passes();
    const auto found = passes_due_.find(entry.id);
    const int due = found == passes_due_.end() ? full : found->second;
    const auto anew = [&](const char* why) {
      it.reason = why;
      it.passes = due;
    };
    const auto further = [&](const char* why, int passes, bool photometric_first) {
      if (full < 3) return anew(why);
      it.reason = why;
      it.has_planes = true;
      it.passes = std::min(passes, full - 1);
      it.photometric_first = photometric_first;
    };
    const RecordedKeyframe* const before = recorded(entry.id);
    if (before == nullptr) return anew("new");
    if (!before->planes) return anew("had no depth map");
    if (before->image != now_.at(entry.id)->image) return anew("its image has changed");
    if (before->planes->own != it.own) return anew("options, mask or engine have changed");
    const int had = before->planes->passes;
    const bool stable = due > kUnstablePasses || full == kUnstablePasses;
    if (had < due && had <= kUnstablePasses) return anew("had too few passes");
    double most = 0.0;
    std::set<std::int64_t> then;
    for (const RecordedSource& source : before->planes->sources) {
      then.insert(source.id);
      const auto now = now_.find(source.id);
      if (now == now_.end()) continue;
      if (now->second->image != source.image) return anew("a neighbour's image has changed");
      most = std::max(most, moved_by(entry.id, before->planes->pose, source.pose, source.id, true));
    }
    if (!(most <= kMovedMove)) return anew("moved far");
    if (most > (stable ? kKeptMove : kUnstableMove)) {
      return had < full ? anew("moved") : further("moved", kMovedPasses, true);
    }
    if (had < due) return further("had too few passes", due - had, false);
    const bool has_others = std::set<std::int64_t>(entry.near.begin(), entry.near.end()) != then;
    if (had >= full && stable && has_others) return further("other neighbours", 1, false);
    it.has_planes = true;
  }

  int full_passes() const { return inputs_.options.advanced.patchmatch.geometric_passes + 1; }

  int passes_had(std::int64_t id) const {
    const RecordedKeyframe* const before = recorded(id);
    return before != nullptr && before->planes ? before->planes->passes : 0;
  }

  /// Sets the number of passes due while more keyframes will follow: source views and poses of the newest keyframes are
  /// not final.
  void choose_passes_due(const Plan& plan) {
    const int full = full_passes();
    const int stair = static_cast<int>(std::max<std::int64_t>(plan_reach(inputs_.options).near, 1));
    int newer = 0;
    int waiting = 0;
    for (auto entry = plan.entries.rbegin(); entry != plan.entries.rend(); ++entry) {
      const int due = newer < kStable ? kUnstablePasses : kUnstablePasses + 1 + (newer - kStable) / stair;
      passes_due_[entry->id] = std::min(due, full);
      waiting += entry->has_depth_map() && due >= full && passes_had(entry->id) < full;
      newer += entry->used();
    }
    // Keyframes with some passes get the rest at once: a run counts passes from its last one (pass_range).
    if (waiting >= std::max(kBatch, (full - 2) * stair)) return;
    for (auto& [id, due] : passes_due_) due = std::min(due, std::max(passes_had(id), kUnstablePasses));
  }

  void plan_points(Step& step, const PointsHalo& halo, std::int64_t id) {
    StepKeyframePlan& it = step.keyframes.at(id);
    it.required_planes = halo.planes_of(id);
    Fingerprint inputs;
    inputs.add(inputs_.options_json).add(inputs_.engine);
    for (const std::int64_t other : it.required_planes) {
      const PlanEntry& lists = halo.entry(other);
      inputs.add(other).add(step.keyframes.at(other).planes_file);
      for (const auto* list : {&lists.consistency, &lists.fusion, &lists.viewers, &lists.duplicate_views})
        add(inputs, *list);
    }
    it.points_inputs = inputs.text();
    it.points_kept = can_keep_points(id, it);
    it.points_file = it.points_kept ? recorded(id)->points->file : std::to_string(id) + "-" + step.name;
  }

  bool can_keep_points(std::int64_t id, const StepKeyframePlan& it) const {
    const RecordedKeyframe* const before = recorded(id);
    if (inputs_.recompute_points || before == nullptr || !before->points) return false;
    if (before->points->inputs != it.points_inputs) return false;
    const auto poses = record_.poses.find(before->points->step);
    if (poses == record_.poses.end()) return false;
    const auto own = poses->second.find(id);
    return own != poses->second.end() &&
           std::all_of(it.required_planes.begin(), it.required_planes.end(), [&](std::int64_t other) {
             const auto then = poses->second.find(other);
             return then != poses->second.end() && moved_by(id, own->second, then->second, other, false) <= kPointsMove;
           });
  }

  const Record& record_;
  const StepInputs& inputs_;
  std::unordered_map<std::int64_t, const StepKeyframe*> now_;
  std::unordered_map<std::int64_t, KeyframePose> poses_;
  std::unordered_map<std::int64_t, int> passes_due_;  ///< number of passes by id, while the mission grows
  std::unordered_map<std::int64_t, double> ranges_;   ///< median distance of the landmarks [map units]
  std::map<std::int64_t, std::vector<RecordedRange>> landmark_ranges_;
};

}  // namespace

std::map<std::int64_t, PlaneReuse> Step::reuses(int passes) const {
  std::map<std::int64_t, PlaneReuse> result;
  for (const auto& [id, it] : keyframes) {
    if (it.has_planes) result[id] = {PlaneReuse::Planes::kStart, it.passes, it.photometric_first};
    if (!it.has_planes && it.passes <= passes) result[id] = {PlaneReuse::Planes::kNone, it.passes, false};
  }
  return result;
}

/// The content of a record follows from its step, except for files deleted since.
std::string step_name(const Record& record, const StepInputs& inputs) {
  Fingerprint name;
  name.add(record.step).add(record.keyframes.size());
  for (const auto& [id, keyframe] : record.keyframes) {
    name.add(id).add(keyframe.planes ? keyframe.planes->file : "").add(keyframe.points ? keyframe.points->file : "");
  }
  name.add(inputs.options_json).add(inputs.engine).add(inputs.mask);
  name.add(inputs.recompute_points).add(inputs.growing);
  for (const StepKeyframe& it : inputs.keyframes) add(name, it);
  return name.text().substr(0, 16);
}

std::string planes_name(std::int64_t keyframe_id, const std::string& step) {
  return std::to_string(keyframe_id) + "-" + step;
}

std::string planes_inputs(const StepInputs& inputs, const std::string& image) {
  Fingerprint own;
  own.add(inputs.planes_options_json).add(inputs.engine).add(inputs.mask).add(image);
  return own.text();
}

Record record_of_begun(const std::string& step, const StepInputs& inputs) {
  Record record;
  record.step = step;
  record.engine = inputs.engine;
  record.options = inputs.options_json;
  for (const StepKeyframe& it : inputs.keyframes) {
    RecordedKeyframe& keyframe = record.keyframes[it.keyframe.id];
    keyframe.image = it.image;
    const bool is_known = it.width > 0;  // else the image was not read beforehand
    keyframe.width = is_known ? it.width : inputs.width;
    keyframe.height = is_known ? it.height : inputs.width / 2;
    keyframe.pose = {it.keyframe.cam_from_world, 1.0};
    keyframe.planes =
        RecordedPlanes{planes_name(it.keyframe.id, step), planes_inputs(inputs, it.image), 1, keyframe.pose, {}};
  }
  return record;
}

Step plan_step(const Record& record, const StepInputs& inputs) { return StepPlanner(record, inputs).plan(); }

Record record_of(const Step& step, const StepInputs& inputs, const Record& record) {
  Record result;
  result.step = step.name;
  result.engine = inputs.engine;
  result.options = inputs.options_json;
  result.lenses_looked_at = record.lenses_looked_at;
  result.map = record.map;
  result.images = record.images;
  result.outputs = record.outputs;
  result.plan = step.plan;
  std::unordered_map<std::int64_t, const StepKeyframe*> now;
  for (const StepKeyframe& it : inputs.keyframes) {
    now.emplace(it.keyframe.id, &it);
    RecordedKeyframe& keyframe = result.keyframes[it.keyframe.id];
    keyframe.image = it.image;
    keyframe.width = it.width;
    keyframe.height = it.height;
    keyframe.looked_for = it.looked_for;
    keyframe.sharpness = it.keyframe.sharpness;
    keyframe.pose = {it.keyframe.cam_from_world, 1.0};
    keyframe.ranges = step.ranges.at(it.keyframe.id);
  }
  for (const PlanEntry& entry : step.plan.entries) {
    const auto planned = step.keyframes.find(entry.id);
    if (planned == step.keyframes.end()) continue;
    const StepKeyframePlan& it = planned->second;
    RecordedKeyframe& keyframe = result.keyframes.at(entry.id);
    keyframe.pose = it.pose;
    const auto before = record.keyframes.find(entry.id);
    if (it.has_planes) keyframe.planes = before->second.planes;
    if (it.passes > 0) {
      RecordedPlanes planes{
          it.planes_file, it.own, it.passes + (it.has_planes ? keyframe.planes->passes : 0), it.pose, {}};
      for (const std::int64_t id : entry.near) {
        const auto source = step.keyframes.find(id);
        const StepKeyframe& its = *now.at(id);
        const KeyframePose pose =
            source != step.keyframes.end() ? source->second.pose : KeyframePose{its.keyframe.cam_from_world, 1.0};
        planes.sources.push_back({id, its.image, pose});
      }
      keyframe.planes = std::move(planes);
    }
    if (it.points_kept) {
      keyframe.points = before->second.points;
      const auto& poses = record.poses.at(keyframe.points->step);
      for (const std::int64_t id : it.required_planes) result.poses[keyframe.points->step][id] = poses.at(id);
      result.poses[keyframe.points->step][entry.id] = poses.at(entry.id);
    } else {
      keyframe.points = RecordedPoints{it.points_file, it.points_inputs, step.name};
      for (const std::int64_t id : it.required_planes) result.poses[step.name][id] = step.keyframes.at(id).pose;
      result.poses[step.name][entry.id] = it.pose;
    }
  }
  return result;
}

}  // namespace pmsp::workspace
