// SPDX-License-Identifier: BSD-2-Clause
#include "batch_report.h"

#include <algorithm>
#include <array>
#include <cstdio>

#include "arguments.h"
#include "progress.h"

namespace pmsp::tool {
namespace {

constexpr std::size_t kColumns = 6;
using Row = std::array<std::string, kColumns>;

std::string fixed(double value, int decimals) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.*f", decimals, value);
  return text;
}

Row row_of(const BatchMission& mission) {
  const MissionStatus& s = mission.status;
  const bool has_ended = !s.started.empty() && !s.finished.empty();
  return {mission.mission.name,
          name_of(s.state),
          s.points ? count_text(*s.points) : "-",
          has_ended ? fixed(s.seconds, 1) : "-",
          has_ended ? fixed(s.peak_memory_mib, 0) : "-",
          s.reason};
}

bool is_number(std::size_t column) { return column >= 2 && column <= 4; }

}  // namespace

std::size_t BatchReport::count(MissionState state) const {
  return static_cast<std::size_t>(std::count_if(missions.begin(), missions.end(), [state](const BatchMission& mission) {
    return mission.status.state == state;
  }));
}

std::string table_text(const BatchReport& report) {
  std::vector<Row> rows{{"mission", "state", "points", "seconds", "MiB", "reason"}};
  for (const BatchMission& mission : report.missions) rows.push_back(row_of(mission));
  std::array<std::size_t, kColumns> widths = {};
  for (const Row& row : rows) {
    for (std::size_t i = 0; i < kColumns; ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  std::string text;
  for (const Row& row : rows) {
    std::string line;
    for (std::size_t i = 0; i < kColumns; ++i) {
      const std::string padding(widths[i] - row[i].size(), ' ');
      line += (i > 0 ? "  " : "") + (is_number(i) ? padding + row[i] : row[i] + padding);
    }
    text += line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
  }
  return text;
}

std::string summary(const BatchReport& report) {
  const auto before = std::count_if(report.missions.begin(), report.missions.end(), [](const BatchMission& mission) {
    return mission.status.state == MissionState::kDone && !mission.has_run;
  });
  std::string text = std::to_string(report.count(MissionState::kDone)) + " of " +
                     std::to_string(report.missions.size()) + " missions done";
  if (before > 0) text += " (" + std::to_string(before) + " of them before)";
  text += ", " + std::to_string(report.count(MissionState::kFailed)) + " failed";
  for (const MissionState state : {MissionState::kRunning, MissionState::kInterrupted, MissionState::kWaiting}) {
    if (report.count(state) > 0) text += ", " + std::to_string(report.count(state)) + " " + name_of(state);
  }
  return text + "; " + duration_text(report.seconds);
}

nlohmann::ordered_json to_json(const BatchMission& mission) {
  nlohmann::ordered_json json{{"name", mission.mission.name}, {"line", mission.mission.line}};
  json.update(to_json(mission.status));
  json["has_run"] = mission.has_run;
  return json;
}

nlohmann::ordered_json to_json(const BatchReport& report) {
  nlohmann::ordered_json json{{"generator", version_text()}, {"manifest", report.manifest}};
  for (const MissionState state : {MissionState::kDone, MissionState::kFailed, MissionState::kRunning,
                                   MissionState::kInterrupted, MissionState::kWaiting}) {
    json[name_of(state)] = report.count(state);
  }
  json["seconds"] = report.seconds;
  json["missions"] = nlohmann::ordered_json::array();
  for (const BatchMission& mission : report.missions) json["missions"].push_back(to_json(mission));
  return json;
}

}  // namespace pmsp::tool
