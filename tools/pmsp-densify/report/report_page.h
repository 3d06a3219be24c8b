// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "export/files.h"
#include "export/page_cloud.h"
#include "plan/plan.h"
#include "pmsp/io/cloud.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"
#include "pmsp/types.h"

namespace pmsp::tool {

struct ReportArguments {
  std::filesystem::path path;  ///< empty = no report
  std::int64_t points = 1'000'000;
  int panoramas = 12;
  std::string unit;  ///< name of the cloud's unit; "" = as the cloud says
};

/// The name of a cloud's unit: the given one, or else "m" where the cloud is in metres; "" = that of the map.
std::string unit_of_lengths(const std::string& given, const CloudUnit& unit);

/// Throws UsageError where `given`, the value of `option`, is a unit of length that the cloud is not in. Where the
/// cloud does not say its unit, all are taken.
void check_unit(const char* option, const std::string& given, const CloudUnit& unit);

/// "metres, by --scale", "map units (no scale is known)", "not known"
std::string unit_text(const CloudUnit& unit);

/// A mission as one page for a browser: what was run, what came of it, and the points. See docs/report.md. Memory: the
/// points that it holds (15 bytes each), and JPEGs.
class ReportPage {
 public:
  /// `map` must outlive it. `keyframes`: that images are expected of. Throws OutputError.
  ReportPage(const ReportArguments& arguments, const CloudHeader& header, const SlamMap& map, std::size_t keyframes);

  /// To be given all points of the cloud.
  PageCloud& cloud() { return cloud_; }

  /// An image, before the densifier gets it; `index` counts from 0.
  void add_image(std::size_t index, const Keyframe& keyframe);
  /// What the keyframe added last is used for.
  void set_used(std::int64_t id, bool used);
  void add_depth(const DepthMap& map);

  /// What a keyframe is used for.
  void set_use(const PlanEntry& entry);

  /// A Potree folder of the same points, which the page asks for the rest of them where it is served. In vain where it
  /// does not lie beside the page, or below.
  void set_potree(const std::filesystem::path& folder);

  /// A sentence about the page.
  void say(const std::string& note) { notes_.push_back(note); }
  /// The points have none, so that nothing is left out by which side is seen.
  void leave_out_normals() { has_normals_ = false; }

  /// Writes the page. `stats`: of the run, as --stats writes them. Throws OutputError.
  void write(const nlohmann::ordered_json& stats);

 private:
  struct Jpegs {
    std::string image, depth, confidence, panorama;
    double near = 0.0, far = 0.0, coverage = 0.0, mean_confidence = 0.0;
    double unmasked = 1.0;  ///< share of the pixels
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
  AtomicFile file_;  ///< opened at once: a run of hours must not end in front of a file that cannot be made
  PageCloud cloud_;
  std::map<std::int64_t, Jpegs> pictures_;
  std::map<std::int64_t, std::string> uses_;
  std::vector<std::string> notes_;
  std::string potree_;  ///< address, relative to the page; "" = none
  bool has_normals_ = true;
  int panoramas_ = 0;
  std::size_t depth_maps_ = 0;
  int depth_width_ = 0;
  std::vector<std::uint32_t> covered_;  ///< of each direction of the coverage map, depth maps with a depth there
};

}  // namespace pmsp::tool
