// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <condition_variable>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace pmsp {

/// Fixed number of threads for parallel loops. The calling thread works, too: a pool of one starts none.
class ThreadPool {
 public:
  /// `threads` <= 0: one per CPU available to the process.
  explicit ThreadPool(int threads);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  int threads() const { return static_cast<int>(workers_.size()) + 1; }

  /// Calls body(i) for each i in [0, count), in any order, on all threads; returns when all calls are complete, without
  /// waiting for threads that wake late. Rethrows the first exception, after which no further call begins. Not
  /// re-entrant: body must not call for_each of the same pool.
  void for_each(int count, const std::function<void(int)>& body);

 private:
  void work();
  void run_what_is_left(std::unique_lock<std::mutex>& lock);

  std::vector<std::thread> workers_;
  std::mutex mutex_;
  std::condition_variable start_;
  std::condition_variable done_;
  const std::function<void(int)>* body_ = nullptr;
  int count_ = 0;
  int next_ = 0;     ///< next index; `count_` = none left
  int running_ = 0;  ///< calls in progress
  bool stop_ = false;
  std::exception_ptr error_;
};

}  // namespace pmsp
