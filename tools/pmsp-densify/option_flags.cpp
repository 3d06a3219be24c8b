// SPDX-License-Identifier: BSD-2-Clause
#include "option_flags.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

namespace pmsp::tool {
namespace {

std::string with_hyphens(std::string name) {
  std::replace_if(
      name.begin(), name.end(), [](char c) { return c == '.' || c == '_'; }, '-');
  return name;
}

}  // namespace

std::string flag_of(const OptionEntry& entry) { return "--" + with_hyphens(entry.key); }

std::string negative_flag_of(const OptionEntry& entry) { return "--no-" + with_hyphens(entry.key); }

std::string flags_of(const OptionEntry& entry) {
  const std::string short_name = entry.short_name;
  return (short_name.empty() ? "" : "--" + with_hyphens(short_name) + ",") + flag_of(entry);
}

std::string description_of(const OptionEntry& entry) {
  static const DensifierOptions online = preset(Quality::kOnline);
  static const std::pair<const char*, DensifierOptions> others[] = {
      {"normal", preset(Quality::kNormal)}, {"high", preset(Quality::kHigh)}, {"paper", preset(Quality::kPaper)}};
  std::string text = std::string(entry.help) + " (" +
                     (entry.is_switch() ? negative_flag_of(entry) + " for no" : entry.expected()) + "; default " +
                     entry.text_of(online);
  for (const auto& [name, options] : others) {
    const std::string value = entry.text_of(options);
    if (value != entry.text_of(online)) text += std::string(", ") + name + " " + value;
  }
  return text + ")";
}

std::string nearest(const std::string& word, const std::vector<std::string>& candidates) {
  std::string best;
  std::size_t best_distance = std::numeric_limits<std::size_t>::max();
  for (const std::string& candidate : candidates) {
    std::vector<std::size_t> row(candidate.size() + 1);  // Levenshtein distance, one row at a time
    std::iota(row.begin(), row.end(), std::size_t{0});
    for (std::size_t i = 0; i < word.size(); ++i) {
      std::size_t diagonal = row[0];
      row[0] = i + 1;
      for (std::size_t j = 0; j < candidate.size(); ++j) {
        const std::size_t replaced = diagonal + (word[i] == candidate[j] ? 0 : 1);
        diagonal = row[j + 1];
        row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
      }
    }
    if (row.back() < best_distance) {
      best_distance = row.back();
      best = candidate;
    }
  }
  return best;
}

}  // namespace pmsp::tool
