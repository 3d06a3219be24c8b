// SPDX-License-Identifier: BSD-2-Clause
#include "arguments.h"

#include <algorithm>
#include <climits>
#include <cstdint>
#include <iostream>
#include <sstream>
#include <system_error>

#include <CLI/CLI.hpp>

#include "command_line.h"
#include "exit_code.h"
#include "machine.h"
#include "numbers.h"
#include "options.h"
#include "pmsp/io/map.h"
#include "pmsp/stages.h"
#include "pmsp/version.h"
#include "report.h"
#include "shard.h"
#include "web/http_server.h"

namespace pmsp::tool {
namespace {

constexpr const char* kHelpAll = "--help-all";
constexpr const char* kAboutHelp = "Common options; --help-all: every option";

/// Hides uncommon options from the help: all of them, or only the library's.
void shorten_help(CLI::App& verb, bool all) {
  std::vector<std::string> stages;
  for (const OptionEntry& entry : option_table()) stages.emplace_back(entry.stage);
  for (CLI::Option* option : verb.get_options()) {
    const bool of_library = std::find(stages.begin(), stages.end(), option->get_group()) != stages.end();
    if ((all || of_library) && !is_common(*option)) option->group("");
  }
}

DepthFormats depth_formats_from(const char* option, const std::string& list, bool may_be_pfm) {
  DepthFormats formats{false, false, false, false};
  std::istringstream names(list);
  std::string name;
  bool is_good = !list.empty() && list.back() != ',';
  while (is_good && std::getline(names, name, ',')) {
    is_good = (name == "pfm" && may_be_pfm) || name == "exr" || name == "png";
    formats.pfm = formats.pfm || name == "pfm";
    formats.exr = formats.exr || name == "exr";
    formats.png = formats.png || name == "png";
  }
  if (is_good) return formats;
  throw UsageError(std::string(option) + " is \"" + list + "\"; expected " + (may_be_pfm ? "pfm, " : "") +
                   "exr or png, separated by commas");
}

std::int64_t frame_offset_from(const std::string& text) {
  return number_in<std::int64_t>("--frame-offset", text, INT64_MIN, INT64_MAX,
                                 "a whole number of frames, such as 12 or -12");
}

double frame_rate_from(const std::string& text) {
  return number_in("--fps", text, 0.0, 1e6, "frames per second up to 1000000, or 0 for the map's own");
}

double cap_from(const char* option, const std::string& text) {
  return number_in(option, text, 0.0, 90.0, "degrees, 0 to 90");
}

std::optional<double> depth_scale_from(const std::string& text) {
  if (text == "auto") return std::nullopt;
  return positive_from("--depth-scale", text, "a number > 0, or auto");
}

double idle_seconds_from(const std::string& text) {
  return number_in("--until-idle", text, 0.0, 1e6, "seconds, 0 to 1000000");
}

void add_inputs(CLI::App& app, Arguments& a) {
  std::string formats;
  for (const std::string& what : map_formats()) formats += (formats.empty() ? "" : ", ") + what;
  app.add_option("map", a.map, "Map of a SLAM or reconstruction program: " + formats)->type_name("MAP");
  app.add_option(
         "--images", a.images,
         "Directory of the keyframes' images, named as in MAP, else by keyframe id, timestamp or frame index [default: "
         "the directory stored in MAP]")
      ->type_name("DIR")
      ->group("Input");
  app.add_option_function<std::string>(
         "--component",
         [&a](const std::string& text) {
           a.component = number_in("--component", text, 0, INT_MAX, "a whole number from 0");
         },
         "Reconstruction in a MAP of several, from 0 [default: the largest]")
      ->type_name("N")
      ->group("Input");
  app.add_option("--points", a.points, "PLY file of points in the frame of MAP, its landmarks if it has none")
      ->type_name("FILE")
      ->group("Input");
  app.add_option("--image-list", a.image_list,
                 "Names of the images: lines \"timestamp name\", or \"name\" for each keyframe in the order of ids")
      ->type_name("FILE")
      ->group("Input");
  app.add_option("--camera-from-body", a.camera_from_body,
                 "Transform from body to camera, for a trajectory of a body (IMU, base): 12 or 16 numbers, rows of a "
                 "matrix, or tx ty tz qx qy qz qw; or a YAML file with T_cam_imu (Kalibr), T_BS (EuRoC) or "
                 "body_T_cam0 (VINS)")
      ->type_name("FILE")
      ->group("Input");
  app.add_option("--video", a.video, "Video that the SLAM processed, instead of --images")
      ->type_name("FILE")
      ->group("Input");
  app.add_option_function<std::string>(
         "--frame-offset", [&a](const std::string& text) { a.frame_offset = frame_offset_from(text); },
         "Offset added to the frame indices of keyframes; images are then paired by frame index only, not by other "
         "names or presentation times. Unix times count from the first keyframe [frames; default: estimated]")
      ->type_name("N")
      ->group("Input");
  app.add_option_function<std::string>(
         "--fps", [&a](const std::string& text) { a.fps = frame_rate_from(text); },
         "Frame rate that turns timestamps into frame indices [1/s; default 0 = that of the map]")
      ->type_name("F")
      ->group("Input");
  app.add_flag("--presentation-times", a.presentation_times,
               "With --video: timestamps are presentation times of its frames, not counts of frames")
      ->group("Input");
  app.add_flag("--allow-missing", a.allow_missing, "Accept images for fewer than half of the keyframes")
      ->group("Input");
}

void add_densifier_options(CLI::App& app, Arguments& a) {
  app.add_option_function<std::string>(
         "--quality", [&a](const std::string& name) { a.quality = name; },
         "Preset: online (640 x 320, for live use), normal (1440 x 720), high (size of the images) or paper (Surmann "
         "et al. 2022 as published, for comparison); --config and flags override its options [default normal]")
      ->type_name("NAME")
      ->group("Configuration");
  app.add_option(
         "--config", a.config,
         "JSON file with options, as printed by `config`, that override the preset; flags override them. Its key "
         "\"quality\" selects the preset if --quality is not given")
      ->type_name("FILE")
      ->group("Configuration");
  for (const OptionEntry& entry : option_table()) {
    const auto add_override = [&a, &entry](const std::string& text) { a.overrides.emplace_back(&entry, text); };
    app.add_option_function<std::string>(flags_of(entry), add_override, description_of(entry))
        ->type_name(entry.is_switch() ? " " : "V")
        ->group(entry.stage);
  }
}

void add_cloud(CLI::App& app, Arguments& a) {
  const char* group = "Output";
  add_cloud_options(app, a.cloud);
  app.add_flag("--force", a.force, "Overwrite existing outputs")->group(group);
  app.add_option("--stats", a.stats, "File for options, counts and times of each stage, ignored keyframes (JSON)")
      ->type_name("FILE")
      ->group(group);
}

void add_outputs(CLI::App& app, Arguments& a) {
  const char* group = "Output";
  add_cloud(app, a);
  app.add_option("--depth-maps", a.depth_maps,
                 "Directory for filtered depth, normal and confidence of each keyframe, and index.json")
      ->type_name("DIR")
      ->group(group);
  app.add_option_function<std::string>(
         "--depth-format",
         [&a](const std::string& list) { a.depth_formats = depth_formats_from("--depth-format", list, true); },
         "Formats of depth maps: pfm, exr or png (16-bit), separated by commas [default: pfm, and the depth as "
         "png]")
      ->type_name("NAMES")
      ->group(group);
  app.add_option_function<std::string>(
         "--dataset-depth",
         [&a](const std::string& list) {
           const DepthFormats formats = depth_formats_from("--dataset-depth", list, false);
           a.cloud.dataset_depth.png = formats.png;
           a.cloud.dataset_depth.exr = formats.exr;
         },
         "COLMAP, nerfstudio: depth, normals and confidence of each image in the dataset, as png (16-bit), exr or "
         "both, "
         "separated by commas [default: none]")
      ->type_name("NAMES")
      ->group(group);
  app.add_option(
         "--scratch", a.scratch,
         "Existing directory for temporary data of keyframes whose points are not final (normal, high; 17 bytes per "
         "pixel of each) [default: that of the cloud; of a shard: the workspace]")
      ->type_name("DIR")
      ->group(group);
  app.add_option("--preview", a.preview, "Directory for pictures of the result (PNG)")->type_name("DIR")->group(group);
  add_report_options(app, a.report);
}

void add_run_outputs(CLI::App& app, Arguments& a) {
  const char* group = "Output";
  add_outputs(app, a);
  app.add_option("--raw-depth-maps", a.raw_depth_maps, "As --depth-maps, before filtering; not with --workspace")
      ->type_name("DIR")
      ->group(group);
  app.add_option_function<std::string>(
         "--workspace",
         [&a](const std::string& folder) {
           if (folder.empty()) throw UsageError("--workspace is empty; expected a directory");
           a.workspace = folder;
         },
         "Directory that caches the results of each keyframe: the same command with a newer map, with more images, or "
         "after an interruption computes only keyframes that are new, moved or missing (16 bytes per pixel of the "
         "depth maps and 40 per point)")
      ->type_name("DIR")
      ->group(group);
  app.add_flag(
         "--delete-workspace", a.delete_workspace,
         "Delete the workspace at the end: a single run becomes resumable. It caches plane maps only (16 bytes per "
         "pixel of the depth maps), and none that are computed faster than 100 MB/s, as by a GPU")
      ->group(group);
  app.add_flag("--growing", a.growing,
               "With --workspace: more keyframes follow; the newest ones get fewer passes until a run without this "
               "option")
      ->group(group);
  app.add_flag("--follow", a.follow, "With --workspace: run again whenever the map or the images change, until Ctrl-C")
      ->group(group);
  app.add_option_function<std::string>(
         "--until-idle", [&a](const std::string& text) { a.until_idle = idle_seconds_from(text); },
         "With --follow: end after this time without changes [s]")
      ->type_name("S")
      ->group(group);
}

void add_plan(CLI::App& app, Arguments& a) {
  const char* group = "Output";
  app.add_option("--plan", a.plan,
                 "File for the plan (JSON): use and dependencies of each keyframe, with the options in force; blurred "
                 "keyframes are detected if images are given")
      ->type_name("FILE")
      ->group(group);
}

void add_live_options(CLI::App& run, LiveArguments& a) {
  const char* group = "Output";
  run.add_option_function<std::string>(
         "--live-view", [&a](const std::string& text) { a.port = port_from("--live-view", text); },
         "Port of a live page with the points computed so far, moved with a newer map (--follow); its address is "
         "printed on stderr [1 to 65535; 0 = any free port]")
      ->type_name("PORT")
      ->group(group);
  run.add_option(
         "--live-address", a.address,
         "Address of the page of --live-view; at an address that others can reach, anyone with its token can see it "
         "[default 127.0.0.1]")
      ->type_name("A")
      ->group(group);
  run.add_option(
         "--live-token", a.token_file,
         "File with the token of the page's address, 16 to 128 letters, digits, - and _, for an address that stays the "
         "same; a missing file is created, with a random token [default: a new token in each run]")
      ->type_name("FILE")
      ->group(group);
  run.add_flag("--live-keep", a.keep,
               "Keep the page of --live-view after the run, until Ctrl-C; it links to the report (--report)")
      ->group(group);
}

ProgressMode progress_mode(const std::string& name) {
  if (name == "auto") return ProgressMode::kAuto;
  if (name == "bar") return ProgressMode::kBar;
  if (name == "plain") return ProgressMode::kPlain;
  if (name == "json") return ProgressMode::kJson;
  if (name == "none") return ProgressMode::kNone;
  throw UsageError("--progress is \"" + name + "\"; expected auto, bar, plain, json or none");
}

void add_behaviour(CLI::App& app, Arguments& a) {
  const char* group = "Behaviour";
  app.add_option_function<std::string>(
         "--progress", [&a](const std::string& name) { a.progress = progress_mode(name); },
         "auto (bar on a terminal, else plain), bar, plain, json (JSON lines on stdout) or none [default auto]")
      ->type_name("MODE")
      ->group(group);
  app.add_flag("-q,--quiet", a.quiet, "Warnings and errors only")->group(group);
  app.add_flag("-v,--verbose", a.verbose, "One line per keyframe, with its use")->group(group);
}

void set_mask(Arguments& a, const std::string& text) {
  a.find_rig = text == kMaskAuto;
  a.no_masks = a.no_masks || text == kMaskNone;
  a.mask = text == kMaskAuto || text == kMaskNone ? "" : text;
}

/// Options of verbs that read images.
void add_image_inputs(CLI::App& app, Arguments& a) {
  add_inputs(app, a);
  app.add_option_function<std::string>(
         "--mask", [&a](const std::string& text) { set_mask(a, text); },
         "auto: masks that come with the images (named in MAP, in the directory masks beside them, 7_mask.png, alpha), "
         "and the rig, found as objects that move with the camera and written as CLOUD.rig-mask.png; none; an "
         "image whose black pixels are ignored in all keyframes; a directory with a mask for each image (7.jpg.png, "
         "7.png, 7_mask.png or 7.mask.png for 7.jpg); or the SLAM's YAML configuration with mask_rectangles [default "
         "auto]")
      ->type_name("auto|none|FILE|DIR")
      ->group("Input");
  app.add_option_function<std::string>(
         "--mask-nadir", [&a](const std::string& text) { a.mask_nadir = cap_from("--mask-nadir", text); },
         "Radius of an ignored cap below the camera, for a rig or a hand [deg, 0 to 90; default 0 = none]")
      ->type_name("DEG")
      ->group("Input");
  app.add_option_function<std::string>(
         "--mask-zenith", [&a](const std::string& text) { a.mask_zenith = cap_from("--mask-zenith", text); },
         "Radius of an ignored cap above the camera, for a pole or a rotor [deg, 0 to 90; default 0 = none]")
      ->type_name("DEG")
      ->group("Input");
  app.add_flag("--no-masks", a.no_masks,
               "Ignore masks that come with the images: alpha channels, masks named in MAP, the directory masks beside "
               "them, 7_mask.png or 7.mask.png; the rig is still found")
      ->group("Input");
  app.add_flag("--no-verify", a.no_verify,
               "No checks of the pairing of images with keyframes and of the conventions of MAP")
      ->group("Input");
}

void add_run(CLI::App& app, Arguments& a) {
  add_image_inputs(app, a);
  app.add_option(
         "--prior-depth", a.prior_depth,
         "Directory with a depth image for each image (7.pfm, 7.exr, 7.npy or 7.png for 7.jpg; or a directory of "
         "--depth-maps): depth or inverse depth along the rays, from a lidar or a network, aligned to the "
         "landmarks and proposed where there is little texture [default: that of ViPE, if MAP is its result]")
      ->type_name("DIR")
      ->group("Input");
  app.add_flag_callback(
         "--no-lens-calibration", [&a] { a.calibrate_lenses = false; },
         "No estimation of the distance of the camera's two lenses (--lens-distance)")
      ->group("Input");
  add_run_outputs(app, a);
  add_behaviour(app, a);
  add_densifier_options(app, a);
}

void add_fuse(CLI::App& app, Arguments& a) {
  app.add_option(
         "depth", a.external_depths,
         "Directory with a depth image for each image (7.pfm, 7.exr, 7.npy or 7.png for 7.jpg), distances along the "
         "rays; or a directory of --depth-maps or --raw-depth-maps; or depth/ of ViPE's results")
      ->type_name("DIR");
  add_image_inputs(app, a);
  app.add_option_function<std::string>(
         "--depth-scale", [&a](const std::string& text) { a.depth_scale = depth_scale_from(text); },
         "Length of one unit of the depth images, such as 0.001; auto: scale and shift of each image are estimated "
         "from the landmarks, for depth of unknown unit and for inverse depth [map units; default 1]")
      ->type_name("S")
      ->group("Input");
  add_outputs(app, a);
  add_behaviour(app, a);
  add_densifier_options(app, a);
}

std::vector<std::string> negative_flags() {
  std::vector<std::string> names;
  for (const OptionEntry& entry : option_table()) {
    if (entry.is_switch()) names.push_back(negative_flag_of(entry));
  }
  return names;
}

void print_version() {
  const std::string commit = *kCommit == '\0' ? "" : "commit " + std::string(kCommit) + "; ";
  std::cout << version_text() << " (" << commit << PMSP_BUILD_TYPE << "; backends: cpu" << (has_cuda() ? ", cuda" : "")
            << "; SIMD: " << name_of(widest_simd()) << ")\n";
}

/// Throws UsageError for a word that resembles a verb, unless a file of that name exists.
void refuse_unknown_verb(const std::string& word) {
  std::error_code ignored;
  const std::string similar = suggestion(word, verbs());
  if (similar.empty() || word.rfind('-', 0) == 0 || std::filesystem::exists(word, ignored)) return;
  throw UsageError("there is no verb or map \"" + word + "\"" + similar);
}

std::vector<std::string> words_of(int argc, const char* const* argv) {
  std::vector<std::string> words(argv + std::min(argc, 1), argv + argc);
  if (words.empty()) throw UsageError("MAP is missing: pmsp-densify MAP --images DIR; see --help");
  const std::vector<std::string>& all = verbs();
  const bool has_verb = std::find(all.begin(), all.end(), words[0]) != all.end();
  if (words[0] == "info" && words.size() > 1 && words[1] == "run") words.erase(words.begin() + 1);
  const bool asks = words[0] == "-h" || words[0] == "--help" || words[0] == kHelpAll || words[0] == "--version";
  if (!has_verb && !asks) {
    refuse_unknown_verb(words[0]);
    words.insert(words.begin(), "run");
  }
  spell_out_switches(words);
  return words;
}

void check_fuse(Arguments& a) {
  if (a.external_depths.empty() || a.map.empty()) {
    throw UsageError(std::string(a.external_depths.empty() ? "DIR and MAP are" : "MAP is") +
                     " missing: pmsp-densify fuse DIR MAP --images IMAGES; see fuse --help");
  }
  a.calibrate_lenses = a.find_rig = false;  // used for PatchMatch only
}

void check_live(const LiveArguments& a, bool is_shard) {
  web::is_loopback(a.address);  // or it is none
  if (!a.port && !a.token_file.empty()) throw UsageError("--live-token needs --live-view PORT");
  if (!a.port && a.keep) throw UsageError("--live-keep needs --live-view PORT");
  if (!a.port) return;
  require_report_page("--live-view");
  if (is_shard) throw UsageError("a shard makes no cloud; leave --live-view out");
}

void check_run(const Arguments& a) {
  if (a.print_config) return;
  if (a.map.empty()) throw UsageError("MAP is missing: pmsp-densify MAP --images DIR; see --help");
  if (a.delete_workspace && a.workspace.empty()) throw UsageError("--delete-workspace needs --workspace DIR");
  if (a.delete_workspace && (a.growing || a.follow)) {
    throw UsageError(std::string("--delete-workspace and ") + (a.growing ? "--growing" : "--follow") +
                     " exclude each other: the next run needs the workspace");
  }
  if (a.growing && a.workspace.empty()) throw UsageError("--growing needs --workspace DIR");
  if (a.growing && a.follow) throw UsageError("--growing and --follow exclude each other: --follow implies it");
  if (a.follow && a.workspace.empty()) throw UsageError("--follow needs --workspace DIR");
  if (a.until_idle && !a.follow) throw UsageError("--until-idle needs --follow");
  if (!a.workspace.empty() && !a.raw_depth_maps.empty()) {
    throw UsageError(
        "--raw-depth-maps and --workspace exclude each other: a workspace contains filtered depth maps only");
  }
}

}  // namespace

std::string version_text() { return kGenerator; }

void spell_out_switches(std::vector<std::string>& words) {
  for (std::string& word : words) {
    for (const OptionEntry& entry : option_table()) {
      if (!entry.is_switch()) continue;
      if (word == flag_of(entry)) {
        word += "=true";
      } else if (word == negative_flag_of(entry)) {
        word = flag_of(entry) + "=false";
      }
    }
  }
}

const std::vector<RunOption>& run_options() {
  static const std::vector<RunOption> options = [] {  // cached: used for each row of a manifest
    Arguments unused;
    CLI::App run;
    run.set_help_flag();
    add_run(run, unused);
    std::vector<RunOption> all;
    for (const CLI::Option* option : run.get_options()) {
      if (option->get_lnames().empty()) continue;
      all.push_back(
          {option->get_name(false, true), "--" + option->get_lnames().back(), option->get_items_expected_max() > 0});
    }
    return all;
  }();
  return options;
}

std::optional<Arguments> parse_arguments(int argc, const char* const* argv) {
  const std::vector<std::string> words = words_of(argc, argv);
  Arguments a;
  CLI::App app("", "pmsp-densify");
  wrap_help(app, 38);
  app.option_defaults()->take_last();
  app.require_subcommand(1);
  bool version = false;
  app.add_flag("--version", version, "Version, commit, build type, backends, instruction set");
  CLI::App& run = *app.add_subcommand("run", "Map and images to a cloud (the default verb)");
  CLI::App& fuse = *app.add_subcommand("fuse", "Existing depth maps to a cloud, without PatchMatch");
  CLI::App& merge = *app.add_subcommand("merge", "Results of shards (run --shard) to a cloud");
  CLI::App& info = *app.add_subcommand("info", "Contents of a map, pairing of its images, and forecast of a run");
  CLI::App& config = *app.add_subcommand("config", "Print the options in force as JSON, for --config");
  app.add_subcommand("batch", "A list of missions, each in a separate process and directory; see batch --help");
  app.add_subcommand("convert", "A cloud or a workspace in another format, frame or unit; see convert --help");
  app.add_subcommand("report", "The page of --report from a cloud or a workspace; see report --help");
  app.add_subcommand("serve", "A report and its directory over HTTP for a browser; see serve --help");
  for (CLI::App* verb : {&run, &fuse, &merge, &info, &config}) verb->allow_extras();
  add_run(run, a);
  run.add_flag("--print-config", a.print_config, "Print the options in force as JSON and stop")->group("Behaviour");
  run.add_flag("--print-memory", a.print_memory,
               "Print the expected memory of the run as JSON, by the map and the size of the first image, "
               "and stop")
      ->group("Behaviour");
  add_shard_options(run, a);
  add_live_options(run, a.live);
  add_fuse(fuse, a);
  merge.add_option("workspace", a.workspace, "Workspace of the shards")->type_name("WORKSPACE");
  add_cloud(merge, a);
  add_report_options(merge, a.report);
  add_behaviour(merge, a);
  add_run(info, a);
  add_shard_options(info, a);
  add_live_options(info, a.live);
  info.add_flag("--json", a.json, "As JSON");
  add_plan(info, a);
  add_densifier_options(config, a);
  if (std::find(words.begin(), words.end(), kHelpAll) == words.end()) {
    shorten_help(run, true);
    shorten_help(fuse, true);
    shorten_help(info, true);
    shorten_help(config, false);
  }
  for (CLI::App* verb : {&run, &fuse, &merge, &info, &config}) verb->set_help_flag("-h,--help,--help-all", kAboutHelp);

  if (words[0] == "--version") {
    print_version();
    return std::nullopt;
  }
  const bool has_run_alone = words[0] == "run" && words.size() == 2;
  const std::string& last = words.back();
  if (words[0] == "-h" || words[0] == "--help" || (has_run_alone && (last == "-h" || last == "--help"))) {
    std::cout << short_help();
    return std::nullopt;
  }
  if (words[0] == kHelpAll) {
    std::cout << run.help("pmsp-densify");
    return std::nullopt;
  }
  try {
    app.parse(std::vector<std::string>(words.rbegin(), words.rend()));
  } catch (const CLI::CallForHelp&) {
    std::cout << app.get_subcommands().front()->help("pmsp-densify");
    return std::nullopt;
  } catch (const CLI::ParseError& error) {
    throw UsageError(error.what());
  }
  refuse_extra_words(*app.get_subcommands().front(), negative_flags());
  check_cloud_arguments(a.cloud);
  a.verb = fuse.parsed()     ? Verb::kFuse
           : merge.parsed()  ? Verb::kMerge
           : info.parsed()   ? Verb::kInfo
           : config.parsed() ? Verb::kConfig
                             : Verb::kRun;
  if (!a.images.empty() && !a.video.empty()) throw UsageError("--images and --video exclude each other");
  if (a.presentation_times && a.video.empty()) throw UsageError("--presentation-times needs --video FILE");
  if (a.presentation_times && a.fps > 0.0) {
    throw UsageError("--presentation-times and --fps exclude each other: timestamps are times, or counts of frames");
  }
  if (a.verb == Verb::kInfo && a.map.empty()) throw UsageError("MAP is missing: pmsp-densify info MAP");
  if (a.cloud.has_map() && a.verb != Verb::kConfig) check_map_units(a.cloud, unit_of_frame(a.cloud.frame));
  if (a.verb == Verb::kRun || a.verb == Verb::kInfo) check_run(a);
  if (a.verb == Verb::kFuse) check_fuse(a);
  check_report(a.report);
  if (!a.report.unit.empty()) check_unit("--report-unit", a.report.unit, unit_of_frame(a.cloud.frame));
  if (a.verb == Verb::kRun || a.verb == Verb::kInfo) {
    check_live(a.live, a.shard.has_value());
    check_shard(a, app.get_subcommands().front()->count("--output") > 0);
  }
  if (a.verb == Verb::kMerge && a.workspace.empty()) {
    throw UsageError("WORKSPACE is missing: pmsp-densify merge WORKSPACE -o cloud.ply");
  }
  return a;
}

}  // namespace pmsp::tool
