// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <type_traits>

#include "pmsp/api.h"

namespace pmsp::workspace {

/// 128-bit hash (XXH3 of xxHash) of the added data, in order. Not cryptographic: collisions can be made on purpose.
class PMSP_API Fingerprint {
 public:
  Fingerprint();
  ~Fingerprint();
  Fingerprint(const Fingerprint&) = delete;
  Fingerprint& operator=(const Fingerprint&) = delete;

  Fingerprint& add(const void* data, std::size_t bytes);
  Fingerprint& add(const std::string& text);  ///< with its length
  Fingerprint& add(const char* text) { return add(std::string(text)); }
  template <class Number, class = std::enable_if_t<std::is_arithmetic_v<Number>>>
  Fingerprint& add(Number number) {
    return add(&number, sizeof(number));
  }

  /// Returns 32 hexadecimal digits.
  std::string text() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Returns the fingerprint of a file's content. Throws IoError.
PMSP_API std::string fingerprint_of_file(const std::filesystem::path& path);

}  // namespace pmsp::workspace
