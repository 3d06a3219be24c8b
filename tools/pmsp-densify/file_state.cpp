// SPDX-License-Identifier: BSD-2-Clause
#include "file_state.h"

#include <algorithm>
#include <system_error>
#include <vector>

namespace pmsp::tool {

namespace fs = std::filesystem;

std::string state_of(const fs::path& file) {
  std::error_code error;
  const auto time = fs::last_write_time(file, error).time_since_epoch().count();
  const bool is_there = !error;
  const auto size = is_there ? fs::file_size(file, error) : 0;  // unknown for folders
  return (is_there ? std::to_string(time) : "missing") + " " + (error ? "-" : std::to_string(size)) + "\n";
}

std::string state_of_files_in(const fs::path& folder) {
  std::error_code error;
  std::vector<std::string> files;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    files.push_back(it->path().filename().string() + " " + state_of(it->path()));
  }
  std::sort(files.begin(), files.end());
  std::string state;
  for (const std::string& file : files) state += file;
  return state;
}

std::string state_of_map(const fs::path& map) {
  std::error_code ignored;
  return fs::is_directory(map, ignored) ? state_of_files_in(map) : state_of(map);
}

}  // namespace pmsp::tool
