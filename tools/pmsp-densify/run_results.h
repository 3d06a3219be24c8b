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
#include "time_account.h"

namespace pmsp::tool {

/// What a run leaves: clouds, depth maps, pictures, the page; each where it was asked for.
class RunResults {
 public:
  struct Setup {
    const Arguments& arguments;
    const DensifierOptions& options;
    const SlamMap& map;
    const CloudFrame& frame;
    const nlohmann::ordered_json& cloud;  ///< see cloud_json
    std::size_t keyframes;                ///< that images are expected of
    int threads;
    LiveView* live;  ///< nullptr = nobody looks
    /// See CloudHeader.
    std::function<std::vector<OutputView>(const std::filesystem::path& folder)> export_views;
  };

  /// Throws OutputError where something cannot be made. Time that it takes is counted there.
  RunResults(const Setup& setup, TimeAccount& time);

  /// Callbacks that lead here; what only others need is not set.
  PlannedCallbacks callbacks();

  /// Each image before the densifier gets it; sizes are those of depth maps. Then what became of it.
  void add_image(std::size_t index, const Keyframe& keyframe, int width, int height);
  void added(const Keyframe& keyframe, bool accepted);

  /// Of the page, if there is one.
  ReportPage* page() { return page_ ? &*page_ : nullptr; }

  /// Points that have come, and that are written.
  std::int64_t points_in() const { return output_->points_in(); }
  std::int64_t points() const { return output_->points(); }
  /// Of every 16th point that has come; 0 without points.
  double mean_confidence() const { return sampled_ > 0 ? confidence_sum_ / static_cast<double>(sampled_) : 0.0; }

  /// After the last keyframe; of the folder of depth maps all is written then. Throws OutputError.
  void finish_depth_maps();
  /// Held back points go to the writers.
  void complete();
  /// Puts depth maps in their place, which `write` does as well. Throws OutputError.
  void commit_depth_maps();
  /// Puts clouds and folders in their places, draws. Throws OutputError.
  void write(Progress& progress);
  void write_page(Progress& progress, const nlohmann::ordered_json& stats);

  /// "cloud.ply, cloud.las"
  std::string clouds_text() const;
  /// All that was written for people to look at, in a line: "cloud.ply, report mission.html, pictures look".
  std::string text() const;
  /// What the pictures leave out; "" = nothing, or there are none.
  const std::string& left_out() const { return dropped_; }

 private:
  using Spent = TimeAccount::Scope;

  const Arguments& arguments_;
  TimeAccount& time_;
  LiveView* const live_;
  std::unique_ptr<CloudOutput> output_;
  std::optional<DepthMapFolder> raw_, filtered_;
  std::optional<Preview> preview_;
  std::optional<ReportPage> page_;
  std::string dropped_;
  double confidence_sum_ = 0.0;
  std::int64_t sampled_ = 0;
};

}  // namespace pmsp::tool
