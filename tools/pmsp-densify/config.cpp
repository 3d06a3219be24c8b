// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <iostream>
#include <string_view>

#include "export/files.h"
#include "given_depth.h"
#include "option_json.h"
#include "verbs.h"

namespace pmsp::tool {
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
DensifierOptions options_over(Quality quality, const Arguments& arguments, const nlohmann::json& file) {
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
  const DensifierOptions options = options_over(quality_of(arguments, file), arguments, file);
  options.validate();
  return options;
}

std::string quality_warning(const Arguments& arguments) {
  if (!arguments.quality || arguments.config.empty()) return "";
  const nlohmann::json file = config_of(arguments);
  const auto online = to_json(options_over(Quality::kOnline, arguments, file));
  for (const Quality other : {Quality::kNormal, Quality::kHigh, Quality::kPaper}) {
    if (to_json(options_over(other, arguments, file)) != online) return "";
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
