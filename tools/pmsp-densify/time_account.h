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
  kWorkspace,  ///< what goes to a workspace, and what comes from it; waiting for the disk where it takes too long
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
    Scope(TimeAccount& account, Busy with) : Scope(&account, with) {}
    /// nullptr = nobody asks.
    Scope(TimeAccount* account, Busy with) : account_(account) {
      if (account_ == nullptr) return;
      before_ = account_->now_;
      account_->turn_to(with);
    }
    ~Scope() {
      if (account_ != nullptr) account_->turn_to(before_);
    }
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;

   private:
    TimeAccount* account_;
    Busy before_ = Busy::kOther;
  };

  /// Up to now.
  double seconds(Busy with) const {
    const double before = seconds_[static_cast<std::size_t>(with)];
    return with == now_ ? before + since(since_) : before;
  }

  double total() const { return since(begin_); }

 private:
  using Clock = std::chrono::steady_clock;

  static double since(Clock::time_point time) { return std::chrono::duration<double>(Clock::now() - time).count(); }

  void turn_to(Busy with) {
    seconds_[static_cast<std::size_t>(now_)] = seconds(now_);
    since_ = Clock::now();
    now_ = with;
  }

  std::array<double, kBusyKinds> seconds_{};
  Busy now_ = Busy::kOther;
  const Clock::time_point begin_ = Clock::now();
  Clock::time_point since_ = begin_;
};

}  // namespace pmsp::tool
