// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
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

  /// Room for `bytes`, the same number in each call. Returns where it begins.
  std::uint64_t take(std::size_t bytes);
  void give_back(std::uint64_t begin) { free_.push_back(begin); }

  /// Throw OutputError, and IoError.
  void write(std::uint64_t at, const void* data, std::size_t bytes);
  void read(std::uint64_t at, void* data, std::size_t bytes) const;

  template <class T>
  void write(std::uint64_t at, const std::vector<T>& values) {
    write(at, values.data(), values.size() * sizeof(T));
  }
  template <class T>
  void read(std::uint64_t at, std::vector<T>& values) const {
    read(at, values.data(), values.size() * sizeof(T));
  }

 private:
  std::string folder_;
  int file_ = -1;
  std::uint64_t end_ = 0;
  std::vector<std::uint64_t> free_;
};

}  // namespace pmsp
