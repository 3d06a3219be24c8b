// SPDX-License-Identifier: BSD-2-Clause
#include "web/web_path.h"

#include <algorithm>
#include <cctype>

#include "util/number_from.h"

namespace pmsp::web {
namespace {

std::optional<int> hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return std::nullopt;
}

/// Decodes percent encoding once.
std::optional<std::string> decoded(std::string_view text) {
  std::string plain;
  for (std::size_t i = 0; i < text.size(); ++i) {
    char c = text[i];
    if (c == '%') {
      if (i + 2 >= text.size()) return std::nullopt;
      const std::optional<int> high = hex_digit(text[i + 1]), low = hex_digit(text[i + 2]);
      if (!high || !low) return std::nullopt;
      c = static_cast<char>(static_cast<unsigned char>(16 * *high + *low));
      i += 2;
    }
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte == 0x7f || c == '/' || c == '\\') return std::nullopt;
    plain += c;
  }
  return plain;
}

}  // namespace

std::optional<std::vector<std::string>> path_segments(std::string_view target) {
  const std::string_view path = target.substr(0, target.find('?'));
  if (path.empty() || path.front() != '/') return std::nullopt;
  std::vector<std::string> segments;
  for (std::size_t begin = 1;;) {
    const std::size_t end = std::min(path.find('/', begin), path.size());
    std::optional<std::string> segment = decoded(path.substr(begin, end - begin));
    const bool is_last = end == path.size();
    if (!segment || (segment->empty() && !is_last) || segment->rfind('.', 0) == 0) return std::nullopt;
    segments.push_back(std::move(*segment));
    if (is_last) return segments;
    begin = end + 1;
  }
}

std::string_view query_of(std::string_view target) {
  const std::size_t mark = target.find('?');
  return mark == std::string_view::npos ? std::string_view() : target.substr(mark + 1);
}

std::optional<std::uint64_t> number_in_query(std::string_view query, std::string_view name) {
  while (!query.empty()) {
    const std::size_t end = std::min(query.find('&'), query.size());
    const std::string_view pair = query.substr(0, end);
    if (pair.size() > name.size() && pair.substr(0, name.size()) == name && pair[name.size()] == '=') {
      return number_from<std::uint64_t>(std::string(pair.substr(name.size() + 1)));
    }
    query.remove_prefix(std::min(end + 1, query.size()));
  }
  return std::nullopt;
}

std::optional<ByteRange> range_from(std::string_view header, std::uint64_t size) {
  constexpr std::string_view kUnit = "bytes=";
  if (header.substr(0, kUnit.size()) != kUnit) return std::nullopt;
  const std::string_view range = header.substr(kUnit.size());
  const std::size_t dash = range.find('-');
  if (dash == std::string_view::npos) return std::nullopt;
  const auto first = number_from<std::uint64_t>(std::string(range.substr(0, dash)));
  const auto last = number_from<std::uint64_t>(std::string(range.substr(dash + 1)));
  const bool has_first = dash > 0, has_last = dash + 1 < range.size();
  if ((has_first && !first) || (has_last && !last) || (!has_first && !has_last)) return std::nullopt;
  if (!has_first) {
    const std::uint64_t count = std::min(*last, size);
    return ByteRange{size - count, count};
  }
  if (has_last && *last < *first) return std::nullopt;
  if (*first >= size) return ByteRange{0, 0};
  const std::uint64_t end = has_last && *last < size ? *last + 1 : size;
  return ByteRange{*first, end - *first};
}

std::string html_text(const std::string& text) {
  std::string html;
  for (const char c : text) {
    if (c == '<' || c == '>' || c == '&' || c == '"') {
      html += "&#" + std::to_string(static_cast<int>(c)) + ";";
    } else {
      html += c;
    }
  }
  return html;
}

std::string relative_address(const std::string& name) {
  std::string address = "./";
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    if ((byte < 128 && std::isalnum(byte) != 0) || c == '/' || c == '-' || c == '_' || c == '.') {
      address += c;
    } else {
      constexpr const char* kDigits = "0123456789ABCDEF";
      address += '%';
      address += kDigits[byte >> 4];
      address += kDigits[byte & 15];
    }
  }
  return address;
}

}  // namespace pmsp::web
