// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "export/files.h"

namespace pmsp::workspace {

/// Writes files on threads of its own, which wait for the disk. What goes wrong there (disk full) is thrown by the next
/// call here, once.
class Saver {
 public:
  using Write = std::function<std::unique_ptr<AtomicFile>()>;  ///< all is in the file, but it is not in its place

  Saver() = default;
  ~Saver();  ///< after all that were taken
  Saver(const Saver&) = delete;
  Saver& operator=(const Saver&) = delete;

  /// Waits until so many bytes more may be held. Throws OutputError.
  void make_room(std::size_t bytes);
  /// `bytes`: of memory that `write` holds.
  void take(std::size_t bytes, Write write);
  /// Until all are in their places. Throws OutputError.
  void finish();
  /// Nobody needs them any more: those that nobody has begun with are not written. Errors do not matter.
  void drop();

 private:
  static constexpr std::size_t kThreads = 4;
  static constexpr std::size_t kMostHeld = std::size_t{64} << 20;

  struct Job {
    std::size_t bytes;
    Write write;
  };

  void work();
  void save(Job job, std::unique_lock<std::mutex>& lock);
  void rethrow();

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Job> jobs_;
  std::size_t held_ = 0;     ///< bytes of jobs that are not written
  std::size_t at_work_ = 0;  ///< threads
  bool stop_ = false;
  std::exception_ptr failed_;
  std::vector<std::thread> threads_;  ///< from the first file on
};

/// Copies whose memory is used again: new memory takes the system longer than to fill it. Copies may be let go on any
/// thread, and must not outlive this.
template <class T>
class Copies {
 public:
  std::shared_ptr<const T> copy(const T& original) {
    std::unique_ptr<T> copy;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (!spare_.empty()) {
        copy = std::move(spare_.back());
        spare_.pop_back();
      }
    }
    if (!copy) copy = std::make_unique<T>();
    *copy = original;
    return {copy.release(), [this](T* returned) {
              const std::lock_guard<std::mutex> lock(mutex_);
              spare_.emplace_back(returned);
            }};
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<T>> spare_;
};

}  // namespace pmsp::workspace
