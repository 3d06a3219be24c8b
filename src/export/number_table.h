// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace pmsp {

/// A line of numbers; `name` is its first word, or column, where that is no number.
struct NumberRow {
  std::size_t line = 0;  ///< in the file, from 1
  std::string name;
  std::vector<double> numbers;
};

/// A text of numbers, with blanks, commas or semicolons between them; # begins a comment, empty lines are skipped, and
/// so is a first line of words, which name the columns and become `names`. With commas or semicolons a row's name may
/// hold blanks. Throws IoError, or InvalidInput with the line: a word that is no finite number, a file above 64 MiB.
std::vector<NumberRow> read_number_table(const std::filesystem::path& path, std::string* names = nullptr);

}  // namespace pmsp
