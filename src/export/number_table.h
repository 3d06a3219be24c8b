// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace pmsp {

/// Line of numbers; `name`: its first column, if that is not a number.
struct NumberRow {
  std::size_t line = 0;  ///< line number in the file, from 1
  std::string name;
  std::vector<double> numbers;
};

/// Reads a text table of numbers separated by blanks, commas or semicolons. # begins a comment; empty lines are
/// skipped, and a header line, which `names` receives. With commas or semicolons, names of rows may contain blanks.
/// Throws IoError, or InvalidInput with the line: not a finite number, file above 64 MiB.
std::vector<NumberRow> read_number_table(const std::filesystem::path& path, std::string* names = nullptr);

}  // namespace pmsp
