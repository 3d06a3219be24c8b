// SPDX-License-Identifier: BSD-2-Clause
#include "option_json.h"

#include <algorithm>
#include <type_traits>
#include <vector>

#include "option_flags.h"
#include "pmsp/error.h"

namespace pmsp::tool {
namespace {

using Json = nlohmann::json;
using Devices = std::vector<int>;

/// Text of `value` for OptionEntry::set. Throws InvalidOption for a wrong JSON type.
template <class Field>
std::string text_in(const Json& value, const OptionEntry& entry, const std::string& where) {
  std::string text = value.dump();
  if constexpr (std::is_same_v<Field, Devices>) {  // a number, a list of numbers, or "all"
    if (value.is_string()) return value.get<std::string>();
    if (value.is_array()) {
      text.clear();
      for (const Json& device : value) text += (text.empty() ? "" : ",") + device.dump();
    }
    return text;
  } else {
    constexpr bool kIsWhole = std::is_integral_v<Field>;
    const bool fits = std::is_same_v<Field, bool> ? value.is_boolean()
                      : std::is_enum_v<Field>     ? value.is_string()
                      : kIsWhole                  ? value.is_number_integer()
                                                  : value.is_number();
    if (!fits) throw InvalidOption(where + " is " + text + "; expected " + entry.expected());
    return value.is_string() ? value.get<std::string>() : text;
  }
}

void apply_level(DensifierOptions& options, const Json& json, const std::string& prefix, const std::string& source) {
  for (const auto& [name, value] : json.items()) {
    const std::string key = prefix + name;
    if (const OptionEntry* entry = find_option(key)) {
      const std::string where = source + ": " + key;
      const std::string text = std::visit(
          [&, &set = value](auto at) { return text_in<std::decay_t<decltype(at(options))>>(set, *entry, where); },
          entry->access);
      entry->set(options, text, where);
      continue;
    }
    const std::string level = key + ".";
    const auto& table = option_table();
    const bool is_level = std::any_of(table.begin(), table.end(),
                                      [&](const OptionEntry& e) { return std::string(e.key).rfind(level, 0) == 0; });
    if (is_level && value.is_object()) {
      apply_level(options, value, level, source);
    } else if (is_level) {
      throw InvalidOption(source + ": " + key + " is " + value.dump().substr(0, 60) + "; expected an object");
    } else {
      std::vector<std::string> keys{"quality"};
      for (const OptionEntry& e : table) keys.emplace_back(e.key);
      throw InvalidOption(source + ": there is no option \"" + key.substr(0, 100) + "\"" + suggestion(key, keys));
    }
  }
}

}  // namespace

nlohmann::ordered_json to_json(const DensifierOptions& options) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  DensifierOptions copy = options;
  for (const OptionEntry& entry : option_table()) {
    const std::string key = entry.key;
    const std::size_t dot = key.find('.');
    auto& at = dot == std::string::npos ? json[key] : json[key.substr(0, dot)][key.substr(dot + 1)];
    std::visit(
        [&](auto field) {
          using Field = std::decay_t<decltype(field(copy))>;
          if constexpr (std::is_enum_v<Field>) {
            at = name_of(field(copy));
          } else if constexpr (std::is_same_v<Field, Devices>) {
            const Devices& devices = field(copy);
            at = devices;
            if (devices.size() == 1) at = devices[0];
            if (devices.empty()) at = "all";
          } else {
            at = field(copy);
          }
        },
        entry.access);
  }
  return json;
}

nlohmann::ordered_json options_of_results(const DensifierOptions& options) {
  nlohmann::ordered_json json = to_json(options);
  for (const char* machine : {"backend", "device", "pipelined", "threads", "simd"}) json.erase(machine);
  return json;
}

void apply_json(DensifierOptions& options, const Json& json, const std::string& source) {
  if (!json.is_object()) throw InvalidOption(source + ": holds no JSON object");
  Json rest = json;
  rest.erase("quality");  // the preset below these values, applied by the caller
  apply_level(options, rest, "", source);
}

}  // namespace pmsp::tool
