// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "export/background_file.h"
#include "pmsp/executor.h"
#include "pmsp/io/cloud_writer.h"
#include "util/thread_pool.h"

namespace pmsp {

/// A file of points as records of one size behind a header, whose bytes several threads make.
class RecordFile {
 public:
  RecordFile(const std::filesystem::path& path, const std::string& header, std::size_t record_bytes)
      : file_(path), record_bytes_(record_bytes) {
    file_.write(BackgroundFile::Block(header.begin(), header.end()));
  }

  /// `encode(points, count, to)` makes records of some of them; it is called by several threads at a time.
  template <class Encode>
  void add(const OutputPoint* points, std::size_t count, const Encode& encode) {
    const std::size_t each = kBlockBytes / record_bytes_;
    const std::size_t blocks = (count + each - 1) / each;
    for (std::size_t begin = 0; begin < blocks; begin += kBlocksAtOnce) {
      std::vector<BackgroundFile::Block> made(std::min(kBlocksAtOnce, blocks - begin));
      for (BackgroundFile::Block& block : made) block = file_.block();
      pool_.for_each(static_cast<int>(made.size()), [&](int at) {
        const std::size_t first = (begin + static_cast<std::size_t>(at)) * each;
        const std::size_t number = std::min(each, count - first);
        BackgroundFile::Block& block = made[static_cast<std::size_t>(at)];
        block.resize(number * record_bytes_);
        encode(points + first, number, block.data());
      });
      for (BackgroundFile::Block& block : made) file_.write(std::move(block));
    }
    points_ += static_cast<std::int64_t>(count);
  }

  std::int64_t points() const { return points_; }
  /// Overwrites a part of the header.
  void patch(std::int64_t offset, const std::string& text) { file_.patch(offset, text); }
  void commit() { file_.commit(); }

 private:
  static constexpr std::size_t kBlockBytes = std::size_t{1} << 20;
  static constexpr std::size_t kBlocksAtOnce = 8;
  static constexpr int kMostThreads = 4;  // as fast as any disk

  BackgroundFile file_;
  ThreadPool pool_{std::min(kMostThreads, usable_cpus())};
  std::size_t record_bytes_;
  std::int64_t points_ = 0;
};

}  // namespace pmsp
