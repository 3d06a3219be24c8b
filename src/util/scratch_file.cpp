// SPDX-License-Identifier: BSD-2-Clause
#include "util/scratch_file.h"

#include <fcntl.h>
#include <unistd.h>
#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "pmsp/error.h"

namespace pmsp {
namespace {

/// Returns -1 on failure.
int open_nameless(const std::string& folder) {
#ifdef O_TMPFILE
  const int file = ::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  if (file >= 0 || errno == ENOENT || errno == EACCES || errno == ENOTDIR) return file;
#endif
  std::string name = folder + "/.pmsp-XXXXXX";  // for file systems without O_TMPFILE
  const int named = ::mkostemp(name.data(), O_CLOEXEC);
  if (named >= 0) ::unlink(name.c_str());
  return named;
}

/// Calls `step(data, bytes, at)`, pread or pwrite, until all bytes are transferred. Returns "" or the reason of a
/// failure: `short_of` if a step makes no progress.
template <class Byte, class Step>
std::string transfer(Byte* data, std::size_t bytes, std::uint64_t at, const char* short_of, const Step& step) {
  while (bytes > 0) {
    const ssize_t done = step(data, bytes, static_cast<off_t>(at));
    if (done < 0 && errno == EINTR) continue;
    if (done <= 0) return done < 0 ? std::strerror(errno) : short_of;
    data += done;
    at += static_cast<std::uint64_t>(done);
    bytes -= static_cast<std::size_t>(done);
  }
  return {};
}

}  // namespace

ScratchFile::ScratchFile(const std::string& folder) : folder_(folder), file_(open_nameless(folder)) {
  if (file_ >= 0) return;
  throw OutputError(folder + ": no scratch file can be made there (" + std::strerror(errno) +
                    "); give an existing, writable directory");
}

ScratchFile::~ScratchFile() { ::close(file_); }

std::uint64_t ScratchFile::take(std::size_t bytes) {
  std::vector<std::uint64_t>& free = free_[bytes];
  if (!free.empty()) {
    const std::uint64_t begin = free.back();
    free.pop_back();
    return begin;
  }
  const std::uint64_t begin = end_;
  end_ += bytes;
  return begin;
}

void ScratchFile::write(std::uint64_t at, const void* data, std::size_t bytes) {
  const std::string why =
      transfer(static_cast<const char*>(data), bytes, at, "no room",
               [&](const char* from, std::size_t size, off_t place) { return ::pwrite(file_, from, size, place); });
  if (why.empty()) return;
  throw OutputError(folder_ + ": scratch data cannot be written there (" + why +
                    "); free some space or give another directory");
}

void ScratchFile::read(std::uint64_t at, void* data, std::size_t bytes) const {
  const std::string why =
      transfer(static_cast<char*>(data), bytes, at, "the file is too short",
               [&](char* to, std::size_t size, off_t place) { return ::pread(file_, to, size, place); });
  if (!why.empty()) throw IoError(folder_ + ": scratch data cannot be read back (" + why + ")");
}

}  // namespace pmsp
