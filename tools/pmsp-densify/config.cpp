// SPDX-License-Identifier: BSD-2-Clause
#include <fstream>
#include <iostream>
#include <iterator>

#include "exit_code.h"
#include "verbs.h"

namespace pmsp::tool {
namespace {

nlohmann::json read_config(const std::filesystem::path& path) {
  std::error_code ignored;
  std::ifstream file(path, std::ios::binary);
  if (!file || !std::filesystem::is_regular_file(path, ignored)) {
    throw IoError(path.string() + ": the configuration cannot be read: there is no such file");
  }
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
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
    if (in_file == file.end()) return Quality::kOnline;
    where = arguments.config.string() + ": quality";
    return quality_from_name(in_file->is_string() ? in_file->get<std::string>() : in_file->dump());
  } catch (const InvalidOption& error) {
    throw InvalidOption(where + ": " + error.what());
  }
}

}  // namespace

DensifierOptions effective_options(const Arguments& arguments) {
  const nlohmann::json file = arguments.config.empty() ? nlohmann::json::object() : read_config(arguments.config);
  DensifierOptions options = preset(quality_of(arguments, file));
  apply_json(options, file, arguments.config.string());
  for (const auto& [entry, text] : arguments.overrides) set_from_text(options, *entry, text, entry->flag());
  options.validate();
  return options;
}

void config(const Arguments& arguments) { std::cout << to_json(effective_options(arguments)).dump(2) << "\n"; }

}  // namespace pmsp::tool
