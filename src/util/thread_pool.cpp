// SPDX-License-Identifier: BSD-2-Clause
#include "util/thread_pool.h"
#include "machine.h"

#include <system_error>
#include <utility>

#include "pmsp/stages.h"

namespace pmsp {

ThreadPool::ThreadPool(int threads) {
  const int wanted = threads > 0 ? threads : usable_cpus();
  workers_.reserve(static_cast<std::size_t>(wanted - 1));
  try {
    for (int i = 1; i < wanted; ++i) workers_.emplace_back([this] { work(); });
  } catch (const std::system_error&) {
    // No more threads available: the existing ones do the work.
  }
}

ThreadPool::~ThreadPool() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  start_.notify_all();
  for (std::thread& worker : workers_) worker.join();
}

void ThreadPool::for_each(int count, const std::function<void(int)>& body) {
  std::unique_lock<std::mutex> lock(mutex_);
  body_ = &body;
  count_ = count;
  next_ = 0;
  // Waking a thread takes time and the mutex; short loops end before many threads would be awake.
  if (count > static_cast<int>(workers_.size())) {
    start_.notify_all();
  } else {
    for (int i = 1; i < count; ++i) start_.notify_one();
  }
  run_what_is_left(lock);
  done_.wait(lock, [this] { return running_ == 0; });
  body_ = nullptr;
  if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
}

void ThreadPool::run_what_is_left(std::unique_lock<std::mutex>& lock) {
  while (next_ < count_) {
    const int i = next_++;
    ++running_;
    lock.unlock();
    std::exception_ptr error;
    try {
      (*body_)(i);
    } catch (...) {
      error = std::current_exception();
    }
    lock.lock();
    --running_;
    if (!error) continue;
    next_ = count_;
    if (!error_) error_ = error;
  }
}

void ThreadPool::work() {
  std::unique_lock<std::mutex> lock(mutex_);
  for (;;) {
    start_.wait(lock, [this] { return stop_ || next_ < count_; });
    if (stop_) return;
    run_what_is_left(lock);
    if (running_ == 0) done_.notify_one();
  }
}

}  // namespace pmsp
