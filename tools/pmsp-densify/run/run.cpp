// SPDX-License-Identifier: BSD-2-Clause
#include <chrono>
#include <exception>
#include <future>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <system_error>
#include <vector>

#include "calibration.h"
#include "cloud_arguments.h"
#include "devices.h"
#include "disk_space.h"
#include "estimates.h"
#include "exit_code.h"
#include "export/files.h"
#include "external_depths.h"
#include "follow.h"
#include "live_view.h"
#include "mission_input.h"
#include "options.h"
#include "planned_densifier.h"
#include "pmsp/densifier.h"
#include "pmsp/io/map.h"
#include "pmsp/stages.h"
#include "process.h"
#include "progress.h"
#include "run_results.h"
#include "shared_step.h"
#include "stats.h"
#include "tool_files.h"
#include "verbs.h"
#include "view_images.h"
#include "web/page.h"
#include "workspace_step.h"

namespace pmsp::tool {
namespace {

using ScopedTimer = TimeAccount::Scope;

/// Starts the CUDA device, if one is used, while the map is being read; returns the time taken [s]. Errors are reported
/// later by the Densifier.
std::future<double> start_device(const DensifierOptions& options) {
  if (options.backend == Backend::kCpu) return {};
  return std::async(std::launch::async, [options] {
    const auto begin = std::chrono::steady_clock::now();
    try {
      const Densifier starts(options, {});
    } catch (const std::exception&) {
    }
    return seconds_since(begin);
  });
}

/// Run of one mission, from images to files.
class Run {
 public:
  /// `workspace`: nullptr = none. `growing`: more keyframes will follow. `merge`: results of shards, instead of new
  /// ones. `live`: nullptr = no live view. `given`: depth maps instead of PatchMatch's.
  Run(const Arguments& arguments, DensifierOptions options, workspace::Workspace* workspace, bool growing,
      const Merge* merge = nullptr, LiveView* live = nullptr, ExternalDepths* given = nullptr)
      : arguments_(arguments),
        workspace_(workspace),
        growing_(growing),
        merge_(merge),
        live_(live),
        external_depths_(given),
        progress_(arguments.progress, arguments.quiet, arguments.verbose),
        input_(arguments, progress_, options.threads, &report_.time) {
    std::future<double> device = start_device(options);
    warn(quality_warning(arguments));
    input_.read_map();
    if (external_depths_ == nullptr) input_.open_prior_depths();
    input_.open_images();
    input_.check_poses();
    report_.map = map_.path.string() + " (" + map_.format + ")";
    report_.images = input_.images->description();
    report_.skipped = input_.images->skipped();
    report_.masks = input_.mask_report;
    report_.keyframes = map_.keyframes.size();
    report_.with_image = input_.images->keyframe_ids().size();
    views_ = std::make_unique<ViewImages>(arguments, map_, *input_.images, *input_.masks);
    for (const std::filesystem::path& path : arguments.cloud.paths) report_.outputs.push_back(path.string());
    frame_ = input_.find_frame();
    options.advanced.expected_keyframes = static_cast<std::int64_t>(report_.with_image);
    input_.announce();
    if (!frame_.description.empty()) progress_.message("cloud: " + frame_.description);
    if (live_ != nullptr) {
      live_->begin(map_, {map_.path.filename().string() + ": live", unit_of_lengths(arguments.report.unit, frame_.unit),
                          frame_.file_from_map});
      progress_.set_observer([this](const std::string& stage, double share, double seconds_left) {
        live_->set_progress(stage, share, seconds_left);
      });
    }
    if (merge == nullptr && given == nullptr) {  // done by the shards, or not needed
      progress_.stage("calibrating the camera");
      const ScopedTimer spent(report_.time, Activity::kImages);
      report_.calibration = calibrate(arguments, options, map_, *input_.images, *input_.masks, growing_,
                                      workspace != nullptr ? workspace->record() : workspace::Record{});
      options.lens_distance = report_.calibration.lens_distance;
      for (const std::string& text : describe(report_.calibration)) progress_.message(text);
    } else if (merge != nullptr) {
      report_.calibration.rig = merge->rig;
    }
    input_.masks->set_rig(report_.calibration.rig.mask);
    if (external_depths_ != nullptr) check_external_depths(options);
    verifier_ = input_.verifier();
    if (workspace_ != nullptr) open_workspace(options);
    check_disk(options);
    open_results(options);
    const bool all_images = !workspace_run_ && external_depths_ == nullptr;
    // While the device starts; not for videos, which are read up to the first keyframe before an error is reported.
    if (all_images && device.valid() && arguments.video.empty()) begin_reading();
    {
      const ScopedTimer spent(report_.time, Activity::kStart);
      if (device.valid()) report_.device_start = device.get();
      densifier_ = workspace_run_                ? workspace_run_->densifier(callbacks())
                   : external_depths_ != nullptr ? external_depths_->densifier(callbacks())
                                                 : std::make_unique<PlannedDensifier>(options, callbacks());
    }
    if (!all_images) need_images(densifier_->images());
    announce_backend();
    if (all_images && report_.options.backend == Backend::kCpu) announce_time(options);
  }

  /// Not called if cached results make the time unknown.
  void announce_time(const DensifierOptions& options) {
    Arguments faster = arguments_;
    faster.quality = "online";
    try {
      const std::string text = cpu_time_text(map_, *input_.images, options, effective_options(faster));
      if (!text.empty()) progress_.message(text);
    } catch (const InvalidInput&) {  // image size unknown: no forecast
    }
  }

  void announce_backend() {
    if (densifier_->backend() == announced_backend_) return;
    announced_backend_ = densifier_->backend();
    report_.options = densifier_->options();
    progress_.message("backend: " + announced_backend_);
  }

  void operator()() {
    {
      const InterruptGuard guard(densifier_.get());
      if (!workspace_run_ || workspace_run_->has_work()) densify(guard);
      if (workspace_run_) workspace_run_->finish();
    }
    if (live_ != nullptr) live_->end();
    report_.stats = densifier_->stats();
    if (external_depths_ != nullptr) external_depths_->count_pixels(report_.stats);
    const std::string inconsistent = consistency_warning(report_.stats);
    if (!inconsistent.empty()) progress_.warning(inconsistent);
    if (workspace_run_) {
      if (!arguments_.delete_workspace) workspace_run_->commit(report_.calibration.images, recorded_);
      workspace_run_->count_keyframes(report_.stats);
      report_.stats.points = results_->points_in();
      report_.stats.depth_maps = workspace_run_->depth_maps();
      report_.workspace = workspace_run_->report();
    }
    close_device();
    results_->finish_depth_maps();
    results_->complete();
    report_.points_written = results_->points();
    report_.confidence = results_->mean_confidence();
    if (input_.prior_depths.wanted()) report_.prior_depth = input_.prior_depths.report();
    report_.warnings = progress_.warnings();
    report_.empty_reason = why_empty();
    if (report_.empty_reason.empty()) {
      write_results();
      if (arguments_.delete_workspace) {
        const ScopedTimer spent(report_.time, Activity::kWorkspace);
        workspace_->remove();
      }
    } else {
      results_->commit_depth_maps();  // may explain the missing points
    }
    if (!arguments_.stats.empty()) write_file(arguments_.stats, json_text(to_json(report_)));
    print_summary();
  }

 private:
  /// In the background, while files are being written.
  void close_device() {
    if (report_.options.backend != Backend::kCuda || arguments_.follow) return;  // needed by the next round
    try {
      closing_ = std::async(std::launch::async, [this, devices = report_.options.devices] {
        densifier_.reset();
        close_devices(devices);
      });
    } catch (const std::system_error&) {  // no thread; closed at process exit
    }
  }

  /// Reason for an empty result; "" = there are points.
  std::string why_empty() const {
    if (results_->points() > 0) return "";
    if (results_->points_in() > 0) {
      return "none of " + std::to_string(results_->points_in()) + " points lies in the box of --crop";
    }
    const bool is_known = !workspace_run_ || report_.stats.depth_maps == 0;  // otherwise counts cover this run only
    return is_known ? explain_empty(report_.stats)
                    : "the filters left none of " + std::to_string(report_.stats.depth_maps) +
                          " depth maps; a run without --workspace shows which one";
  }

  /// At most ten lines. Throws EmptyResult without points.
  void print_summary() {
    if (workspace_run_) progress_.message(workspace_run_->summary());
    if (input_.prior_depths.wanted()) progress_.message(input_.prior_depths.summary());
    progress_.message(summary(report_));
    nlohmann::ordered_json result{{"points", results_->points()}, {"seconds", report_.time.total()}};
    if (!report_.empty_reason.empty()) {
      throw EmptyResult("no points: " + report_.empty_reason + "; " + arguments_.cloud.text() +
                        (report_.outputs.size() > 1 ? " were" : " was") + " not written");
    }
    if (!results_->map_failure().empty()) throw InvalidInput(results_->map_failure());
    if (!results_->left_out().empty()) progress_.message("pictures:    " + results_->left_out());
    progress_.message("wrote " + results_->text());
    if (const std::string next = next_steps(); !next.empty()) progress_.message(next);
    result["output"] = report_.outputs.front();
    result["outputs"] = report_.outputs;
    progress_.done(result);
  }

  /// "" = no warning.
  void warn(const std::string& text) {
    if (!text.empty()) progress_.warning(text);
  }

  /// Suggested commands after a run.
  std::string next_steps() const {
    const std::filesystem::path* const first = arguments_.cloud.first_cloud();
    if (first == nullptr) return "";
    const std::string cloud = first->string();
    std::string text;
    if (arguments_.report.path.empty() && web::has_report_page())
      text += "\n  look:   pmsp-densify report " + cloud + " -o report.html";
    if (frame_.unit.kind != CloudUnit::Kind::kMetres)
      text += "\n  metres: pmsp-densify convert " + cloud + " -o metres.ply --scale METRES_PER_UNIT";
    return text.empty() ? "" : "next:" + text;
  }

  void skip(const SkippedKeyframe& skipped) {
    report_.skipped.push_back(skipped);
    progress_.skipped(skipped);
  }

  void open_results(const DensifierOptions& options) {
    report_.cloud = cloud_json(arguments_.cloud, frame_);
    recorded_ = recorded_cloud(options, map_);
    const auto export_views = [this](const std::filesystem::path& folder) {
      if (workspace_run_)
        workspace_run_->each_image_size([this](std::int64_t id, int w, int h) { views_->set_size(id, w, h); });
      return views_->put(folder, frame_.file_from_map);
    };
    results_ =
        std::make_unique<RunResults>(RunResults::Setup{arguments_, options, map_, frame_, report_.cloud,
                                                       report_.with_image, input_.threads(), live_, export_views},
                                     report_.time);
    warn(results_->map_warning());
    if (merge_ != nullptr && results_->page() != nullptr) {
      results_->page()->say("Pictures of keyframes and coverage are not available from shards.");
    }
  }

  /// Compares the forecast with the free space. Throws OutputError.
  void check_disk(DensifierOptions options) {
    if (!knows_size(options, map_)) return;  // no forecast
    Plan plan = workspace_run_                ? workspace_run_->step().plan
                : external_depths_ != nullptr ? external_depths_->plan()
                                              : Plan{};
    if (!workspace_run_ && external_depths_ == nullptr) {
      plan = make_plan(keyframes_without_image(map_, input_.images, options), options);
    }
    warn(disk_warning(arguments_, map_, *input_.images, plan, options,
                      workspace_run_ ? share_to_make(workspace_run_->step()) : 1.0));
  }

  void check_external_depths(DensifierOptions& options) {
    progress_.stage("reading the depth images");
    const ScopedTimer spent(report_.time, Activity::kImages);
    for (const SkippedKeyframe& skipped : external_depths_->look(map_, *input_.images, options)) skip(skipped);
    report_.with_image = external_depths_->count();
    report_.external_depths = external_depths_->report();
    progress_.message(external_depths_->summary());
  }

  void open_workspace(const DensifierOptions& options) {
    if (arguments_.delete_workspace && workspace_->is_blank()) {
      plane_writer_ = std::make_unique<PlaneMapWriter>(*workspace_, arguments_, options, map_, report_.calibration.rig,
                                                       *input_.images, report_.time);
    } else {
      open_step(options);
    }
  }

  /// Determines what is missing in a workspace, after reading new images.
  void open_step(const DensifierOptions& options) {
    workspace_run_ = std::make_unique<WorkspaceStep>(*workspace_, arguments_, options, map_, report_.calibration.rig,
                                                     growing_, &report_.time);
    std::vector<SkippedKeyframe> unreadable;
    const std::set<std::int64_t> fresh = workspace_run_->new_images(*input_.images, unreadable);
    if (merge_ == nullptr) workspace_run_->refuse_losses();
    for (const SkippedKeyframe& skipped : unreadable) skip(skipped);
    report_.with_image -= unreadable.size();
    if (!fresh.empty()) {
      progress_.stage("reading " + std::to_string(fresh.size()) + " new images");
      const InterruptGuard guard(nullptr);
      const std::unique_ptr<ImageSource> images = input_.images->reopen();
      images->restrict_to(fresh);
      io::ImageReader reader(*images, map_, input_.threads(), verifier_.get());
      const std::string error = each_image(
          reader, guard, [&](std::size_t, const Keyframe& keyframe) { workspace_run_->add_image(keyframe); });
      if (!error.empty() && fresh.size() + unreadable.size() == input_.images->keyframe_ids().size())
        refuse_images(error);
      verifier_.reset();  // verified once only
    }
    workspace_run_->decide(merge_ != nullptr ? merge_->job.engine : "");
    if (merge_ != nullptr) merge_->join(*workspace_run_);
    if (workspace_run_->has_work()) workspace_run_->begin();
  }

  void begin_reading() { images_.emplace(*input_.images, map_, input_.threads(), verifier_.get()); }

  void need_images(const std::vector<std::int64_t>& needed) {
    input_.images->restrict_to({needed.begin(), needed.end()});
    steps_ = needed.size();
  }

  PlannedCallbacks callbacks() {
    PlannedCallbacks callbacks = results_->callbacks();
    if (plane_writer_) {
      callbacks.wants_planes = [this](std::int64_t /*keyframe_id*/) {
        return plane_writer_->wants_planes(*densifier_);
      };
      callbacks.planes = [this](const PlaneMap& planes) { plane_writer_->keep(planes, *densifier_); };
    }
    callbacks.progress = [this] { progress_.run_progress(run_progress()); };
    return callbacks;
  }

  /// Total number of images.
  std::size_t expected() const { return workspace_run_ || external_depths_ != nullptr ? steps_ : report_.with_image; }

  RunProgress run_progress() const {
    RunProgress run_progress = run_progress_of(densifier_->stats(), expected());
    run_progress.points = results_->points_in();
    return run_progress;
  }

  void densify(const InterruptGuard& guard) {
    if (!images_) begin_reading();
    const std::string error =
        each_image(*images_, guard, [&](std::size_t index, Keyframe& keyframe) { add(index, keyframe); });
    images_.reset();
    if (!error.empty()) refuse_images(error);
    progress_.stage("finishing the last keyframes");
    const ScopedTimer spent(report_.time, Activity::kDensify);
    densifier_->flush();
    progress_.run_progress(run_progress(), true);
    guard.check();
  }

  /// The plan of a step depends on this keyframe.
  [[noreturn]] static void refuse_lost(const SkippedKeyframe& skipped) {
    throw IoError("the image of keyframe " + std::to_string(skipped.keyframe_id) +
                  ", which results depend on, can no longer be read: " + skipped.reason +
                  "; do not change images during a run, or start with a new --workspace");
  }

  [[noreturn]] static void refuse_images(const std::string& error) {
    throw IoError("no image can be read; the first one: " + error);
  }

  /// Returns the error of the first image if none is readable; else "".
  std::string each_image(io::ImageReader& images, const InterruptGuard& guard,
                         const decltype(io::ImageLoop::visit)& visit) {
    const auto lost = [this](const SkippedKeyframe& skipped) {
      if (densifier_ && workspace_run_) refuse_lost(skipped);
      skip(skipped);
      if (external_depths_ != nullptr) densifier_->add(external_depths_->without_image(skipped.keyframe_id));
      --report_.with_image;
    };
    std::optional<ScopedTimer> waiting;
    const auto waits = [&](bool begins) {
      waiting.reset();
      if (begins) waiting.emplace(report_.time, Activity::kWait);
    };
    const io::ImageLoop::End end = io::ImageLoop{images, visit, lost, [&guard] { guard.check(); }, waits}();
    if (end.pairing) report_.pairing = end.pairing;
    if (end.pairing) warn(io::warning_of(*end.pairing, end.images == report_.with_image));
    return end.first_error;
  }

  void add(std::size_t index, Keyframe& keyframe) {
    if (workspace_run_) keyframe.scale = workspace_run_->scale_of(keyframe.id);
    views_->set_size(keyframe.id, keyframe.image.width, keyframe.image.height);
    input_.complete(keyframe, *input_.images);
    if (external_depths_ != nullptr)
      external_depths_->set_image_size(keyframe.id, keyframe.image.width, keyframe.image.height);
    const int width = report_.options.width > 0 ? report_.options.width : keyframe.image.width;
    const int height = report_.options.height > 0 ? report_.options.height : width / 2;
    results_->add_image(index, keyframe, width, height);
    const bool accepted = [&] {
      const ScopedTimer spent(report_.time, Activity::kDensify);
      return densifier_->add(keyframe);
    }();
    results_->added(keyframe, accepted);
    announce_backend();  // may change at the first image, if device memory is insufficient
    progress_.step({"densify", index + 1, expected(), keyframe.id, accepted, run_progress()});
  }

  void write_results() {
    results_->write(progress_);
    write_rig();
    if (results_->page() == nullptr) return;
    if (workspace_run_ || external_depths_ != nullptr) {  // otherwise reported by the densifier
      const Plan& plan = workspace_run_ ? workspace_run_->step().plan : external_depths_->plan();
      for (const PlanEntry& entry : plan.entries) results_->page()->set_use(entry);
    }
    results_->write_page(progress_, to_json(report_));
  }

  void write_rig() {
    if (report_.calibration.rig.mask.empty()) return;
    const std::filesystem::path path = rig_mask_path(arguments_);
    if (write_rig_mask(arguments_, report_.calibration.rig)) {
      report_.outputs.push_back(path.string());
    } else {
      warn(path.string() + ": exists with other pixels, so the rig mask of this run is not written; --mask " +
           path.string() + " uses it, --force replaces it");
    }
  }

  RunReport report_;  ///< first member: its clock starts
  const Arguments& arguments_;
  workspace::Workspace* const workspace_;
  const bool growing_;
  const Merge* const merge_;
  LiveView* const live_;
  ExternalDepths* const external_depths_;
  Progress progress_;
  MissionInput input_;
  const SlamMap& map_ = input_.map;
  CloudFrame frame_;
  workspace::RecordedCloud recorded_;
  std::unique_ptr<ViewImages> views_;
  std::unique_ptr<RunResults> results_;
  std::unique_ptr<PairingVerifier> verifier_;
  std::unique_ptr<WorkspaceStep>
      workspace_run_;  ///< before the densifier, which calls it; alternative to plane_writer_
  std::unique_ptr<PlaneMapWriter> plane_writer_;  ///< before the densifier, which calls it
  std::size_t steps_ = 0;                         ///< number of images needed by the step
  std::optional<io::ImageReader> images_;         ///< after the members that it uses
  std::unique_ptr<PlannedDensifier> densifier_;
  std::string announced_backend_;
  std::future<void> closing_;  ///< last member, since it uses the others
};

}  // namespace

void run(const Arguments& arguments) {
  DensifierOptions options = effective_options(arguments);
  if (arguments.workspace.empty()) check_targets(arguments);
  if (options.advanced.free_space.whole_mission) options.scratch_folder = scratch_folder(arguments).string();
  const std::unique_ptr<LiveView> live = arguments.live.port ? std::make_unique<LiveView>(arguments.live) : nullptr;
  if (arguments.workspace.empty()) {
    Run(arguments, options, nullptr, false, nullptr, live.get())();
    if (live) live->finish(true);
    return;
  }
  check_names(arguments);
  workspace::Workspace workspace(arguments.workspace);
  check_targets(arguments, recorded_outputs(arguments, workspace));
  const auto once = [&](bool growing) { Run(arguments, options, &workspace, growing, nullptr, live.get())(); };
  const bool is_interrupted = arguments.follow && !follow(arguments, once);
  if (!arguments.follow) once(arguments.growing);
  if (live) live->finish(!is_interrupted);
}

void fuse(const Arguments& arguments) {
  DensifierOptions options = effective_options(arguments);
  check_targets(arguments);
  if (options.advanced.free_space.whole_mission) options.scratch_folder = scratch_folder(arguments).string();
  ExternalDepths given(arguments);
  Run(arguments, options, nullptr, false, nullptr, nullptr, &given)();
}

void merge(const Arguments& arguments) {
  std::error_code ignored;
  if (!std::filesystem::exists(arguments.workspace / "workspace.json", ignored)) {
    throw InvalidInput(arguments.workspace.string() + ": is no workspace; expected that of shards (run --shard)");
  }
  workspace::Workspace workspace(arguments.workspace, workspace::Workspace::Access::kMerge);
  const Merge merge(arguments, workspace);
  check_targets(merge.arguments, recorded_outputs(arguments, workspace));
  Run(merge.arguments, merge.options, &workspace, false, &merge)();
}

}  // namespace pmsp::tool
