// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "pmsp/api.h"
#include "web/web_path.h"

namespace pmsp::web {

/// File descriptor, closed with its owner.
class PMSP_API OwnedDescriptor {
 public:
  OwnedDescriptor() = default;
  explicit OwnedDescriptor(int number) : number_(number) {}
  OwnedDescriptor(OwnedDescriptor&& other) noexcept : number_(other.release()) {}
  OwnedDescriptor& operator=(OwnedDescriptor&& other) noexcept;
  ~OwnedDescriptor();

  bool is_open() const { return number_ >= 0; }
  int get() const { return number_; }
  int release();

 private:
  int number_ = -1;
};

/// Regular file, open for reading.
struct ServedFile {
  OwnedDescriptor descriptor;  ///< not open = no such file
  std::uint64_t size = 0;
};

/// Directory whose regular files are served. Symbolic links are not followed, names with a leading dot not opened.
class PMSP_API ServedFolder {
 public:
  /// Throws IoError if it cannot be opened.
  explicit ServedFolder(const std::filesystem::path& folder);

  /// `path`: names of directories, then of a file, as of path_segments.
  ServedFile open(const std::vector<std::string>& path) const;

 private:
  OwnedDescriptor folder_;
};

/// Returns the Content-Type for the extension of a file name.
PMSP_API std::string media_type(const std::string& name);

}  // namespace pmsp::web
