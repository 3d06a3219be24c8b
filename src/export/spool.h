// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "util/scratch_file.h"

namespace pmsp {

/// Growing lists of records in a scratch file, each read in the order of writing.
template <class Record>
class Spool {
 public:
  Spool(const std::string& folder, std::size_t lists) : file_(folder), lists_(lists) {}

  void add(std::size_t list, const Record& record) {
    List& it = lists_[list];
    it.waiting.push_back(record);
    ++it.size;
    if (it.waiting.size() == kChunk) flush(it);
  }

  /// Adds a list; returns its index.
  std::size_t add_list() {
    lists_.emplace_back();
    return lists_.size() - 1;
  }
  std::int64_t size(std::size_t list) const { return lists_[list].size; }

  /// Calls `take(records, count)` for each piece of a list.
  template <class Take>
  void read(std::size_t list, const Take& take) const {
    const List& it = lists_[list];
    std::vector<Record> chunk(it.chunks.empty() ? 0 : kChunk);
    for (const std::uint64_t begin : it.chunks) {
      file_.read(begin, static_cast<void*>(chunk.data()), kChunkBytes);
      take(chunk.data(), kChunk);
    }
    if (!it.waiting.empty()) take(it.waiting.data(), it.waiting.size());
  }

  /// Clears a list and reuses its space.
  void drop(std::size_t list) {
    for (const std::uint64_t begin : lists_[list].chunks) file_.give_back(begin, kChunkBytes);
    lists_[list] = {};
  }

 private:
  static constexpr std::size_t kChunk = 1024;
  static constexpr std::size_t kChunkBytes = kChunk * sizeof(Record);
  struct List {
    std::vector<Record> waiting;
    std::vector<std::uint64_t> chunks;
    std::int64_t size = 0;
  };

  void flush(List& list) {
    const std::uint64_t begin = file_.take(kChunkBytes);
    file_.write(begin, list.waiting.data(), kChunkBytes);
    list.chunks.push_back(begin);
    list.waiting.clear();
  }

  ScratchFile file_;
  std::vector<List> lists_;
};

}  // namespace pmsp
