// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include "export/files.h"
#include "export/little_endian.h"
#include "map_scene.h"

namespace pmsp::map_detail {

/// Little-endian binary file, read number by number. Throws IoError; InvalidInput with the byte offset.
class BinaryInput {
 public:
  explicit BinaryInput(const std::filesystem::path& path) : path_(path) {
    require_regular_file(path);
    file_.open(path, std::ios::binary);
    std::error_code error;
    size_ = std::filesystem::file_size(path, error);
    if (!file_ || error) throw IoError(path.string() + ": cannot be opened for reading");
  }

  std::uint64_t size() const { return size_; }
  std::string here() const { return "byte " + std::to_string(at_); }
  [[noreturn]] void refuse(const std::string& what) const { fail(path_, here(), what); }

  template <class T>
  T number() {
    require(sizeof(T));
    char bytes[sizeof(T)];
    file_.read(bytes, sizeof(T));
    if (!file_) throw IoError(path_.string() + ": cannot be read beyond byte " + std::to_string(at_));
    at_ += sizeof(T);
    return get_little<T>(bytes);
  }

  /// Reads a number of elements of at least `bytes` each. Throws if the rest of the file is too short for them.
  std::uint64_t count(const char* what, std::uint64_t bytes) {
    const auto value = number<std::uint64_t>();
    if (value > (size_ - at_) / bytes) {
      refuse("announces " + std::to_string(value) + " " + what + ", but only " + std::to_string(size_ - at_) +
             " bytes follow: it is truncated or broken");
    }
    return value;
  }

  /// Reads a zero-terminated string.
  std::string text() {
    constexpr std::size_t kLongest = 4096;
    std::string result;
    for (auto c = number<char>(); c != '\0'; c = number<char>()) {
      result += c;
      if (result.size() > kLongest) refuse("a name of more than " + std::to_string(kLongest) + " characters");
    }
    return result;
  }

  void skip(std::uint64_t bytes) {
    require(bytes);
    file_.ignore(static_cast<std::streamsize>(bytes));
    at_ += bytes;
  }

  void expect_end() const {
    if (at_ != size_) refuse("more data after the end, expected none");
  }

 private:
  void require(std::uint64_t bytes) const {
    if (bytes > size_ - at_) {
      fail(path_, "byte " + std::to_string(size_), "the file ends in the middle of the data: it is truncated");
    }
  }

  std::filesystem::path path_;
  std::ifstream file_;
  std::uint64_t size_ = 0;
  std::uint64_t at_ = 0;
};

}  // namespace pmsp::map_detail
