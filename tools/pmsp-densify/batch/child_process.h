// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <signal.h>
#include <sys/types.h>

namespace pmsp::tool {

/// How a process ended: one of the first two.
struct ChildEnd {
  std::optional<int> exit_code;
  std::optional<int> signal;
  double peak_memory_mib = 0.0;
};

/// A file that exists as long as this object. Throws OutputError.
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

/// Starts this very program with other words; `words[0]` is its name. Its output is appended to the file `log`. It is
/// in a process group of its own, so that Ctrl-C does not reach it, and on Linux it is killed when its parent ends.
/// Throws OutputError, std::system_error.
pid_t start_child(const std::vector<std::string>& words, const std::filesystem::path& log);

/// nullopt while it runs.
std::optional<ChildEnd> end_of_child(pid_t child);

/// While it lives, SIGINT, SIGTERM and the ends of children are waited for, instead of acting by themselves.
class SignalQueue {
 public:
  SignalQueue();
  ~SignalQueue();
  SignalQueue(const SignalQueue&) = delete;
  SignalQueue& operator=(const SignalQueue&) = delete;

  /// The next one. SIGCHLD: some children may have ended.
  int wait();

 private:
  sigset_t signals_;
  sigset_t before_;
  struct sigaction child_before_ = {};
};

}  // namespace pmsp::tool
