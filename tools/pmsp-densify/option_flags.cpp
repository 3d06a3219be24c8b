// SPDX-License-Identifier: BSD-2-Clause
#include "option_flags.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace pmsp::tool {
namespace {

constexpr std::size_t kSuggestedLetters = 2;  ///< maximum edit distance of a suggestion

std::string with_hyphens(std::string name) {
  std::replace_if(
      name.begin(), name.end(), [](char c) { return c == '.' || c == '_'; }, '-');
  return name;
}

/// Levenshtein distance.
std::size_t distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);  // one row of the table
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

}  // namespace

std::string flag_of(const OptionEntry& entry) { return "--" + with_hyphens(entry.key); }

std::string negative_flag_of(const OptionEntry& entry) { return "--no-" + with_hyphens(entry.key); }

std::string flags_of(const OptionEntry& entry) {
  const std::string short_name = entry.short_name;
  return (short_name.empty() ? "" : "--" + with_hyphens(short_name) + ",") + flag_of(entry);
}

std::string description_of(const OptionEntry& entry) {
  static const DensifierOptions normal = preset(Quality::kNormal);
  static const std::pair<const char*, DensifierOptions> others[] = {
      {"online", preset(Quality::kOnline)}, {"high", preset(Quality::kHigh)}, {"paper", preset(Quality::kPaper)}};
  std::string text = std::string(entry.help) + " (" +
                     (entry.is_switch() ? negative_flag_of(entry) + " disables it" : entry.expected()) + "; default " +
                     entry.text_of(normal);
  for (const auto& [name, options] : others) {
    const std::string value = entry.text_of(options);
    if (value != entry.text_of(normal)) text += std::string(", ") + name + " " + value;
  }
  return text + ")";
}

std::string suggestion(const std::string& word, const std::vector<std::string>& candidates) {
  const std::string* best = nullptr;
  std::size_t least = kSuggestedLetters + 1;
  for (const std::string& candidate : candidates) {
    const std::size_t letters = distance(word, candidate);
    if (letters >= least) continue;
    least = letters;
    best = &candidate;
  }
  return best != nullptr ? "; did you mean " + *best + "?" : "";
}

}  // namespace pmsp::tool
