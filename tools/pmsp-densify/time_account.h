// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <chrono>
#include <cstddef>

namespace pmsp::tool {

/// Activity of a run's main thread, or reason of its waiting; other threads are not accounted.
enum class Busy {
  kOther,
  kMap,        ///< reading the map
  kImages,     ///< finding the images of keyframes
  kStart,      ///< creating a Densifier: threads, or CUDA context
  kWait,       ///< for images being read and verified
  kDensify,    ///< stages on the CPU, or waiting for a device
  kPoints,     ///< encoding points, waiting for the writing thread
  kDepthMaps,  ///< encoding and writing
  kWorkspace,  ///< reading and writing a workspace, waiting for the disk
  kPreview,    ///< drawing
  kFinish,     ///< until all data are on disk
};
constexpr std::size_t kBusyKinds = static_cast<std::size_t>(Busy::kFinish) + 1;

/// Time of a run by activity: each moment counts for the innermost open scope, so the sum is the total. For one thread.
class TimeAccount {
 public:
  class Scope {
   public:
    Scope(TimeAccount& account, Busy with) : Scope(&account, with) {}
    /// nullptr = no account.
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

  /// Seconds up to now.
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
