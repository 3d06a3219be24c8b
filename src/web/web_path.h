// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pmsp/api.h"

namespace pmsp::web {

/// The path of a request's target ("/a/b%20c?query"), segment by segment and decoded; the last one is empty where the
/// path ends with a slash. nullopt where it is none, or holds what no file that is served has: empty segments, names
/// that begin with a dot, slashes or backslashes that were encoded, control characters.
PMSP_API std::optional<std::vector<std::string>> path_segments(std::string_view target);

/// The text behind "?", "" without one.
PMSP_API std::string_view query_of(std::string_view target);

/// The whole number that "name=" gives in a query; nullopt = none.
PMSP_API std::optional<std::uint64_t> number_in_query(std::string_view query, std::string_view name);

/// A part of a file, in bytes.
struct ByteRange {
  std::uint64_t first = 0, count = 0;
};

/// What a Range header asks for of a file of `size` bytes. nullopt: the whole file, which is what HTTP asks for where
/// the header is empty, not understood, or names several ranges. A count of 0: nothing that the file has.
PMSP_API std::optional<ByteRange> range_from(std::string_view header, std::uint64_t size);

/// The other way: a relative path, its folders with '/' between them, as an address; path_segments gives its names
/// again.
PMSP_API std::string relative_address(const std::string& path);

/// Text as HTML shows it, in elements and in attributes with double quotes.
PMSP_API std::string html_text(const std::string& text);

}  // namespace pmsp::web
