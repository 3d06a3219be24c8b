// SPDX-License-Identifier: BSD-2-Clause
#include "export/number_table.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include "io/text_input.h"
#include "util/text.h"

namespace pmsp {
namespace {

constexpr const char* kSeparators = " \t\v\f\r,;";

std::optional<double> finite_number(const std::string& word) {
  const std::optional<double> value = number_from<double>(word);
  return value && std::isfinite(*value) ? value : std::nullopt;
}

bool is_row_of_numbers(const std::string& text) {
  const std::vector<std::string> words = words_of(text, kSeparators);
  return std::all_of(words.begin(), words.end(),
                     [](const std::string& word) { return finite_number(word).has_value(); });
}

}  // namespace

std::vector<NumberRow> read_number_table(const std::filesystem::path& path, std::string* names) {
  constexpr std::size_t kLongestFirst = 1000;
  constexpr std::uint64_t kMostBytes = std::uint64_t{64} << 20;
  TextInput in(path);
  if (in.size() > kMostBytes) fail(path, "", "is larger than 64 MiB; expected a table of numbers");
  std::vector<NumberRow> rows;
  std::string columns;
  while (in.next_line()) {
    std::string line = in.line().substr(0, in.line().find('#'));
    NumberRow row;
    row.line = in.number_of_line();
    const std::size_t comma = line.find_first_of(",;");
    if (comma != std::string::npos) {
      const std::string first = trimmed(line.substr(0, comma), " \t\r\"");
      if (!is_row_of_numbers(first)) {
        row.name = first.substr(0, kLongestFirst);
        line.erase(0, comma);
      }
    }
    const std::vector<std::string> words = words_of(line, kSeparators);
    std::string no_number;
    for (const std::string& word : words) {
      if (const std::optional<double> value = finite_number(word)) {
        row.numbers.push_back(*value);
      } else if (row.name.empty() && row.numbers.empty()) {
        row.name = word.substr(0, kLongestFirst);
      } else if (no_number.empty()) {
        no_number = word;
      }
    }
    if (!no_number.empty() && rows.empty() && columns.empty() && row.numbers.empty() && !row.name.empty()) {
      columns = row.name;
      for (const std::string& word : words) columns += " " + word;
      continue;
    }
    if (!no_number.empty()) {
      in.refuse("\"" + no_number.substr(0, 40) +
                "\" is no number; expected numbers, with blanks or commas between them");
    }
    if (!row.numbers.empty() || !row.name.empty()) rows.push_back(std::move(row));
  }
  if (names != nullptr) *names = columns;
  return rows;
}

}  // namespace pmsp
