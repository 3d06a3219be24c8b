// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cloud_arguments.h"
#include "depth_output.h"
#include "live_arguments.h"
#include "option_flags.h"
#include "report_page.h"
#include "workspace/shards.h"

namespace pmsp::tool {

enum class Verb { kRun, kFuse, kMerge, kInfo, kConfig };
enum class ProgressMode { kAuto, kBar, kPlain, kJson, kNone };

/// Words in place of a path after --mask.
constexpr const char* kMaskAuto = "auto";
constexpr const char* kMaskNone = "none";

/// The command line, understood but not yet acted upon.
struct Arguments {
  Verb verb = Verb::kRun;

  std::filesystem::path map;
  std::optional<int> component;
  std::filesystem::path points;  ///< PLY
  std::filesystem::path image_list;
  std::filesystem::path camera_from_body;
  std::filesystem::path images;
  std::filesystem::path video;
  std::filesystem::path mask;  ///< empty: --mask auto or none
  double mask_nadir = 0.0;     ///< [deg]
  double mask_zenith = 0.0;    ///< [deg]
  bool no_masks = false;       ///< none but those of --mask, --mask-nadir and --mask-zenith
  bool find_rig = true;        ///< --mask auto
  std::filesystem::path prior_depth;
  std::filesystem::path given_depth;        ///< fuse
  std::optional<double> depth_scale = 1.0;  ///< fuse [scene units of a value]; nullopt = by the landmarks
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
  std::filesystem::path scratch;  ///< empty = the folder of the output
  std::filesystem::path plan;     ///< info
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
  bool json = false;  ///< info
  bool print_config = false;
  bool print_memory = false;

  std::optional<std::string> quality;
  std::filesystem::path config;
  std::vector<std::pair<const OptionEntry*, std::string>> overrides;  ///< options given as flags
};

/// Reads the command line. nullopt when it asked for help or the version, which is then on stdout. Throws UsageError,
/// InvalidOption.
std::optional<Arguments> parse_arguments(int argc, const char* const* argv);

/// An option of `run`, for a verb that hands options on to it.
struct RunOption {
  std::string names;  ///< "-o,--output"
  std::string name;   ///< the long one
  bool takes_value = false;
};
const std::vector<RunOption>& run_options();

/// Switches take a value inside, so that the last of several wins: --x is --x=true, --no-x is --x=false.
void spell_out_switches(std::vector<std::string>& words);

/// The preset that flag or configuration file name. Throws as effective_options.
Quality quality_of(const Arguments& arguments);

/// Defaults, then the preset of the quality, then the configuration file, then flags; validated. Throws InvalidOption,
/// IoError.
DensifierOptions effective_options(const Arguments& arguments);

/// A warning where --quality was given in vain, because the configuration file and flags set all that it would; ""
/// else.
std::string quality_warning(const Arguments& arguments);

/// "pmsp-densify 0.1.0"
std::string version_text();

}  // namespace pmsp::tool
