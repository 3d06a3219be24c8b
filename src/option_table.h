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

/// Field of DensifierOptions. Its entry determines DensifierOptions::validate, preset, and the command line, help and
/// JSON of pmsp-densify.
struct PMSP_API OptionEntry {
  /// Accessor of the field.
  using Access = std::variant<bool& (*)(DensifierOptions&), int& (*)(DensifierOptions&), double& (*)(DensifierOptions&),
                              std::uint64_t& (*)(DensifierOptions&), Simd& (*)(DensifierOptions&),
                              Backend& (*)(DensifierOptions&), std::vector<int>& (*)(DensifierOptions&)>;
  enum class Numbers { kAll, kEven, kOdd };  ///< allowed whole numbers

  const char* key;    ///< dots separate levels: "patchmatch.iterations"
  const char* stage;  ///< heading in the help: "PatchMatch"
  const char* help;   ///< short description
  Access access;
  const char* unit = "";        ///< "" = none
  const char* short_name = "";  ///< "min_confidence", for frequently used options; "" = none
  double min = 0.0;             ///< of numbers, and of each number of a list; inclusive
  double max = 0.0;
  Numbers numbers = Numbers::kAll;
  bool allows_zero = false;  ///< 0 is allowed, too: "automatic"
  /// Values of the presets that differ from the default, by Quality: numbers, or 0 and 1 for switches.
  std::array<std::optional<double>, 4> presets{};

  bool is_switch() const { return std::holds_alternative<bool& (*)(DensifierOptions&)>(access); }

  /// Returns a description of the allowed values with the unit: "a whole number from 1 to 100 [keyframes]".
  std::string expected() const;

  /// Returns the value as text that `set` accepts.
  std::string text_of(const DensifierOptions& options) const;

  /// Throws InvalidOption, naming `where` (flag, or position in a file), value and expectation; the option is then
  /// unchanged.
  void set(DensifierOptions& options, const std::string& text, const std::string& where) const;

  /// Throws InvalidOption, naming key, value and expectation, if the value is out of range.
  void check(const DensifierOptions& options) const;
};

/// Returns entries for all fields of DensifierOptions except `scratch_folder` and `expected_keyframes`, by stage.
PMSP_API const std::vector<OptionEntry>& option_table();

/// Returns nullptr if there is none.
PMSP_API const OptionEntry* find_option(const std::string& key);

}  // namespace pmsp
