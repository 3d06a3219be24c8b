// SPDX-License-Identifier: BSD-2-Clause
#include "workspace/fingerprint.h"

#include <algorithm>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "io/binary_input.h"
#include "util/text.h"

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
  return format("%016llx%016llx", static_cast<unsigned long long>(hash.high64),
                static_cast<unsigned long long>(hash.low64));
}

std::string fingerprint_of_file(const std::filesystem::path& path) {
  constexpr std::uint64_t kBlockBytes = std::uint64_t{1} << 20;
  BinaryInput in(path);
  Fingerprint fingerprint;
  while (in.remaining() > 0) {
    const auto bytes = static_cast<std::size_t>(std::min(in.remaining(), kBlockBytes));
    fingerprint.add(in.take(bytes), bytes);
  }
  return fingerprint.text();
}

}  // namespace pmsp::workspace
