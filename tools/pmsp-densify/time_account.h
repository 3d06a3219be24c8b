// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <chrono>
#include <cstddef>

namespace pmsp::tool {

/// What the main thread of a run is busy with, or waits for. What other threads do meanwhile is not in it.
enum class Busy {
  kOther,
  kMap,        ///< reading the map
  kImages,     ///< finding the images that belong to it
  kStart,      ///< making a Densifier: threads, or a CUDA device's context
  kWait,       ///< for images that are being read, and compared with the map
  kDensify,    ///< stages on the CPU; waiting for them on a device
  kPoints,     ///< encoding points, waiting for the thread that writes them
  kDepthMaps,  ///< encoding and writing them
  kPreview,    ///< drawing
  kFinish,     ///< until all is on the disk
};
constexpr std::size_t kBusyKinds = static_cast<std::size_t>(Busy::kFinish) + 1;

/// Where the time of a run goes: each moment counts for the innermost scope that is open, so that all add up to the
/// whole. For one thread.
class TimeAccount {
 public:
  class Scope {
   public:
    Scope(TimeAccount& account, Busy with) : account_(account), before_(account.now_) { account_.turn_to(with); }
    ~Scope() { account_.turn_to(before_); }
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;

   private:
    TimeAccount& account_;
    Busy before_;
  };

  double seconds(Busy with) {
    turn_to(now_);
    return seconds_[static_cast<std::size_t>(with)];
  }

  double total() {
    turn_to(now_);
    double sum = 0.0;
    for (const double seconds : seconds_) sum += seconds;
    return sum;
  }

 private:
  using Clock = std::chrono::steady_clock;

  void turn_to(Busy with) {
    const Clock::time_point time = Clock::now();
    seconds_[static_cast<std::size_t>(now_)] += std::chrono::duration<double>(time - since_).count();
    since_ = time;
    now_ = with;
  }

  std::array<double, kBusyKinds> seconds_{};
  Busy now_ = Busy::kOther;
  Clock::time_point since_ = Clock::now();
};

}  // namespace pmsp::tool
