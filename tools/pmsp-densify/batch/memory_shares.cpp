// SPDX-License-Identifier: BSD-2-Clause
#include "memory_shares.h"

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>

#include <nlohmann/json.hpp>

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;

constexpr double kContext = 600.0 * 1024 * 1024;  // additional GPU memory: CUDA context, kernels and their stacks

/// Number after a name in lines such as "MemAvailable:  123 kB"; 0 = none.
double number_after(const fs::path& file, const std::string& name) {
  std::ifstream lines(file);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string word;
    double number = 0.0;
    if (words >> word >> number && word == name) return number;
  }
  return 0.0;
}

/// First number of a file; nullopt = none ("max").
std::optional<double> number_in(const fs::path& file) {
  double number = 0.0;
  if (std::ifstream(file) >> number) return number;
  return std::nullopt;
}

/// Memory files of a version of Linux control groups.
struct Groups {
  const char* controllers;  ///< in /proc/self/cgroup
  const char* root;
  const char* limit;
  const char* used;
  const char* cached;  ///< key in memory.stat: reclaimable memory
};
constexpr Groups kGroups[] = {
    {"", "/sys/fs/cgroup", "memory.max", "memory.current", "inactive_file"},
    {"memory", "/sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"}};

/// Minimum of the memory left in a group and its ancestors [bytes].
double left_in(const Groups& groups, const fs::path& path) {
  double left = std::numeric_limits<double>::infinity();
  for (fs::path group = path;; group = group.parent_path()) {
    const fs::path folder = groups.root / group.relative_path();
    const auto limit = number_in(folder / groups.limit);
    const auto used = number_in(folder / groups.used);
    if (limit && used) left = std::min(left, *limit - *used + number_after(folder / "memory.stat", groups.cached));
    if (!group.has_relative_path()) return left;
  }
}

}  // namespace

MemoryNeed memory_need_from(const std::string& log) {
  const std::size_t line = log.rfind("\n{");
  try {
    const nlohmann::json parsed = nlohmann::json::parse(log.substr(line == std::string::npos ? 0 : line));
    const nlohmann::json& gpu = parsed.at("gpu");
    MemoryNeed need;
    need.host = parsed.at("cpu").at("memory_bytes").get<double>();
    need.gpu_host = gpu.at("memory_bytes").get<double>();
    need.device = gpu.at("device_bytes").get<double>();
    need.device_least = gpu.at("least_device_bytes").get<double>();
    need.device_free = gpu.at("free_device_bytes").get<double>();
    need.devices = gpu.at("devices").get<std::vector<int>>();
    return need;
  } catch (const nlohmann::json::exception&) {
    return {};
  }
}

std::optional<MemoryShares::Share> MemoryShares::take(const MemoryNeed& need) {
  Share share{need.host, 0.0, {}};
  if (need.device_free > 0.0) {
    double bytes = std::numeric_limits<double>::infinity();  // of the GPU with least memory
    for (const int number : need.devices) {
      Device& device = devices_[number];
      device.bytes = std::max(device.bytes, need.device_free);
      bytes = std::min(bytes, device.bytes);
    }
    if (need.device_least <= bytes) {
      share = {need.gpu_host, (need.device <= bytes ? need.device : need.device_least) + kContext, need.devices};
    }
  }
  if (users_ > 0 && taken_ + share.host > host_) return std::nullopt;
  for (const int number : share.devices) {
    const Device& device = devices_[number];
    if (device.users > 0 && device.taken + share.device > device.bytes) return std::nullopt;
  }
  taken_ += share.host;
  ++users_;
  for (const int number : share.devices) {
    devices_[number].taken += share.device;
    ++devices_[number].users;
  }
  return share;
}

void MemoryShares::give_back(const Share& share) {
  taken_ -= share.host;
  --users_;
  for (const int number : share.devices) {
    devices_[number].taken -= share.device;
    --devices_[number].users;
  }
}

double free_host_memory() {
  double left = 1024.0 * number_after("/proc/meminfo", "MemAvailable:");
  if (left == 0.0) left = static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGESIZE));
  std::ifstream lines("/proc/self/cgroup");
  for (std::string line; std::getline(lines, line);) {  // "0::/user.slice" or "4:memory:/jobs/7"
    const std::size_t first = line.find(':');
    const std::size_t second = line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1);
    for (const Groups& groups : kGroups) {
      if (controllers == groups.controllers) left = std::min(left, left_in(groups, line.substr(second + 1)));
    }
  }
  return std::max(left, 0.0);
}

}  // namespace pmsp::tool
