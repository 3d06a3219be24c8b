// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pmsp/api.h"

namespace pmsp::web {

/// Returns the decoded segments of the path of a request target ("/a/b%20c?query"); the last one is empty if the path
/// ends with a slash. nullopt if it is no path, or has empty segments, names with a leading dot, encoded slashes or
/// backslashes, or control characters.
PMSP_API std::optional<std::vector<std::string>> path_segments(std::string_view target);

/// Returns the text after "?"; "" if there is none.
PMSP_API std::string_view query_of(std::string_view target);

/// Returns the integer after "name=" in a query; nullopt if there is none.
PMSP_API std::optional<std::uint64_t> number_in_query(std::string_view query, std::string_view name);

/// Part of a file [bytes].
struct ByteRange {
  std::uint64_t first = 0, count = 0;
};

/// Returns the range of a Range header for a file of `size` bytes; nullopt = the complete file, as HTTP requires for
/// empty or unknown headers and for several ranges. A count of 0: outside the file.
PMSP_API std::optional<ByteRange> range_from(std::string_view header, std::uint64_t size);

/// Encodes a relative path with '/' separators as a relative URL; inverse of path_segments.
PMSP_API std::string relative_address(const std::string& path);

/// Escapes text for HTML elements and double-quoted attributes.
PMSP_API std::string html_text(const std::string& text);

}  // namespace pmsp::web
