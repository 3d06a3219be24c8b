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

/// An AtomicFile that threads of its own write, block by block: one alone copies a gigabyte a second to where the
/// system keeps it, which is less than disks take. What goes wrong there (disk full) is thrown by the next call here.
class BackgroundFile {
 public:
  using Block = std::vector<char>;

  explicit BackgroundFile(const std::filesystem::path& target);
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
  std::int64_t end_ = 0;        ///< of the blocks that came
  std::vector<Block> written_;  ///< to be used again
  int writing_ = 0;             ///< threads
  bool stop_ = false;
  std::exception_ptr failed_;
  std::vector<std::thread> threads_;
};

}  // namespace pmsp
