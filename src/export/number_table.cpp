// SPDX-License-Identifier: BSD-2-Clause
#include "export/number_table.h"

#include <charconv>
#include <cmath>
#include <sstream>
#include <system_error>
#include <utility>

#include "export/files.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

bool is_number(const std::string& word, double& value) {
  const char* first = word.data() + (word.size() > 1 && word[0] == '+' ? 1 : 0);
  const auto [end, error] = std::from_chars(first, word.data() + word.size(), value);
  return error == std::errc() && end == word.data() + word.size() && std::isfinite(value);
}

bool is_numbers(const std::string& text) {
  std::istringstream words(text);
  double value = 0.0;
  for (std::string word; words >> word;) {
    if (!is_number(word, value)) return false;
  }
  return true;
}

/// Trims the given characters at both ends.
std::string without(const std::string& text, const char* characters) {
  const std::size_t begin = text.find_first_not_of(characters);
  return begin == std::string::npos ? "" : text.substr(begin, text.find_last_not_of(characters) + 1 - begin);
}

}  // namespace

std::vector<NumberRow> read_number_table(const std::filesystem::path& path, std::string* names) {
  constexpr std::size_t kLongestName = 1000;
  constexpr std::uintmax_t kMostBytes = std::uintmax_t{64} << 20;
  require_regular_file(path);
  std::error_code error;
  if (std::filesystem::file_size(path, error) > kMostBytes || error) {
    throw InvalidInput(path.string() + ": is larger than 64 MiB; expected a table of numbers");
  }
  std::istringstream text(read_whole_file(path));
  std::vector<NumberRow> rows;
  std::string columns;
  std::string line;
  for (std::size_t number = 1; std::getline(text, line); ++number) {
    if (number == 1 && line.compare(0, 3, "\xEF\xBB\xBF") == 0) line.erase(0, 3);  // byte order mark
    line = line.substr(0, line.find('#'));
    NumberRow row;
    row.line = number;
    const std::size_t comma = line.find_first_of(",;");
    if (comma != std::string::npos) {
      const std::string first = without(line.substr(0, comma), " \t\r\"");
      if (!is_numbers(first)) {
        row.name = first.substr(0, kLongestName);
        line.erase(0, comma);
      }
    }
    for (char& c : line) {
      if (c == ',' || c == ';' || c == '\t' || c == '\r') c = ' ';
    }
    std::istringstream words(line);
    std::string word;
    std::string no_number;
    while (words >> word) {
      double value = 0.0;
      if (is_number(word, value)) {
        row.numbers.push_back(value);
      } else if (row.name.empty() && row.numbers.empty()) {
        row.name = word.substr(0, kLongestName);
      } else if (no_number.empty()) {
        no_number = word;
      }
    }
    if (!no_number.empty() && rows.empty() && columns.empty() && row.numbers.empty() && !row.name.empty()) {
      columns = row.name + " " + line;
      continue;
    }
    if (!no_number.empty()) {
      throw InvalidInput(path.string() + ": line " + std::to_string(number) + ": \"" + no_number.substr(0, 40) +
                         "\" is no number; expected numbers, with blanks or commas between them");
    }
    if (!row.numbers.empty() || !row.name.empty()) rows.push_back(std::move(row));
  }
  if (names != nullptr) *names = columns;
  return rows;
}

}  // namespace pmsp
