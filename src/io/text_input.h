// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>

#include "export/files.h"
#include "map_scene.h"

namespace pmsp::map_detail {

/// A text file line by line, and the words of a line. Throws IoError, and InvalidInput that names the line.
class TextInput {
 public:
  explicit TextInput(const std::filesystem::path& path, char separator = ' ') : path_(path), separator_(separator) {
    require_regular_file(path);
    file_.open(path, std::ios::binary);
    if (!file_) throw IoError(path.string() + ": cannot be opened for reading");
  }

  /// The next line, whatever is in it; false at the end.
  bool next_line() {
    if (!std::getline(file_, line_)) {
      if (file_.bad()) throw IoError(path_.string() + ": cannot be read");
      return false;
    }
    ++number_;
    if (number_ == 1 && line_.compare(0, 3, "\xEF\xBB\xBF") == 0) line_.erase(0, 3);  // a byte order mark
    while (!line_.empty() && (line_.back() == '\r' || line_.back() == ' ')) line_.pop_back();
    left_ = line_;
    return true;
  }

  /// The next line with words in it that is no comment ("# ...").
  bool next() {
    while (next_line()) {
      skip_blanks();
      if (!left_.empty() && left_.front() != '#') return true;
    }
    return false;
  }

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

  /// All that is left of the line.
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

  /// The same where programs write NaN for what they have lost.
  double number_or_nan(const char* what) {
    return number_where<double>(what, [](double /*value*/) { return true; });
  }

  [[noreturn]] void refuse(const std::string& what) const { fail(path_, here(), what); }
  std::string here() const { return "line " + std::to_string(number_); }
  std::size_t number_of_line() const { return number_; }
  const std::filesystem::path& path() const { return path_; }

 private:
  template <class T, class Accept>
  T number_where(const char* what, const Accept& accept) {
    const std::string_view text = word(what);
    T value{};
    const char* const begin = text.data() + (text.front() == '+' ? 1 : 0);
    const auto [end, error] = std::from_chars(begin, text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || !accept(value)) {
      refuse(std::string(what) + " is " + in_quotes(std::string(text)) + ", expected a " +
             (std::is_floating_point_v<T> ? "finite number" : "whole number"));
    }
    return value;
  }

  bool is_blank(char c) const { return separator_ == ' ' ? c == ' ' || c == '\t' || c == ',' : c == separator_; }
  void skip_blanks() {
    while (!left_.empty() && is_blank(left_.front())) left_.remove_prefix(1);
  }

  std::filesystem::path path_;
  char separator_;
  std::ifstream file_;
  std::string line_;
  std::string_view left_;
  std::size_t number_ = 0;
};

}  // namespace pmsp::map_detail
