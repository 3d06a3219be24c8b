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
#include "pmsp/io/cloud_frame.h"

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;

/// What batch says for each mission, or has a column or an option of its own for.
constexpr std::array kOfBatch{"--images",    "--video",          "--output",    "--force",        "--stats",
                              "--workspace", "--growing",        "--follow",    "--until-idle",   "--progress",
                              "--quiet",     "--raw-depth-maps", "--live-view", "--live-address", "--delete-workspace"};
constexpr std::array kOfMachine{"--threads", "--device", "--backend", "--simd", "--pipelined", "--scratch"};
constexpr std::array kFilesToRead{"--config", "--mask",      "--prior-depth", "--scratch",
                                  "--align",  "--transform", "--crs"};
constexpr const char* kFormat = "--format";
constexpr std::array kFoldersForResults{"--depth-maps", "--preview"};
constexpr const char* kReport = "--report";

template <std::size_t N>
bool is_one_of(const std::array<const char*, N>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

std::string name_of_option(const std::string& option) { return option.substr(0, option.find('=')); }

bool is_plain_name(const std::string& name) {
  return !name.empty() && name[0] != '.' && fs::path(name).filename() == name;
}

std::string value_for_mission(const std::string& name, const std::string& value, const fs::path& folder) {
  if (name == "--format") formats_in({name + "=" + value});
  if (name == "--align" && value == kAlignExif) return value;
  if (is_one_of(kFilesToRead, name)) return (folder / value).string();
  const bool is_taken = value == "work" || value.rfind("cloud.", 0) == 0 || value.find(".json") != std::string::npos ||
                        value == "log.txt";
  if (is_one_of(kFoldersForResults, name) && (is_taken || !is_plain_name(value))) {
    throw UsageError(name + " is \"" + value +
                     "\"; in a batch expected the name of a folder in that of the mission, such as \"depth\"");
  }
  const bool is_page = is_plain_name(value) && fs::path(value).extension() == ".html";
  if (name == kReport && !is_page) {
    throw UsageError(
        name + " is \"" + value +
        "\"; in a batch expected the name of a file in the folder of the mission, such as \"report.html\"");
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
    if (is_this) throw UsageError(name + " is not for missions of a batch; leave it out (see batch --help)");
  }
  refuse_extra_words(app);
}

MissionOptions::MissionOptions(const fs::path& folder) : app_(std::make_unique<CLI::App>()) {
  app_->set_help_flag();
  app_->allow_extras();
  add_mission_options(*app_, folder, result_);
}

MissionOptions::~MissionOptions() = default;

std::vector<std::string> MissionOptions::read(std::vector<std::string> words) {
  result_.clear();
  spell_out_switches(words);
  parse_words(*app_, std::move(words));
  refuse_words_for_missions(*app_);
  return result_;
}

std::vector<const CloudFormat*> formats_in(const std::vector<std::string>& options) {
  std::string names = "ply";
  for (const std::string& option : options) {
    if (name_of_option(option) == kFormat) names = value_of(option, kFormat);
  }
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

std::vector<std::string> without_formats(std::vector<std::string> options) {
  const auto is_format = [](const std::string& option) { return name_of_option(option) == kFormat; };
  options.erase(std::remove_if(options.begin(), options.end(), is_format), options.end());
  return options;
}

bool is_of_machine(const std::string& option) { return is_one_of(kOfMachine, name_of_option(option)); }

std::string value_of(const std::string& option, const std::string& name) {
  return option.rfind(name + "=", 0) == 0 ? option.substr(name.size() + 1) : "";
}

std::vector<std::string> options_in(const fs::path& folder, const std::vector<std::string>& options) {
  std::vector<std::string> result = options;
  for (std::string& option : result) {
    for (const char* name : {kFoldersForResults[0], kFoldersForResults[1], kReport}) {
      const std::string value = value_of(option, name);
      if (!value.empty()) option = std::string(name) + "=" + (folder / value).string();
    }
  }
  return result;
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
