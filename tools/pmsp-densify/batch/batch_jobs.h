// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <signal.h>
#include <sys/types.h>
#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace pmsp::tool {

/// End of a process; exactly one of the first two is set.
struct ChildEnd {
  std::optional<int> exit_code;
  std::optional<int> signal;
  double peak_memory_mib = 0.0;
};

/// File that exists as long as this object. Throws OutputError.
class TemporaryFile {
 public:
  TemporaryFile();
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// Starts this program with other arguments; `words[0]` is its name. Output is appended to `log`. The child has its own
/// process group, so that Ctrl-C does not reach it; on Linux it is killed when its parent ends. Throws OutputError,
/// std::system_error.
pid_t start_child(const std::vector<std::string>& words, const std::filesystem::path& log);

/// Returns nullopt while it runs.
std::optional<ChildEnd> end_of_child(pid_t child);

/// Blocks SIGINT, SIGTERM and SIGCHLD during its lifetime and queues them for `wait`.
class SignalQueue {
 public:
  SignalQueue();
  ~SignalQueue();
  SignalQueue(const SignalQueue&) = delete;
  SignalQueue& operator=(const SignalQueue&) = delete;

  /// Blocks until the next signal. SIGCHLD: some children may have ended.
  int wait();

 private:
  sigset_t signals_;
  sigset_t before_;
  struct sigaction child_before_ = {};
};

/// Returns the devices of one of `jobs` jobs: round-robin, so that no device is idle if there are enough jobs.
std::vector<int> devices_of_job(std::size_t job, std::size_t jobs, const std::vector<int>& devices);

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
