// SPDX-License-Identifier: BSD-2-Clause
#include "web/served_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <map>
#include <utility>

#include "pmsp/error.h"

namespace pmsp::web {

OwnedDescriptor& OwnedDescriptor::operator=(OwnedDescriptor&& other) noexcept {
  std::swap(number_, other.number_);
  return *this;
}

OwnedDescriptor::~OwnedDescriptor() {
  if (is_open()) close(number_);
}

int OwnedDescriptor::release() { return std::exchange(number_, -1); }

ServedFolder::ServedFolder(const std::filesystem::path& folder)
    : folder_(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
  if (!folder_.is_open()) throw IoError(folder.string() + ": cannot be opened: " + std::strerror(errno));
}

ServedFile ServedFolder::open(const std::vector<std::string>& path) const {
  OwnedDescriptor at;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const std::string& name = path[i];
    if (name.empty() || name.front() == '.' || name.find('/') != std::string::npos) return {};
    const bool is_last = i + 1 == path.size();
    // O_NONBLOCK: opening a pipe must not wait for who writes to it.
    const int kind = is_last ? O_NONBLOCK : O_DIRECTORY;
    const int from = at.is_open() ? at.get() : folder_.get();
    OwnedDescriptor next(openat(from, name.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC | O_NOCTTY | kind));
    if (!next.is_open()) return {};
    at = std::move(next);
  }
  struct stat about = {};
  if (!at.is_open() || fstat(at.get(), &about) != 0 || !S_ISREG(about.st_mode)) return {};
  return {std::move(at), static_cast<std::uint64_t>(about.st_size)};
}

std::string media_type(const std::string& name) {
  static const std::map<std::string, std::string> kTypes{{".html", "text/html; charset=utf-8"},
                                                         {".txt", "text/plain; charset=utf-8"},
                                                         {".json", "application/json"},
                                                         {".js", "text/javascript; charset=utf-8"},
                                                         {".css", "text/css; charset=utf-8"},
                                                         {".svg", "image/svg+xml"},
                                                         {".png", "image/png"},
                                                         {".jpg", "image/jpeg"},
                                                         {".jpeg", "image/jpeg"}};
  const auto found = kTypes.find(std::filesystem::path(name).extension().string());
  return found != kTypes.end() ? found->second : "application/octet-stream";
}

}  // namespace pmsp::web
