// SPDX-License-Identifier: BSD-2-Clause
#include "options.h"

#include <algorithm>
#include <iostream>
#include <numeric>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "export/files.h"
#include "external_depths.h"
#include "pmsp/error.h"
#include "verbs.h"

namespace pmsp::tool {
namespace {

constexpr std::size_t kSuggestedLetters = 2;  ///< maximum edit distance of a suggestion

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

std::string with_hyphens(std::string name) {
  std::replace_if(
      name.begin(), name.end(), [](char c) { return c == '.' || c == '_'; }, '-');
  return name;
}

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

namespace {

using Devices = std::vector<int>;

/// Text of `value` for OptionEntry::set. Throws InvalidOption for a wrong JSON type.
template <class Field>
std::string value_text(const nlohmann::json& value, const OptionEntry& entry, const std::string& where) {
  std::string text = value.dump();
  if constexpr (std::is_same_v<Field, Devices>) {  // a number, a list of numbers, or "all"
    if (value.is_string()) return value.get<std::string>();
    if (value.is_array()) {
      text.clear();
      for (const nlohmann::json& device : value) text += (text.empty() ? "" : ",") + device.dump();
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

void apply_level(DensifierOptions& options, const nlohmann::json& json, const std::string& prefix,
                 const std::string& source) {
  for (const auto& [name, value] : json.items()) {
    const std::string key = prefix + name;
    if (const OptionEntry* entry = find_option(key)) {
      const std::string where = source + ": " + key;
      const std::string text = std::visit(
          [&, &set = value](auto at) { return value_text<std::decay_t<decltype(at(options))>>(set, *entry, where); },
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

void apply_json(DensifierOptions& options, const nlohmann::json& json, const std::string& source) {
  if (!json.is_object()) throw InvalidOption(source + ": holds no JSON object");
  nlohmann::json rest = json;
  rest.erase("quality");  // the preset below these values, applied by the caller
  apply_level(options, rest, "", source);
}

namespace {

nlohmann::json read_config(const std::filesystem::path& path) {
  const std::string text = read_whole_file(path);
  try {
    return nlohmann::json::parse(text, nullptr, true, true);
  } catch (const nlohmann::json::parse_error& error) {
    throw InvalidOption(path.string() + ": is no JSON, byte " + std::to_string(error.byte) + ": " + error.what());
  }
}

Quality quality_of(const Arguments& arguments, const nlohmann::json& file) {
  const auto in_file = file.is_object() ? file.find("quality") : file.end();
  std::string where = "--quality";
  try {
    if (arguments.quality) return quality_from_name(*arguments.quality);
    if (in_file == file.end()) return Quality::kNormal;
    where = arguments.config.string() + ": quality";
    return quality_from_name(in_file->is_string() ? in_file->get<std::string>() : in_file->dump());
  } catch (const InvalidOption& error) {
    throw InvalidOption(where + ": " + error.what());
  }
}

nlohmann::json config_of(const Arguments& arguments) {
  return arguments.config.empty() ? nlohmann::json::object() : read_config(arguments.config);
}

/// If only one side is set, the other is derived from the images instead of the preset.
void follow_given_side(DensifierOptions& options, bool has_width, bool has_height) {
  if (has_width && !has_height) options.height = 0;
  if (has_height && !has_width) options.width = 0;
}

/// Preset, overridden by the configuration file, overridden by flags.
DensifierOptions merged_options(Quality quality, const Arguments& arguments, const nlohmann::json& file) {
  DensifierOptions options = preset(quality);
  if (arguments.verb == Verb::kFuse) set_fuse_defaults(options, arguments);
  if (file.is_object()) follow_given_side(options, file.contains("width"), file.contains("height"));
  apply_json(options, file, arguments.config.string());
  const auto has_flag = [&](const char* key) {
    return std::any_of(arguments.overrides.begin(), arguments.overrides.end(),
                       [&](const auto& given) { return std::string_view(given.first->key) == key; });
  };
  follow_given_side(options, has_flag("width"), has_flag("height"));
  for (const auto& [entry, text] : arguments.overrides) entry->set(options, text, flag_of(*entry));
  return options;
}

}  // namespace

Quality quality_of(const Arguments& arguments) { return quality_of(arguments, config_of(arguments)); }

DensifierOptions effective_options(const Arguments& arguments) {
  const nlohmann::json file = config_of(arguments);
  const DensifierOptions options = merged_options(quality_of(arguments, file), arguments, file);
  options.validate();
  return options;
}

std::string quality_warning(const Arguments& arguments) {
  if (!arguments.quality || arguments.config.empty()) return "";
  const nlohmann::json file = config_of(arguments);
  const auto online = to_json(merged_options(Quality::kOnline, arguments, file));
  for (const Quality other : {Quality::kNormal, Quality::kHigh, Quality::kPaper}) {
    if (to_json(merged_options(other, arguments, file)) != online) return "";
  }
  return "--quality " + *arguments.quality + " changes nothing: " + arguments.config.string() +
         " sets all of its options; leave one of them out";
}

void config(const Arguments& arguments) {
  std::cout << to_json(effective_options(arguments)).dump(2) << "\n";
  const std::string warning = quality_warning(arguments);
  if (!warning.empty()) std::cerr << "warning: " << warning << "\n";
}

}  // namespace pmsp::tool
