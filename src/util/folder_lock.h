// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>
#include <filesystem>
#include <string>
#include <thread>

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>
#include <cerrno>
#include <cstring>

#include "pmsp/error.h"

namespace pmsp {

/// While it lives, no other process gets the lock of this folder: its file "lock", which stays. The lock ends with the
/// process, however that ends.
class FolderLock {
 public:
  enum class For { kOne, kMany };              ///< kMany: others that say so, too, get it as well
  enum class Need { kAlways, kWhereItWorks };  ///< kWhereItWorks: a file system without locks is no error

  /// `what` the folder is, for the message. Tries again for as long as `patience`. Throws OutputError.
  FolderLock(const std::filesystem::path& folder, const std::string& what, std::chrono::milliseconds patience = {},
             For whom = For::kOne, Need need = Need::kAlways)
      : kind_(whom == For::kOne ? LOCK_EX : LOCK_SH) {
    const std::filesystem::path path = folder / kName;
    file_ = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    const auto end = std::chrono::steady_clock::now() + patience;
    int code = file_ >= 0 ? try_lock() : errno;
    while (code == EWOULDBLOCK && std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      code = try_lock();
    }
    if (code == 0) return;
    const bool has_no_locks = code == ENOLCK || code == ENOSYS || code == EOPNOTSUPP || code == EINVAL;
    if (file_ >= 0 && has_no_locks && need == Need::kWhereItWorks) return;
    if (file_ >= 0) ::close(file_);
    if (code == EWOULDBLOCK) {
      throw OutputError(folder.string() + ": another process works in this " + what +
                        "; wait until it has ended, or name another folder");
    }
    throw OutputError(path.string() + ": the " + what + " cannot be locked (" + std::strerror(code) +
                      "); name a folder that may be written to, on a file system with locks");
  }
  ~FolderLock() { ::close(file_); }
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

  static constexpr const char* kName = "lock";

 private:
  int try_lock() const { return ::flock(file_, kind_ | LOCK_NB) == 0 ? 0 : errno; }

  int kind_;
  int file_ = -1;
};

}  // namespace pmsp
