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

#include "export/files.h"

namespace pmsp {

/// AtomicFile written in blocks by threads of its own, since copying to the page cache is slower than fast disks.
/// Errors there (disk full) are thrown by the next call.
class BackgroundFile {
 public:
  using Block = std::vector<char>;

  explicit BackgroundFile(const std::filesystem::path& target);
  ~BackgroundFile();
  BackgroundFile(const BackgroundFile&) = delete;
  BackgroundFile& operator=(const BackgroundFile&) = delete;

  /// Returns a buffer to fill: a written one for reuse, with old contents, or an empty one.
  Block block();
  /// Blocks while kMostWaiting blocks are pending. Throws OutputError.
  void write(Block block);
  /// Overwrites bytes written before. Throws OutputError.
  void patch(std::int64_t offset, const std::string& text);
  /// Waits for all blocks, then moves the file to its final name. Throws OutputError.
  void commit();

 private:
  static constexpr std::size_t kMostWaiting = 32;
  static constexpr int kThreads = 3;
  struct Waiting {
    Block block;
    std::int64_t offset;
  };

  void work();
  void wait_until_written(std::unique_lock<std::mutex>& lock);
  void rethrow() const;

  AtomicFile file_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Waiting> waiting_;
  std::int64_t end_ = 0;        ///< file offset after the last block received [bytes]
  std::vector<Block> written_;  ///< buffers for reuse
  int writing_ = 0;             ///< number of threads that are writing
  bool stop_ = false;
  std::exception_ptr failed_;
  std::vector<std::thread> threads_;
};

}  // namespace pmsp
