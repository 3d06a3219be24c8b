// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>

#include <sys/resource.h>

#include "pmsp/densifier.h"

namespace pmsp::tool {

/// During its lifetime, the first SIGINT or SIGTERM cancels the densifier, the second one ends the process at once. May
/// be nested; the outer guard is then inactive.
class InterruptGuard {
 public:
  /// `densifier`: nullptr = none to cancel.
  explicit InterruptGuard(Densifier* densifier);
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;

  /// Throws Interrupted after a signal.
  void check() const;

 private:
  Densifier* outer_;
};

/// Returns the name of this computer; "" if unknown.
std::string host_name();

/// Peak resident memory [MiB].
double peak_memory_mib(const rusage& usage);
/// The same, of this process.
double peak_memory_mib();

}  // namespace pmsp::tool
