// SPDX-License-Identifier: BSD-2-Clause
#include "workspace/saver.h"

#include <utility>

namespace pmsp::workspace {

Saver::~Saver() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void Saver::make_room(std::size_t bytes) {
  std::unique_lock<std::mutex> lock(mutex_);
  changed_.wait(lock, [&] { return failed_ || held_ == 0 || held_ + bytes <= kMostHeld; });
  rethrow();
}

void Saver::take(std::size_t bytes, Write write) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    while (threads_.size() < kThreads) threads_.emplace_back([this] { work(); });
    held_ += bytes;
    jobs_.push_back({bytes, std::move(write)});
  }
  changed_.notify_all();
}

void Saver::finish() {
  std::unique_lock<std::mutex> lock(mutex_);
  changed_.wait(lock, [&] { return jobs_.empty() && at_work_ == 0; });
  rethrow();
}

void Saver::drop() {
  std::unique_lock<std::mutex> lock(mutex_);
  for (const Job& job : jobs_) held_ -= job.bytes;
  jobs_.clear();
  changed_.wait(lock, [&] { return at_work_ == 0; });
  failed_ = nullptr;
}

void Saver::rethrow() {
  if (failed_) std::rethrow_exception(std::exchange(failed_, nullptr));
}

void Saver::work() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    changed_.wait(lock, [&] { return stop_ || !jobs_.empty(); });
    if (jobs_.empty()) return;
    Job job = std::move(jobs_.front());
    jobs_.pop_front();
    save(std::move(job), lock);
  }
}

/// Releases the memory of the job before waiting for the disk.
void Saver::save(Job job, std::unique_lock<std::mutex>& lock) {
  ++at_work_;
  std::exception_ptr failed;
  std::unique_ptr<AtomicFile> file;
  lock.unlock();
  try {
    file = job.write();
  } catch (...) {
    failed = std::current_exception();
  }
  job.write = nullptr;
  lock.lock();
  held_ -= job.bytes;
  lock.unlock();
  changed_.notify_all();
  try {
    if (file) file->commit();
    file.reset();
  } catch (...) {
    failed = std::current_exception();
  }
  lock.lock();
  --at_work_;
  if (failed && !failed_) failed_ = failed;
  changed_.notify_all();
}

}  // namespace pmsp::workspace
