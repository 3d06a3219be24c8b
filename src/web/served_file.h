// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "pmsp/api.h"
#include "web/web_path.h"

namespace pmsp::web {

/// A descriptor that is closed with its owner.
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

/// An ordinary file that is being served.
struct ServedFile {
  OwnedDescriptor descriptor;  ///< closed = there is no such file
  std::uint64_t size = 0;
};

/// A folder whose files are served, and nothing else: no link is followed, wherever it leads to, no name with a dot at
/// its beginning is opened, nor anything but ordinary files.
class PMSP_API ServedFolder {
 public:
  /// Throws IoError where it cannot be opened.
  explicit ServedFolder(const std::filesystem::path& folder);

  /// `path`: names of folders, then that of a file, as path_segments gives them.
  ServedFile open(const std::vector<std::string>& path) const;

 private:
  OwnedDescriptor folder_;
};

/// What the name of a file says about its contents, for Content-Type.
PMSP_API std::string media_type(const std::string& name);

}  // namespace pmsp::web
