// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "export/folder_lock.h"
#include "pmsp/api.h"

namespace pmsp {

/// A folder whose files appear under its name when `commit` is called, all of them, or not at all. Until then they lie
/// in `path()`: "NAME.part" where there is no folder NAME, else NAME/.part. The destructor deletes what was not
/// committed. What a killed process leaves is deleted by the next AtomicFolder of that name.
class PMSP_API AtomicFolder {
 public:
  /// Whether the writer gives an entry of the folder this name.
  using IsOwn = bool (*)(const std::string& name);

  /// Throws OutputError where the folder cannot be made, another process writes it, or NAME.part is no folder that an
  /// AtomicFolder has left. `part`: ends the temporary name; writers that may share a folder need different ones.
  AtomicFolder(const std::filesystem::path& target, IsOwn is_own, const std::string& part = ".part");
  ~AtomicFolder();
  AtomicFolder(const AtomicFolder&) = delete;
  AtomicFolder& operator=(const AtomicFolder&) = delete;

  const std::filesystem::path& path() const { return part_; }
  std::filesystem::path operator/(const std::string& name) const { return part_ / name; }
  /// The folder's name in the end.
  const std::filesystem::path& target() const { return target_; }

  /// Puts the folder in its place. In one that exists, own files are replaced, those that were not written this time
  /// are deleted, files in folders of the same name are added; all others stay. A process that is killed meanwhile
  /// leaves a folder that `is_free` calls free. Throws OutputError.
  void commit();

  /// Whether nothing lies under the name but what a killed process left.
  static bool is_free(const std::filesystem::path& target);

 private:
  void take_up(const std::filesystem::path& folder) const;
  void replace() const;

  std::filesystem::path target_;
  IsOwn is_own_;
  std::filesystem::path part_;
  bool in_target_;
  bool is_placing_ = false;
  std::optional<FolderLock> lock_;
};

}  // namespace pmsp
