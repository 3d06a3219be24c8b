// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <filesystem>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "export/atomic_file.h"

namespace pmsp {

/// An AtomicFile that a thread of its own writes, block by block. What goes wrong there (disk full) is thrown by the
/// next call here.
class BackgroundFile {
 public:
  using Block = std::vector<char>;

  explicit BackgroundFile(const std::filesystem::path& target) : file_(target), thread_([this] { work(); }) {}
  ~BackgroundFile();
  BackgroundFile(const BackgroundFile&) = delete;
  BackgroundFile& operator=(const BackgroundFile&) = delete;

  /// To be filled, whatever is in it: one that has been written, whose memory is there, or an empty one.
  Block block();
  /// Waits while too many blocks wait. Throws OutputError.
  void write(Block block);
  /// Overwrites bytes that were written before. Throws OutputError.
  void patch(std::int64_t offset, const std::string& text);
  /// Puts the file in its place when all is written. Throws OutputError.
  void commit();

 private:
  static constexpr std::size_t kMostWaiting = 32;

  void work();
  void wait_until_written(std::unique_lock<std::mutex>& lock);
  void rethrow() const;

  AtomicFile file_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Block> waiting_;
  std::vector<Block> written_;  ///< to be used again
  bool writing_ = false;
  bool stop_ = false;
  std::exception_ptr failed_;
  std::thread thread_;  ///< after all that it uses
};

}  // namespace pmsp
