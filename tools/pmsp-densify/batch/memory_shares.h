// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace pmsp::tool {

/// Maximum memory that a mission is expected to take [bytes]; all 0 = unknown.
struct MemoryNeed {
  double host = 0.0;          ///< on the CPU
  double gpu_host = 0.0;      ///< the host's, on a GPU
  double device = 0.0;        ///< of each GPU
  double device_least = 0.0;  ///< of each GPU, where the scratch folder has what waits
  double device_free = 0.0;   ///< of the GPU that has least, at the time of the query; 0 = it takes none
  std::vector<int> devices;   ///< those
};

/// The object that `run --print-memory` has printed, after whatever libraries had to say. All 0 where there is none.
MemoryNeed memory_need_from(const std::string& log);

/// Shares the memory of the host and of its GPUs out among missions that run at once.
class MemoryShares {
 public:
  /// `host`: what all of them together may take of the host's memory [bytes].
  explicit MemoryShares(double host) : host_(host) {}

  struct Share {
    double host = 0.0;
    double device = 0.0;  ///< of each of these
    std::vector<int> devices;
  };
  /// nullopt: others must give theirs back first. Who is alone gets whatever it needs.
  std::optional<Share> take(const MemoryNeed& need);
  void give_back(const Share& share);

 private:
  struct Device {
    double bytes = 0.0;  ///< free without shares, or the most since
    double taken = 0.0;
    std::size_t users = 0;
  };

  double host_;
  double taken_ = 0.0;
  std::size_t users_ = 0;
  std::map<int, Device> devices_;
};

/// What this process and those that it starts may still take of the host's memory [bytes]: of the machine's, or of the
/// limit that its control groups set (Linux: memory.max, memory.limit_in_bytes).
double free_host_memory();

}  // namespace pmsp::tool
