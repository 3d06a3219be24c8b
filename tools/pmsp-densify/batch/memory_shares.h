// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace pmsp::tool {

/// Expected peak memory of a mission [bytes]; all 0 = unknown.
struct MemoryNeed {
  double host = 0.0;          ///< on the CPU
  double gpu_host = 0.0;      ///< host memory with a GPU
  double device = 0.0;        ///< per GPU
  double device_least = 0.0;  ///< per GPU, with pending data spilled to the scratch folder
  double device_free = 0.0;   ///< minimum free memory of `devices` at the time of the query; 0 = no GPU is used
  std::vector<int> devices;   ///< used by the mission
};

/// Parses the output of `run --print-memory`, ignoring messages of libraries before it. All 0 if missing.
MemoryNeed memory_need_from(const std::string& log);

/// Distributes memory of the host and its GPUs among concurrent missions.
class MemoryShares {
 public:
  /// `host`: host memory of all missions together [bytes].
  explicit MemoryShares(double host) : host_(host) {}

  struct Share {
    double host = 0.0;
    double device = 0.0;  ///< per device
    std::vector<int> devices;
  };
  /// Returns nullopt if memory must be released first. A single mission always gets what it needs.
  std::optional<Share> take(const MemoryNeed& need);
  void give_back(const Share& share);

 private:
  struct Device {
    double bytes = 0.0;  ///< free memory without shares, maximum seen
    double taken = 0.0;
    std::size_t users = 0;
  };

  double host_;
  double taken_ = 0.0;
  std::size_t users_ = 0;
  std::map<int, Device> devices_;
};

/// Returns the host memory available to this process and its children [bytes]: of the machine, or within the limits of
/// its control groups (Linux: memory.max, memory.limit_in_bytes).
double free_host_memory();

}  // namespace pmsp::tool
