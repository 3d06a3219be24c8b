// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>
#include <filesystem>
#include <string>

#include "pmsp/api.h"

namespace pmsp {

/// Lock of a folder between processes, on its file "lock", which stays. Released by the destructor and at the end of
/// the process, however it ends.
class PMSP_API FolderLock {
 public:
  enum class For { kOne, kMany };              ///< exclusive, shared
  enum class Need { kAlways, kWhereItWorks };  ///< kWhereItWorks: file systems without locks are no error

  /// `what`: description of the folder, for messages. Retries for `patience`. Throws OutputError.
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
