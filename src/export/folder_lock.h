// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>
#include <filesystem>
#include <string>

#include "pmsp/api.h"

namespace pmsp {

/// While it lives, no other process gets the lock of this folder: its file "lock", which stays. The lock ends with the
/// process, however that ends.
class PMSP_API FolderLock {
 public:
  enum class For { kOne, kMany };              ///< kMany: others that say so, too, get it as well
  enum class Need { kAlways, kWhereItWorks };  ///< kWhereItWorks: a file system without locks is no error

  /// `what` the folder is, for the message. Tries again for as long as `patience`. Throws OutputError.
  FolderLock(const std::filesystem::path& folder, const std::string& what, std::chrono::milliseconds patience = {},
             For whom = For::kOne, Need need = Need::kAlways);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

  static constexpr const char* kName = "lock";

 private:
  int file_ = -1;
};

}  // namespace pmsp
