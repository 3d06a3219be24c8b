// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>
#include <vector>

#include "export/files.h"
#include "pmsp/error.h"

namespace pmsp {

/// Byte stream of a file with a buffer of 1 MiB. Throws IoError if it cannot be read.
class BufferedInput {
 public:
  explicit BufferedInput(const std::filesystem::path& path) : name_(path.string()) {
    require_regular_file(path);
    std::error_code error;
    stream_.open(path, std::ios::binary);
    size_ = std::filesystem::file_size(path, error);
    if (!stream_ || error) throw IoError(name_ + ": cannot be opened for reading");
    buffer_.resize(std::size_t{1} << 20);
  }

  [[noreturn]] void fail(const std::string& what) const { throw InvalidInput(name_ + ": " + what); }
  std::string here() const { return "byte " + std::to_string(position()); }
  std::uint64_t size() const { return size_; }
  std::uint64_t position() const { return consumed_ + at_; }
  std::uint64_t remaining() const { return size_ > position() ? size_ - position() : 0; }

  void seek(std::uint64_t position) {
    stream_.clear();
    stream_.seekg(static_cast<std::streamoff>(position));
    consumed_ = position;
    at_ = end_ = 0;
  }

  void skip(std::uint64_t bytes) {
    if (bytes <= end_ - at_) {
      at_ += static_cast<std::size_t>(bytes);
    } else {
      seek(position() + bytes);
    }
  }

  /// Returns the next byte, -1 at the end.
  int get() {
    if (at_ == end_ && !refill()) return -1;
    return buffer_[at_++];
  }

  /// Returns the next `bytes` bytes, at most the buffer size; valid until the next call. Throws InvalidInput at the
  /// end.
  const unsigned char* take(std::size_t bytes) {
    while (end_ - at_ < bytes) {
      if (!refill()) fail("ends at byte " + std::to_string(size_) + ", in the middle of the data");
    }
    at_ += bytes;
    return buffer_.data() + at_ - bytes;
  }

 private:
  bool refill() {
    std::copy(buffer_.begin() + static_cast<std::ptrdiff_t>(at_), buffer_.begin() + static_cast<std::ptrdiff_t>(end_),
              buffer_.begin());
    consumed_ += at_;
    end_ -= at_;
    at_ = 0;
    stream_.read(reinterpret_cast<char*>(buffer_.data() + end_), static_cast<std::streamsize>(buffer_.size() - end_));
    const std::streamsize got = stream_.gcount();
    end_ += static_cast<std::size_t>(got);
    return got > 0;
  }

  std::string name_;
  std::ifstream stream_;
  std::uint64_t size_ = 0;
  std::uint64_t consumed_ = 0;
  std::vector<unsigned char> buffer_;
  std::size_t at_ = 0;
  std::size_t end_ = 0;
};

}  // namespace pmsp
