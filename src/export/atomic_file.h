// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "pmsp/error.h"

namespace pmsp {

/// A file that appears under its name when `commit` is called, complete, or not at all. Where the file system can do
/// it, the file has no name before, so that even a killed process leaves nothing behind; elsewhere it lies beside the
/// target as ".NAME.PID-N.tmp" and is removed by the destructor.
class AtomicFile {
 public:
  explicit AtomicFile(const std::filesystem::path& target) : target_(target) {
    namespace fs = std::filesystem;
    std::error_code ignored;
    const fs::file_status status = fs::status(target_, ignored);
    if (target_.filename().empty() || fs::is_directory(status)) {
      throw OutputError(target_.string() + ": cannot be written, it names a folder; give a file name");
    }
    if (fs::exists(status) && !fs::is_regular_file(status)) {
      throw OutputError(target_.string() + ": cannot be written, it exists and is no ordinary file");
    }
    folder_ = target_.has_parent_path() ? target_.parent_path() : fs::path(".");
    buffer_.reserve(kBufferBytes);
    open_temporary();
  }

  ~AtomicFile() { discard(); }
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  void write(const void* data, std::size_t bytes) {
    const char* first = static_cast<const char*>(data);
    if (buffer_.size() + bytes > kBufferBytes) flush();
    if (bytes >= kBufferBytes) {
      write_through(first, bytes);
    } else {
      buffer_.insert(buffer_.end(), first, first + bytes);
    }
  }
  void write(const std::string& text) { write(text.data(), text.size()); }

  /// Overwrites bytes that were written before.
  void patch(std::int64_t offset, const std::string& text) {
    flush();
    if (::pwrite(fd_, text.data(), text.size(), static_cast<off_t>(offset)) != static_cast<ssize_t>(text.size())) {
      fail("write");
    }
  }

  /// Puts the file in its place. The content has reached the disk before the name changes.
  void commit() {
    flush();
    if (::fsync(fd_) != 0 && errno != EINVAL) fail("write");
    if (temporary_.empty()) link_unnamed();
    if (::rename(temporary_.c_str(), target_.c_str()) != 0) fail("rename");
    temporary_.clear();
    const int closed = ::close(fd_);
    fd_ = -1;
    if (closed != 0) fail("close");
    const int folder = ::open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder >= 0) {
      ::fsync(folder);
      ::close(folder);
    }
  }

 private:
  static constexpr std::size_t kBufferBytes = std::size_t{1} << 20;

  [[noreturn]] void fail(const char* what) {
    const int code = errno;
    discard();
    std::string message = target_.string() + ": cannot " + what + ": " + std::strerror(code);
    if (code == ENOENT) message += "; does the folder exist?";
    throw OutputError(message);
  }

  void discard() noexcept {
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
    if (!temporary_.empty()) ::unlink(temporary_.c_str());
    temporary_.clear();
  }

  std::filesystem::path temporary_name() const {
    static std::atomic<unsigned> counter{0};
    return folder_ / ("." + target_.filename().string() + "." + std::to_string(::getpid()) + "-" +
                      std::to_string(counter++) + ".tmp");
  }

  std::string descriptor_path() const { return "/proc/self/fd/" + std::to_string(fd_); }

  void open_temporary() {
#ifdef O_TMPFILE
    fd_ = ::open(folder_.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0666);
    if (fd_ >= 0) {
      if (::access(descriptor_path().c_str(), F_OK) == 0) return;
      ::close(fd_);  // without /proc it could not be given a name
      fd_ = -1;
    }
#endif
    const std::filesystem::path name = temporary_name();
    fd_ = ::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd_ < 0) fail("create");
    temporary_ = name;
  }

  void link_unnamed() {
    const std::filesystem::path name = temporary_name();
    if (::linkat(AT_FDCWD, descriptor_path().c_str(), AT_FDCWD, name.c_str(), AT_SYMLINK_FOLLOW) != 0) fail("create");
    temporary_ = name;
  }

  void flush() {
    write_through(buffer_.data(), buffer_.size());
    buffer_.clear();
  }

  void write_through(const char* data, std::size_t bytes) {
    while (bytes > 0) {
      const ssize_t written = ::write(fd_, data, bytes);
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) fail("write");
      data += written;
      bytes -= static_cast<std::size_t>(written);
    }
  }

  std::filesystem::path target_;
  std::filesystem::path folder_;
  std::filesystem::path temporary_;
  int fd_ = -1;
  std::vector<char> buffer_;
};

}  // namespace pmsp
