// SPDX-License-Identifier: BSD-2-Clause
#include <exception>
#include <iostream>
#include <new>

#include <CLI/CLI.hpp>

#include "pmsp-eval/commands.h"
#include "pmsp/error.h"
#include "pmsp/version.h"

namespace pmsp::eval {
namespace {

enum ExitCode { kOk = 0, kUsage = 2, kInput = 3, kOutput = 6 };

constexpr double kLarge = 1e6;

/// Command line; percent and centimetres are converted to shares and metres afterwards.
struct Arguments {
  CommonArguments common;
  CloudArguments cloud;
  DepthArguments depth;
  AlignArguments align;
  std::int64_t keyframe = 0;
  bool no_align = false;
  std::vector<double> relative_percent = {1.0, 2.0, 5.0};
  std::vector<double> absolute_cm = {1.0, 2.0, 5.0, 10.0};
  double correct_percent = 5.0;
};

void add_common(CLI::App& app, Arguments& a, bool truth_required) {
  CLI::Option* truth = app.add_option(
      "--gt", a.common.truth,
      "Directory of ground truth: traj_tum.txt, and range_mm/<frame>.png (16-bit, mm; 65535: no surface) or "
      "range/<frame>.pfm, .exr, .npy (m) or .png; optional normal/<frame>.exr (channels X, Y, Z, in "
      "the world of the poses), .pfm or .png; optional label/<frame>.png (16-bit: 1 thin object, "
      "2 mirroring surface, 3 behind glass, 0 other) for figures by label; names may go on after _");
  truth->required(truth_required)->type_name("DIR");
  CLI::Option_group* poses = app.add_option_group("keyframes", "Poses of the keyframes, one of:");
  poses->add_option("--map", a.common.map, "Map of the keyframes, in any format of pmsp-densify")->type_name("FILE");
  poses
      ->add_option("--trajectory", a.common.trajectory,
                   "TUM file, camera to world, in the frame of the result: ts tx ty tz qx qy qz qw")
      ->type_name("FILE");
  poses->require_option(1);
  app.add_option(
         "--time-offset", a.common.alignment.time_offset,
         "Offset added to the keyframes' timestamps to give the time of the truth [s], for maps with Unix times")
      ->capture_default_str()
      ->type_name("S");
  app.add_option("--time-tolerance", a.common.alignment.time_tolerance,
                 "Largest difference between the times of a keyframe and of its true pose [s]")
      ->capture_default_str()
      ->check(CLI::Range(1e-6, kLarge))
      ->type_name("S");
  CLI::Option* no_align = app.add_flag("--no-align", a.no_align,
                                       "No alignment by a similarity: map and truth have the same frame and unit");
  if (truth_required) {
    app.add_flag("--map-is-truth", a.common.map_is_truth,
                 "The poses of the keyframes are the truth [m]: no alignment and no traj_tum.txt; range maps are named "
                 "by keyframe id")
        ->excludes(no_align);
  }
  app.add_option("--json", a.common.json,
                 "Write all figures as JSON; - = standard output (the table then goes to stderr)")
      ->type_name("FILE");
}

template <class T>
void add_number(CLI::App& app, const char* name, T& value, const char* help, double low, double high) {
  app.add_option(name, value, help)
      ->capture_default_str()
      ->check(CLI::Range(static_cast<T>(low), static_cast<T>(high)))
      ->type_name("N");
}

/// Comma-separated thresholds, so that the list does not consume the next argument.
void add_thresholds(CLI::App& app, const char* name, std::vector<double>& values, const char* help) {
  app.add_option(name, values, help)
      ->capture_default_str()
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(CLI::Range(1e-6, kLarge))
      ->type_name("N,N,...");
}

void add_measuring(CLI::App& app, Arguments& a, RenderArguments& render) {
  app.add_option("--gt-fps", a.common.truth_fps, "Rate that the frame numbers of the range maps count in [1/s]")
      ->capture_default_str()
      ->check(CLI::Range(1e-3, kLarge))
      ->type_name("FPS");
  app.add_option("--gt-png-scale", a.common.truth_png_scale,
                 "Length of one gray level of the 16-bit PNGs range/<frame>.png [m]; no default")
      ->check(CLI::Range(1e-12, kLarge))
      ->type_name("M");
  add_thresholds(app, "--relative", a.relative_percent, "Thresholds relative to distance [%]");
  app.add_option("--render", render.folder, "Write error pictures (PNG) into this directory")->type_name("DIR");
  app.add_option("--render-keyframes", render.keyframes, "Keyframes with a picture, evenly spread; 0 = all")
      ->capture_default_str()
      ->check(CLI::Range(0, 1000000))
      ->type_name("N");
  app.add_option("--threads", a.common.threads, "Threads; 0 = one for each CPU")
      ->capture_default_str()
      ->check(CLI::Range(0, 1024))
      ->type_name("N");
}

CLI::App* add_cloud(CLI::App& app, Arguments& a) {
  CLI::App* cloud = app.add_subcommand(
      "cloud",
      "Examples:\n  pmsp-eval cloud cloud.ply --gt gt --map map.msg\n"
      "  pmsp-eval cloud cloud.ply --gt gt --map map.msg --time-offset=-1763660000.25 --json figures.json\n"
      "  pmsp-eval cloud cloud.ply --gt gt --trajectory keyframes_tum.txt --render pictures\n\n"
      "Measures a cloud: share of each keyframe's view that it covers, share of that which is correct, and distances "
      "between cloud and true surface.");
  cloud
      ->add_option(
          "cloud", a.cloud.cloud,
          "PLY, LAS, Potree directory or workspace; a transform in its header is inverted, which gives the frame and "
          "unit of the keyframes")
      ->required()
      ->type_name("CLOUD");
  cloud->add_flag("--as-is", a.cloud.as_is,
                  "The cloud is in the frame and unit of the keyframes, regardless of its header");
  add_common(*cloud, a, true);
  add_measuring(*cloud, a, a.cloud.render);
  add_thresholds(*cloud, "--absolute", a.absolute_cm, "Thresholds for distances [cm]");
  add_number(*cloud, "--correct", a.correct_percent, "A hit is correct within this share of the true range [%]", 1e-6,
             1e3);
  add_number(*cloud, "--slack", a.cloud.views.slack_px,
             "Pixels of the range map about the true one that also count [px]", 0, 100);
  add_number(*cloud, "--view-height", a.cloud.views.height, "Height of the views, half their width [px]", 8, 8192);
  add_number(*cloud, "--max-keyframes", a.cloud.views.max_keyframes, "Views, evenly spread over the keyframes; 0 = all",
             0, kLarge);
  add_number(*cloud, "--max-range", a.cloud.measures.max_range_m,
             "True surface farther from every keyframe does not count as missing [m]", 1e-3, kLarge);
  add_number(*cloud, "--voxel", a.cloud.surface.voxel_m, "Spacing of the true surface's samples [m]", 1e-3, 10);
  add_number(*cloud, "--gt-frames", a.cloud.surface.max_frames, "Range maps used for the true surface; 0 = all", 0,
             kLarge);
  add_number(*cloud, "--gt-stride", a.cloud.surface.stride, "Step between used rows and columns of a range map [px]", 1,
             64);
  add_number(*cloud, "--gt-max-range", a.cloud.surface.max_range_m, "True range beyond which it is not used [m]", 1e-2,
             kLarge);
  add_number(*cloud, "--max-points", a.cloud.measures.max_points, "Cloud points drawn for accuracy; 0 = all", 0, 4e9);
  add_number(*cloud, "--max-gt-points", a.cloud.measures.max_truth, "Surface samples drawn for completeness; 0 = all",
             0, 4e9);
  add_number(*cloud, "--seed", a.cloud.measures.seed, "Seed of the random samples", 0, 1e15);
  return cloud;
}

CLI::App* add_depth(CLI::App& app, Arguments& a) {
  CLI::App* depth =
      app.add_subcommand("depth",
                         "Examples:\n  pmsp-eval depth depth_maps/ --gt gt --map map.msg\n"
                         "  pmsp-eval depth depth_maps/ --gt gt --map map.msg --png-scale 0.001 --render pictures\n"
                         "  pmsp-eval depth estimate.pfm --keyframe 42 --gt gt --map map.msg --json -\n"
                         "  pmsp-eval depth depth_maps/ --gt gt --map map.msg --calibration calibration.png\n\n"
                         "Measures depth maps against the true range of their keyframes, pixel by pixel, and errors "
                         "over confidence: shares within thresholds of all pixels, and the usual figures (AbsRel, "
                         "SqRel, RMSE, log10, shares of ratios below 1.25^n, normals) of those with an estimate, "
                         "plain and by solid angle.");
  depth
      ->add_option("inputs", a.depth.inputs,
                   "Directories of depth_<keyframe id>.pfm (with --png-scale: .png), or single files")
      ->required()
      ->type_name("PATH");
  add_common(*depth, a, true);
  add_measuring(*depth, a, a.depth.render);
  depth->add_option("--keyframe", a.keyframe, "Keyframe id of a single file, or the only one of a directory; >= 0")
      ->check(CLI::NonNegativeNumber)
      ->type_name("ID");
  depth
      ->add_option("--png-scale", a.depth.png_scale, "Length of one gray level of a 16-bit PNG [map units]; no default")
      ->check(CLI::Range(1e-12, 1e12))
      ->type_name("UNITS");
  depth->add_flag(
      "--own-scales", a.depth.own_scales,
      "One scale per depth map (median of truth / estimate) instead of one for all: excludes the scale drift "
      "of a SLAM");
  depth->add_option("--gt-max-range", a.depth.max_true_range_m, "True range beyond which pixels do not count [m]")
      ->check(CLI::Range(1e-2, kLarge))
      ->type_name("M");
  add_number(*depth, "--slack", a.depth.measures.slack_px,
             "Pixels of the range map about the true one that also count [px]", 0, 100);
  add_number(*depth, "--correct", a.correct_percent,
             "By label, an estimate is wrong beyond this share of the true range [%]", 1e-6, 1e3);
  depth
      ->add_option("--calibration", a.depth.calibration,
                   "Plot error over confidence (PNG); needs confidence_<keyframe id>.pfm beside the depth maps")
      ->type_name("FILE");
  return depth;
}

CLI::App* add_align(CLI::App& app, Arguments& a) {
  CLI::App* align = app.add_subcommand(
      "align",
      "Examples:\n  pmsp-eval align --gt gt --map map.msg\n"
      "  pmsp-eval align --map map.msg --write-trajectory keyframes_tum.txt\n"
      "  pmsp-eval align --gt gt --map map.msg --write-trajectory aligned_tum.txt --aligned\n\n"
      "Fits the similarity between a map and the truth, and writes the map's keyframes as a TUM file.");
  add_common(*align, a, false);
  align->add_option("--write-trajectory", a.align.write_trajectory, "Write the keyframes' poses, camera to world (TUM)")
      ->type_name("FILE");
  align->add_flag("--aligned", a.align.aligned, "Write them in the frame of the truth [m], not of the map; needs --gt");
  return align;
}

void run(const CLI::App& cloud, const CLI::App& depth, Arguments& a) {
  std::vector<double> relative = a.relative_percent;
  for (double& value : relative) value /= 100.0;
  for (double& value : a.absolute_cm) value /= 100.0;
  a.common.alignment.enabled = !a.no_align;
  if (cloud.parsed()) {
    a.cloud.measures.relative = relative;
    a.cloud.measures.absolute_m = a.absolute_cm;
    a.cloud.views.max_relative_error = a.correct_percent / 100.0;
    run_cloud(a.common, a.cloud);
  } else if (depth.parsed()) {
    a.depth.measures.relative = relative;
    a.depth.labels.max_relative_error = a.correct_percent / 100.0;
    if (depth.count("--keyframe") > 0) a.depth.keyframe = a.keyframe;
    run_depth(a.common, a.depth);
  } else {
    if (a.common.truth.empty() && (a.align.write_trajectory.empty() || a.align.aligned || !a.common.json.empty())) {
      throw pmsp::InvalidOption(
          "--gt is missing; only --write-trajectory without --aligned and --json works without it");
    }
    run_align(a.common, a.align);
  }
}

int fail(ExitCode code, const char* what) {
  std::cerr << "pmsp-eval: " << what << std::endl;
  return code;
}

int run_tool(int argc, char** argv) {
  CLI::App app(
      "Examples:\n  pmsp-eval cloud cloud.ply --gt gt --map map.msg\n  pmsp-eval depth depth_maps/ --gt gt --map "
      "map.msg\n"
      "  pmsp-eval align --gt gt --map map.msg\n\n"
      "Compares results of pmsp-densify with ground truth. Exit codes: 0 done, 2 wrong usage, 3 input unusable, 6 "
      "output "
      "cannot be written.",
      "pmsp-eval");
  Arguments arguments;
  app.set_version_flag("--version", "pmsp-eval " PMSP_VERSION_STRING);
  app.require_subcommand(1);
  const CLI::App* cloud = add_cloud(app, arguments);
  const CLI::App* depth = add_depth(app, arguments);
  add_align(app, arguments);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kOk : kUsage;
  }
  run(*cloud, *depth, arguments);
  return kOk;
}

}  // namespace
}  // namespace pmsp::eval

int main(int argc, char** argv) {
  using pmsp::eval::fail;
  try {
    return pmsp::eval::run_tool(argc, argv);
  } catch (const pmsp::InvalidOption& error) {
    return fail(pmsp::eval::kUsage, error.what());
  } catch (const pmsp::OutputError& error) {
    return fail(pmsp::eval::kOutput, error.what());
  } catch (const std::bad_alloc&) {
    return fail(pmsp::eval::kInput, "the memory does not suffice for the input");
  } catch (const std::exception& error) {
    return fail(pmsp::eval::kInput, error.what());
  }
}
