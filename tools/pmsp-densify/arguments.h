// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cloud_arguments.h"
#include "option_table.h"
#include "workspace/shards.h"

namespace pmsp::tool {

enum class Verb { kRun, kFuse, kMerge, kInfo, kConfig };
enum class ProgressMode { kAuto, kBar, kPlain, kJson, kNone };

/// Values of --mask other than paths.
constexpr const char* kMaskAuto = "auto";
constexpr const char* kMaskNone = "none";

/// File formats of depth, normals and confidence.
struct DepthFormats {
  bool pfm = true, exr = false, png = false;
  bool depth_png = true;  ///< depth only
};

/// Page of a run, or of a cloud.
struct ReportArguments {
  std::filesystem::path path;  ///< empty = no report
  std::int64_t points = 1'000'000;
  int panoramas = 12;
  std::filesystem::path photos;  ///< of all keyframes; empty = none
  std::string unit;              ///< name of the cloud's unit; "" = from the cloud
};

/// Live page of a run.
struct LiveArguments {
  std::optional<std::uint16_t> port;  ///< nullopt = no live page
  std::string address = "127.0.0.1";
  std::filesystem::path token_file;  ///< empty = new random token
  bool keep = false;                 ///< after the run, until a signal
};

/// Parsed command line.
struct Arguments {
  Verb verb = Verb::kRun;

  std::filesystem::path map;
  std::optional<int> component;
  std::filesystem::path points;  ///< PLY
  std::filesystem::path image_list;
  std::filesystem::path camera_from_body;
  std::filesystem::path images;
  std::filesystem::path video;
  std::filesystem::path mask;  ///< empty = --mask auto or none
  double mask_nadir = 0.0;     ///< [deg]
  double mask_zenith = 0.0;    ///< [deg]
  bool no_masks = false;       ///< ignores all masks except --mask, --mask-nadir and --mask-zenith
  bool find_rig = true;        ///< --mask auto
  std::filesystem::path prior_depth;
  std::filesystem::path external_depths;    ///< of fuse
  std::optional<double> depth_scale = 1.0;  ///< of fuse [map units per value]; nullopt = estimated from landmarks
  std::optional<std::int64_t> frame_offset;
  double fps = 0.0;
  bool presentation_times = false;
  bool allow_missing = false;
  bool no_verify = false;
  bool calibrate_lenses = true;

  CloudArguments cloud;
  bool force = false;
  std::filesystem::path depth_maps;
  std::filesystem::path raw_depth_maps;
  DepthFormats depth_formats;
  std::filesystem::path stats;
  std::filesystem::path preview;
  ReportArguments report;
  LiveArguments live;
  std::filesystem::path scratch;  ///< empty = folder of the output
  std::filesystem::path plan;     ///< of info
  std::filesystem::path workspace;
  bool delete_workspace = false;
  bool growing = false;
  bool follow = false;
  std::optional<double> until_idle;  ///< [s]
  std::optional<workspace::Shard> shard;
  std::optional<workspace::Wave> wave;  ///< nullopt = both

  ProgressMode progress = ProgressMode::kAuto;
  bool quiet = false;
  bool verbose = false;
  bool json = false;  ///< of info
  bool print_config = false;
  bool print_memory = false;

  std::optional<std::string> quality;
  std::filesystem::path config;
  std::vector<std::pair<const OptionEntry*, std::string>> overrides;  ///< options set by flags
};

/// Parses the command line. Returns nullopt after printing help or version to stdout. Throws UsageError, InvalidOption.
std::optional<Arguments> parse_arguments(int argc, const char* const* argv);

/// Option of `run`, for verbs that forward options.
struct RunOption {
  std::string names;  ///< "-o,--output"
  std::string name;   ///< long name
  bool takes_value = false;
};
const std::vector<RunOption>& run_options();

/// Rewrites switches as values, so that the last one wins: --x to --x=true, --no-x to --x=false.
void spell_out_switches(std::vector<std::string>& words);

/// Returns "pmsp-densify 0.1.0".
std::string version_text();

/// Commit of the checkout that the build is of, with "+" if files differed from it; "" outside a checkout.
extern const char* const kCommit;

}  // namespace pmsp::tool
