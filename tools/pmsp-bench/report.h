// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <benchmark/benchmark.h>

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "pmsp-bench/workload.h"
#include "pmsp/options.h"

namespace pmsp::bench {

/// One benchmark: a row's cell.
struct Case {
  const Workload* workload = nullptr;
  std::string stage;
  Simd simd = Simd::kScalar;
  int threads = 1;

  std::string name() const;
};

/// One figure for each repetition [ms].
struct Times {
  std::vector<double> wall_ms;
  std::vector<double> cpu_ms;  ///< all threads together
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

struct Machine {
  std::string cpu;  ///< "unknown" where the system does not tell
  int cpus = 0;     ///< that this process may use
};
Machine this_machine();

/// A table for each quality and number of threads: stage, and a column for each instruction set.
std::string tables(const std::vector<Case>& cases, const Results& results);

/// All figures, and where they come from.
nlohmann::ordered_json to_json(const std::vector<Case>& cases, const Results& results, const Machine& machine);

}  // namespace pmsp::bench
