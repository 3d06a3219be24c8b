// SPDX-License-Identifier: BSD-2-Clause
#include "export/folder_lock.h"

#include <thread>

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>
#include <cerrno>
#include <cstring>

#include "pmsp/error.h"

namespace pmsp {
namespace {

int try_lock(int file, int kind) { return ::flock(file, kind | LOCK_NB) == 0 ? 0 : errno; }

}  // namespace

FolderLock::FolderLock(const std::filesystem::path& folder, const std::string& what, std::chrono::milliseconds patience,
                       For whom, Need need) {
  const int kind = whom == For::kOne ? LOCK_EX : LOCK_SH;
  const std::filesystem::path path = folder / kName;
  file_ = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  const auto end = std::chrono::steady_clock::now() + patience;
  int code = file_ >= 0 ? try_lock(file_, kind) : errno;
  while (code == EWOULDBLOCK && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    code = try_lock(file_, kind);
  }
  if (code == 0) return;
  const bool has_no_locks = code == ENOLCK || code == ENOSYS || code == EOPNOTSUPP || code == EINVAL;
  if (file_ >= 0 && has_no_locks && need == Need::kWhereItWorks) return;
  if (file_ >= 0) ::close(file_);
  if (code == EWOULDBLOCK) {
    throw OutputError(folder.string() + ": another process works in this " + what +
                      "; wait until it has ended, or give another directory");
  }
  throw OutputError(path.string() + ": the " + what + " cannot be locked (" + std::strerror(code) +
                    "); give a writable directory on a file system with locks");
}

FolderLock::~FolderLock() { ::close(file_); }

}  // namespace pmsp
