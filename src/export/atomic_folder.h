// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "export/folder_lock.h"
#include "pmsp/api.h"

namespace pmsp {

/// Folder whose files appear under its name at `commit`, all or none. Until then they are in `path()`: "NAME.part", or
/// NAME/.part if a folder NAME exists. The destructor deletes uncommitted files; remains of a killed process are
/// deleted by the next AtomicFolder of that name.
class PMSP_API AtomicFolder {
 public:
  /// Whether an entry of that name belongs to this format's output.
  using IsOwn = bool (*)(const std::string& name);

  /// Throws OutputError if the folder cannot be created, another process writes it, or NAME.part was not created by an
  /// AtomicFolder. `part`: suffix of the temporary name; different for writers that may share a folder.
  AtomicFolder(const std::filesystem::path& target, IsOwn is_own, const std::string& part = ".part");
  ~AtomicFolder();
  AtomicFolder(const AtomicFolder&) = delete;
  AtomicFolder& operator=(const AtomicFolder&) = delete;

  const std::filesystem::path& path() const { return part_; }
  std::filesystem::path operator/(const std::string& name) const { return part_ / name; }
  /// Final name of the folder.
  const std::filesystem::path& target() const { return target_; }

  /// Moves the folder to its final name. In an existing folder own entries are replaced, own entries of previous runs
  /// are deleted, folders of the same name are merged; all others stay. A process killed meanwhile leaves a folder that
  /// is `is_free`. Throws OutputError.
  void commit();

  /// True if nothing exists under that name except remains of a killed process.
  static bool is_free(const std::filesystem::path& target);

 private:
  void require_leftover(const std::filesystem::path& folder) const;
  void replace() const;

  std::filesystem::path target_;
  IsOwn is_own_;
  std::filesystem::path part_;
  bool in_target_;
  bool is_placing_ = false;
  std::optional<FolderLock> lock_;
};

}  // namespace pmsp
