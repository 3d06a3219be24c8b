// SPDX-License-Identifier: BSD-2-Clause
#include "export/background_file.h"

#include <utility>

namespace pmsp {

BackgroundFile::BackgroundFile(const std::filesystem::path& target) : file_(target) {
  for (int i = 0; i < kThreads; ++i) threads_.emplace_back([this] { work(); });
}

BackgroundFile::~BackgroundFile() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
    waiting_.clear();
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

BackgroundFile::Block BackgroundFile::block() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (written_.empty()) return {};
  Block block = std::move(written_.back());
  written_.pop_back();
  return block;
}

void BackgroundFile::write(Block block) {
  {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [&] { return failed_ || waiting_.size() < kMostWaiting; });
    rethrow();
    const std::int64_t bytes = static_cast<std::int64_t>(block.size());
    waiting_.push_back({std::move(block), end_});
    end_ += bytes;
  }
  changed_.notify_all();
}

void BackgroundFile::patch(std::int64_t offset, const std::string& text) {
  std::unique_lock<std::mutex> lock(mutex_);
  wait_until_written(lock);
  file_.patch(offset, text);
}

void BackgroundFile::commit() {
  std::unique_lock<std::mutex> lock(mutex_);
  wait_until_written(lock);
  file_.commit();
}

void BackgroundFile::wait_until_written(std::unique_lock<std::mutex>& lock) {
  changed_.wait(lock, [&] { return failed_ || (waiting_.empty() && writing_ == 0); });
  rethrow();
}

void BackgroundFile::rethrow() const {
  if (failed_) std::rethrow_exception(failed_);
}

void BackgroundFile::work() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    changed_.wait(lock, [&] { return stop_ || !waiting_.empty(); });
    if (stop_) return;
    Waiting next = std::move(waiting_.front());
    waiting_.pop_front();
    ++writing_;
    lock.unlock();
    std::exception_ptr failed;
    try {
      file_.write_at(next.offset, next.block.data(), next.block.size());
    } catch (...) {
      failed = std::current_exception();
    }
    lock.lock();
    --writing_;
    if (failed) failed_ = failed;
    written_.push_back(std::move(next.block));
    if (failed_) waiting_.clear();
    lock.unlock();
    changed_.notify_all();
    lock.lock();
    if (failed_) return;
  }
}

}  // namespace pmsp
