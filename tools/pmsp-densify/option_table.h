// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <charconv>
#include <cstdint>
#include <optional>
#include <string>
#include <system_error>
#include <variant>
#include <vector>

#include <nlohmann/json.hpp>

#include "exit_code.h"
#include "pmsp/options.h"

namespace pmsp::tool {

/// One option of the library. The table of them is the only place that the tool knows them from: command line, help,
/// configuration file and its printout are all made from it.
struct OptionEntry {
  using Access = std::variant<bool& (*)(DensifierOptions&), int& (*)(DensifierOptions&), double& (*)(DensifierOptions&),
                              std::uint64_t& (*)(DensifierOptions&), Simd& (*)(DensifierOptions&),
                              Backend& (*)(DensifierOptions&), std::vector<int>& (*)(DensifierOptions&)>;
  const char* key;    ///< in the configuration file, dots separate levels: "patchmatch.iterations"
  const char* group;  ///< heading in the help: the stage
  const char* unit;   ///< "" for none
  double min;         ///< inclusive; not used for switches and names
  double max;
  const char* help;
  Access access;
  const char* short_flag = nullptr;  ///< "--min-confidence", of what most users touch

  bool is_switch() const { return access.index() == 0; }
  /// "--patchmatch-iterations"
  std::string flag() const;
  /// "--no-view-filter-enabled", for switches
  std::string negative_flag() const;
  /// Help, unit, range and default, and the defaults of the other qualities where they differ.
  std::string description() const;
  /// Value as text, as the command line takes it.
  std::string text_of(const DensifierOptions& options) const;
};

const std::vector<OptionEntry>& option_table();

/// Throws InvalidOption naming `where` (the flag), the value and what was expected.
void set_from_text(DensifierOptions& options, const OptionEntry& entry, const std::string& text,
                   const std::string& where);

/// All options, nested by stage, in the order of the table.
nlohmann::ordered_json to_json(const DensifierOptions& options);

/// Without those that are a matter of the machine, and change no result but by the kind of processor.
nlohmann::ordered_json options_of_results(const DensifierOptions& options);

/// Sets what `json` holds. Throws InvalidOption naming `source` (the file) and the key; for an unknown one, the
/// nearest.
void apply_json(DensifierOptions& options, const nlohmann::json& json, const std::string& source);

/// The number that the whole of `text` is, nullopt otherwise. A leading + is fine.
template <class T>
std::optional<T> number_from(const std::string& text) {
  T value{};
  const char* first = text.data() + (text.size() > 1 && text[0] == '+' ? 1 : 0);
  const auto result = std::from_chars(first, text.data() + text.size(), value);
  const bool whole = result.ec == std::errc() && result.ptr == text.data() + text.size() && !text.empty();
  return whole ? std::optional<T>(value) : std::nullopt;
}

/// A number of an option, from `low` to `high`. Throws UsageError, which says what was expected.
template <class T>
T number_in(const char* option, const std::string& text, T low, T high, const std::string& expected) {
  const auto value = number_from<T>(text);
  if (value && *value >= low && *value <= high) return *value;
  throw UsageError(std::string(option) + " is \"" + text + "\"; expected " + expected);
}

/// The whole numbers of a list such as "0,1", nullopt where it is none.
std::optional<std::vector<int>> numbers_from(const std::string& list);

/// The candidate that differs from `word` in the fewest letters; "" when there is none.
std::string nearest(const std::string& word, const std::vector<std::string>& candidates);

}  // namespace pmsp::tool
