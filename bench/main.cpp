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

#include "bench_arguments.h"
#include "bench_report.h"
#include "device_runs.h"
#include "export/files.h"
#include "pmsp-densify/exit_code.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"
#include "pmsp/version.h"
#include "stages.h"
#include "workload.h"
#include "write_bench.h"

namespace pmsp::bench {
namespace {

/// Data of benchmarks, alive until the last one has run.
struct Session {
  std::vector<std::unique_ptr<Workload>> workloads;
  std::vector<Case> cases;
  std::map<std::pair<Simd, int>, Executor> executors;
  std::exception_ptr error;  ///< first exception of a stage
};

bool is_wanted(const Arguments& arguments, const Stage& stage) {
  return std::find(arguments.stages.begin(), arguments.stages.end(), stage.name) != arguments.stages.end();
}

WorkloadRequest request_of(const Arguments& arguments, const std::string& quality) {
  return {quality,
          arguments.width,
          arguments.height,
          arguments.image_width,
          arguments.neighbours,
          arguments.iterations,
          arguments.refinements,
          arguments.geometric_passes};
}

void choose_cpu_cases(const Arguments& arguments, const Workload& workload, std::vector<Case>& cases) {
  for (const int threads : arguments.threads) {
    for (const Stage& stage : all_stages()) {
      if (!is_wanted(arguments, stage) || stage.run == nullptr) continue;
      if (is_end_to_end(stage) && threads != arguments.threads.back()) continue;
      for (const Simd simd : arguments.simds) cases.push_back({&workload, stage.name, simd, threads});
    }
  }
}

void choose_cases(const Arguments& arguments, Session& session) {
  for (const std::string& quality : arguments.qualities) {
    session.workloads.push_back(outline(request_of(arguments, quality)));
    const Workload& workload = *session.workloads.back();
    if (arguments.cpu) choose_cpu_cases(arguments, workload, session.cases);
    if (!arguments.cuda) continue;
    for (const Stage& stage : all_stages()) {
      if (is_wanted(arguments, stage) && stage.on_device) session.cases.push_back({&workload, stage.name, {}, 0, true});
    }
  }
}

/// Returns sequences by image width; one for all if a map is given.
std::map<int, Flight> make_flights(const Arguments& arguments, const Session& session) {
  std::map<int, int> flights;  // image width -> keyframes
  for (const auto& workload : session.workloads) {
    int& keyframes = flights[image_width_of(request_of(arguments, workload->quality))];
    keyframes = std::max(keyframes, flight_length(workload->options));
  }
  std::map<int, Flight> result;
  for (const auto& [width, keyframes] : flights) {
    if (arguments.map.empty()) {
      std::cerr << "rendering " << keyframes << " images of " << width << " x " << width / 2 << '\n';
      result[width] = render_flight(width, keyframes);
    } else {
      std::cerr << "reading " << keyframes << " images\n";
      result[width] = read_flight(arguments.map, arguments.images, keyframes);
    }
  }
  return result;
}

void make_workloads(const Arguments& arguments, Session& session) {
  const std::map<int, Flight> flights = make_flights(arguments, session);
  const bool with_maps =
      arguments.cpu && std::any_of(arguments.stages.begin(), arguments.stages.end(),
                                   [](const std::string& name) { return stage_named(name).needs_maps; });
  for (const auto& workload : session.workloads) {
    if (with_maps) std::cerr << "making the depth maps that stages start from, " << workload->quality << '\n';
    fill(*workload, flights.at(image_width_of(request_of(arguments, workload->quality))), with_maps);
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

/// Own flags come first: of equal flags, Google Benchmark uses the last one.
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

void run_on_cpu(const Arguments& arguments, Session& session, Results& results) {
  for (const Case& one : session.cases) {
    if (one.cuda) continue;
    auto* registered = benchmark::RegisterBenchmark(one.name().c_str(),
                                                    [&](benchmark::State& state) { run_case(state, one, session); })
                           ->Unit(benchmark::kMillisecond)
                           ->MeasureProcessCPUTime()
                           ->UseRealTime();
    if (!arguments.repetitions && is_end_to_end(stage_named(one.stage))) {  // the slowest ones
      registered->Repetitions(one.simd == Simd::kScalar ? 1 : 2);
    }
  }
  Collector collector(results);
  benchmark::RunSpecifiedBenchmarks(&collector);
  if (isatty(STDERR_FILENO) != 0) std::cerr << "\r\033[K" << std::flush;
  if (session.error) std::rethrow_exception(session.error);
}

AllDeviceFigures run_on_devices(const Arguments& arguments, const Session& session, Results& results) {
  AllDeviceFigures figures;
  const DeviceRequest request{arguments.device, arguments.stages, arguments.keyframes,
                              arguments.repetitions.value_or(kDeviceRepetitions)};
  for (const auto& workload : session.workloads) run_on_device(*workload, request, results, figures[workload.get()]);
  return figures;
}

void run(const Arguments& arguments) {
  Session session;
  choose_cases(arguments, session);
  if (arguments.list) {
    for (const Case& one : session.cases) std::cout << one.name() << '\n';
    return;
  }
  std::optional<AtomicFile> json;  // opened first, to fail early
  if (!arguments.json.empty()) json.emplace(arguments.json);
  initialize_google(arguments);
  const Machine machine = this_machine();
  std::cout << "pmsp-bench " << PMSP_VERSION_STRING << " (" << PMSP_BUILD_TYPE << "), " << machine.cpu << ", "
            << machine.cpus << " CPU" << (machine.cpus == 1 ? "" : "s") << std::endl;
  make_workloads(arguments, session);
  benchmark::AddCustomContext("pmsp_version", PMSP_VERSION_STRING);
  benchmark::AddCustomContext("cpu", machine.cpu);
  Results results;
  if (arguments.cpu) run_on_cpu(arguments, session, results);
  AllDeviceFigures device;
  if (arguments.cuda) device = run_on_devices(arguments, session, results);
  if (results.empty()) {
    throw tool::UsageError(
        "no benchmark was run; pmsp-bench --list prints the names that --benchmark_filter may match");
  }
  std::cout << tables(session.cases, results, device);
  if (json) {
    json->write(to_json(session.cases, results, machine, device).dump(2) + '\n');
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
    if (argc > 1 && std::string(argv[1]) == "write") return pmsp::bench::write_bench(argc - 1, argv + 1);
    return pmsp::bench::guarded_main(argc, argv);
  } catch (const std::exception& error) {
    std::cerr << "pmsp-bench: " << error.what() << '\n';
    return pmsp::tool::exit_code_of(error);
  }
}
