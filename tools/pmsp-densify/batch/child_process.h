// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <signal.h>
#include <sys/types.h>

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

}  // namespace pmsp::tool
