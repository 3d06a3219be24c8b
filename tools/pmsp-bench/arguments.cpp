// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-bench/arguments.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>

#include "pmsp-bench/stages.h"
#include "pmsp-densify/exit_code.h"
#include "pmsp/error.h"
#include "pmsp/executor.h"
#include "pmsp/version.h"

namespace pmsp::bench {
namespace {

constexpr const char* kFooter =
    R"(The input is made in memory: a flight through a textured room, whose rendering is not timed. With 1 thread, tables show
the CPU's time, which a busy machine disturbs least; with more, the wall clock's. JSON has both. `keyframe` runs with
the largest number of threads only. Repetitions of all benchmarks are shuffled, so that a passing load hits all alike.

Stages:
)";

constexpr const char* kExamples = R"(
Examples:
  pmsp-bench                                        online quality, 1 thread and all: less than 2 minutes on 2 idle cores
  pmsp-bench --stages patchmatch --threads 1        SIMD over scalar, per core
  pmsp-bench --stages keyframe --simd avx2 --json keyframe.json
  pmsp-bench --quality normal --simd avx512 --repetitions 1
  pmsp-bench --list
  pmsp-bench --stages median --benchmark_min_time=1 --benchmark_out=google.json

Options that start with --benchmark_ go to Google Benchmark.

Exit codes: 0 done, 2 wrong usage, 4 the machine lacks the instruction set, 6 the JSON file cannot be written.)";

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

/// In the order of the columns; throws BackendUnavailable for one that was asked for and is not there.
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

void check_size(const char* option, int width) {
  if (width != 0 && (width < 64 || width > 8192 || width % 4 != 0)) {
    throw tool::UsageError(std::string(option) + " is " + std::to_string(width) +
                           "; expected a multiple of 4 from 64 to 8192");
  }
}

}  // namespace

std::optional<Arguments> parse_arguments(int argc, char** argv) {
  Arguments arguments;
  std::vector<std::string> simds;
  std::vector<std::string> threads = {"1", "all"};
  CLI::App app("Times the stages of libpmsp, and keyframes from image to points, on each instruction set.",
               "pmsp-bench");
  app.footer(footer());
  app.allow_extras();
  app.set_version_flag("--version", std::string("pmsp-bench ") + PMSP_VERSION_STRING);
  app.add_option("--stages", arguments.stages, "stages to time, default all")
      ->delimiter(',')
      ->check(CLI::IsMember(stage_names()))
      ->option_text("LIST");
  app.add_option("--simd", simds,
                 "instruction sets: scalar, avx2, avx512, auto (the widest); default all that are here")
      ->delimiter(',')
      ->option_text("LIST");
  app.add_option("--threads", threads, "numbers of threads, or all; default 1,all")
      ->delimiter(',')
      ->option_text("LIST");
  app.add_option("--quality", arguments.qualities, "presets: paper, online, normal, high; default online")
      ->delimiter(',')
      ->option_text("LIST");
  app.add_option("--width", arguments.width, "width of the depth maps [px] instead of the preset's, a multiple of 4")
      ->option_text("N");
  app.add_option("--image-width", arguments.image_width,
                 "width of the images [px], a multiple of 4; default 1920, or the depth maps' width if that is more")
      ->option_text("N");
  app.add_option("--repetitions", arguments.repetitions,
                 "runs of each benchmark, 1 to 1000; default 3, and 1 of keyframe on scalar")
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
  std::vector<std::string>& qualities = arguments.qualities;
  for (const std::string& quality : qualities) quality_from_name(quality);
  std::sort(qualities.begin(), qualities.end());
  qualities.erase(std::unique(qualities.begin(), qualities.end()), qualities.end());
  if (arguments.stages.empty()) arguments.stages = stage_names();
  arguments.simds = resolve_simds(simds);
  arguments.threads = resolve_threads(threads);
  return arguments;
}

}  // namespace pmsp::bench
