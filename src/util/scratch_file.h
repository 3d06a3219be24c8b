// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace pmsp {

/// A file in a scratch folder for what memory should not hold. It has no name, so that even a killed process leaves
/// nothing behind. Space that is given back is used again.
class ScratchFile {
 public:
  /// Throws OutputError when no file can be made there.
  explicit ScratchFile(const std::string& folder);
  ~ScratchFile();
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;

  /// Returns where room for `bytes` begins.
  std::uint64_t take(std::size_t bytes);
  /// What `take` gave; used again where as much is asked for.
  void give_back(std::uint64_t begin, std::size_t bytes) { free_[bytes].push_back(begin); }

  /// Throw OutputError, and IoError.
  void write(std::uint64_t at, const void* data, std::size_t bytes);
  void read(std::uint64_t at, void* data, std::size_t bytes) const;

 private:
  std::string folder_;
  int file_ = -1;
  std::uint64_t end_ = 0;
  std::map<std::size_t, std::vector<std::uint64_t>> free_;  ///< by size
};

}  // namespace pmsp
