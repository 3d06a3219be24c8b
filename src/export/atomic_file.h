// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <system_error>
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
/// target as ".NAME.PID-N.tmp" and is removed by the destructor; one that a killed process leaves does no harm.
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
      append(first, bytes);
    } else {
      buffer_.insert(buffer_.end(), first, first + bytes);
    }
  }
  void write(const std::string& text) { write(text.data(), text.size()); }

  /// Overwrites bytes that were written before.
  void patch(std::int64_t offset, const std::string& text) {
    flush();
    put(offset, text.data(), text.size());
  }

  /// Writes bytes at a place of the file, and lets the system bring them to the disk at once, so that `commit` has less
  /// to wait for. Several threads may do so at a time; not to be mixed with `write`.
  void write_at(std::int64_t offset, const char* data, std::size_t bytes) {
    put(offset, data, bytes);
#ifdef SYNC_FILE_RANGE_WRITE
    const std::int64_t size = static_cast<std::int64_t>(bytes);
    ::sync_file_range(fd_, offset, size, SYNC_FILE_RANGE_WRITE);  // where it cannot, commit does it all
#endif
  }

  /// Puts the file in its place. The content has reached the disk before the name changes.
  void commit() {
    make_ready();
    if (::rename(temporary_.c_str(), target_.c_str()) != 0) fail("rename");
    temporary_.clear();
    finish();
  }

  /// The same where there is no file of that name, and no other process is faster; else leaves that one as it is and
  /// returns false.
  bool commit_unless_there() {
    make_ready();
    if (::link(temporary_.c_str(), target_.c_str()) == 0) {
      ::unlink(temporary_.c_str());
      temporary_.clear();
      finish();
      return true;
    }
    std::error_code ignored;
    const bool is_there = errno == EEXIST || std::filesystem::exists(target_, ignored);
    if (is_there) {
      discard();
    } else {  // a file system without hard links: in two steps then
      commit();
    }
    return !is_there;
  }

 private:
  static constexpr std::size_t kBufferBytes = std::size_t{1} << 20;

  std::string failure(const std::string& what) const {
    const int code = errno;
    std::string message = target_.string() + ": cannot " + what + ": " + std::strerror(code);
    if (code == ENOENT) message += "; does the folder exist?";
    if (code == EEXIST) message += "; runs that were killed left such files, remove them";
    return message;
  }

  [[noreturn]] void fail(const std::string& what) {
    const std::string message = failure(what);
    discard();
    throw OutputError(message);
  }

  /// All is on the disk, and has a name.
  void make_ready() {
    flush();
    if (::fsync(fd_) != 0 && errno != EINVAL) fail("write");
    if (temporary_.empty()) link_unnamed();
  }

  void finish() {
    const int closed = ::close(fd_);
    fd_ = -1;
    if (closed != 0) fail("close");
    const int folder = ::open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder >= 0) {
      ::fsync(folder);
      ::close(folder);
    }
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

  /// Calls `make` with one name after the other until it has made a file of that name. In containers PIDs repeat, so
  /// names may be taken by what killed processes left.
  template <class Make>
  void make_temporary(const Make& make) {
    constexpr int kTries = 1000;
    for (int left = kTries;; --left) {
      const std::filesystem::path name = temporary_name();
      if (make(name.c_str())) {
        temporary_ = name;
        return;
      }
      if (errno != EEXIST || left == 0) fail("create the temporary file " + name.string());
    }
  }

  void open_temporary() {
#ifdef O_TMPFILE
    fd_ = ::open(folder_.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0666);
    if (fd_ >= 0) {
      if (::access(descriptor_path().c_str(), F_OK) == 0) return;
      ::close(fd_);  // without /proc it could not be given a name
      fd_ = -1;
    }
#endif
    make_temporary([this](const char* name) {
      fd_ = ::open(name, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
      return fd_ >= 0;
    });
  }

  void link_unnamed() {
    make_temporary([this](const char* name) {
      return ::linkat(AT_FDCWD, descriptor_path().c_str(), AT_FDCWD, name, AT_SYMLINK_FOLLOW) == 0;
    });
  }

  void flush() {
    append(buffer_.data(), buffer_.size());
    buffer_.clear();
  }

  void append(const char* data, std::size_t bytes) {
    put(end_, data, bytes);
    end_ += static_cast<std::int64_t>(bytes);
  }

  void put(std::int64_t offset, const char* data, std::size_t bytes) const {
    while (bytes > 0) {
      const ssize_t written = ::pwrite(fd_, data, bytes, static_cast<off_t>(offset));
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) throw OutputError(failure("write"));
      data += written;
      offset += written;
      bytes -= static_cast<std::size_t>(written);
    }
  }

  std::filesystem::path target_;
  std::filesystem::path folder_;
  std::filesystem::path temporary_;
  int fd_ = -1;
  std::int64_t end_ = 0;  ///< of what `write` has brought to the file
  std::vector<char> buffer_;
};

/// Writes a whole file or nothing; `bytes` is a string or a vector of bytes. Throws OutputError.
template <class Bytes>
void write_file(const std::filesystem::path& path, const Bytes& bytes) {
  AtomicFile file(path);
  file.write(bytes.data(), bytes.size());
  file.commit();
}

/// The same unless there is such a file; returns whether it was written.
template <class Bytes>
bool write_new_file(const std::filesystem::path& path, const Bytes& bytes) {
  AtomicFile file(path);
  file.write(bytes.data(), bytes.size());
  return file.commit_unless_there();
}

/// Makes a folder and its parents, which may exist. Throws OutputError.
inline void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error || !std::filesystem::is_directory(folder, error)) {
    throw OutputError(folder.string() + ": the folder cannot be made" + (error ? ": " + error.message() : ""));
  }
}

}  // namespace pmsp
