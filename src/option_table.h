// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/options.h"

namespace pmsp {

/// One field of DensifierOptions, for programs that take options by name. All that is said of an option follows from
/// its entry: DensifierOptions::validate, preset, and the command line, help and JSON of pmsp-densify.
struct PMSP_API OptionEntry {
  /// Gives the field.
  using Access = std::variant<bool& (*)(DensifierOptions&), int& (*)(DensifierOptions&), double& (*)(DensifierOptions&),
                              std::uint64_t& (*)(DensifierOptions&), Simd& (*)(DensifierOptions&),
                              Backend& (*)(DensifierOptions&), std::vector<int>& (*)(DensifierOptions&)>;
  enum class Numbers { kAll, kEven, kOdd };  ///< which whole numbers

  const char* key;    ///< dots separate levels: "patchmatch.iterations"
  const char* stage;  ///< heading in a help: "PatchMatch"
  const char* help;   ///< a few words
  Access access;
  const char* unit = "";        ///< "" = none
  const char* short_name = "";  ///< "min_confidence", of an option that many people touch; "" = none
  double min = 0.0;             ///< of numbers, and of each number of a list; inclusive
  double max = 0.0;
  Numbers numbers = Numbers::kAll;
  bool zero_too = false;  ///< 0 is fine as well, and stands for "automatic"
  /// Values of the qualities that differ from the default; numbers, or 0 and 1 for switches. By Quality.
  std::array<std::optional<double>, 4> presets{};

  bool is_switch() const { return std::holds_alternative<bool& (*)(DensifierOptions&)>(access); }

  /// What may be set, in words, with the unit: "a whole number from 1 to 100 [keyframes]".
  std::string expected() const;

  /// The value as text, as `set` takes it.
  std::string text_of(const DensifierOptions& options) const;

  /// Throws InvalidOption, naming `where` (a flag, or the place in a file), the value and what was expected; the option
  /// is then as it was.
  void set(DensifierOptions& options, const std::string& text, const std::string& where) const;

  /// Throws InvalidOption, naming key, value and what was expected, where the value is out of range.
  void check(const DensifierOptions& options) const;
};

/// All fields of DensifierOptions but `scratch_folder` and `expected_keyframes`, stage by stage.
PMSP_API const std::vector<OptionEntry>& option_table();

/// nullptr when there is none.
PMSP_API const OptionEntry* find_option(const std::string& key);

}  // namespace pmsp
