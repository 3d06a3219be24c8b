// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "binary_input.h"
#include "util/number_from.h"

namespace pmsp {

/// Returns the words of a line; each of the characters `blanks` separates words.
inline std::vector<std::string> words_of(std::string_view line, const char* blanks) {
  std::vector<std::string> words;
  for (std::size_t begin = line.find_first_not_of(blanks); begin != std::string_view::npos;) {
    const std::size_t end = std::min(line.find_first_of(blanks, begin), line.size());
    words.emplace_back(line.substr(begin, end - begin));
    begin = line.find_first_not_of(blanks, end);
  }
  return words;
}

/// Text file, read line by line and word by word. Throws IoError; InvalidInput with the number of the line.
class TextInput {
 public:
  explicit TextInput(const std::filesystem::path& path, char separator = ' ') : in_(path), separator_(separator) {}

  std::uint64_t size() const { return in_.size(); }

  /// Reads the next line; false at the end of the file.
  bool next_line() {
    if (!in_.line(line_)) return false;
    ++number_;
    if (number_ == 1 && line_.compare(0, 3, "\xEF\xBB\xBF") == 0) line_.erase(0, 3);  // byte order mark
    while (!line_.empty() &&
           (line_.back() == '\r' || line_.back() == ' ' || (separator_ == ' ' && line_.back() == '\t')))
      line_.pop_back();
    left_ = line_;
    return true;
  }

  /// Reads up to the next line that is neither blank nor a comment ("# ...").
  bool next() {
    while (next_line()) {
      skip_blanks();
      if (!left_.empty() && left_.front() != '#') return true;
    }
    return false;
  }

  const std::string& line() const { return line_; }  ///< without blanks at its end

  bool at_end() {
    skip_blanks();
    return left_.empty();
  }

  std::string_view word(const char* what) {
    if (at_end()) refuse(std::string(what) + " is missing");
    std::size_t end = 0;
    while (end < left_.size() && !is_blank(left_[end])) ++end;
    const std::string_view result = left_.substr(0, end);
    left_.remove_prefix(end);
    return result;
  }

  /// Reads the rest of the line.
  std::string rest(const char* what) {
    if (at_end()) refuse(std::string(what) + " is missing");
    const std::string_view all = left_;
    left_ = {};
    return std::string(all);
  }

  template <class T = double>
  T number(const char* what) {
    return number_where<T>(what, [](T value) { return std::isfinite(static_cast<double>(value)); });
  }

  /// As `number`, but also accepts NaN and infinity.
  double number_or_nan(const char* what) {
    return number_where<double>(what, [](double /*value*/) { return true; });
  }

  [[noreturn]] void refuse(const std::string& what) const { fail(in_.path(), here(), what); }
  std::string here() const { return "line " + std::to_string(number_); }
  std::size_t number_of_line() const { return number_; }

 private:
  template <class T, class Accept>
  T number_where(const char* what, const Accept& accept) {
    const std::string_view text = word(what);
    const std::optional<T> value = number_from<T>(text);
    if (!value || !accept(*value)) {
      refuse(std::string(what) + " is " + in_quotes(std::string(text)) + ", expected a " +
             (std::is_floating_point_v<T> ? "finite number" : "whole number"));
    }
    return *value;
  }

  bool is_blank(char c) const { return separator_ == ' ' ? c == ' ' || c == '\t' || c == ',' : c == separator_; }
  void skip_blanks() {
    while (!left_.empty() && is_blank(left_.front())) left_.remove_prefix(1);
  }

  BinaryInput in_;
  char separator_;
  std::string line_;
  std::string_view left_;
  std::size_t number_ = 0;
};

}  // namespace pmsp
