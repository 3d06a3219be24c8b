// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace pmsp {

/// Unnamed file in a scratch folder for spilled data: nothing remains even after a killed process. Released space is
/// reused.
class ScratchFile {
 public:
  /// Throws OutputError if the file cannot be created.
  explicit ScratchFile(const std::string& folder);
  ~ScratchFile();
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;

  /// Allocates `bytes`; returns their offset.
  std::uint64_t take(std::size_t bytes);
  /// Releases space of `take`, for allocations of the same size.
  void give_back(std::uint64_t begin, std::size_t bytes) { free_[bytes].push_back(begin); }

  /// Throw OutputError and IoError.
  void write(std::uint64_t at, const void* data, std::size_t bytes);
  void read(std::uint64_t at, void* data, std::size_t bytes) const;

 private:
  std::string folder_;
  int file_ = -1;
  std::uint64_t end_ = 0;
  std::map<std::size_t, std::vector<std::uint64_t>> free_;  ///< offsets, by size
};

}  // namespace pmsp
