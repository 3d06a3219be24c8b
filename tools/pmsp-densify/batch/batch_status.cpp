// SPDX-License-Identifier: BSD-2-Clause
#include "batch_status.h"

#include <array>
#include <ctime>
#include <system_error>
#include <utility>

#include "depth_output.h"
#include "pmsp/error.h"
#include "pmsp/io/files.h"

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFile = "status.json";
constexpr std::array kStates{std::pair(MissionState::kWaiting, "waiting"), std::pair(MissionState::kRunning, "running"),
                             std::pair(MissionState::kInterrupted, "interrupted"),
                             std::pair(MissionState::kDone, "done"), std::pair(MissionState::kFailed, "failed")};

MissionState state_from(const std::string& name) {
  for (const auto& [state, text] : kStates) {
    if (name == text) return state;
  }
  throw InvalidInput("there is no state \"" + name + "\"");
}

template <class T>
void put(nlohmann::ordered_json& json, const char* key, const std::optional<T>& value) {
  if (value) json[key] = *value;
}

template <class T>
std::optional<T> get(const nlohmann::json& json, const char* key) {
  return json.contains(key) ? std::optional<T>(json.at(key).get<T>()) : std::nullopt;
}

MissionStatus status_from(const nlohmann::json& json) {
  MissionStatus status;
  status.state = state_from(json.at("state").get<std::string>());
  status.reason = json.value("reason", "");
  status.exit_code = get<int>(json, "exit_code");
  status.signal = get<int>(json, "signal");
  status.process = get<std::int64_t>(json, "process");
  status.started = json.value("started", "");
  status.finished = json.value("finished", "");
  status.seconds = json.value("seconds", 0.0);
  status.peak_memory_mib = json.value("peak_memory_mib", 0.0);
  status.points = get<std::int64_t>(json, "points");
  status.fingerprint = json.at("fingerprint").get<std::string>();
  status.command = json.value("command", std::vector<std::string>());
  status.keeps_workspace = json.value("keeps_workspace", false);
  return status;
}

}  // namespace

const char* name_of(MissionState state) {
  for (const auto& [known, text] : kStates) {
    if (state == known) return text;
  }
  return "";
}

nlohmann::ordered_json to_json(const MissionStatus& status) {
  nlohmann::ordered_json json{{"state", name_of(status.state)}};
  if (!status.reason.empty()) json["reason"] = status.reason;
  put(json, "points", status.points);
  put(json, "exit_code", status.exit_code);
  put(json, "signal", status.signal);
  put(json, "process", status.process);
  if (!status.started.empty()) json["started"] = status.started;
  if (!status.finished.empty()) json["finished"] = status.finished;
  if (!status.started.empty() && !status.finished.empty()) {
    json["seconds"] = status.seconds;
    json["peak_memory_mib"] = status.peak_memory_mib;
  }
  json["fingerprint"] = status.fingerprint;
  json["keeps_workspace"] = status.keeps_workspace;
  json["command"] = status.command;
  return json;
}

std::optional<MissionStatus> read_status(const fs::path& folder) {
  const fs::path path = folder / kFile;
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return std::nullopt;
  const std::string text = read_whole_file(path);
  try {
    return status_from(nlohmann::json::parse(text));
  } catch (const std::exception& error) {
    throw InvalidInput(path.string() + ": is no status of a mission (" + error.what() +
                       "); delete the folder, or name another one with -o");
  }
}

bool is_unfinished_status(const std::string& name) { return target_of_temporary(name) == kFile; }

void write_status(const fs::path& folder, const MissionStatus& status) {
  write_file(folder / kFile, json_text(to_json(status)));
}

std::string time_text() {
  const std::time_t now = std::time(nullptr);
  std::tm utc = {};
  gmtime_r(&now, &utc);
  char text[32];
  std::strftime(text, sizeof(text), "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text;
}

}  // namespace pmsp::tool
