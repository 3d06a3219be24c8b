// SPDX-License-Identifier: BSD-2-Clause
#include "follow.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <string>
#include <thread>

#include "exit_code.h"
#include "process.h"
#include "progress.h"
#include "tool_files.h"

namespace pmsp::tool {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto kImageRecord = std::chrono::milliseconds(100);
/// Time without change after which files are considered complete.
constexpr auto kRest = std::chrono::milliseconds(500);

/// Names, sizes and times of a run's inputs.
std::string state_of_inputs(const Arguments& arguments) {
  const std::string state = state_of_map(arguments.map);
  const std::string priors = arguments.prior_depth.empty() ? "" : state_of_files_in(arguments.prior_depth);
  return state + priors + (arguments.video.empty() ? state_of_files_in(arguments.images) : state_of(arguments.video));
}

/// Polls frequently, but all images only if map or folder have changed, or once a second.
class Watch {
 public:
  explicit Watch(const Arguments& arguments) : arguments_(arguments) {}

  const std::string& state() {
    const std::string brief = state_of_map(arguments_.map) + state_of(arguments_.images) + state_of(arguments_.video) +
                              (arguments_.prior_depth.empty() ? "" : state_of(arguments_.prior_depth));
    if (brief == brief_ && Clock::now() - looked_ < kLookAtAll) return state_;
    state_ = state_of_inputs(arguments_);
    brief_ = brief;
    looked_ = Clock::now();
    return state_;
  }

 private:
  static constexpr auto kLookAtAll = std::chrono::seconds(1);

  const Arguments& arguments_;
  std::string brief_, state_;
  Clock::time_point looked_;
};

/// True for errors that the next state of the inputs may fix.
bool may_pass(const std::exception& error) {
  const int code = exit_code_of(error);
  return code == kExitInput || code == kExitEmpty;
}

}  // namespace

bool follow(const Arguments& arguments, const std::function<void(bool growing)>& once) {
  const InterruptGuard guard(nullptr);
  std::exception_ptr refused;
  Watch watch(arguments);
  std::string seen, done;
  Clock::time_point changed = Clock::now();
  for (;;) {
    try {
      guard.check();
    } catch (const Interrupted&) {
      return false;  // idle
    }
    const std::string state = watch.state();
    if (state != seen) changed = Clock::now();
    seen = state;
    const auto rest = Clock::now() - changed;
    if (state != done && rest >= kRest) {
      done = state;
      refused = nullptr;
      try {
        once(true);
      } catch (const std::exception& error) {
        if (!may_pass(error)) throw;
        refused = std::current_exception();
        Progress(arguments.progress, arguments.quiet, arguments.verbose)
            .warning(std::string(error.what()) + "; waiting for a newer state");
      }
      changed = std::max(changed, Clock::now() - kRest);
      continue;
    }
    if (state == done && arguments.until_idle && rest >= std::chrono::duration<double>(*arguments.until_idle)) {
      if (refused) std::rethrow_exception(refused);
      once(false);
      return true;
    }
    std::this_thread::sleep_for(kImageRecord);
  }
}

}  // namespace pmsp::tool
