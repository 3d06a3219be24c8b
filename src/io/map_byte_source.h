// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <vector>

namespace pmsp::map_detail {

/// A file as a range of characters, read chunk by chunk: the speed of a plain pointer, without the file in memory (a
/// mapped file would count as memory of the process, and one that shrinks meanwhile would end it).
class ByteSource {
 public:
  /// Throws IoError.
  explicit ByteSource(const std::filesystem::path& path);
  /// Of a part of the file that is in memory.
  ByteSource(const std::filesystem::path& path, const std::string& bytes);

  bool at_end() const { return current_ == end_; }
  char peek() const { return *current_; }
  void advance() {
    if (++current_ == end_) refill();
  }

  /// Advances past a value of MessagePack, whatever it holds, and puts a nil before what follows it: much faster than a
  /// parser that takes each number of it. Stops early at the end of the file, and at what is no MessagePack.
  void replace_value_by_nil();

  /// Appends a value as it stands to `to`. False where it is broken, or `to` would get longer than `most` bytes.
  bool copy_value(std::string& to, std::size_t most);
  /// Advances past a value. False where it is broken.
  bool skip_value();
  /// Advances past the head of a map and returns how many pairs follow; none where there is no map.
  std::optional<std::uint64_t> enter_map();
  /// Puts a nil before what follows.
  void put_nil();

  /// Offset of the next character.
  std::uint64_t offset() const { return chunk_offset_ + static_cast<std::uint64_t>(current_ - chunk_.data() - 1); }

  /// To be called for each token that is read. A token that is longer than a chunk (a hostile string) makes `advance`
  /// throw InvalidInput, before it fills the memory.
  void token_seen() { token_seen_ = true; }

 private:
  void refill();
  bool skip(std::uint64_t bytes);
  std::uint64_t skip_row(std::uint64_t most);
  std::uint64_t size_of_value(int bytes);
  void copy_up_to_here();

  std::filesystem::path path_;
  std::ifstream file_;
  std::vector<char> chunk_;  ///< after a byte that is left free
  const char* current_ = nullptr;
  const char* end_ = nullptr;
  std::uint64_t chunk_offset_ = 0;
  bool token_seen_ = true;
  std::string* copy_ = nullptr;   ///< where a value is copied to
  const char* copied_ = nullptr;  ///< up to here
  std::size_t most_copied_ = 0;
};

/// Input iterator of nlohmann::json over a source with peek(), advance() and at_end(); without a source, the end.
template <class Source>
class SourceIterator {
 public:
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = char;

  SourceIterator() = default;
  explicit SourceIterator(Source* source) : source_(source) {}

  char operator*() const { return source_->peek(); }
  SourceIterator& operator++() {
    source_->advance();
    return *this;
  }
  friend bool operator==(const SourceIterator& a, const SourceIterator& b) { return a.done() == b.done(); }
  friend bool operator!=(const SourceIterator& a, const SourceIterator& b) { return a.done() != b.done(); }

 private:
  bool done() const { return source_ == nullptr || source_->at_end(); }

  Source* source_ = nullptr;
};
using ByteIterator = SourceIterator<ByteSource>;

}  // namespace pmsp::map_detail
