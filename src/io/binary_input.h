// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "export/little_endian.h"

// Common part of all readers of files: bytes (BinaryInput), lines and words (TextInput), values of JSON (JsonValue).
// Errors contain the path and the place in the file.
namespace pmsp {

/// Throws InvalidInput: "PATH: WHERE: WHAT"; "PATH: WHAT" if `where` is empty.
[[noreturn]] void fail(const std::filesystem::path& path, const std::string& where, const std::string& what);

/// Quotes text of a file for a message: shortened, without control characters.
std::string in_quotes(const std::string& text);

/// Formats a number for messages.
std::string to_message(double value);

/// Byte stream of a file with a buffer of 1 MiB, or of a member of a ZIP archive (io::archive_of); numbers are
/// little-endian. Throws IoError if it cannot be read, InvalidInput with the byte offset if it ends too early.
class BinaryInput {
 public:
  explicit BinaryInput(const std::filesystem::path& path);
  /// Reads `bytes` instead of a file; `path` is its name in errors.
  BinaryInput(const std::filesystem::path& path, std::string bytes);

  const std::filesystem::path& path() const { return path_; }
  std::uint64_t size() const { return size_; }
  std::uint64_t position() const { return read_ - (end_ - at_); }
  std::uint64_t remaining() const { return size_ > position() ? size_ - position() : 0; }
  std::string here() const { return "byte " + std::to_string(position()); }
  [[noreturn]] void fail(const std::string& what) const { pmsp::fail(path_, "", what); }
  [[noreturn]] void refuse(const std::string& what) const { pmsp::fail(path_, here(), what); }

  /// Throws if fewer bytes follow. To be called before allocating for them.
  void require(std::uint64_t bytes) const;
  void seek(std::uint64_t position);
  void skip(std::uint64_t bytes) {
    require(bytes);
    seek(position() + bytes);
  }

  /// Returns the next byte, -1 at the end.
  int peek() { return at_ == end_ && !refill() ? -1 : static_cast<unsigned char>(buffer_[at_]); }
  int get() {
    const int byte = peek();
    at_ += byte >= 0 ? 1 : 0;
    return byte;
  }
  /// Returns the next `bytes` bytes; valid until the next call.
  const char* take(std::size_t bytes) {
    if (bytes > end_ - at_) fill(bytes);
    at_ += bytes;
    return buffer_.data() + at_ - bytes;
  }
  /// Takes the next bytes if they are `bytes`, otherwise none.
  bool take_if(std::string_view bytes);

  template <class T>
  T number() {
    return get_little<T>(take(sizeof(T)));
  }
  /// Reads a number of elements of at least `bytes` each. Throws if the rest of the file is too short for them.
  std::uint64_t count(const char* what, std::uint64_t bytes);
  /// Reads a zero-terminated string of at most `most` bytes.
  std::string text(std::size_t most = 4096);
  /// Reads a word of at most `most` characters and one blank after it; empty at the end of the file.
  std::string word(std::size_t most);
  /// Reads a line of at most `most` characters, without its end; false at the end of the file.
  bool line(std::string& line, std::size_t most = std::string::npos);
  void expect_end() const;

 private:
  bool refill();
  void fill(std::size_t bytes);

  std::filesystem::path path_;
  std::ifstream file_;
  std::uint64_t size_ = 0;
  std::uint64_t read_ = 0;  ///< bytes of the file up to the buffer's end
  std::string buffer_;
  std::size_t at_ = 0;
  std::size_t end_ = 0;
};

}  // namespace pmsp
