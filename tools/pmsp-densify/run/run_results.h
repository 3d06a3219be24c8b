// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "arguments.h"
#include "depth_output.h"
#include "export/cloud_frame.h"
#include "live_view.h"
#include "plan/plan.h"
#include "planned_densifier.h"
#include "pmsp/io/cloud.h"
#include "pmsp/io/map.h"
#include "preview.h"
#include "progress.h"
#include "report_page.h"

namespace pmsp::tool {

/// Outputs of a run, as enabled: clouds, depth maps, pictures, page.
class RunResults {
 public:
  struct Setup {
    const Arguments& arguments;
    const DensifierOptions& options;
    const SlamMap& map;
    const CloudFrame& frame;
    const nlohmann::ordered_json& cloud;  ///< see cloud_json
    std::size_t keyframes;                ///< expected number of images
    int threads;
    LiveView* live;  ///< nullptr = no live view
    /// See CloudHeader.
    std::function<std::vector<OutputView>(const std::filesystem::path& folder)> export_views;
  };

  /// Throws OutputError if an output cannot be created. `time`: account for its work.
  RunResults(const Setup& setup, TimeAccount& time);

  /// Callbacks into this object; those not needed are not set.
  PlannedCallbacks callbacks();

  /// To be called for each image before the densifier, with the size of the depth map; then `added` with the result.
  void add_image(std::size_t index, const Keyframe& keyframe, int width, int height);
  void added(const Keyframe& keyframe, bool accepted);

  /// nullptr without page.
  ReportPage* page() { return page_ ? &*page_ : nullptr; }

  /// Numbers of points received and written.
  std::int64_t points_in() const { return output_->points_in(); }
  std::int64_t points() const { return output_->points(); }
  /// Mean of every 16th received point; 0 without points.
  double mean_confidence() const { return sampled_ > 0 ? confidence_sum_ / static_cast<double>(sampled_) : 0.0; }

  /// To be called after the last keyframe; completes the content of the depth map folder. Throws OutputError.
  void finish_depth_maps();
  /// Passes held-back points to the writers.
  void complete();
  /// Moves the depth map folder to its final name, as `write` does. Throws OutputError.
  void commit_depth_maps();
  /// Moves clouds and folders to their final names, and draws. Throws OutputError.
  void write(Progress& progress);
  /// Why `write` could not make the maps for robots, with all else written; "" = it could, or none was requested.
  const std::string& map_failure() const { return map_failure_; }
  /// Warning if the maps for robots may become too large; "" = none.
  const std::string& map_warning() const { return map_warning_; }
  void write_page(Progress& progress, const nlohmann::ordered_json& stats);

  /// Returns all outputs for people: "cloud.ply, report mission.html, pictures look".
  std::string text() const;
  /// Description of what is outside of the pictures; "" = nothing, or no pictures.
  const std::string& left_out() const { return dropped_; }

 private:
  using ScopedTimer = TimeAccount::Scope;

  const Arguments& arguments_;
  TimeAccount& time_;
  LiveView* const live_;
  std::unique_ptr<CloudOutput> output_;
  std::optional<DepthMapFolder> raw_, filtered_;
  std::optional<Preview> preview_;
  std::optional<ReportPage> page_;
  std::string dropped_, map_failure_, map_warning_;
  double confidence_sum_ = 0.0;
  std::int64_t sampled_ = 0;
};

}  // namespace pmsp::tool
