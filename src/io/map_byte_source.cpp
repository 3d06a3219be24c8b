// SPDX-License-Identifier: BSD-2-Clause
#include "map_byte_source.h"

#include <cerrno>
#include <cstring>
#include <string>

#include "pmsp/error.h"

namespace pmsp::map_detail {
namespace {

constexpr std::size_t kChunkBytes = std::size_t{1} << 20;

}  // namespace

ByteSource::ByteSource(const std::filesystem::path& path) : path_(path), chunk_(kChunkBytes) {
  file_.rdbuf()->pubsetbuf(nullptr, 0);  // chunks are large: a second buffer would only copy them
  file_.open(path, std::ios::binary);
  if (!file_) throw IoError(path.string() + ": cannot be opened: " + std::strerror(errno));
  current_ = end_ = chunk_.data();
  refill();
}

void ByteSource::refill() {
  chunk_offset_ = offset();
  const bool full = end_ == chunk_.data() + chunk_.size();  // the last chunk may well be the end of a token
  if (full && !token_seen_) {
    throw InvalidInput(path_.string() + ": byte " + std::to_string(chunk_offset_) +
                       ": a string or binary block of more than a mebibyte, expected no such thing in a map");
  }
  token_seen_ = false;
  file_.read(chunk_.data(), static_cast<std::streamsize>(chunk_.size()));
  if (file_.bad()) {
    throw IoError(path_.string() + ": cannot be read beyond byte " + std::to_string(chunk_offset_) + ": " +
                  std::strerror(errno));
  }
  current_ = chunk_.data();
  end_ = current_ + file_.gcount();
}

}  // namespace pmsp::map_detail
