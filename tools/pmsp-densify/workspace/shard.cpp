// SPDX-License-Identifier: BSD-2-Clause
#include "shard.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <exception>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "calibration.h"
#include "disk_space.h"
#include "exit_code.h"
#include "export/files.h"
#include "mission_input.h"
#include "numbers.h"
#include "options.h"
#include "plan/plan.h"
#include "planned_densifier.h"
#include "pmsp/error.h"
#include "pmsp/io/map.h"
#include "pmsp/stages.h"
#include "process.h"
#include "progress.h"
#include "shared_step.h"
#include "tool_files.h"
#include "verbs.h"
#include "workspace/fingerprint.h"
#include "workspace_step.h"

namespace pmsp::tool {
namespace {

std::optional<int> number_in_environment(const char* name) {
  const char* const text = std::getenv(name);
  return text == nullptr ? std::nullopt : number_from<int>(text);
}

/// Array tasks may be numbered from any minimum in any steps.
workspace::Shard shard_of_array_task(const std::string& option) {
  const auto id = number_in_environment("SLURM_ARRAY_TASK_ID");
  const auto count = number_in_environment("SLURM_ARRAY_TASK_COUNT");
  if (!id || !count) {
    throw UsageError(
        option +
        " auto: SLURM_ARRAY_TASK_ID or SLURM_ARRAY_TASK_COUNT is not set to a number; expected a job array "
        "(sbatch --array=0-6), or " +
        option + " K/N");
  }
  const int first = number_in_environment("SLURM_ARRAY_TASK_MIN").value_or(0);
  const int step = number_in_environment("SLURM_ARRAY_TASK_STEP").value_or(1);
  const workspace::Shard shard{step > 0 ? (*id - first) / step : -1, *count};
  if (shard.index >= 0 && shard.index < shard.count) return shard;
  throw UsageError(option + " auto: task " + std::to_string(*id) + " of an array of " + std::to_string(*count) +
                   " that begins at " + std::to_string(first) +
                   " is none of them; expected tasks without gaps (sbatch --array=0-6), or " + option + " K/N");
}

workspace::Wave wave_from(const std::string& text) {
  for (const workspace::Wave wave : {workspace::Wave::kPlanes, workspace::Wave::kPoints}) {
    if (text == name_of(wave)) return wave;
  }
  throw UsageError("--wave is \"" + text + "\"; expected planes or points");
}

}  // namespace

workspace::Shard shard_from(const std::string& text, const std::string& option) {
  if (text == "auto") return shard_of_array_task(option);
  const std::size_t slash = text.find('/');
  if (slash != std::string::npos) {
    const auto index = number_from<int>(text.substr(0, slash));
    const auto count = number_from<int>(text.substr(slash + 1));
    constexpr int kMost = 1000000;
    if (index && count && *index >= 0 && *index < *count && *count <= kMost) return {*index, *count};
  }
  throw UsageError(option + " is \"" + text + "\"; expected K/N, from 0/N to N-1/N, such as 2/7, or auto");
}

void add_shard_options(CLI::App& run, Arguments& a) {
  const char* group = "Shards";
  run.add_option_function<std::string>(
         "--shard", [&a](const std::string& text) { a.shard = shard_from(text, "--shard"); },
         "With --workspace: compute one of N shares of the mission, number K from 0, without a cloud; `merge` joins "
         "them. auto: K and N of this task of a SLURM job array")
      ->type_name("K/N")
      ->group(group);
  run.add_option_function<std::string>(
         "--wave", [&a](const std::string& text) { a.wave = wave_from(text); },
         "With --shard: only planes, or only points, which need the planes of other shards [planes or points; default: "
         "both, with missing planes of other shards]")
      ->type_name("WAVE")
      ->group(group);
}

void check_shard(Arguments& a, bool names_output) {
  if (!a.shard) {
    if (a.wave) throw UsageError("--wave needs --shard K/N");
    return;
  }
  if (a.workspace.empty()) throw UsageError("--shard needs --workspace DIR, which all shards share");
  if (a.follow) throw UsageError("--shard and --follow exclude each other");
  if (a.growing) throw UsageError("--shard and --growing exclude each other");
  if (a.delete_workspace) throw UsageError("--shard and --delete-workspace exclude each other: merge needs it");
  if (names_output || !a.depth_maps.empty() || !a.preview.empty() || !a.report.path.empty() ||
      a.cloud.double_positions) {
    throw UsageError(
        "a shard writes no cloud, depth maps, pictures or report; leave --output, --double, --depth-maps, "
        "--preview and --report out, and merge the shards: pmsp-densify merge " +
        a.workspace.string() + " -o cloud.ply");
  }
  a.cloud.paths.clear();
}

namespace {

using Clock = std::chrono::steady_clock;
using workspace::ShardMarker;
using workspace::Wave;
using Ids = std::vector<std::int64_t>;

/// Version, build type, compiler and, if readable, fingerprint of this program.
std::string build_text() {
  std::string text = version_text() + ", " + PMSP_BUILD_TYPE;
#if defined(__clang__)
  text += ", Clang " __clang_version__;
#elif defined(__GNUC__)
  text += ", GCC " __VERSION__;
#endif
  try {
    text += ", " + workspace::fingerprint_of_file("/proc/self/exe").substr(0, 16);
  } catch (const IoError&) {  // system without that file
  }
  return text;
}

/// Result of a wave.
struct WaveReport {
  std::int64_t keyframes = 0, made = 0, found = 0;
  Ids without;
  double seconds = 0.0;
};

/// One shard of a mission, from images to files of the workspace.
class ShardRun {
 public:
  ShardRun(const Arguments& arguments, const DensifierOptions& options, workspace::Workspace& workspace)
      : arguments_(arguments),
        options_(options),
        workspace_(workspace),
        shard_(*arguments.shard),
        build_(build_text()),
        wave_(arguments.wave.value_or(Wave::kPlanes)),
        progress_(arguments.progress, arguments.quiet, arguments.verbose) {}

  void operator()() {
    try {
      work();
    } catch (const std::exception& error) {
      leave_reason(error.what());
      throw;
    }
  }

 private:
  void work() {
    input_.read_map();
    input_.open_prior_depths();
    input_.open_images();
    input_.check_poses();
    input_.announce();
    const Calibration calibration =  // the same for all shards, from the same images
        calibrate(arguments_, options_, map_, *input_.images, *input_.masks, false, workspace_.record());
    options_.advanced.expected_keyframes = static_cast<std::int64_t>(input_.images->keyframe_ids().size());
    options_.lens_distance = calibration.lens_distance;
    input_.masks->set_rig(calibration.rig.mask);
    for (const std::string& text : describe(calibration)) progress_.message(text);
    step_ = std::make_unique<WorkspaceStep>(workspace_, arguments_, options_, map_, calibration.rig, false, nullptr);
    const std::optional<workspace::ShardJob> before = workspace_.shards().job(workspace_.record().step);
    if (before) require_same(*before);
    look(!before);
    step_->decide();
    require_same(workspace_.shards().post(my_job()));
    const std::string warning =
        disk_warning(arguments_, map_, *input_.images, step_->step().plan, options_, share_to_make(step_->step()));
    if (!warning.empty()) progress_.warning(warning);
    step_->begin();
    for (const PlanEntry& entry : step_->step().plan.entries) {
      if (entry.has_depth_map()) depth_maps_.push_back(entry.id);
    }
    const workspace::IdRange stretch = id_range_of(shard_, depth_maps_.size());
    mine_.assign(depth_maps_.begin() + static_cast<std::ptrdiff_t>(stretch.first),
                 depth_maps_.begin() + static_cast<std::ptrdiff_t>(stretch.last));
    nlohmann::ordered_json waves = nlohmann::ordered_json::object();
    for (const Wave wave : {Wave::kPlanes, Wave::kPoints}) {
      if (arguments_.wave && *arguments_.wave != wave) continue;
      wave_ = wave;
      const Clock::time_point start = Clock::now();
      WaveReport report = wave == Wave::kPlanes ? make_planes() : make_points();
      workspace_.wait_until_saved();
      report.seconds = seconds_since(start);
      workspace_.shards().mark(marker(report));
      tell(report);
      waves[name_of(wave)] = {{"keyframes", report.keyframes},
                              {"made", report.made},
                              {"found", report.found},
                              {"without", report.without.size()},
                              {"seconds", report.seconds}};
    }
    if (input_.prior_depths.wanted()) progress_.message(input_.prior_depths.summary());
    finish(waves);
  }

  // --- before the plan -----------------------------------------------------------------------------------------------

  workspace::ShardJob my_job() const {
    workspace::ShardJob job = shared_job(arguments_, options_, workspace_);
    job.count = shard_.count;
    job.step = step_->step().name;
    job.engine = step_->inputs().engine;
    job.build = build_;
    return job;
  }

  void require_same(const workspace::ShardJob& job) const {
    const std::string other = workspace::difference(my_job(), job);
    if (other.empty()) return;
    throw InvalidInput(arguments_.workspace.string() + ": shard " + text_of(shard_) +
                       " does not match the others: " + other +
                       "; run it with equal inputs, or in another workspace (for another number of shards, delete " +
                       workspace_.shards().path().string() + ")");
  }

  /// Reads new images: first this shard's part, then those of others from the end, so that concurrent shards read each
  /// image about once. `is_first`: no shard has published the step yet.
  void look(bool is_first) {
    std::vector<SkippedKeyframe> unreadable;
    fresh_ = step_->new_images(*input_.images, unreadable);
    if (is_first) step_->refuse_losses();
    for (const SkippedKeyframe& skipped : input_.images->skipped()) skipped_.insert(skipped.keyframe_id);
    for (const SkippedKeyframe& skipped : unreadable) skip(skipped);
    if (fresh_.empty()) return;
    progress_.stage("reading up to " + std::to_string(fresh_.size()) + " new images");
    const InterruptGuard guard(nullptr);
    const Ids& all = input_.images->keyframe_ids();  // the same for all shards
    for (int turn = 0; turn < shard_.count; ++turn) {
      const workspace::IdRange stretch =
          workspace::id_range_of({(shard_.index + turn) % shard_.count, shard_.count}, all.size());
      std::size_t first = stretch.first, last = stretch.last;
      while (first < last) {
        // Videos are read from their beginning each time.
        const std::size_t number = arguments_.video.empty() ? std::min(kLookedAtOnce, last - first) : last - first;
        const std::size_t begin = turn == 0 ? first : last - number;
        add_image({all.begin() + static_cast<std::ptrdiff_t>(begin),
                   all.begin() + static_cast<std::ptrdiff_t>(begin + number)},
                  guard);
        if (turn == 0) first += number;
        if (turn != 0) last -= number;
      }
    }
    if (readable_ == 0 && !first_error_.empty() && fresh_.size() == input_.images->keyframe_ids().size()) {
      throw IoError("no image can be read; the first one: " + first_error_);
    }
  }

  /// Reads some consecutive images. They are verified among themselves, since their neighbours may be read by other
  /// shards.
  void add_image(const Ids& ids, const InterruptGuard& guard) {
    std::set<std::int64_t> wanted;
    for (const std::int64_t id : ids) {
      if (fresh_.count(id) == 0) continue;
      const bool is_known = step_->find_image_record(id);
      readable_ += is_known;
      if (!is_known) wanted.insert(id);
    }
    if (wanted.empty()) return;
    const std::unique_ptr<PairingVerifier> verifier = input_.verifier();
    const std::unique_ptr<ImageSource> images = input_.images->reopen();
    images->restrict_to(wanted);
    const auto lost = [this](const SkippedKeyframe& skipped) {
      if (first_error_.empty()) first_error_ = skipped.reason;
      skip(skipped);
    };
    const auto look = [&](std::size_t, const Keyframe& keyframe) {
      step_->add_image(keyframe);
      step_->save_image_record(keyframe.id);
      ++readable_;
    };
    io::ImageReader reader(*images, map_, input_.threads(), verifier.get());
    const io::ImageLoop::End end = io::ImageLoop{reader, look, lost, [&guard] { guard.check(); }}();
    const std::string warning = end.pairing ? io::warning_of(*end.pairing, false) : "";
    if (!warning.empty()) progress_.warning(warning);
  }

  void skip(const SkippedKeyframe& skipped) {
    if (!skipped_.insert(skipped.keyframe_id).second) return;
    progress_.skipped(skipped);
  }

  // --- waves ---------------------------------------------------------------------------------------------------------

  WaveReport make_planes() {
    Ids missing;
    for (const std::int64_t id : mine_) {
      if (!step_->has_planes(id)) missing.push_back(id);
    }
    return make(missing, [&](const auto& made) { return step_->planes_densifier(missing, made); });
  }

  WaveReport make_points() {
    Ids missing;
    for (const std::int64_t id : mine_) {
      if (!step_->has_points(id)) missing.push_back(id);
    }
    const SharedStep shared(*step_, workspace_.shards().markers(), shard_.count);
    const Ids lacking = step_->planes_lacking(missing, shared.without(Wave::kPlanes));
    if (!lacking.empty() && arguments_.wave == Wave::kPoints) {
      throw IoError(
          arguments_.workspace.string() + ": points of shard " + text_of(shard_) +
          " need missing planes: " + shared.who_lacks(lacking, {}) +
          "; run those shards first, with --wave planes, or omit --wave: this shard then computes these planes, too");
    }
    return make(missing, [&](const auto& made) { return step_->points_densifier(missing, lacking.empty(), made); });
  }

  template <class Open>
  WaveReport make(const Ids& missing, const Open& open) {
    WaveReport report;
    report.keyframes = static_cast<std::int64_t>(mine_.size());
    report.found = report.keyframes - static_cast<std::int64_t>(missing.size());
    if (missing.empty()) return report;
    std::set<std::int64_t> without(missing.begin(), missing.end());
    const std::unique_ptr<PlannedDensifier> densifier =
        open([&](std::int64_t id) { report.made += static_cast<std::int64_t>(without.erase(id)); });
    densify(*densifier);
    report.without.assign(without.begin(), without.end());
    return report;
  }

  void densify(PlannedDensifier& densifier) {
    if (announced_backend_ != densifier.backend()) progress_.message("backend: " + densifier.backend());
    announced_backend_ = densifier.backend();
    const InterruptGuard guard(&densifier);
    const Ids needed = densifier.images();
    const std::unique_ptr<ImageSource> images = input_.images->reopen();
    images->restrict_to({needed.begin(), needed.end()});
    const auto lost = [](const SkippedKeyframe& skipped) {
      throw IoError("the image of keyframe " + std::to_string(skipped.keyframe_id) +
                    ", which results depend on, can no longer be read: " + skipped.reason +
                    "; do not change images while shards run");
    };
    const auto add = [&](std::size_t index, Keyframe& keyframe) {
      keyframe.scale = step_->scale_of(keyframe.id);
      input_.complete(keyframe, *images);
      const bool taken = densifier.add(keyframe);
      const RunProgress run_progress = run_progress_of(densifier.stats(), needed.size());
      progress_.step({name_of(wave_), index + 1, needed.size(), keyframe.id, taken, run_progress});
    };
    {
      io::ImageReader reader(*images, map_, input_.threads(), nullptr);
      io::ImageLoop{reader, add, lost, [&guard] { guard.check(); }}();
    }
    progress_.stage("finishing the last keyframes");
    densifier.flush();
    guard.check();
  }

  // --- reports -------------------------------------------------------------------------------------------------------

  ShardMarker marker(const WaveReport& report) const {
    ShardMarker marker;
    marker.shard = shard_;
    marker.wave = wave_;
    if (step_) marker.step = step_->step().name;
    if (step_) marker.engine = step_->inputs().engine;
    marker.build = build_;
    marker.host = host_name();
    marker.seconds = report.seconds;
    marker.keyframes = report.keyframes;
    marker.made = report.made;
    marker.without = report.without;
    return marker;
  }

  void leave_reason(const std::string& reason) noexcept {
    try {
      ShardMarker it = marker({});
      it.failure = reason;
      workspace_.shards().mark(it);
    } catch (const std::exception&) {  // the first error is reported
    }
  }

  void tell(const WaveReport& report) {
    std::string text = "shard " + text_of(shard_) + ": " + name_of(wave_) + " of " + std::to_string(report.keyframes) +
                       " of " + std::to_string(depth_maps_.size()) + " depth maps: " + std::to_string(report.made) +
                       " made, " + std::to_string(report.found) + " found";
    if (!report.without.empty()) text += ", " + std::to_string(report.without.size()) + " have none";
    progress_.message(text + "; " + duration_text(report.seconds));
  }

  void finish(const nlohmann::ordered_json& waves) {
    nlohmann::ordered_json json{{"generator", version_text()},
                                {"shard", shard_.index},
                                {"of", shard_.count},
                                {"step", step_->step().name},
                                {"engine", step_->inputs().engine},
                                {"build", build_},
                                {"host", host_name()},
                                {"depth_maps", depth_maps_.size()},
                                {"waves", waves},
                                {"seconds", seconds_since(start_)},
                                {"peak_memory_mib", peak_memory_mib()}};
    if (!arguments_.stats.empty()) write_file(arguments_.stats, json.dump(2) + "\n");
    progress_.done(json);
  }

  static constexpr std::size_t kLookedAtOnce = 16;

  const Arguments& arguments_;
  DensifierOptions options_;
  workspace::Workspace& workspace_;
  const workspace::Shard shard_;
  const std::string build_;
  Wave wave_;  ///< current or first wave
  const Clock::time_point start_ = Clock::now();
  Progress progress_;
  MissionInput input_{arguments_, progress_, options_.threads};
  const SlamMap& map_ = input_.map;
  std::unique_ptr<WorkspaceStep> step_;
  std::set<std::int64_t> fresh_;
  std::set<std::int64_t> skipped_;
  std::size_t readable_ = 0;
  std::string first_error_;
  Ids depth_maps_;  ///< keyframes with a depth map
  Ids mine_;        ///< those of this shard
  std::string announced_backend_;
};

}  // namespace

void run_shard(const Arguments& arguments) {
  DensifierOptions options = effective_options(arguments);
  check_chain(options);
  check_names(arguments);
  workspace::Workspace workspace(arguments.workspace, workspace::Workspace::Access::kShared);
  check_targets(arguments);
  if (options.advanced.free_space.whole_mission) {
    options.scratch_folder = (arguments.scratch.empty() ? arguments.workspace : arguments.scratch).string();
  }
  ShardRun(arguments, options, workspace)();
}

}  // namespace pmsp::tool
