// SPDX-License-Identifier: BSD-2-Clause
#include "batch_options.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

#include <CLI/CLI.hpp>

#include "arguments.h"
#include "command_line.h"
#include "exit_code.h"
#include "export/cloud_frame.h"

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;

/// Set by batch per mission, columns of the list, or options of batch itself.
constexpr std::array kOfBatch{"--images",    "--video",          "--output",    "--force",        "--stats",
                              "--workspace", "--growing",        "--follow",    "--until-idle",   "--progress",
                              "--quiet",     "--raw-depth-maps", "--live-view", "--live-address", "--delete-workspace"};
constexpr std::array kMachineOptions{"--threads",   "--device",  "--backend",    "--simd",
                                     "--pipelined", "--scratch", kKeepWorkspaces};
constexpr std::array kFilesToRead{"--config",    "--mask", "--prior-depth", "--scratch",    "--align",
                                  "--transform", "--crs",  "--points",      "--image-list", "--camera-from-body"};
constexpr const char* kFormat = "--format";
constexpr std::array kFoldersForResults{"--depth-maps", "--preview"};
constexpr const char* kReport = "--report";

template <std::size_t N>
bool is_one_of(const std::array<const char*, N>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

bool is_plain_name(const std::string& name) {
  return !name.empty() && name[0] != '.' && fs::path(name).filename() == name;
}

std::string value_for_mission(const std::string& name, const std::string& value, const fs::path& folder) {
  if (name == kFormat) formats_in({name + "=" + value});
  if (value.empty()) return value;
  if (is_file_to_read(name + "=" + value)) return fs::absolute(folder / value).lexically_normal().string();
  const bool is_taken = value == "work" || value.rfind("cloud.", 0) == 0 || value.find(".json") != std::string::npos ||
                        value == "log.txt";
  if (is_one_of(kFoldersForResults, name) && (is_taken || !is_plain_name(value))) {
    throw UsageError(name + " is \"" + value +
                     "\"; in a batch expected the name of a directory in that of the mission, such as \"depth\"");
  }
  const bool is_page = is_plain_name(value) && fs::path(value).extension() == ".html";
  if (name == kReport && !is_page) {
    throw UsageError(
        name + " is \"" + value +
        "\"; in a batch expected the name of a file in the directory of the mission, such as \"report.html\"");
  }
  return value;
}

}  // namespace

void add_mission_options(CLI::App& app, const fs::path& folder, std::vector<std::string>& result) {
  for (const RunOption& option : run_options()) {
    if (is_one_of(kOfBatch, option.name) || app.get_option_no_throw(option.name) != nullptr) continue;
    const auto take = [&result, folder, name = option.name](const std::string& value) {
      result.push_back(name + "=" + value_for_mission(name, value, folder));
    };
    if (option.takes_value) {
      app.add_option_function<std::string>(option.names, take)->take_last()->group("");
    } else {
      app.add_flag_function(option.names, [take](std::int64_t count) { take(count > 0 ? "true" : "false"); })
          ->group("");
    }
  }
}

void refuse_words_for_missions(const CLI::App& app) {
  const std::vector<std::string> extras = app.remaining();
  if (extras.empty()) return;
  const std::string name = name_of_option(extras.front());
  for (const RunOption& option : run_options()) {
    const bool is_this = ("," + option.names + ",").find("," + name + ",") != std::string::npos;
    if (is_this) throw UsageError(name + " is not available in a batch; omit it (see batch --help)");
  }
  refuse_extra_words(app);
}

std::vector<std::string> mission_options(std::vector<std::string> words, const fs::path& folder) {
  std::vector<std::string> result;
  CLI::App app;
  app.set_help_flag();
  app.allow_extras();
  add_mission_options(app, folder, result);
  spell_out_switches(words);
  parse_words(app, std::move(words));
  refuse_words_for_missions(app);
  return result;
}

std::vector<const CloudFormat*> formats_in(const std::vector<std::string>& options) {
  std::string names = value_in(options, kFormat);
  if (names.empty()) names = "ply";
  std::vector<const CloudFormat*> formats;
  std::string known;
  for (const CloudFormat& format : cloud_formats()) known += (known.empty() ? "" : ", ") + std::string(format.name);
  for (std::size_t at = 0; at <= names.size();) {
    const std::size_t end = std::min(names.find(',', at), names.size());
    const CloudFormat* const format = find_cloud_format(names.substr(at, end - at));
    if (format == nullptr || std::find(formats.begin(), formats.end(), format) != formats.end()) {
      throw UsageError("--format is \"" + names + "\"; in a batch expected one or several of " + known +
                       ", with commas between them, each once");
    }
    formats.push_back(format);
    at = end + 1;
  }
  return formats;
}

bool is_machine_option(const std::string& option) { return is_one_of(kMachineOptions, name_of_option(option)); }

bool is_file_to_read(const std::string& option) {
  const std::string name = name_of_option(option), value = value_of(option);
  const bool is_word =
      (name == "--align" && value == kAlignExif) || (name == "--mask" && (value == kMaskAuto || value == kMaskNone));
  return is_one_of(kFilesToRead, name) && !value.empty() && !is_word;
}

std::string name_of_option(const std::string& option) { return option.substr(0, option.find('=')); }

std::string value_of(const std::string& option) {
  const std::size_t equals = option.find('=');
  return equals == std::string::npos ? "" : option.substr(equals + 1);
}

std::string value_in(const std::vector<std::string>& options, const std::string& name) {
  const auto last =
      std::find_if(options.rbegin(), options.rend(), [&](const std::string& it) { return name_of_option(it) == name; });
  return last != options.rend() ? value_of(*last) : "";
}

std::vector<std::string> run_options_in(const fs::path& folder, const std::vector<std::string>& options) {
  std::vector<std::string> result;
  for (const std::string& option : options) {
    const std::string name = name_of_option(option);
    if (name == kFormat || name == kKeepWorkspaces) continue;
    const bool is_result = is_one_of(kFoldersForResults, name) || name == kReport;
    result.push_back(is_result ? name + "=" + (folder / value_of(option)).string() : option);
  }
  return result;
}

std::string difference(const std::vector<std::string>& recorded, const std::vector<std::string>& given) {
  for (const std::string& option : given) {
    if (is_machine_option(option) || std::find(recorded.begin(), recorded.end(), option) != recorded.end()) continue;
    const std::string before = value_in(recorded, name_of_option(option));
    return "recorded " + (before.empty() ? "none" : name_of_option(option) + "=" + before) + ", given " + option;
  }
  return "";
}

std::vector<std::string> merged(std::vector<std::string> recorded, const std::vector<std::string>& given) {
  const auto is_given = [&](const std::string& option) {
    return std::any_of(given.begin(), given.end(),
                       [&](const std::string& it) { return name_of_option(it) == name_of_option(option); });
  };
  recorded.erase(std::remove_if(recorded.begin(), recorded.end(), is_given), recorded.end());
  recorded.insert(recorded.end(), given.begin(), given.end());
  return recorded;
}

std::string command_text(const std::vector<std::string>& words) {
  const char* plain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=./,:@%";
  std::string text;
  for (const std::string& word : words) {
    if (!text.empty()) text += " ";
    if (!word.empty() && word.find_first_not_of(plain) == std::string::npos) {
      text += word;
      continue;
    }
    text += "'";
    for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
    text += "'";
  }
  return text;
}

std::vector<std::string> split_words(const std::string& line) {
  std::vector<std::string> words;
  char quote = 0;
  bool inside = false;
  for (const char c : line) {
    if (quote != 0 ? c == quote : c == '"' || c == '\'') {
      quote = quote != 0 ? '\0' : c;
      if (!inside) words.emplace_back();
      inside = true;
    } else if (quote == 0 && (c == ' ' || c == '\t')) {
      inside = false;
    } else {
      if (!inside) words.emplace_back();
      inside = true;
      words.back() += c;
    }
  }
  if (quote != 0) throw UsageError(std::string("a quote (") + quote + ") is not closed: " + line);
  return words;
}

}  // namespace pmsp::tool
