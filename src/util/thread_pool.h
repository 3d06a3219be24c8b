// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <condition_variable>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace pmsp {

/// A fixed number of threads that share loops. The thread that calls works too, so a pool of one starts none.
class ThreadPool {
 public:
  /// `threads` <= 0: one for each CPU that the process may use.
  explicit ThreadPool(int threads);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  int threads() const { return static_cast<int>(workers_.size()) + 1; }

  /// Calls body(i) for each i in [0, count), in any order, on all threads; returns when all are done. Threads that are
  /// late to wake are not waited for. The first exception is rethrown, and what has not begun by then never does. Not
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
  int next_ = 0;     ///< to begin with; `count_`: none is left
  int running_ = 0;  ///< begun, not done
  bool stop_ = false;
  std::exception_ptr error_;
};

}  // namespace pmsp
