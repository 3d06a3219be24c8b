// SPDX-License-Identifier: BSD-2-Clause
#include "batch_run.h"

#include <algorithm>
#include <csignal>
#include <cstring>
#include <exception>
#include <fstream>

#include <nlohmann/json.hpp>

#include "arguments.h"
#include "batch_options.h"
#include "file_state.h"
#include "pmsp/io/files.h"
#include "pmsp/io/workspace/fingerprint.h"

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;

/// A file's name as a word of a command line, where a leading "-" would make it an option.
std::string as_word(const fs::path& path) {
  const std::string text = path.string();
  return !text.empty() && text[0] == '-' ? "./" + text : text;
}

/// The last thing that a run said in its log, which is why it failed.
std::string last_words(const fs::path& log) {
  constexpr std::streamoff kTail = 1 << 16;
  std::ifstream file(log, std::ios::binary | std::ios::ate);
  const std::streamoff size = file ? static_cast<std::streamoff>(file.tellg()) : 0;
  file.seekg(std::max<std::streamoff>(size - kTail, 0));
  const std::string prefix = "pmsp-densify: ";
  std::string last, error;
  for (std::string line; std::getline(file, line);) {
    if (line.rfind(prefix, 0) == 0) error = line.substr(prefix.size());
    if (!line.empty()) last = line;
  }
  return error.empty() ? last : error;
}

void add_option(workspace::Fingerprint& fingerprint, const std::string& option) {
  if (is_of_machine(option)) return;
  for (const char* name : {"--config", "--mask", "--prior-depth"}) {
    const std::string file = value_of(option, name);
    if (file.empty()) continue;
    fingerprint.add(name).add(state_of(file));
    std::error_code ignored;
    if (fs::is_directory(file, ignored)) fingerprint.add(state_of_files_in(file));
    return;
  }
  fingerprint.add(option);
}

}  // namespace

std::vector<fs::path> clouds_of(const BatchMission& mission, const BatchArguments& batch) {
  std::vector<std::string> options = batch.options;
  options.insert(options.end(), mission.mission.options.begin(), mission.mission.options.end());
  std::vector<fs::path> clouds;
  for (const CloudFormat* format : formats_in(options)) clouds.push_back(cloud_of(mission.folder, *format));
  return clouds;
}

std::optional<fs::path> report_of(const BatchMission& mission, const BatchArguments& batch) {
  std::string name;
  for (const auto* options : {&batch.options, &mission.mission.options}) {
    for (const std::string& option : *options) {
      const std::string value = value_of(option, "--report");
      if (!value.empty()) name = value;
    }
  }
  return name.empty() ? std::nullopt : std::optional<fs::path>(mission.folder / name);
}

std::vector<std::string> run_words(const BatchMission& mission, const BatchArguments& batch, const fs::path& inputs) {
  const Mission& m = mission.mission;
  const fs::path& folder = mission.folder;
  std::vector<std::string> words{batch.program, "run", as_word(inputs / m.map)};
  words.push_back(m.video.empty() ? "--images=" + (inputs / m.images).string()
                                  : "--video=" + (inputs / m.video).string());
  for (const auto* options : {&batch.options, &m.options}) {
    const std::vector<std::string> here = without_formats(options_in(folder, *options));
    words.insert(words.end(), here.begin(), here.end());
  }
  if (!m.mask.empty()) words.push_back("--mask=" + (inputs / m.mask).string());
  words.push_back("--workspace=" + workspace_of(folder).string());
  if (!batch.keep_workspaces) words.emplace_back("--delete-workspace");
  for (const fs::path& cloud : clouds_of(mission, batch)) words.push_back("--output=" + cloud.string());
  words.push_back("--stats=" + stats_of(folder).string());
  words.insert(words.end(), {"--force", "--progress=plain"});
  return words;
}

void check_run_words(const std::vector<std::string>& words) {
  std::vector<const char*> argv;
  argv.reserve(words.size());
  for (const std::string& word : words) argv.push_back(word.c_str());
  const auto arguments = parse_arguments(static_cast<int>(argv.size()), argv.data());
  if (arguments) effective_options(*arguments);
}

std::string fingerprint_of(const Mission& mission, const BatchArguments& batch, const fs::path& inputs) {
  workspace::Fingerprint fingerprint;
  for (const std::string* name : {&mission.map, &mission.images, &mission.video, &mission.mask}) {
    fingerprint.add(*name).add(name->empty() ? std::string() : state_of(inputs / *name));
  }
  fingerprint.add(state_of_map(inputs / mission.map));
  if (!mission.images.empty()) fingerprint.add(state_of_files_in(inputs / mission.images));
  for (const auto* options : {&batch.options, &mission.options}) {
    for (const std::string& option : *options) add_option(fingerprint, option);
  }
  return fingerprint.text();
}

std::string reason_of(const ChildEnd& end, const fs::path& log) {
  if (end.signal) {
    const std::string text = "killed by signal " + std::to_string(*end.signal) + " (" + strsignal(*end.signal) + ")";
    return *end.signal == SIGKILL ? text + "; memory may have run out" : text;
  }
  const std::string words = last_words(log);
  return words.empty() ? "ended with exit code " + std::to_string(*end.exit_code) : words;
}

std::optional<std::int64_t> points_in(const fs::path& stats) {
  try {
    return nlohmann::json::parse(read_whole_file(stats)).at("points").get<std::int64_t>();
  } catch (const std::exception&) {
    return std::nullopt;  // the cloud is there all the same
  }
}

}  // namespace pmsp::tool
