// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "arguments.h"
#include "export/files.h"
#include "export/page_cloud.h"
#include "plan/plan.h"
#include "pmsp/io/cloud.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"
#include "pmsp/types.h"
#include "report_photos.h"

namespace pmsp::tool {

/// Returns the facts about a run for the page: pairs of name and value. `stats`: as written by --stats; values of wrong
/// type count as missing.
nlohmann::ordered_json report_facts(const nlohmann::ordered_json& stats);

/// Returns pairs of activity and seconds.
nlohmann::ordered_json report_times(const nlohmann::ordered_json& stats);

/// Returns problems that follow from the counts, in plain words.
std::vector<std::string> report_problems(const nlohmann::ordered_json& stats);

/// Returns "3", "3 and 4", "3 to 5 and 9": runs of adjacent ids in `order`.
std::string list_of_keyframes(const std::vector<std::int64_t>& ids, const std::vector<std::int64_t>& order);

/// Mission as one page for a browser: input, statistics and points. See docs/report.md. Memory: its points (15 bytes
/// each) and JPEGs.
class ReportPage {
 public:
  /// `map` must outlive it. `keyframes`: expected number of images. Throws OutputError.
  ReportPage(const ReportArguments& arguments, const CloudHeader& header, const SlamMap& map, std::size_t keyframes);

  /// Receives all points of the cloud.
  PageCloud& cloud() { return cloud_; }

  /// To be called for each image before the densifier; `index` counts from 0.
  void add_image(std::size_t index, const Keyframe& keyframe);
  /// Whether the last added keyframe is used.
  void set_used(std::int64_t id, bool used);
  void add_depth(const DepthMap& map);

  /// Use of a keyframe.
  void set_use(const PlanEntry& entry);

  /// Sets a Potree folder of the same points, from which the page loads the rest when served. Ignored unless it is in
  /// the page's folder or below.
  void set_potree(const std::filesystem::path& folder);

  /// Names in the page's directory that it loads files of.
  std::vector<std::string> beside() const;

  /// Keyframes whose images this run does not read keep the photos of a previous run.
  void keep_photos() { keeps_photos_ = true; }

  /// Input of `convert` that gives this cloud. Default: the first output of the run that `convert` reads.
  void set_source(const std::filesystem::path& source) { source_ = source.string(); }
  /// Direction in the frame of the cloud, of a page without keyframes. Default: the -y axis.
  void set_up(const Eigen::Vector3d& up) { up_ = up; }

  /// Adds a sentence about the page.
  void say(const std::string& note) { notes_.push_back(note); }
  /// Points have no normals: disables back-face culling.
  void leave_out_normals() { has_normals_ = false; }
  /// The y axis of the cloud points north: plans show it.
  void set_north() { has_north_ = true; }

  /// Writes the page. `stats`: of the run, as --stats writes them. Throws OutputError.
  void write(const nlohmann::ordered_json& stats);

 private:
  struct Jpegs {
    std::string image, depth, confidence, panorama;
    std::string depths;  ///< see page_depth; of those with a panorama
    double near = 0.0, far = 0.0, coverage = 0.0, mean_confidence = 0.0;
    double unmasked = 1.0;  ///< share of pixels
    bool has_depth = false;
  };

  nlohmann::ordered_json keyframes_json(const nlohmann::ordered_json& stats) const;
  nlohmann::ordered_json coverage_json() const;
  nlohmann::ordered_json page_json(const nlohmann::ordered_json& stats) const;
  void put(AtomicFile& file, const std::string& name, const std::string& bytes) const;
  std::vector<std::string> problems(const nlohmann::ordered_json& stats, const nlohmann::ordered_json& keyframes) const;

  ReportArguments arguments_;
  const SlamMap& map_;
  Similarity file_from_map_;
  CloudUnit unit_;
  std::size_t keyframes_;
  AtomicFile file_;  ///< opened at the start, so that a long run does not fail at its end
  PageCloud cloud_;
  std::map<std::int64_t, Jpegs> pictures_;
  std::map<std::int64_t, std::string> uses_;
  std::vector<std::string> notes_;
  std::optional<ReportPhotos> photos_;
  bool keeps_photos_ = false;
  std::filesystem::path potree_;  ///< relative to the page's directory; empty = none
  std::string source_;
  Eigen::Vector3d up_ = -Eigen::Vector3d::UnitY();
  bool has_normals_ = true;
  bool has_north_ = false;
  int panoramas_ = 0;
  std::size_t depth_maps_ = 0;
  int depth_width_ = 0;
  std::vector<std::uint32_t> covered_;  ///< per direction of the coverage map: number of depth maps with a depth
};

}  // namespace pmsp::tool
