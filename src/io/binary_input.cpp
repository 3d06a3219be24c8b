// SPDX-License-Identifier: BSD-2-Clause
#include "binary_input.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>

#include "export/files.h"
#include "pmsp/error.h"
#include "util/text.h"
#include "zip_member.h"

namespace pmsp {

void fail(const std::filesystem::path& path, const std::string& where, const std::string& what) {
  throw InvalidInput(path.string() + ": " + (where.empty() ? "" : where + ": ") + what);
}

std::string in_quotes(const std::string& text) {
  constexpr std::size_t kLongest = 60;
  std::string result = "\"";
  for (std::size_t i = 0; i < text.size() && i < kLongest; ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    const bool control = byte < 0x20U || byte == 0x7FU;
    result += control ? '?' : text[i];
  }
  return result + (text.size() > kLongest ? "...\"" : "\"");
}

std::string to_message(double value) { return number_text(value, "%.10g"); }

BinaryInput::BinaryInput(const std::filesystem::path& path) : path_(path) {
  constexpr std::uint64_t kBufferBytes = std::uint64_t{1} << 20;
  if (!io::archive_of(path).empty()) {
    buffer_ = io::read_zip_member(path);
    size_ = read_ = end_ = buffer_.size();
    return;
  }
  require_regular_file(path);
  file_.rdbuf()->pubsetbuf(nullptr, 0);  // a second buffer would only copy
  file_.open(path, std::ios::binary);
  if (!file_) throw IoError(path.string() + ": cannot be opened for reading: " + std::strerror(errno));
  std::error_code error;
  size_ = std::filesystem::file_size(path, error);
  if (error) throw IoError(path.string() + ": cannot be read: " + error.message());
  buffer_.resize(static_cast<std::size_t>(std::min(size_, kBufferBytes)));
}

BinaryInput::BinaryInput(const std::filesystem::path& path, std::string bytes)
    : path_(path), size_(bytes.size()), read_(bytes.size()), buffer_(std::move(bytes)), end_(buffer_.size()) {}

void BinaryInput::require(std::uint64_t bytes) const {
  if (bytes <= remaining()) return;
  pmsp::fail(path_, "byte " + std::to_string(size_),
             "the file ends in the middle of the data: it is truncated; copy it again");
}

void BinaryInput::seek(std::uint64_t position) {
  const std::uint64_t begin = read_ - end_;
  if (position >= begin && position <= read_) {
    at_ = static_cast<std::size_t>(position - begin);
    return;
  }
  file_.clear();
  file_.seekg(static_cast<std::streamoff>(position));
  read_ = position;
  at_ = end_ = 0;
}

bool BinaryInput::refill() {
  if (read_ >= size_) return false;
  end_ -= at_;
  std::memmove(buffer_.data(), buffer_.data() + at_, end_);
  at_ = 0;
  file_.read(buffer_.data() + end_,
             static_cast<std::streamsize>(std::min<std::uint64_t>(buffer_.size() - end_, size_ - read_)));
  const auto got = static_cast<std::size_t>(file_.gcount());
  if (got == 0) throw IoError(path_.string() + ": cannot be read beyond byte " + std::to_string(read_));
  end_ += got;
  read_ += got;
  return true;
}

void BinaryInput::fill(std::size_t bytes) {
  require(bytes);
  if (buffer_.size() < bytes) buffer_.resize(bytes);
  while (end_ - at_ < bytes) refill();
}

bool BinaryInput::take_if(std::string_view bytes) {
  if (bytes.size() > remaining()) return false;
  const bool are_these = std::string_view(take(bytes.size()), bytes.size()) == bytes;
  if (!are_these) at_ -= bytes.size();
  return are_these;
}

std::uint64_t BinaryInput::count(const char* what, std::uint64_t bytes) {
  const auto value = number<std::uint64_t>();
  if (value > remaining() / bytes) {
    refuse("announces " + std::to_string(value) + " " + what + ", but only " + std::to_string(remaining()) +
           " bytes follow: it is truncated or damaged; copy it again");
  }
  return value;
}

std::string BinaryInput::text(std::size_t most) {
  std::string result;
  for (auto c = number<char>(); c != '\0'; c = number<char>()) {
    result += c;
    if (result.size() > most) refuse("a name of more than " + std::to_string(most) + " characters");
  }
  return result;
}

std::string BinaryInput::word(std::size_t most) {
  const auto is_blank = [](int c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; };
  int c = get();
  while (is_blank(c)) c = get();
  std::string result;
  for (; c >= 0 && !is_blank(c) && result.size() < most; c = get()) result += static_cast<char>(c);
  return result;
}

bool BinaryInput::line(std::string& line, std::size_t most) {
  line.clear();
  if (peek() < 0) return false;
  do {
    const std::string_view rest(buffer_.data() + at_, end_ - at_);
    const std::size_t end = rest.find('\n');
    line += rest.substr(0, end);
    if (line.size() > most) refuse("a line that is longer than " + std::to_string(most) + " characters");
    at_ += std::min(end, rest.size());
    if (end == std::string_view::npos) continue;
    ++at_;
    return true;
  } while (refill());
  return true;
}

void BinaryInput::expect_end() const {
  if (remaining() > 0) refuse("more data after the end, expected none");
}

}  // namespace pmsp
