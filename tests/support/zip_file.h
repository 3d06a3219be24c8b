// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <map>
#include <stdexcept>
#include <string>

#include <zip.h>

namespace pmsp_test {

/// Writes a ZIP archive of these members: names and bytes.
inline void write_zip(const std::filesystem::path& path, const std::map<std::string, std::string>& members) {
  std::filesystem::create_directories(path.parent_path());
  zip_t* const archive = zip_open(path.c_str(), ZIP_CREATE | ZIP_TRUNCATE, nullptr);
  if (archive == nullptr) throw std::runtime_error("cannot write " + path.string());
  for (const auto& [name, bytes] : members) {
    zip_file_add(archive, name.c_str(), zip_source_buffer(archive, bytes.data(), bytes.size(), 0), 0);
  }
  if (zip_close(archive) != 0) throw std::runtime_error("cannot write " + path.string());
}

}  // namespace pmsp_test
