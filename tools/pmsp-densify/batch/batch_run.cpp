// SPDX-License-Identifier: BSD-2-Clause
#include "batch_run.h"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <exception>
#include <fstream>
#include <map>
#include <system_error>

#include <nlohmann/json.hpp>

#include "arguments.h"
#include "batch_options.h"
#include "export/files.h"
#include "export/folder_lock.h"
#include "file_state.h"
#include "pmsp/error.h"
#include "workspace/fingerprint.h"

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;

void add_option(workspace::Fingerprint& fingerprint, const std::string& option) {
  if (is_machine_option(option)) return;
  if (!is_file_to_read(option)) {
    fingerprint.add(option);
    return;
  }
  const std::string file = value_of(option);
  fingerprint.add(name_of_option(option)).add(state_of(file));
  std::error_code ignored;
  if (fs::is_directory(file, ignored)) fingerprint.add(state_of_files_in(file));
}

bool is_locked(const fs::path& folder) {
  try {
    const FolderLock lock(folder, kLockedFolder);
    return false;
  } catch (const OutputError&) {
    return true;
  }
}

/// True if there are files besides the lock and a temporary status, which a killed batch may leave.
bool holds_anything(const fs::path& folder) {
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (name != FolderLock::kName && !is_unfinished_status(name)) return true;
  }
  return false;
}

}  // namespace

std::vector<fs::path> clouds_of(const BatchMission& mission) {
  std::vector<fs::path> clouds;
  for (const CloudFormat* format : formats_in(mission.options)) clouds.push_back(cloud_of(mission.folder, *format));
  return clouds;
}

std::optional<fs::path> report_of(const BatchMission& mission) {
  const std::string name = value_in(mission.options, "--report");
  return name.empty() ? std::nullopt : std::optional<fs::path>(mission.folder / name);
}

bool has_results(const BatchMission& mission) {
  std::vector<fs::path> results = clouds_of(mission);
  if (const auto page = report_of(mission)) results.push_back(*page);
  std::error_code ignored;
  return std::all_of(results.begin(), results.end(), [&](const fs::path& it) { return fs::exists(it, ignored); });
}

bool has_state(const MissionStatus& status, const char* state) { return text_in(status, "state") == state; }

void refuse(BatchMission& mission, const std::string& reason) {
  mission.status["state"] = kFailed;
  mission.status["reason"] = reason;
}

void look_at(BatchMission& mission) {
  mission.status = {{"state", kWaiting}};
  if (!mission.mission.error.empty()) return refuse(mission, mission.mission.error);
  try {
    const std::optional<MissionStatus> status = read_status(mission.folder);
    if (!status && holds_anything(mission.folder)) {
      throw OutputError(mission.folder.string() +
                        ": exists and is no result of a batch; give the mission another \"name\", or another -o");
    }
    if (!status || (has_state(*status, kDone) && !has_results(mission))) return;
    mission.status = *status;
    if (has_state(*status, kRunning) && !is_locked(mission.folder)) mission.status["state"] = kInterrupted;
  } catch (const std::exception& error) {
    refuse(mission, error.what());
  }
}

std::vector<std::string> run_words(const BatchMission& mission, const std::string& program, const fs::path& inputs) {
  const Mission& m = mission.mission;
  const fs::path& folder = mission.folder;
  std::vector<std::string> words{program, "run", (inputs / m.map).string()};
  words.push_back(m.video.empty() ? "--images=" + (inputs / m.images).string()
                                  : "--video=" + (inputs / m.video).string());
  for (std::string& option : run_options_in(folder, mission.options)) words.push_back(std::move(option));
  if (!m.mask.empty()) words.push_back("--mask=" + (inputs / m.mask).string());
  words.push_back("--workspace=" + workspace_of(folder).string());
  if (value_in(mission.options, kKeepWorkspaces) != "true") words.emplace_back("--delete-workspace");
  for (const fs::path& cloud : clouds_of(mission)) words.push_back("--output=" + cloud.string());
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

std::string fingerprint_of(const Mission& mission, const std::vector<std::string>& options, const fs::path& inputs) {
  workspace::Fingerprint fingerprint;
  for (const std::string* name : {&mission.map, &mission.images, &mission.video, &mission.mask}) {
    fingerprint.add(fs::path(*name).filename().string());
    fingerprint.add(name->empty() ? std::string() : state_of(inputs / *name));
  }
  fingerprint.add(state_of_map(inputs / mission.map));
  if (!mission.images.empty()) fingerprint.add(state_of_files_in(inputs / mission.images));
  std::map<std::string, std::string> in_force;  // independent of the order on the command line
  for (const std::string& option : options) in_force[name_of_option(option)] = option;
  for (const auto& [name, option] : in_force) add_option(fingerprint, option);
  return fingerprint.text();
}

bool has_inputs(const Mission& mission, const fs::path& inputs) {
  std::error_code ignored;
  return fs::exists(inputs / mission.map, ignored) &&
         fs::exists(inputs / (mission.video.empty() ? mission.images : mission.video), ignored);
}

std::size_t begin_log(const fs::path& log, const MissionStatus& status) {
  std::ofstream file(log, std::ios::binary | std::ios::app);
  if (file.tellp() > 0) file << "\n";
  file << text_in(status, "started") << ", host " << text_in(status, "host") << ", " << text_in(status, "version")
       << "\n"
       << command_text(status["command"]) << "\n"
       << std::flush;
  if (!file) throw OutputError(log.string() + ": cannot be written: " + std::strerror(errno));
  return static_cast<std::size_t>(file.tellp());
}

std::string reason_of(const ChildEnd& end, const fs::path& log, std::size_t begin) {
  if (end.signal) {
    const std::string text = "killed by signal " + std::to_string(*end.signal) + " (" + strsignal(*end.signal) + ")";
    return *end.signal == SIGKILL ? text + "; memory may have run out" : text;
  }
  constexpr std::streamoff kTail = 1 << 16;
  std::ifstream file(log, std::ios::binary | std::ios::ate);
  const std::streamoff size = file ? static_cast<std::streamoff>(file.tellg()) : 0;
  file.seekg(std::max<std::streamoff>(size - kTail, static_cast<std::streamoff>(begin)));
  const std::string prefix = "pmsp-densify: ";
  std::string last, error;
  for (std::string line; std::getline(file, line);) {
    if (line.rfind(prefix, 0) == 0) error = line.substr(prefix.size());
    if (!line.empty()) last = line;
  }
  if (!error.empty()) return error;
  return last.empty() ? "ended with exit code " + std::to_string(*end.exit_code) : last;
}

std::string warning_in(const fs::path& log) {
  std::ifstream file(log, std::ios::binary);
  for (std::string line; std::getline(file, line);) {
    if (line.rfind("warning: ", 0) == 0 && line.rfind("warning: keyframe ", 0) != 0) return line;
  }
  return "";
}

void read_stats(const fs::path& stats, MissionStatus& status) {
  try {
    const nlohmann::json json = nlohmann::json::parse(read_whole_file(stats));
    for (const char* key : {"points", "coverage", "confidence"}) {
      if (json.contains(key)) status[key] = json[key];
    }
    if (json.contains("pairing")) status["fit"] = json["pairing"].at("fit");
    if (!json.value("warnings", nlohmann::json::array()).empty()) {
      status["reason"] = "warning: " + json["warnings"].front().get<std::string>();
    }
  } catch (const std::exception&) {  // optional: the cloud exists
  }
}

std::vector<int> devices_of_job(std::size_t job, std::size_t jobs, const std::vector<int>& devices) {
  if (devices.empty()) return {};
  if (devices.size() <= jobs) return {devices[job % devices.size()]};
  std::vector<int> shared;
  for (std::size_t i = job; i < devices.size(); i += jobs) shared.push_back(devices[i]);
  return shared;
}

}  // namespace pmsp::tool
