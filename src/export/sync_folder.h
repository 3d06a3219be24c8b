// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>

#include <fcntl.h>
#include <unistd.h>

namespace pmsp {

/// Syncs the entries of a folder ("" = current one), if the file system supports it.
inline void sync_folder(const std::filesystem::path& folder) {
  const int file = ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (file < 0) return;
  ::fsync(file);
  ::close(file);
}

}  // namespace pmsp
