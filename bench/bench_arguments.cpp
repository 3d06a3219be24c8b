// SPDX-License-Identifier: BSD-2-Clause
#include "bench_arguments.h"

#include <CLI/CLI.hpp>
#include <algorithm>

#include "cuda/cuda_engine.h"
#include "pmsp-densify/exit_code.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"
#include "pmsp/version.h"
#include "stages.h"

namespace pmsp::bench {
namespace {

constexpr const char* kFooter =
    R"(Without --map and --images the input is made in memory: a flight through a textured room, whose rendering is not
timed. On the CPU with 1 thread, tables show the CPU's time, which a busy machine disturbs least; with more, the wall
clock's. JSON has both. Whole keyframes (keyframe, cloud) run with the largest number of threads only. Repetitions of
all benchmarks are shuffled, so that a passing load hits all alike. On a CUDA device, flights run to and fro over the
keyframes; stages are timed by the device, whole keyframes by the wall clock.

Stages:
)";

constexpr const char* kExamples = R"(
Examples:
  pmsp-bench                                        online quality, widest instruction set, all threads, GPU if there is one
  pmsp-bench --simd scalar,avx2,avx512 --threads 1 --stages patchmatch --backends cpu      SIMD over scalar, per core
  pmsp-bench --backends cuda --iterations 4 --refinements 6 --geometric-passes 0 --json paper.json
  pmsp-bench --backends cuda --width 5760 --image-width 5760
  pmsp-bench --map map.msg --images keyframes/
  pmsp-bench --list
  pmsp-bench write --points 100000000               the cloud's writers; see pmsp-bench write --help
  pmsp-bench --stages median --benchmark_min_time=1 --benchmark_out=google.json

Options that start with --benchmark_ go to Google Benchmark, which times the CPU.

Exit codes: 0 done, 2 wrong usage, 3 input, 4 the machine lacks the instruction set or the device, 6 the JSON file cannot
be written.)";

std::vector<std::string> stage_names() {
  std::vector<std::string> names;
  for (const Stage& stage : all_stages()) names.emplace_back(stage.name);
  return names;
}

std::string footer() {
  std::string text = kFooter;
  for (const Stage& stage : all_stages()) {
    const std::string name = stage.name;
    text += "  " + name + std::string(14 - name.size(), ' ') + stage.what + '\n';
  }
  return text + kExamples;
}

bool has(Simd simd) {
  try {
    const Executor executor(1, simd);
    return executor.simd() == simd;
  } catch (const BackendUnavailable&) {
    return false;
  }
}

/// Returns instruction sets in the order of the columns; throws BackendUnavailable if a requested one is missing.
std::vector<Simd> resolve_simds(const std::vector<std::string>& names) {
  std::vector<Simd> wanted;
  wanted.reserve(names.size());
  for (const std::string& name : names) {
    wanted.push_back(Executor(1, simd_from_name(name)).simd());
  }
  std::vector<Simd> simds;
  for (const Simd simd : {Simd::kScalar, Simd::kAvx2, Simd::kAvx512}) {
    const bool asked = std::find(wanted.begin(), wanted.end(), simd) != wanted.end();
    if (names.empty() ? has(simd) : asked) simds.push_back(simd);
  }
  return simds;
}

std::vector<int> resolve_threads(const std::vector<std::string>& texts) {
  std::vector<int> threads;
  threads.reserve(texts.size());
  for (const std::string& text : texts) {
    int count = 0;
    if (text != "all" && (!CLI::detail::lexical_cast(text, count) || count < 1 || count > 1024)) {
      throw tool::UsageError("--threads: '" + text + "'; expected numbers from 1 to 1024, or all");
    }
    threads.push_back(count > 0 ? count : Executor(0).threads());
  }
  std::sort(threads.begin(), threads.end());
  threads.erase(std::unique(threads.begin(), threads.end()), threads.end());
  return threads;
}

/// Sets `cpu` and `cuda`. Throws UsageError; BackendUnavailable if a requested device is missing.
void resolve_backends(const std::vector<std::string>& names, Arguments& arguments) {
  const auto asked = [&](const char* name) { return std::find(names.begin(), names.end(), name) != names.end(); };
  arguments.cpu = names.empty() || asked("cpu");
  arguments.cuda = names.empty() || asked("cuda");
  if (!arguments.cuda) return;
  const std::string why_not = cuda::find_device(arguments.device).why_not;
  if (why_not.empty()) return;
  if (!names.empty()) throw BackendUnavailable("backend cuda: " + why_not);
  arguments.cuda = false;
}

void check_size(const char* option, int width) {
  if (width != 0 && (width < 64 || width > 8192 || width % 4 != 0)) {
    throw tool::UsageError(std::string(option) + " is " + std::to_string(width) +
                           "; expected a multiple of 4 from 64 to 8192");
  }
}

}  // namespace

std::optional<Arguments> parse_arguments(int argc, char** argv) {
  Arguments arguments;
  std::vector<std::string> simds = {"auto"};
  std::vector<std::string> threads = {"all"};
  std::vector<std::string> backends;
  CLI::App app("Times the stages of libpmsp, and whole keyframes, on the CPU's instruction sets and on a CUDA device.",
               "pmsp-bench");
  app.footer(footer());
  app.allow_extras();
  app.set_version_flag("--version", std::string("pmsp-bench ") + PMSP_VERSION_STRING);
  app.add_option("--stages", arguments.stages, "stages to time, default all")
      ->delimiter(',')
      ->check(CLI::IsMember(stage_names()))
      ->option_text("LIST");
  app.add_option("--backends", backends, "cpu, cuda; default cpu and, where a device answers, cuda")
      ->delimiter(',')
      ->check(CLI::IsMember({"cpu", "cuda"}))
      ->option_text("LIST");
  app.add_option("--device", arguments.device, "CUDA device, 0 to 255; default 0")
      ->check(CLI::Range(0, 255))
      ->option_text("N");
  app.add_option("--simd", simds, "instruction sets: scalar, avx2, avx512, auto (the widest), all; default auto")
      ->delimiter(',')
      ->option_text("LIST");
  app.add_option("--threads", threads, "numbers of threads, or all; default all")->delimiter(',')->option_text("LIST");
  app.add_option("--quality", arguments.qualities, "presets: paper, online, normal, high; default online")
      ->delimiter(',')
      ->option_text("LIST");
  app.add_option("--width", arguments.width, "width of the depth maps [px] instead of the preset's, a multiple of 4")
      ->option_text("N");
  app.add_option("--height", arguments.height, "height of the depth maps [px], even; default half the width")
      ->check(CLI::Range(16, 8192))
      ->option_text("N");
  app.add_option("--neighbours", arguments.neighbours, "source keyframes per depth map instead of the preset's, 1 to 8")
      ->check(CLI::Range(1, 8))
      ->option_text("N");
  app.add_option("--iterations", arguments.iterations, "iterations of PatchMatch instead of the preset's, 1 to 100")
      ->check(CLI::Range(1, 100))
      ->option_text("N");
  app.add_option("--refinements", arguments.refinements, "random steps a visit instead of the preset's, 0 to 32")
      ->check(CLI::Range(0, 32))
      ->option_text("N");
  app.add_option("--geometric-passes", arguments.geometric_passes,
                 "passes that look at the neighbours' maps instead of the preset's, 0 to 8")
      ->check(CLI::Range(0, 8))
      ->option_text("N");
  app.add_option("--image-width", arguments.image_width,
                 "width of the images [px], a multiple of 4; default 1920, or the depth maps' width if that is more")
      ->option_text("N");
  CLI::Option* map = app.add_option("--map", arguments.map, "map of a SLAM, instead of the rendered flight")
                         ->check(CLI::ExistingFile)
                         ->option_text("FILE");
  app.add_option("--images", arguments.images, "folder of its keyframes' images")
      ->check(CLI::ExistingDirectory)
      ->needs(map)
      ->option_text("DIR");
  map->needs("--images");
  app.add_option("--keyframes", arguments.keyframes, "length of a flight on the device, 4 to 10000; default 30")
      ->check(CLI::Range(4, 10000))
      ->option_text("N");
  app.add_option("--repetitions", arguments.repetitions,
                 "runs of each benchmark, 1 to 1000; default 3, 2 of whole keyframes, 5 on a device")
      ->check(CLI::Range(1, 1000))
      ->option_text("N");
  app.add_option("--json", arguments.json, "write all figures to this file")->option_text("FILE");
  app.add_flag("--list", arguments.list, "print the names of the benchmarks that would run, and stop");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) {
      app.exit(error);
      return std::nullopt;
    }
    throw tool::UsageError(std::string(error.what()) + "; see pmsp-bench --help");
  }
  for (const std::string& extra : app.remaining()) {
    if (extra.rfind("--benchmark_", 0) != 0) {
      throw tool::UsageError("unknown argument '" + extra + "'; see pmsp-bench --help");
    }
    arguments.google_args.push_back(extra);
  }
  check_size("--width", arguments.width);
  check_size("--image-width", arguments.image_width);
  if (arguments.height % 2 != 0) throw tool::UsageError("--height is odd; expected an even number");
  std::vector<std::string>& qualities = arguments.qualities;
  for (const std::string& quality : qualities) quality_from_name(quality);
  std::sort(qualities.begin(), qualities.end());
  qualities.erase(std::unique(qualities.begin(), qualities.end()), qualities.end());
  if (arguments.stages.empty()) arguments.stages = stage_names();
  if (simds == std::vector<std::string>{"all"}) simds.clear();
  arguments.simds = resolve_simds(simds);
  resolve_backends(backends, arguments);
  arguments.threads = resolve_threads(threads);
  return arguments;
}

}  // namespace pmsp::bench
