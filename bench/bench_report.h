// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <benchmark/benchmark.h>

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "pmsp/options.h"
#include "workload.h"

namespace pmsp::bench {

/// Benchmark: a cell of a table.
struct Case {
  const Workload* workload = nullptr;
  std::string stage;
  Simd simd = Simd::kScalar;
  int threads = 1;
  bool cuda = false;  ///< on the CUDA device; `simd` and `threads` are unused

  std::string name() const;
};

/// One value per repetition.
struct Times {
  std::vector<double> wall_ms;  ///< by the device's clock, for stages on a device
  std::vector<double> cpu_ms;   ///< of all threads; empty for a device
};

/// By name of the case.
using Results = std::map<std::string, Times>;

/// Stores the results of Google Benchmark; prints nothing.
class Collector : public benchmark::BenchmarkReporter {
 public:
  explicit Collector(Results& results) : results_(results) {}
  bool ReportContext(const Context&) override { return true; }
  void ReportRuns(const std::vector<Run>& runs) override;

 private:
  Results& results_;
};

/// Measurements on a CUDA device besides times.
struct DeviceFigures {
  std::string name;
  int number = 0;
  int keyframes = 0;                              ///< of each sequence
  std::map<std::string, std::size_t> peak_bytes;  ///< peak device memory, code and stacks included: keyframe, cloud ...
  double samples = 0.0;                           ///< maximum number of samples of PatchMatch per keyframe
  double texture_rate = 0.0;                      ///< maximum number of samples per second of the texture units
};
using AllDeviceFigures = std::map<const Workload*, DeviceFigures>;

struct Machine {
  std::string cpu;  ///< "unknown" if not available
  int cpus = 0;     ///< available to this process
};
Machine this_machine();

/// Returns a table per preset and number of threads, with stages as rows and instruction sets as columns, and one per
/// preset for the device.
std::string tables(const std::vector<Case>& cases, const Results& results, const AllDeviceFigures& device);

/// Returns all results with their conditions.
nlohmann::ordered_json to_json(const std::vector<Case>& cases, const Results& results, const Machine& machine,
                               const AllDeviceFigures& device);

}  // namespace pmsp::bench
