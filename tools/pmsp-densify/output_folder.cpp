// SPDX-License-Identifier: BSD-2-Clause
#include "output_folder.h"

#include <algorithm>
#include <cstdio>
#include <system_error>
#include <vector>

#include "pmsp/error.h"
#include "pmsp/io/files.h"

namespace pmsp::tool {

namespace fs = std::filesystem;

std::string numbered_name(const char* prefix, std::int64_t id, const char* extension) {
  char number[32];
  std::snprintf(number, sizeof(number), "%06lld", static_cast<long long>(id));
  return std::string(prefix) + number + extension;
}

bool is_numbered_name(const std::string& name, const std::string& prefix, const std::string& extension) {
  if (name.size() < prefix.size() + 6 + extension.size()) return false;
  const auto digits_end = name.end() - static_cast<std::ptrdiff_t>(extension.size());
  return name.compare(0, prefix.size(), prefix) == 0 && std::equal(extension.begin(), extension.end(), digits_end) &&
         std::all_of(name.begin() + static_cast<std::ptrdiff_t>(prefix.size()), digits_end,
                     [](char c) { return c >= '0' && c <= '9'; });
}

void prepare_folder(const fs::path& folder, bool (*is_own)(const std::string& name)) {
  make_folder(folder);
  std::error_code error;
  std::vector<fs::path> old;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    std::error_code ignored;
    if (is_own(it->path().filename().string()) && it->is_regular_file(ignored)) old.push_back(it->path());
  }
  if (error) throw OutputError(folder.string() + ": the folder cannot be listed: " + error.message());
  for (const fs::path& file : old) {
    if (!fs::remove(file, error) && error) {
      throw OutputError(file.string() + ": this file of an earlier run cannot be removed: " + error.message());
    }
  }
}

}  // namespace pmsp::tool
