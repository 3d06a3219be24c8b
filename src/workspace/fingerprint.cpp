// SPDX-License-Identifier: BSD-2-Clause
#include "workspace/fingerprint.h"

#include <cstdio>
#include <fstream>
#include <vector>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "export/files.h"
#include "pmsp/error.h"

namespace pmsp::workspace {

struct Fingerprint::State {
  XXH3_state_t hash;
};

Fingerprint::Fingerprint() : state_(std::make_unique<State>()) { XXH3_128bits_reset(&state_->hash); }
Fingerprint::~Fingerprint() = default;

Fingerprint& Fingerprint::add(const void* data, std::size_t bytes) {
  XXH3_128bits_update(&state_->hash, data, bytes);
  return *this;
}

Fingerprint& Fingerprint::add(const std::string& text) { return add(text.size()).add(text.data(), text.size()); }

std::string Fingerprint::text() const {
  const XXH128_hash_t hash = XXH3_128bits_digest(&state_->hash);
  char text[33];
  std::snprintf(text, sizeof(text), "%016llx%016llx", static_cast<unsigned long long>(hash.high64),
                static_cast<unsigned long long>(hash.low64));
  return text;
}

std::string fingerprint_of_file(const std::filesystem::path& path) {
  require_regular_file(path);
  std::ifstream file(path, std::ios::binary);
  if (!file) throw IoError(path.string() + ": cannot be opened for reading");
  Fingerprint fingerprint;
  std::vector<char> block(std::size_t{1} << 20);
  while (file) {
    file.read(block.data(), static_cast<std::streamsize>(block.size()));
    fingerprint.add(block.data(), static_cast<std::size_t>(file.gcount()));
  }
  if (file.bad()) throw IoError(path.string() + ": cannot be read");
  return fingerprint.text();
}

}  // namespace pmsp::workspace
