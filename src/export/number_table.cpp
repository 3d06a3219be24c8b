// SPDX-License-Identifier: BSD-2-Clause
#include "export/number_table.h"

#include <charconv>
#include <cmath>
#include <sstream>
#include <system_error>
#include <utility>

#include "pmsp/error.h"
#include "pmsp/io/files.h"

namespace pmsp {
namespace {

bool is_number(const std::string& word, double& value) {
  const char* first = word.data() + (word.size() > 1 && word[0] == '+' ? 1 : 0);
  const auto [end, error] = std::from_chars(first, word.data() + word.size(), value);
  return error == std::errc() && end == word.data() + word.size() && std::isfinite(value);
}

}  // namespace

std::vector<NumberRow> read_number_table(const std::filesystem::path& path) {
  constexpr std::uintmax_t kMostBytes = std::uintmax_t{64} << 20;
  require_regular_file(path);
  std::error_code error;
  if (std::filesystem::file_size(path, error) > kMostBytes || error) {
    throw InvalidInput(path.string() + ": is larger than 64 MiB; expected a table of numbers");
  }
  std::istringstream text(read_whole_file(path));
  std::vector<NumberRow> rows;
  std::string line;
  for (std::size_t number = 1; std::getline(text, line); ++number) {
    line = line.substr(0, line.find('#'));
    for (char& c : line) {
      if (c == ',' || c == ';' || c == '\t' || c == '\r') c = ' ';
    }
    std::istringstream words(line);
    NumberRow row;
    row.line = number;
    std::string word;
    for (bool is_first = true; words >> word; is_first = false) {
      double value = 0.0;
      if (is_number(word, value)) {
        row.numbers.push_back(value);
      } else if (is_first) {
        row.name = word.substr(0, 100);
      } else {
        throw InvalidInput(path.string() + ": line " + std::to_string(number) + ": \"" + word.substr(0, 40) +
                           "\" is no number; expected numbers, with blanks or commas between them");
      }
    }
    if (!row.numbers.empty() || !row.name.empty()) rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace pmsp
