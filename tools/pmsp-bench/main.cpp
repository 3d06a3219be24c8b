// SPDX-License-Identifier: BSD-2-Clause
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <algorithm>
#include <exception>
#include <iostream>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "export/atomic_file.h"
#include "pmsp-bench/arguments.h"
#include "pmsp-bench/report.h"
#include "pmsp-bench/stages.h"
#include "pmsp-bench/workload.h"
#include "pmsp-densify/exit_code.h"
#include "pmsp/error.h"
#include "pmsp/executor.h"
#include "pmsp/version.h"

namespace pmsp::bench {
namespace {

/// All that benchmarks use, alive until the last of them has run.
struct Session {
  std::vector<std::unique_ptr<Workload>> workloads;
  std::vector<Case> cases;
  std::map<std::pair<Simd, int>, Executor> executors;
  std::exception_ptr error;  ///< the first that a stage threw
};

WorkloadRequest request_of(const Arguments& arguments, const std::string& quality) {
  return {quality, arguments.width, arguments.image_width};
}

void choose_cases(const Arguments& arguments, Session& session) {
  for (const std::string& quality : arguments.qualities) {
    session.workloads.push_back(outline(request_of(arguments, quality)));
    for (const int threads : arguments.threads) {
      for (const Stage& stage : all_stages()) {
        const auto& wanted = arguments.stages;
        if (std::find(wanted.begin(), wanted.end(), stage.name) == wanted.end()) continue;
        if (is_end_to_end(stage) && threads != arguments.threads.back()) continue;
        for (const Simd simd : arguments.simds) {
          session.cases.push_back({session.workloads.back().get(), stage.name, simd, threads});
        }
      }
    }
  }
}

void make_workloads(const Arguments& arguments, Session& session) {
  std::map<int, int> flights;  // image width -> keyframes
  for (const auto& workload : session.workloads) {
    int& keyframes = flights[image_width_of(request_of(arguments, workload->quality))];
    keyframes = std::max(keyframes, flight_length(workload->options));
  }
  std::map<int, std::shared_ptr<const synth::Mission>> missions;
  for (const auto& [width, keyframes] : flights) {
    std::cerr << "rendering " << keyframes << " images of " << width << " x " << width / 2 << '\n';
    missions[width] = render_flight(width, keyframes);
  }
  const bool with_maps = std::any_of(arguments.stages.begin(), arguments.stages.end(),
                                     [](const std::string& name) { return stage_named(name).needs_maps; });
  for (const auto& workload : session.workloads) {
    if (with_maps) std::cerr << "making the depth maps that stages start from, " << workload->quality << '\n';
    fill(*workload, missions.at(image_width_of(request_of(arguments, workload->quality))), with_maps);
  }
}

void run_case(benchmark::State& state, const Case& one, Session& session) {
  if (isatty(STDERR_FILENO) != 0) std::cerr << "\r\033[K" << one.name() << std::flush;
  try {
    const auto executor = session.executors.try_emplace({one.simd, one.threads}, one.threads, one.simd).first;
    stage_named(one.stage).run(state, *one.workload, executor->second);
  } catch (const std::exception& error) {
    if (!session.error) session.error = std::current_exception();
    state.SkipWithError(error.what());
  }
}

/// Ours first: of two equal flags, Google Benchmark takes the later one.
void initialize_google(const Arguments& arguments) {
  std::vector<std::string> words = {
      "pmsp-bench", "--benchmark_repetitions=" + std::to_string(arguments.repetitions.value_or(kRepetitions)),
      "--benchmark_enable_random_interleaving=true", "--benchmark_min_time=0.05"};
  words.insert(words.end(), arguments.google_args.begin(), arguments.google_args.end());
  std::vector<char*> argv;
  argv.reserve(words.size());
  for (std::string& word : words) argv.push_back(word.data());
  int argc = static_cast<int>(argv.size());
  benchmark::Initialize(&argc, argv.data());
  if (benchmark::ReportUnrecognizedArguments(argc, argv.data())) {
    throw tool::UsageError("Google Benchmark does not know this argument; see pmsp-bench --help");
  }
}

void run(const Arguments& arguments) {
  Session session;
  choose_cases(arguments, session);
  if (arguments.list) {
    for (const Case& one : session.cases) std::cout << one.name() << '\n';
    return;
  }
  std::optional<AtomicFile> json;  // opened first: better to fail now than after minutes
  if (!arguments.json.empty()) json.emplace(arguments.json);
  initialize_google(arguments);
  const Machine machine = this_machine();
  std::cout << "pmsp-bench " << PMSP_VERSION_STRING << " (" << PMSP_BUILD_TYPE << "), " << machine.cpu << ", "
            << machine.cpus << " CPU" << (machine.cpus == 1 ? "" : "s") << std::endl;
  make_workloads(arguments, session);
  benchmark::AddCustomContext("pmsp_version", PMSP_VERSION_STRING);
  benchmark::AddCustomContext("cpu", machine.cpu);
  for (const Case& one : session.cases) {
    auto* registered = benchmark::RegisterBenchmark(one.name().c_str(),
                                                    [&](benchmark::State& state) { run_case(state, one, session); })
                           ->Unit(benchmark::kMillisecond)
                           ->MeasureProcessCPUTime()
                           ->UseRealTime();
    // It takes longest and matters least.
    const bool once = !arguments.repetitions && one.simd == Simd::kScalar && is_end_to_end(stage_named(one.stage));
    if (once) registered->Repetitions(1);
  }
  Results results;
  Collector collector(results);
  benchmark::RunSpecifiedBenchmarks(&collector);
  if (isatty(STDERR_FILENO) != 0) std::cerr << "\r\033[K" << std::flush;
  if (session.error) std::rethrow_exception(session.error);
  if (results.empty()) {
    throw tool::UsageError(
        "no benchmark was run; pmsp-bench --list prints the names that --benchmark_filter may match");
  }
  std::cout << tables(session.cases, results);
  if (json) {
    json->write(to_json(session.cases, results, machine).dump(2) + '\n');
    json->commit();
  }
}

int guarded_main(int argc, char** argv) {
  const std::optional<Arguments> arguments = parse_arguments(argc, argv);
  if (!arguments) return tool::kExitOk;
  run(*arguments);
  std::cout.flush();
  if (!std::cout) throw OutputError("standard output cannot be written");
  return tool::kExitOk;
}

}  // namespace
}  // namespace pmsp::bench

int main(int argc, char** argv) {
  try {
    return pmsp::bench::guarded_main(argc, argv);
  } catch (const std::exception& error) {
    std::cerr << "pmsp-bench: " << error.what() << '\n';
    return pmsp::tool::exit_code_of(error);
  }
}
