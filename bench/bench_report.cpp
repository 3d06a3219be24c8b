// SPDX-License-Identifier: BSD-2-Clause
#include "bench_report.h"

#include <algorithm>
#include <fstream>
#include <optional>

#include "pmsp/stages.h"
#include "pmsp/version.h"
#include "util/text.h"

namespace pmsp::bench {
namespace {

/// Ratio of wall-clock to CPU time of one thread above which other processes used the CPU.
constexpr double kBusy = 1.1;

struct Summary {
  double median = 0.0;
  double min = 0.0;
  double max = 0.0;
};

Summary summary_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  const double median = values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
  return {median, values.front(), values.back()};
}

/// Whether CPU time is reported: for one thread it equals wall-clock time on an idle machine and nearly the same on a
/// busy one.
bool by_cpu_time(const Case& one) { return one.threads == 1 && !one.cuda; }

std::optional<Summary> summary_of(const Case& one, const Results& results) {
  const auto found = results.find(one.name());
  if (found == results.end()) return std::nullopt;
  return summary_of(by_cpu_time(one) ? found->second.cpu_ms : found->second.wall_ms);
}

std::optional<double> speedup_over_scalar(const Case& one, const Results& results) {
  if (one.cuda) return std::nullopt;
  Case scalar = one;
  scalar.simd = Simd::kScalar;
  const std::optional<Summary> slow = summary_of(scalar, results);
  const std::optional<Summary> fast = summary_of(one, results);
  if (one.simd == Simd::kScalar || !slow || !fast || !(fast->median > 0.0)) return std::nullopt;
  return slow->median / fast->median;
}

std::string milliseconds(double value) {
  return format(value < 10.0 ? "%.3f" : value < 100.0 ? "%.2f" : "%.0f", value);
}

std::string cell(const Case& one, const Results& results) {
  const std::optional<Summary> summary = summary_of(one, results);
  if (!summary) return "-";
  const std::optional<double> speedup = speedup_over_scalar(one, results);
  std::string text = milliseconds(summary->median);
  if (speedup) text += format(" (x%.2f)", *speedup);
  const bool spread = results.at(one.name()).wall_ms.size() > 1;
  return spread ? text + ' ' + milliseconds(summary->min) + ".." + milliseconds(summary->max) : text;
}

std::size_t most_repetitions(const std::vector<Case>& cases, const Results& results) {
  std::size_t repetitions = 0;
  for (const Case& member : cases) repetitions = std::max(repetitions, results.at(member.name()).wall_ms.size());
  return repetitions;
}

std::string setting(const Workload& workload) {
  const DensifierOptions& options = workload.options;
  return format("\n%s: depth maps %d x %d, %d neighbours, %d iterations, %d geometric passes; images %d x %d\n",
                workload.quality.c_str(), options.width, options.height, options.advanced.patchmatch.neighbours,
                options.advanced.patchmatch.iterations, options.advanced.patchmatch.geometric_passes,
                workload.flight.image_width, workload.flight.image_height);
}

std::string heading(const std::vector<Case>& cases, const Results& results) {
  const Case& one = cases.front();
  const std::size_t repetitions = most_repetitions(cases, results);
  return setting(*one.workload) +
         format("%d thread%s, %s time per keyframe [ms]: median (speed over scalar) min..max of %zu repetition%s\n",
                one.threads, one.threads == 1 ? "" : "s", by_cpu_time(one) ? "CPU" : "wall clock", repetitions,
                repetitions == 1 ? "" : "s");
}

/// Returns a table of cases of one workload and number of threads.
std::string table(const std::vector<Case>& cases, const Results& results) {
  std::vector<std::string> stages;
  std::vector<Simd> simds;
  for (const Case& one : cases) {
    if (std::find(stages.begin(), stages.end(), one.stage) == stages.end()) stages.push_back(one.stage);
    if (std::find(simds.begin(), simds.end(), one.simd) == simds.end()) simds.push_back(one.simd);
  }
  std::string text = format("%-12s", "stage");
  for (const Simd simd : simds) text += format(" %-30s", name_of(simd));
  text.erase(text.find_last_not_of(' ') + 1);
  text += '\n';
  for (const std::string& stage : stages) {
    text += format("%-12s", stage.c_str());
    for (const Simd simd : simds) {
      text += format(" %-30s", cell({cases.front().workload, stage, simd, cases.front().threads}, results).c_str());
    }
    text.erase(text.find_last_not_of(' ') + 1);
    text += '\n';
  }
  return text;
}

constexpr double kMiB = 1024.0 * 1024.0;

/// Returns the samples of PatchMatch per second, by its median time; 0 if not timed.
double sample_rate(const Workload& workload, const Results& results, const DeviceFigures& figures) {
  Case one;
  one.workload = &workload;
  one.stage = "patchmatch";
  one.cuda = true;
  const auto found = results.find(one.name());
  return found == results.end() ? 0.0 : figures.samples / (1e-3 * summary_of(found->second.wall_ms).median);
}

std::string device_table(const std::vector<Case>& cases, const Results& results, const DeviceFigures& figures) {
  const Workload& workload = *cases.front().workload;
  const std::size_t repetitions = most_repetitions(cases, results);
  std::string text = setting(workload);
  text += format("CUDA device %d, %s: time per keyframe [ms]: median min..max of %zu flight%s of %d keyframes\n",
                 figures.number, figures.name.c_str(), repetitions, repetitions == 1 ? "" : "s", figures.keyframes);
  text += format("%-12s %-30s %s\n", "stage", "cuda", "device memory");
  for (const Case& one : cases) {
    text += format("%-12s %-30s", one.stage.c_str(), cell(one, results).c_str());
    const auto peak = figures.peak_bytes.find(one.stage);
    if (peak != figures.peak_bytes.end()) text += format(" %.0f MiB", static_cast<double>(peak->second) / kMiB);
    text.erase(text.find_last_not_of(' ') + 1);
    text += '\n';
  }
  const double rate = sample_rate(workload, results, figures);
  if (rate > 0.0 && figures.texture_rate > 0.0) {
    text += format("PatchMatch: %.0f G samples/s, %.0f %% of what the texture units filter (%.0f G/s)\n", 1e-9 * rate,
                   100.0 * rate / figures.texture_rate, 1e-9 * figures.texture_rate);
  }
  return text;
}

std::string busy_note(const std::vector<Case>& cases, const Results& results) {
  double wall = 0.0;
  double cpu = 0.0;
  for (const Case& one : cases) {
    const auto found = results.find(one.name());
    if (!by_cpu_time(one) || found == results.end()) continue;
    wall += summary_of(found->second.wall_ms).median;
    cpu += summary_of(found->second.cpu_ms).median;
  }
  if (!(cpu > 0.0) || wall < kBusy * cpu) return "";
  return format(
      "\nThe machine was busy: with one thread, the wall clock took %.2f times the CPU time. Wall clock times "
      "above are too long.\n",
      wall / cpu);
}

nlohmann::ordered_json to_json(const std::vector<double>& all) {
  const Summary summary = summary_of(all);
  return {{"median", summary.median}, {"min", summary.min}, {"max", summary.max}, {"all", all}};
}

void add_device(nlohmann::ordered_json& entry, const Case& one, const Results& results, const DeviceFigures& figures) {
  entry["device"] = figures.name;
  entry["device_number"] = figures.number;
  entry["keyframes_per_flight"] = figures.keyframes;
  const auto peak = figures.peak_bytes.find(one.stage);
  if (peak != figures.peak_bytes.end()) entry["device_bytes"] = peak->second;
  if (one.stage != "patchmatch") return;
  entry["samples"] = figures.samples;
  entry["samples_per_second"] = sample_rate(*one.workload, results, figures);
  entry["texture_samples_per_second"] = figures.texture_rate;
}

}  // namespace

std::string Case::name() const {
  if (cuda) return workload->quality + '/' + stage + "/cuda";
  return workload->quality + '/' + stage + '/' + name_of(simd) + "/threads:" + std::to_string(threads);
}

void Collector::ReportRuns(const std::vector<Run>& runs) {
  for (const Run& run : runs) {
    if (run.run_type != Run::RT_Iteration || run.error_occurred) continue;
    Times& times = results_[run.run_name.function_name];
    times.wall_ms.push_back(run.GetAdjustedRealTime());
    times.cpu_ms.push_back(run.GetAdjustedCPUTime());
  }
}

Machine this_machine() {
  Machine machine{"unknown", Executor(0).threads()};
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    const std::size_t colon = line.find(": ");
    if (line.rfind("model name", 0) == 0 && colon != std::string::npos) {
      machine.cpu = line.substr(colon + 2);
      break;
    }
  }
  return machine;
}

std::string tables(const std::vector<Case>& cases, const Results& results, const AllDeviceFigures& device) {
  std::vector<std::vector<Case>> groups;
  for (const Case& one : cases) {
    if (results.count(one.name()) == 0) continue;
    const auto group = std::find_if(groups.begin(), groups.end(), [&](const std::vector<Case>& other) {
      return other.front().workload == one.workload && other.front().threads == one.threads &&
             other.front().cuda == one.cuda;
    });
    if (group == groups.end()) {
      groups.push_back({one});
    } else {
      group->push_back(one);
    }
  }
  std::string text;
  for (const std::vector<Case>& group : groups) {
    text += group.front().cuda ? device_table(group, results, device.at(group.front().workload))
                               : heading(group, results) + table(group, results);
  }
  return text + busy_note(cases, results);
}

nlohmann::ordered_json to_json(const std::vector<Case>& cases, const Results& results, const Machine& machine,
                               const AllDeviceFigures& device) {
  nlohmann::ordered_json json = {{"generator", std::string("pmsp-bench ") + PMSP_VERSION_STRING},
                                 {"build_type", PMSP_BUILD_TYPE},
                                 {"cpu", machine.cpu},
                                 {"cpus", machine.cpus},
                                 {"benchmarks", nlohmann::ordered_json::array()}};
  for (const Case& one : cases) {
    const auto found = results.find(one.name());
    if (found == results.end()) continue;
    const DensifierOptions& options = one.workload->options;
    nlohmann::ordered_json entry = {{"name", one.name()},
                                    {"quality", one.workload->quality},
                                    {"stage", one.stage},
                                    {"backend", name_of(one.cuda ? Backend::kCuda : Backend::kCpu)},
                                    {"width", options.width},
                                    {"height", options.height},
                                    {"neighbours", options.advanced.patchmatch.neighbours},
                                    {"iterations", options.advanced.patchmatch.iterations},
                                    {"refinements", options.advanced.patchmatch.refinements},
                                    {"geometric_passes", options.advanced.patchmatch.geometric_passes},
                                    {"image_width", one.workload->flight.image_width},
                                    {"image_height", one.workload->flight.image_height},
                                    {"wall_ms", to_json(found->second.wall_ms)}};
    if (one.cuda) {
      add_device(entry, one, results, device.at(one.workload));
      json["benchmarks"].push_back(entry);
      continue;
    }
    entry["simd"] = name_of(one.simd);
    entry["threads"] = one.threads;
    entry["cpu_ms"] = to_json(found->second.cpu_ms);
    const std::optional<double> speedup = speedup_over_scalar(one, results);
    if (speedup) entry["speedup_over_scalar"] = *speedup;
    if (speedup) entry["speedup_clock"] = by_cpu_time(one) ? "cpu" : "wall";
    json["benchmarks"].push_back(entry);
  }
  return json;
}

}  // namespace pmsp::bench
