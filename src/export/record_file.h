// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "export/background_file.h"
#include "machine.h"
#include "pmsp/io/cloud.h"
#include "pmsp/stages.h"
#include "util/thread_pool.h"

namespace pmsp {

/// File of fixed-size records behind a header, encoded by several threads.
class RecordFile {
 public:
  /// `threads`: 0 = one per CPU.
  RecordFile(const std::filesystem::path& path, const std::string& header, std::size_t record_bytes, int threads)
      : file_(path), pool_(std::min(threads > 0 ? threads : usable_cpus(), kMostThreads)), record_bytes_(record_bytes) {
    file_.write(BackgroundFile::Block(header.begin(), header.end()));
  }

  /// Appends points. `encode(points, count, to)` encodes some of them; called concurrently.
  template <class Encode>
  void add(const OutputPoint* points, std::size_t count, const Encode& encode) {
    each_share(count, [&](std::size_t first, std::size_t number, char* to) { encode(points + first, number, to); });
  }

  /// As above, for points that are transformed just before encoding, while in the cache.
  template <class Encode>
  void add(std::size_t count, const PointProducer& place, const Encode& encode) {
    each_share(count, [&](std::size_t first, std::size_t number, char* to) {
      std::array<OutputPoint, kPlaced> placed;
      for (std::size_t done = 0; done < number; done += kPlaced) {
        const std::size_t some = std::min(kPlaced, number - done);
        place(first + done, first + done + some, placed.data());
        encode(placed.data(), some, to + done * record_bytes_);
      }
    });
  }

  /// Appends points of any other kind: `fill(first, number, to)` encodes some of them; called concurrently.
  template <class Fill>
  void fill(std::size_t count, const Fill& fill) {
    each_share(count, fill);
  }

  std::int64_t points() const { return points_; }
  /// Overwrites part of the header.
  void patch(std::int64_t offset, const std::string& text) { file_.patch(offset, text); }
  void commit() { file_.commit(); }

 private:
  static constexpr std::size_t kBlockBytes = std::size_t{1} << 20;
  static constexpr std::size_t kBlocksAtOnce = 16;
  static constexpr std::size_t kShare = 4096;  ///< points encoded per task
  static constexpr std::size_t kPlaced = 512;  ///< points transformed at a time
  static constexpr int kMostThreads = 16;      ///< enough for the fastest disks

  /// Threads take tasks smaller than blocks: small maps have few blocks per keyframe.
  template <class Fill>
  void each_share(std::size_t count, const Fill& fill) {
    const std::size_t of_block = std::max(kBlockBytes / (kShare * record_bytes_), std::size_t{1}) * kShare;
    for (std::size_t begin = 0; begin < count; begin += kBlocksAtOnce * of_block) {
      const std::size_t points = std::min(count - begin, kBlocksAtOnce * of_block);
      std::vector<BackgroundFile::Block> blocks;
      for (std::size_t first = 0; first < points; first += of_block) {
        blocks.push_back(file_.block());
        blocks.back().resize(std::min(of_block, points - first) * record_bytes_);
      }
      pool_.for_each(static_cast<int>((points + kShare - 1) / kShare), [&](int share) {
        const std::size_t first = static_cast<std::size_t>(share) * kShare;
        char* const to = blocks[first / of_block].data() + first % of_block * record_bytes_;
        fill(begin + first, std::min(kShare, points - first), to);
      });
      for (BackgroundFile::Block& block : blocks) file_.write(std::move(block));
    }
    points_ += static_cast<std::int64_t>(count);
  }

  BackgroundFile file_;
  ThreadPool pool_;
  std::size_t record_bytes_;
  std::int64_t points_ = 0;
};

}  // namespace pmsp
