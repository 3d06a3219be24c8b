// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>
#include <type_traits>

#include "option_table.h"
#include "pmsp/error.h"
#include "util/number_from.h"

namespace pmsp {
namespace {

/// Returns the shortest text that reads back as the same number.
template <class T>
std::string number_text(T value) {
  char text[64];
  const auto result = std::to_chars(text, text + sizeof(text), value);
  return {text, result.ptr};
}

std::string range_text(const OptionEntry& entry, bool whole) {
  if (!whole) return number_text(entry.min) + " to " + number_text(entry.max);
  const auto end = [](double value) { return number_text(static_cast<long long>(value)); };
  const char* kind = entry.numbers == OptionEntry::Numbers::kEven  ? "an even"
                     : entry.numbers == OptionEntry::Numbers::kOdd ? "an odd"
                                                                   : "a whole";
  return (entry.allows_zero ? "0, or " : "") + std::string(kind) + " number from " + end(entry.min) + " to " +
         end(entry.max);
}

bool is_in_range(const OptionEntry& entry, double value) {
  if (entry.allows_zero && value == 0.0) return true;
  if (!(value >= entry.min && value <= entry.max)) return false;  // false for NaN
  if (entry.numbers == OptionEntry::Numbers::kAll) return true;
  return (std::fmod(value, 2.0) == 0.0) == (entry.numbers == OptionEntry::Numbers::kEven);
}

bool is_valid(const OptionEntry&, bool) { return true; }
bool is_valid(const OptionEntry&, std::uint64_t) { return true; }
bool is_valid(const OptionEntry&, Simd) { return true; }
bool is_valid(const OptionEntry&, Backend) { return true; }
bool is_valid(const OptionEntry& entry, int value) { return is_in_range(entry, value); }
bool is_valid(const OptionEntry& entry, double value) { return is_in_range(entry, value); }
bool is_valid(const OptionEntry& entry, const std::vector<int>& list) {
  return list.size() <= static_cast<std::size_t>(kMaxDevices) &&
         std::all_of(list.begin(), list.end(), [&](int value) { return is_in_range(entry, value); });
}

std::string text(bool value) { return value ? "true" : "false"; }
std::string text(int value) { return number_text(value); }
std::string text(double value) { return number_text(value); }
std::string text(std::uint64_t value) { return number_text(value); }
std::string text(Simd value) { return name_of(value); }
std::string text(Backend value) { return name_of(value); }
std::string text(const std::vector<int>& list) {
  std::string all;
  for (const int value : list) all += (all.empty() ? "" : ",") + number_text(value);
  return list.empty() ? "all" : all;
}

// Parses a value; nullopt if invalid.
template <class T>
std::optional<T> read(const std::string& text) {
  if constexpr (std::is_same_v<T, bool>) {
    if (text == "true") return true;
    if (text == "false") return false;
    return std::nullopt;
  } else if constexpr (std::is_enum_v<T>) {
    try {
      if constexpr (std::is_same_v<T, Simd>) return simd_from_name(text);
      if constexpr (std::is_same_v<T, Backend>) return backend_from_name(text);
    } catch (const InvalidOption&) {
      return std::nullopt;  // the caller reports the position
    }
  } else if constexpr (std::is_same_v<T, std::vector<int>>) {
    T list;
    if (text == "all") return list;
    std::istringstream items(text + ",");
    for (std::string item; std::getline(items, item, ',');) {
      const auto number = number_from<int>(item);
      if (!number) return std::nullopt;
      list.push_back(*number);
    }
    return list;
  } else {
    return number_from<T>(text);
  }
}

}  // namespace

std::string OptionEntry::expected() const {
  const std::string what = std::visit(
      [this](auto at) -> std::string {
        using T = std::decay_t<decltype(at(std::declval<DensifierOptions&>()))>;
        if constexpr (std::is_same_v<T, bool>) {
          return "true or false";
        } else if constexpr (std::is_same_v<T, Simd>) {
          return "auto, scalar, avx2 or avx512";
        } else if constexpr (std::is_same_v<T, Backend>) {
          return "auto, cpu or cuda";
        } else if constexpr (std::is_same_v<T, std::vector<int>>) {
          return "numbers from " + number_text(min) + " to " + number_text(max) + " such as 0,1, " +
                 number_text(kMaxDevices) + " at most, or all";
        } else if constexpr (std::is_same_v<T, std::uint64_t>) {
          return "a whole number from 0 to 18446744073709551615";
        } else {
          return range_text(*this, std::is_same_v<T, int>);
        }
      },
      access);
  return unit[0] == '\0' ? what : what + " [" + unit + "]";
}

std::string OptionEntry::text_of(const DensifierOptions& options) const {
  DensifierOptions copy = options;  // accessors return mutable references
  return std::visit([&copy](auto at) { return text(at(copy)); }, access);
}

void OptionEntry::set(DensifierOptions& options, const std::string& text, const std::string& where) const {
  std::visit(
      [&](auto at) {
        auto value = read<std::decay_t<decltype(at(options))>>(text);
        if (!value) throw InvalidOption(where + " is \"" + text + "\"; expected " + expected());
        if (!is_valid(*this, *value)) throw InvalidOption(where + " is " + text + "; expected " + expected());
        at(options) = std::move(*value);
      },
      access);
}

void OptionEntry::check(const DensifierOptions& options) const {
  DensifierOptions copy = options;
  std::visit(
      [&](auto at) {
        if (is_valid(*this, at(copy))) return;
        throw InvalidOption(std::string(key) + " is " + text(at(copy)) + "; expected " + expected());
      },
      access);
}

const OptionEntry* find_option(const std::string& key) {
  for (const OptionEntry& entry : option_table()) {
    if (key == entry.key) return &entry;
  }
  return nullptr;
}

}  // namespace pmsp
