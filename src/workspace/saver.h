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

/// Writes files on its own threads, which wait for the disk. Errors there (such as a full disk) are thrown by the next
/// call, once.
class Saver {
 public:
  using Write = std::function<std::unique_ptr<AtomicFile>()>;  ///< returns a complete file that is not in its place

  Saver() = default;
  ~Saver();  ///< completes all writes
  Saver(const Saver&) = delete;
  Saver& operator=(const Saver&) = delete;

  /// Blocks until `bytes` more may be held. Throws OutputError.
  void make_room(std::size_t bytes);
  /// `bytes`: memory held by `write`.
  void take(std::size_t bytes, Write write);
  /// Blocks until all files are in place. Throws OutputError.
  void finish();
  /// Discards writes that have not begun, and errors; for files that are no longer needed.
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
  std::size_t held_ = 0;     ///< bytes of unwritten jobs
  std::size_t at_work_ = 0;  ///< busy threads
  bool stop_ = false;
  std::exception_ptr failed_;
  std::vector<std::thread> threads_;  ///< started with the first file
};

/// Copies in reused memory, since allocation takes longer than filling. Copies may be released on any thread and must
/// not outlive this object.
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
