// SPDX-License-Identifier: BSD-2-Clause
#include <exception>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cloud_report.h"
#include "decoder.h"
#include "depth_output.h"
#include "exit_code.h"
#include "export/atomic_file.h"
#include "follow.h"
#include "interrupt.h"
#include "io/map_keyframe.h"
#include "lenses.h"
#include "live_view.h"
#include "map_input.h"
#include "pmsp/densifier.h"
#include "preview.h"
#include "prior_depth.h"
#include "progress.h"
#include "report_page.h"
#include "shared_step.h"
#include "stats.h"
#include "targets.h"
#include "time_account.h"
#include "util/thread_pool.h"
#include "verbs.h"
#include "view_images.h"
#include "workspace_step.h"

namespace pmsp::tool {
namespace {

using Spent = TimeAccount::Scope;

/// Starts a CUDA device, if there is one to be used, while the map is being read. What stands in the way is told by the
/// Densifier that is made later.
std::future<void> start_device(const DensifierOptions& options) {
  if (options.backend == Backend::kCpu) return {};
  return std::async(std::launch::async, [options] {
    try {
      const Densifier starts(options, {});
    } catch (const std::exception&) {
    }
  });
}

/// One mission from images to files.
class Run {
 public:
  /// `workspace`: nullptr = none. `growing`: more keyframes will come. `merge`: what shards have made is all there is.
  /// `live`: nullptr = nobody looks.
  Run(const Arguments& arguments, DensifierOptions options, workspace::Workspace* workspace, bool growing,
      const Merge* merge = nullptr, LiveView* live = nullptr)
      : arguments_(arguments),
        growing_(growing),
        merge_(merge),
        live_(live),
        threads_(options.threads > 0 ? options.threads : usable_cpus()),
        progress_(arguments.progress, arguments.quiet, arguments.verbose) {
    std::future<void> device = start_device(options);
    const std::string warning = quality_warning(arguments);
    if (!warning.empty()) progress_.warning(warning);
    progress_.stage("reading " + arguments.map.string());
    {
      const Spent spent(report_.time, Busy::kMap);
      map_ = read_map(arguments);
    }
    {
      const Spent spent(report_.time, Busy::kImages);
      source_ = open_images(arguments, map_);
    }
    std::vector<std::string> about_map = remarks(map_);
    if (map_.landmarks.empty()) {
      progress_.stage("looking for landmarks in the images");
      const Spent spent(report_.time, Busy::kImages);
      about_map.push_back(sweep_landmarks(map_, arguments, options.threads));
    }
    report_.map = map_.path.string() + " (" + map_.format + ")";
    report_.images = source_->description();
    views_ = std::make_unique<ViewImages>(arguments, map_, *source_);
    for (const std::filesystem::path& path : arguments.cloud.paths) report_.outputs.push_back(path.string());
    ImageFiles files;
    if (arguments.cloud.frame.align == kAlignExif) {
      for (const std::int64_t id : source_->keyframe_ids()) files[id] = source_->origin(id).file;
    }
    frame_ = find_cloud_frame(arguments.cloud.frame, map_, files);
    report_.keyframes = map_.keyframes.size();
    report_.with_image = source_->keyframe_ids().size();
    announce(about_map);
    if (live_ != nullptr) {
      live_->begin(map_, {map_.path.filename().string() + ": live",
                          unit_of_lengths(arguments.report.unit, frame_.file_from_map), frame_.file_from_map});
    }
    if (merge == nullptr) {  // shards have done so
      progress_.stage("looking at the lenses");
      const Spent spent(report_.time, Busy::kImages);
      report_.lenses = find_lenses(arguments, options, map_, workspace != nullptr ? workspace->record().options : "{}");
      options.lens_distance = report_.lenses.distance;
      if (report_.lenses.estimated) progress_.message(describe(report_.lenses));
    }
    if (!arguments.no_verify) verifier_ = std::make_unique<PairingVerifier>(map_);
    if (workspace != nullptr) open_step(*workspace, options);
    open_outputs(options);
    {
      const Spent spent(report_.time, Busy::kStart);
      if (device.valid()) device.get();
      densifier_ = step_ ? step_->densifier(callbacks()) : std::make_unique<Densifier>(options, callbacks());
    }
    if (step_) need_images(densifier_->images());
    announce_backend();
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
      try {
        if (!step_ || step_->has_work()) densify(guard);
        if (step_) step_->finish();
      } catch (...) {
        keep_depth_maps();
        throw;
      }
    }
    if (live_ != nullptr) live_->end();
    report_.stats = densifier_->stats();
    if (step_) {
      step_->commit();
      step_->count_keyframes(report_.stats);
      report_.stats.points = output_->points_in();
      report_.stats.depth_maps = step_->depth_maps();
      report_.workspace = step_->report();
    }
    finish_depth_maps();
    {
      const Spent spent(report_.time, Busy::kPoints);
      output_->complete();
    }
    report_.points_written = output_->points();
    if (priors_.wanted()) {
      report_.prior_depth = priors_.report();
      progress_.message(priors_.summary());
    }
    if (output_->points_in() > 0 && output_->points() == 0) {
      report_.empty_reason = "none of " + std::to_string(output_->points_in()) + " points lies in the box of --crop";
    } else if (output_->points() == 0) {
      const bool is_known = !step_ || report_.stats.depth_maps == 0;  // counts are of this run's work alone
      report_.empty_reason = is_known ? explain_empty(report_.stats)
                                      : "the filters left none of " + std::to_string(report_.stats.depth_maps) +
                                            " depth maps; a run without --workspace says which one it was";
    }
    if (report_.empty_reason.empty()) write_results();
    if (!arguments_.stats.empty()) write_file(arguments_.stats, json_text(to_json(report_)));
    if (step_) progress_.message(step_->summary());
    progress_.message(summary(report_));
    nlohmann::ordered_json result{{"points", output_->points()}, {"seconds", report_.time.total()}};
    if (!report_.empty_reason.empty()) {
      throw EmptyResult("no points: " + report_.empty_reason + "; " + outputs_text() +
                        (report_.outputs.size() > 1 ? " were" : " was") + " not written");
    }
    progress_.message("wrote " + outputs_text());
    result["output"] = report_.outputs.front();
    result["outputs"] = report_.outputs;
    progress_.done(result);
  }

  /// With a workspace: whether nothing would be made better by a run that expects no more keyframes.
  bool is_finished() const { return step_->is_finished(); }

 private:
  void announce(const std::vector<std::string>& about_map) {
    progress_.message(report_.map + ": " + std::to_string(report_.keyframes) + " keyframes, " +
                      std::to_string(map_.landmarks.size()) + " landmarks");
    for (const std::string& remark : about_map) progress_.message(remark);
    progress_.message("images: " + report_.images);
    if (masks_.is_folder()) {
      std::vector<std::filesystem::path> images;
      for (const std::int64_t id : source_->keyframe_ids()) images.push_back(source_->origin(id).file);
      progress_.message("masks: " + std::to_string(masks_.count(images)) + " of " + std::to_string(images.size()) +
                        " images have one in " + arguments_.mask.string());
    }
    if (!frame_.description.empty()) progress_.message("cloud: " + frame_.description);
    if (map_.landmarks.empty()) {
      progress_.warning(
          "neither the map nor the images give landmarks; without them no keyframe gets a depth range, nor a depth "
          "map; "
          "--points takes a PLY file with points of the same frame");
    }
    for (const SkippedKeyframe& skipped : source_->skipped()) skip(skipped);
  }

  std::string outputs_text() const {
    std::string text;
    for (const std::string& output : report_.outputs) text += (text.empty() ? "" : ", ") + output;
    return text;
  }

  void skip(const SkippedKeyframe& skipped) {
    report_.skipped.push_back(skipped);
    progress_.warning("keyframe " + std::to_string(skipped.keyframe_id) + " skipped: " + skipped.reason);
  }

  void open_outputs(const DensifierOptions& options) {
    report_.cloud = cloud_json(arguments_.cloud, frame_);
    CloudHeader header = cloud_header(arguments_, options, map_, frame_);
    header.export_views = [this](const std::filesystem::path& folder) {
      if (step_) step_->each_image_size([this](std::int64_t id, int w, int h) { views_->set_size(id, w, h); });
      return views_->put(folder, frame_.file_from_map);
    };
    output_ = std::make_unique<CloudOutput>(header, arguments_.cloud.amount, arguments_.cloud.targets(), threads_);
    const double scale = png_depth_scale(map_, options.init.range_margin);
    if (!arguments_.depth_maps.empty())
      filtered_.emplace(arguments_.depth_maps, "filtered", map_, scale, arguments_.depth_formats, report_.cloud);
    if (!arguments_.raw_depth_maps.empty())
      raw_.emplace(arguments_.raw_depth_maps, "raw", map_, scale, arguments_.depth_formats, report_.cloud);
    if (!arguments_.preview.empty()) preview_.emplace(arguments_.preview, report_.with_image);
    if (!arguments_.report.path.empty()) {
      page_.emplace(arguments_.report, header, map_, report_.with_image);
      output_->also_to(page_->cloud());
      if (merge_ != nullptr) page_->say("The shards have left no pictures of keyframes, and no coverage.");
    }
  }

  /// What a workspace lacks. Images that it does not know are looked at first.
  void open_step(workspace::Workspace& workspace, const DensifierOptions& options) {
    step_ = std::make_unique<WorkspaceStep>(workspace, arguments_, options, map_, growing_);
    std::vector<SkippedKeyframe> unreadable;
    const std::set<std::int64_t> fresh = step_->new_images(*source_, unreadable);
    for (const SkippedKeyframe& skipped : unreadable) skip(skipped);
    report_.with_image -= unreadable.size();
    if (!fresh.empty()) {
      progress_.stage("looking at " + std::to_string(fresh.size()) + " new images");
      const InterruptGuard guard(nullptr);
      const std::unique_ptr<ImageSource> images = open_images(arguments_, map_);
      images->restrict_to(fresh);
      const std::string error = each_image(*images, guard, [&](std::size_t, const ImageSource::Item& item) {
        step_->look_at(item.keyframe_id, item.image);
      });
      if (!error.empty() && fresh.size() + unreadable.size() == source_->keyframe_ids().size()) refuse_images(error);
      verifier_.reset();  // once is enough
    }
    step_->decide(merge_ != nullptr ? merge_->job.engine : "");
    if (merge_ != nullptr) merge_->join(*step_);
  }

  void need_images(const std::vector<std::int64_t>& needed) {
    source_->restrict_to({needed.begin(), needed.end()});
    steps_ = needed.size();
  }

  DensifierCallbacks callbacks() {
    DensifierCallbacks callbacks;
    if (raw_) {
      callbacks.raw_depth = [this](const DepthMap& map) {
        const Spent spent(report_.time, Busy::kDepthMaps);
        raw_->write(map);
      };
    }
    if (filtered_ || preview_ || page_) {
      callbacks.filtered_depth = [this](const DepthMap& map) {
        const Spent spent(report_.time, Busy::kDepthMaps);
        if (filtered_) filtered_->write(map);
        const Spent drawing(report_.time, Busy::kPreview);
        if (preview_) preview_->add_depth(map);
        if (page_) page_->add_depth(map);
      };
    }
    callbacks.cloud = [this](const KeyframeCloud& cloud) {
      const Spent spent(report_.time, Busy::kPoints);
      output_->add(cloud);
      const Spent drawing(report_.time, Busy::kPreview);
      if (preview_) preview_->add_points(cloud);
      if (live_ != nullptr) live_->add(cloud);
    };
    return callbacks;
  }

  void densify(const InterruptGuard& guard) {
    const std::string error =
        each_image(*source_, guard, [&](std::size_t index, const ImageSource::Item& item) { add(index, item); });
    if (!error.empty()) refuse_images(error);
    progress_.stage("finishing the last keyframes");
    const Spent spent(report_.time, Busy::kDensify);
    densifier_->flush();
    guard.check();
  }

  /// A keyframe that the plan of a step counts on.
  [[noreturn]] static void refuse_lost(const SkippedKeyframe& skipped) {
    throw IoError("the image of keyframe " + std::to_string(skipped.keyframe_id) +
                  ", which results depend on, can no longer be read: " + skipped.reason +
                  "; leave images as they are while a run works, or start with a new --workspace");
  }

  [[noreturn]] static void refuse_images(const std::string& error) {
    throw IoError("no image can be read; the first one: " + error);
  }

  /// While one keyframe is densified, the next images are decoded. Returns why the first one cannot be read where none
  /// can; else "".
  std::string each_image(ImageSource& source, const InterruptGuard& guard,
                         const std::function<void(std::size_t index, const ImageSource::Item&)>& visit) {
    ImageReader images(source, map_, threads_, verifier_.get());
    std::size_t index = 0;
    for (;; ++index) {
      ImageReader::Read read = [&] {
        const Spent spent(report_.time, Busy::kWait);
        return images.next();
      }();
      if (read.pairing) report_.pairing = read.pairing;
      guard.check();
      for (const SkippedKeyframe& skipped : read.skipped) {
        if (densifier_ && step_) refuse_lost(skipped);
        skip(skipped);
      }
      report_.with_image -= read.skipped.size();
      if (!read.item) break;
      visit(index, *read.item);
      images.let_go(std::move(*read.item));
      guard.check();
    }
    if (verifier_ && report_.pairing && report_.pairing->doubtful) progress_.warning(report_.pairing->message);
    return index == 0 ? images.first_error() : "";
  }

  void add(std::size_t index, const ImageSource::Item& item) {
    const MapKeyframe* found = map_.find_keyframe(item.keyframe_id);
    if (found == nullptr)
      throw InvalidInput("an image names keyframe " + std::to_string(item.keyframe_id) + ", which the map lacks");
    Keyframe keyframe = io::keyframe_of(map_, *found);
    if (step_) keyframe.scale = step_->scale_of(keyframe.id);
    keyframe.image = item.image.view();
    views_->set_size(item.keyframe_id, item.image.width(), item.image.height());
    keyframe.mask = masks_.mask_for(source_->origin(keyframe.id).file, item.image.width(), item.image.height());
    priors_.give(keyframe, source_->origin(keyframe.id).file);
    if (preview_) {
      const Spent spent(report_.time, Busy::kPreview);
      const int width = report_.options.width > 0 ? report_.options.width : item.image.width();
      const int height = report_.options.height > 0 ? report_.options.height : width / 2;
      preview_->add_keyframe(index, keyframe.id, keyframe.cam_from_world, keyframe.image, width, height);
    }
    if (page_) {
      const Spent spent(report_.time, Busy::kPreview);
      page_->add_image(index, keyframe);
      if (!step_) planned_.push_back(plan_keyframe(keyframe, densifier_->options()));
    }
    const bool accepted = [&] {
      const Spent spent(report_.time, Busy::kDensify);
      return densifier_->add(keyframe);
    }();
    if (live_ != nullptr) live_->set_camera(keyframe.cam_from_world);
    announce_backend();  // whether its memory suffices may turn out with the first image
    if (preview_ && !accepted) preview_->drop_keyframe(keyframe.id);
    if (page_) page_->set_used(keyframe.id, accepted);
    progress_.step(
        {"densify", index + 1, step_ ? steps_ : report_.with_image, keyframe.id, accepted, output_->points_in()});
  }

  void finish_depth_maps() {
    if (raw_) raw_->finish();
    if (filtered_) filtered_->finish();
  }

  /// After an error. The depth maps that are there are whole and stay usable; what went wrong first is what is told.
  void keep_depth_maps() noexcept {
    try {
      finish_depth_maps();
    } catch (const std::exception&) {
    }
  }

  void write_results() {
    progress_.stage("writing " + outputs_text());
    {
      const Spent spent(report_.time, Busy::kFinish);
      output_->commit();
    }
    const Spent spent(report_.time, Busy::kPreview);
    if (preview_) {
      progress_.stage("drawing " + arguments_.preview.string());
      preview_->finish(output_->points_in());
    }
    if (page_) {
      progress_.stage("writing " + arguments_.report.path.string());
      page_->set_uses(step_ ? step_->step().plan : make_plan(planned_, densifier_->options()));
      page_->write(to_json(report_));
    }
  }

  RunReport report_;  ///< its clock runs
  const Arguments& arguments_;
  const bool growing_;
  const Merge* const merge_;
  LiveView* const live_;
  const int threads_;
  Progress progress_;
  SlamMap map_;
  std::unique_ptr<ImageSource> source_;
  CloudFrame frame_;
  std::unique_ptr<ViewImages> views_;
  std::unique_ptr<CloudOutput> output_;
  std::optional<DepthMapFolder> raw_;
  std::optional<DepthMapFolder> filtered_;
  std::optional<Preview> preview_;
  std::optional<ReportPage> page_;
  std::vector<PlanKeyframe> planned_;  ///< for the report, where no step has a plan
  std::unique_ptr<PairingVerifier> verifier_;
  MaskSource masks_{open_masks(arguments_)};
  PriorDepths priors_{arguments_};
  std::unique_ptr<WorkspaceStep> step_;  ///< before the densifier, which calls it
  std::size_t steps_ = 0;                ///< images that it needs
  std::unique_ptr<Densifier> densifier_;
  std::string announced_backend_;
};

std::vector<std::filesystem::path> written_before(const Arguments& arguments, const workspace::Workspace& workspace) {
  std::vector<std::filesystem::path> paths;
  for (const std::string& output : workspace.record().outputs) paths.push_back(arguments.workspace / output);
  return paths;
}

}  // namespace

MaskSource open_masks(const Arguments& arguments) {
  return MaskSource({arguments.mask, arguments.images, arguments.mask_nadir});
}

std::string masks_text(const Arguments& arguments, workspace::Workspace& workspace) {
  std::error_code ignored;
  std::string text;
  if (std::filesystem::is_directory(arguments.mask, ignored)) {
    text = "one for each image";
  } else if (!arguments.mask.empty()) {
    text = workspace.fingerprint(arguments.mask);
  }
  if (arguments.mask_nadir > 0.0) text += ", nadir " + nlohmann::json(arguments.mask_nadir).dump();
  return text;
}

std::unique_ptr<ImageSource> open_images(const Arguments& arguments, const SlamMap& map) {
  if (!arguments.images.empty()) {
    ImageFolderOptions options;
    options.fps = arguments.fps;
    options.frame_offset = arguments.frame_offset;
    return open_image_folder(map, arguments.images, options);
  }
  if (arguments.video.empty()) return nullptr;
  VideoOptions options;
  options.fps = arguments.fps;
  options.frame_offset = arguments.frame_offset;
  return open_video(map, arguments.video, options);
}

void run(const Arguments& arguments) {
  DensifierOptions options = effective_options(arguments);
  if (arguments.workspace.empty()) check_targets(arguments);
  if (options.free_space.whole_mission) options.scratch_folder = scratch_folder(arguments).string();
  const std::unique_ptr<LiveView> live = arguments.live.port ? std::make_unique<LiveView>(arguments.live) : nullptr;
  if (arguments.workspace.empty()) {
    Run(arguments, options, nullptr, false, nullptr, live.get())();
    if (live) live->finish();
    return;
  }
  check_names(arguments);
  workspace::Workspace workspace(arguments.workspace);
  check_targets(arguments, written_before(arguments, workspace));
  const auto once = [&](bool growing) {
    Run run(arguments, options, &workspace, growing, nullptr, live.get());
    run();
    return run.is_finished();
  };
  if (arguments.follow) {
    follow(arguments, once);
  } else {
    once(false);
  }
  if (live) live->finish();
}

void merge(const Arguments& arguments) {
  std::error_code ignored;
  if (!std::filesystem::exists(arguments.workspace / "workspace.json", ignored)) {
    throw InvalidInput(arguments.workspace.string() +
                       ": is no workspace; expected the folder that shards have worked in (run --shard)");
  }
  workspace::Workspace workspace(arguments.workspace, workspace::Workspace::Access::kMerge);
  const Merge merge(arguments, workspace);
  check_targets(merge.arguments, written_before(arguments, workspace));
  Run(merge.arguments, merge.options, &workspace, false, &merge)();
}

}  // namespace pmsp::tool
