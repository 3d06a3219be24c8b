// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <stdexcept>

#include "pmsp/error.h"

namespace pmsp::tool {

/// Exit codes; part of the interface, never renumbered. 128 + n: ended by signal n (130: Ctrl-C).
enum ExitCode {
  kExitOk = 0,
  kExitUnexpected = 1,
  kExitUsage = 2,
  kExitInput = 3,
  kExitBackend = 4,
  kExitEmpty = 5,
  kExitOutput = 6,
  kExitSomeFailed = 7,  ///< batch
  kExitAllFailed = 8,   ///< batch
  kExitSignal = 128
};

/// Invalid or contradictory command line.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Run without a single point.
class EmptyResult : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Run ended by a signal.
class Interrupted : public std::runtime_error {
 public:
  explicit Interrupted(int signal)
      : std::runtime_error("interrupted; nothing was written to the output"), signal_(signal) {}
  int signal() const { return signal_; }

 private:
  int signal_;
};

inline int exit_code_of(const std::exception& error) {
  if (const auto* interrupted = dynamic_cast<const Interrupted*>(&error)) return kExitSignal + interrupted->signal();
  if (dynamic_cast<const UsageError*>(&error) != nullptr) return kExitUsage;
  if (dynamic_cast<const EmptyResult*>(&error) != nullptr) return kExitEmpty;
  if (dynamic_cast<const InvalidOption*>(&error) != nullptr) return kExitUsage;
  if (dynamic_cast<const InvalidInput*>(&error) != nullptr) return kExitInput;
  if (dynamic_cast<const IoError*>(&error) != nullptr) return kExitInput;
  if (dynamic_cast<const OutputError*>(&error) != nullptr) return kExitOutput;
  if (dynamic_cast<const BackendUnavailable*>(&error) != nullptr) return kExitBackend;
  if (dynamic_cast<const DeviceError*>(&error) != nullptr) return kExitBackend;
  return kExitUnexpected;
}

}  // namespace pmsp::tool
