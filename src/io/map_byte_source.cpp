// SPDX-License-Identifier: BSD-2-Clause
#include "map_byte_source.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <string>

#include "pmsp/error.h"

namespace pmsp::map_detail {
namespace {

constexpr std::size_t kChunkBytes = std::size_t{1} << 20;

/// Bytes of a value of MessagePack by its first byte, that included; 0: they depend on what follows, other values are
/// in it, or there is no such value.
constexpr std::array<std::uint8_t, 256> lengths() {
  std::array<std::uint8_t, 256> bytes{};
  for (unsigned first = 0; first < 256; ++first) {
    const bool is_small_number = first < 0x80 || first >= 0xE0;
    const bool is_nil_or_boolean = first == 0xC0 || first == 0xC2 || first == 0xC3;
    if (is_small_number || is_nil_or_boolean) bytes[first] = 1;
    if (first >= 0xA0 && first < 0xC0) bytes[first] = static_cast<std::uint8_t>(1 + (first & 0x1FU));  // short strings
    if (first == 0xCA || first == 0xCB) bytes[first] = static_cast<std::uint8_t>(1 + (4U << (first - 0xCA)));
    if (first >= 0xCC && first <= 0xD3) bytes[first] = static_cast<std::uint8_t>(1 + (1U << (first & 3U)));
    if (first >= 0xD4 && first <= 0xD8) bytes[first] = static_cast<std::uint8_t>(2 + (1U << (first - 0xD4)));
  }
  return bytes;
}
constexpr std::array<std::uint8_t, 256> kLengths = lengths();

}  // namespace

ByteSource::ByteSource(const std::filesystem::path& path) : path_(path), chunk_(1 + kChunkBytes) {
  file_.rdbuf()->pubsetbuf(nullptr, 0);  // chunks are large: a second buffer would only copy them
  file_.open(path, std::ios::binary);
  if (!file_) throw IoError(path.string() + ": cannot be opened: " + std::strerror(errno));
  current_ = end_ = chunk_.data() + 1;
  refill();
}

ByteSource::ByteSource(const std::filesystem::path& path, const std::string& bytes)
    : path_(path), chunk_(1 + bytes.size()) {
  std::copy(bytes.begin(), bytes.end(), chunk_.begin() + 1);
  current_ = chunk_.data() + 1;
  end_ = current_ + bytes.size();
}

void ByteSource::refill() {
  copy_up_to_here();
  if (!file_.is_open()) return;
  chunk_offset_ = offset();
  const bool full = end_ == chunk_.data() + chunk_.size();  // the last chunk may well be the end of a token
  if (full && !token_seen_) {
    throw InvalidInput(path_.string() + ": byte " + std::to_string(chunk_offset_) +
                       ": a string or binary block of more than a mebibyte, expected no such thing in a map");
  }
  token_seen_ = false;
  file_.read(chunk_.data() + 1, static_cast<std::streamsize>(kChunkBytes));
  if (file_.bad()) {
    throw IoError(path_.string() + ": cannot be read beyond byte " + std::to_string(chunk_offset_) + ": " +
                  std::strerror(errno));
  }
  current_ = copied_ = chunk_.data() + 1;
  end_ = current_ + file_.gcount();
}

void ByteSource::copy_up_to_here() {
  if (copy_ == nullptr) return;
  if (copy_->size() + static_cast<std::size_t>(current_ - copied_) > most_copied_) {
    copy_ = nullptr;
    return;
  }
  copy_->append(copied_, current_);
  copied_ = current_;
}

bool ByteSource::copy_value(std::string& to, std::size_t most) {
  copy_ = &to;
  copied_ = current_;
  most_copied_ = most;
  const bool whole = skip_value();
  copy_up_to_here();
  const bool copied = copy_ != nullptr;
  copy_ = nullptr;
  return whole && copied;
}

std::optional<std::uint64_t> ByteSource::enter_map() {
  if (at_end()) return {};
  const auto first = static_cast<unsigned char>(peek());
  const bool is_small = first >= 0x80 && first < 0x90;
  if (!is_small && first != 0xDE && first != 0xDF) return {};
  token_seen();
  advance();
  return is_small ? first & 0x0FU : size_of_value(first == 0xDE ? 2 : 4);
}

/// False if the file ends before so many are past.
bool ByteSource::skip(std::uint64_t bytes) {
  while (bytes > 0 && !at_end()) {
    const auto step = std::min(bytes, static_cast<std::uint64_t>(end_ - current_));
    current_ += step;
    bytes -= step;
    if (current_ == end_) refill();
  }
  return bytes == 0;
}

/// A big-endian number; one that no file can hold where the file ends in the middle of it.
std::uint64_t ByteSource::size_of_value(int bytes) {
  std::uint64_t value = 0;
  for (; bytes > 0 && !at_end(); --bytes, advance()) value = value << 8U | static_cast<unsigned char>(peek());
  return bytes == 0 ? value : std::uint64_t{1} << 62U;
}

void ByteSource::put_nil() {
  constexpr char kNil = '\xC0';
  --current_;
  chunk_[static_cast<std::size_t>(current_ - chunk_.data())] = kNil;
}

void ByteSource::replace_value_by_nil() {
  if (skip_value()) put_nil();
}

/// Numbers stand in long rows, mostly of one length: a processor that foresees the next one's first byte does not wait
/// for it.
std::uint64_t ByteSource::skip_row(std::uint64_t most) {
  const char first = peek();
  const std::ptrdiff_t bytes = kLengths[static_cast<unsigned char>(first)];
  if (bytes == 0) return 0;
  std::uint64_t skipped = 0;
  while (skipped < most && end_ - current_ > bytes && *current_ == first) {
    current_ += bytes;
    ++skipped;
  }
  return skipped;
}

bool ByteSource::skip_value() {
  std::uint64_t values = 1;  // that are left; arrays and maps add theirs
  while (values > 0) {
    if (at_end()) return false;
    token_seen();
    if (const std::uint64_t skipped = skip_row(values); skipped > 0) {
      values -= skipped;
      continue;
    }
    const auto first = static_cast<unsigned char>(peek());
    constexpr unsigned char kNever = 0xC1;
    if (first == kNever) return false;
    advance();
    --values;
    const auto wide = [first](unsigned char base) { return 1 << (first - base); };
    std::uint64_t bytes = 0;
    if (kLengths[first] > 0) {  // at the end of a chunk
      bytes = kLengths[first] - 1U;
    } else if (first >= 0x80 && first < 0x90) {
      values += 2 * (first & 0x0FU);
    } else if (first >= 0x90 && first < 0xA0) {
      values += first & 0x0FU;
    } else if (first >= 0xC4 && first <= 0xC6) {  // binary
      bytes = size_of_value(wide(0xC4));
    } else if (first >= 0xC7 && first <= 0xC9) {  // other types, with a byte for which
      bytes = 1 + size_of_value(wide(0xC7));
    } else if (first >= 0xD9 && first <= 0xDB) {  // strings
      bytes = size_of_value(wide(0xD9));
    } else if (first >= 0xDC && first <= 0xDD) {
      values += size_of_value(2 * wide(0xDC));
    } else if (first >= 0xDE && first <= 0xDF) {
      values += 2 * size_of_value(2 * wide(0xDE));
    }
    if (bytes < static_cast<std::uint64_t>(end_ - current_)) {
      current_ += bytes;
    } else if (!skip(bytes)) {
      return false;
    }
  }
  return true;
}

}  // namespace pmsp::map_detail
