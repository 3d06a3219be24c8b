// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <system_error>

#include "pmsp/error.h"

namespace pmsp {

/// Throws IoError unless `path` is an ordinary file. To be asked before it is opened: opening a pipe may wait for ever.
inline void require_regular_file(const std::filesystem::path& path) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (std::filesystem::is_regular_file(status)) return;
  std::string what = "it is no ordinary file; expected one";
  if (status.type() == std::filesystem::file_type::not_found) {
    what = "there is no such file";
  } else if (error) {
    what = error.message();
  } else if (std::filesystem::is_directory(status)) {
    what = "it is a folder; give a file in it";
  }
  throw IoError(path.string() + ": cannot be read: " + what);
}

/// All bytes of an ordinary file. Throws IoError.
inline std::string read_whole_file(const std::filesystem::path& path) {
  require_regular_file(path);
  std::ifstream file(path, std::ios::binary);
  if (!file) throw IoError(path.string() + ": cannot be opened for reading");
  std::string bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  if (file.bad()) throw IoError(path.string() + ": cannot be read");
  return bytes;
}

}  // namespace pmsp
