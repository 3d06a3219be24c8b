// SPDX-License-Identifier: BSD-2-Clause
#include "export/files.h"

#include <atomic>
#include <fstream>
#include <iterator>
#include <system_error>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "export/sync_folder.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

constexpr std::size_t kBufferBytes = std::size_t{1} << 20;

}  // namespace

AtomicFile::AtomicFile(const std::filesystem::path& target) : target_(end_of_links(target)) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  const fs::file_status status = fs::status(target_, ignored);
  if (target_.filename().empty() || fs::is_directory(status)) {
    throw OutputError(target_.string() + ": cannot be written, it names a directory; give a file name");
  }
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    throw OutputError(target_.string() + ": cannot be written, it exists and is no regular file");
  }
  folder_ = target_.has_parent_path() ? target_.parent_path() : fs::path(".");
  buffer_.reserve(kBufferBytes);
  open_temporary();
}

AtomicFile::~AtomicFile() { discard(); }

void AtomicFile::write(const void* data, std::size_t bytes) {
  const char* first = static_cast<const char*>(data);
  if (buffer_.size() + bytes > kBufferBytes) flush();
  if (bytes >= kBufferBytes) {
    append(first, bytes);
  } else {
    buffer_.insert(buffer_.end(), first, first + bytes);
  }
}

void AtomicFile::patch(std::int64_t offset, const std::string& text) {
  flush();
  put(offset, text.data(), text.size());
}

void AtomicFile::write_at(std::int64_t offset, const char* data, std::size_t bytes) {
  put(offset, data, bytes);
#ifdef SYNC_FILE_RANGE_WRITE
  const std::int64_t size = static_cast<std::int64_t>(bytes);
  ::sync_file_range(fd_, offset, size, SYNC_FILE_RANGE_WRITE);  // best effort; commit syncs in any case
#endif
}

void AtomicFile::commit() {
  make_ready();
  if (::rename(temporary_.c_str(), target_.c_str()) != 0) fail("rename");
  temporary_.clear();
  finish();
}

bool AtomicFile::commit_unless_there() {
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
  } else {  // file system without hard links: in two steps
    commit();
  }
  return !is_there;
}

std::string AtomicFile::failure(const std::string& what) const {
  const int code = errno;
  std::string message = target_.string() + ": cannot " + what + ": " + std::strerror(code);
  if (code == ENOENT) message += "; does the directory exist?";
  if (code == EEXIST) message += "; remove such files of killed runs";
  return message;
}

void AtomicFile::fail(const std::string& what) {
  const std::string message = failure(what);
  discard();
  throw OutputError(message);
}

/// Syncs the file and gives it a name.
void AtomicFile::make_ready() {
  flush();
  if (::fsync(fd_) != 0 && errno != EINVAL) fail("write");
  if (temporary_.empty()) link_unnamed();
}

void AtomicFile::finish() {
  const int closed = ::close(fd_);
  fd_ = -1;
  if (closed != 0) fail("close");
  sync_folder(folder_);
}

void AtomicFile::discard() noexcept {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
  if (!temporary_.empty()) ::unlink(temporary_.c_str());
  temporary_.clear();
}

std::filesystem::path AtomicFile::temporary_name() const {
  static std::atomic<unsigned> counter{0};
  return folder_ / ("." + target_.filename().string() + "." + std::to_string(::getpid()) + "-" +
                    std::to_string(counter++) + ".tmp");
}

std::string AtomicFile::descriptor_path() const { return "/proc/self/fd/" + std::to_string(fd_); }

/// Calls `make` with different names until it succeeds. Names may be taken: PIDs repeat in containers, and killed
/// processes leave files.
template <class Make>
void AtomicFile::make_temporary(const Make& make) {
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

void AtomicFile::open_temporary() {
#ifdef O_TMPFILE
  fd_ = ::open(folder_.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0666);
  if (fd_ >= 0) {
    if (::access(descriptor_path().c_str(), F_OK) == 0) return;
    ::close(fd_);  // cannot be named without /proc
    fd_ = -1;
  }
#endif
  make_temporary([this](const char* name) {
    fd_ = ::open(name, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    return fd_ >= 0;
  });
}

void AtomicFile::link_unnamed() {
  make_temporary([this](const char* name) {
    return ::linkat(AT_FDCWD, descriptor_path().c_str(), AT_FDCWD, name, AT_SYMLINK_FOLLOW) == 0;
  });
}

void AtomicFile::flush() {
  append(buffer_.data(), buffer_.size());
  buffer_.clear();
}

void AtomicFile::append(const char* data, std::size_t bytes) {
  put(end_, data, bytes);
  end_ += static_cast<std::int64_t>(bytes);
}

void AtomicFile::put(std::int64_t offset, const char* data, std::size_t bytes) const {
  while (bytes > 0) {
    const ssize_t written = ::pwrite(fd_, data, bytes, static_cast<off_t>(offset));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) throw OutputError(failure("write"));
    data += written;
    offset += written;
    bytes -= static_cast<std::size_t>(written);
  }
}

std::filesystem::path end_of_links(std::filesystem::path path) {
  namespace fs = std::filesystem;
  constexpr int kMostLinks = 40;  // limit of the kernel
  std::error_code ignored;
  for (int i = 0; fs::is_symlink(fs::symlink_status(path, ignored)); ++i) {
    if (i == kMostLinks) throw OutputError(path.string() + ": cannot be written, it is a symbolic link to itself");
    path = path.parent_path() / fs::read_symlink(path, ignored);  // an absolute target replaces the path
  }
  return path;
}

std::string target_of_temporary(const std::string& name) {
  const std::string end = ".tmp";
  if (name.size() <= end.size() || name[0] != '.' || name.compare(name.size() - end.size(), end.size(), end) != 0) {
    return "";
  }
  const std::string inner = name.substr(1, name.size() - 1 - end.size());  // NAME.PID-N
  const std::size_t dot = inner.rfind('.');
  const std::size_t dash = inner.rfind('-');
  if (dot == std::string::npos || dash == std::string::npos || dash < dot + 2 || dash + 1 == inner.size()) return "";
  const bool has_numbers = inner.find_first_not_of("0123456789", dot + 1) == dash &&
                           inner.find_first_not_of("0123456789", dash + 1) == std::string::npos;
  return has_numbers ? inner.substr(0, dot) : "";
}

void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error || !std::filesystem::is_directory(folder, error)) {
    throw OutputError(folder.string() + ": the directory cannot be made" + (error ? ": " + error.message() : ""));
  }
}

bool is_file(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(path, ignored);
}

void require_regular_file(const std::filesystem::path& path) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (std::filesystem::is_regular_file(status)) return;
  std::string what = "it is no regular file; expected one";
  if (status.type() == std::filesystem::file_type::not_found) {
    what = "there is no such file";
  } else if (error) {
    what = error.message();
  } else if (std::filesystem::is_directory(status)) {
    what = "it is a directory; give a file in it";
  }
  throw IoError(path.string() + ": cannot be read: " + what);
}

std::string read_whole_file(const std::filesystem::path& path) {
  require_regular_file(path);
  std::ifstream file(path, std::ios::binary);
  if (!file) throw IoError(path.string() + ": cannot be opened for reading");
  std::string bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  if (file.bad()) throw IoError(path.string() + ": cannot be read");
  return bytes;
}

}  // namespace pmsp
