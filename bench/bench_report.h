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

/// One benchmark: a row's cell.
struct Case {
  const Workload* workload = nullptr;
  std::string stage;
  Simd simd = Simd::kScalar;
  int threads = 1;
  bool cuda = false;  ///< on the CUDA device; `simd` and `threads` then say nothing

  std::string name() const;
};

/// One figure for each repetition [ms].
struct Times {
  std::vector<double> wall_ms;  ///< of stages on a device, its own clock's
  std::vector<double> cpu_ms;   ///< all threads together; empty for a device
};

/// By the name of the case.
using Results = std::map<std::string, Times>;

/// Keeps what Google Benchmark measures; prints nothing.
class Collector : public benchmark::BenchmarkReporter {
 public:
  explicit Collector(Results& results) : results_(results) {}
  bool ReportContext(const Context&) override { return true; }
  void ReportRuns(const std::vector<Run>& runs) override;

 private:
  Results& results_;
};

/// What was measured on a CUDA device besides times.
struct DeviceFigures {
  std::string name;
  int number = 0;
  int keyframes = 0;  ///< of each flight
  std::map<std::string, std::size_t>
      peak_bytes;             ///< device memory taken, code and stacks included: keyframe, cloud ...
  double samples = 0.0;       ///< that PatchMatch takes for a keyframe, at most
  double texture_rate = 0.0;  ///< samples that the texture units filter in a second, at most
};
using AllDeviceFigures = std::map<const Workload*, DeviceFigures>;

struct Machine {
  std::string cpu;  ///< "unknown" where the system does not tell
  int cpus = 0;     ///< that this process may use
};
Machine this_machine();

/// A table for each quality and number of threads: stage, and a column for each instruction set; and one for each
/// quality on the device.
std::string tables(const std::vector<Case>& cases, const Results& results, const AllDeviceFigures& device);

/// All figures, and where they come from.
nlohmann::ordered_json to_json(const std::vector<Case>& cases, const Results& results, const Machine& machine,
                               const AllDeviceFigures& device);

}  // namespace pmsp::bench
