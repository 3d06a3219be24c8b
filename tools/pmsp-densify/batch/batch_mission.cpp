// SPDX-License-Identifier: BSD-2-Clause
#include "batch_mission.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <ctime>
#include <exception>
#include <fstream>
#include <map>
#include <optional>
#include <system_error>

#include <nlohmann/json.hpp>

#include "arguments.h"
#include "batch_arguments.h"
#include "export/files.h"
#include "export/folder_lock.h"
#include "options.h"
#include "pmsp/error.h"
#include "tool_files.h"
#include "util/text.h"
#include "web/web_path.h"
#include "workspace/fingerprint.h"

namespace pmsp::tool {

namespace fs = std::filesystem;

namespace {

constexpr const char* kFile = "status.json";

}  // namespace

std::string text_in(const MissionStatus& status, const char* key) {
  return status.contains(key) && status[key].is_string() ? status[key].get<std::string>() : "";
}

std::optional<MissionStatus> read_status(const fs::path& folder) {
  const fs::path path = folder / kFile;
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return std::nullopt;
  MissionStatus status = MissionStatus::parse(read_whole_file(path), nullptr, false);
  const std::string state = text_in(status, "state");
  if (!text_in(status, "fingerprint").empty() &&
      (state == kRunning || state == kInterrupted || state == kDone || state == kFailed)) {
    return status;
  }
  throw InvalidInput(path.string() + ": is no status of a mission; delete the directory, or give another one with -o");
}

void write_status(const fs::path& folder, const MissionStatus& status) {
  write_file(folder / kFile, json_text(status));
}

std::string time_text() {
  const std::time_t now = std::time(nullptr);
  std::tm utc = {};
  gmtime_r(&now, &utc);
  char text[32];
  std::strftime(text, sizeof(text), "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text;
}

namespace {

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
  const std::vector<fs::path> entries = entries_in(folder);
  return std::any_of(entries.begin(), entries.end(), [](const fs::path& entry) {
    const std::string name = entry.filename().string();
    return name != FolderLock::kName && target_of_temporary(name) != kFile;
  });
}

}  // namespace

std::vector<fs::path> clouds_of(const BatchMission& mission) {
  std::vector<fs::path> clouds;
  for (const CloudFormat* format : formats_in(mission.options)) {
    clouds.push_back(mission.folder / ("cloud" + std::string(format->extension)));
  }
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

namespace {

struct Column {
  const char* name;
  const char* key;       ///< of the status; nullptr = name of the mission
  int decimals;          ///< -1 = text
  bool is_brief = true;  ///< included in tables for people
};
constexpr std::array kColumns{Column{"mission", nullptr, -1},
                              Column{"state", "state", -1},
                              Column{"points", "points", 0},
                              Column{"coverage", "coverage", 3},
                              Column{"confidence", "confidence", 3},
                              Column{"fit", "fit", 3},
                              Column{"seconds", "seconds", 1},
                              Column{"MiB", "peak_memory_mib", 0},
                              Column{"host", "host", -1, false},
                              Column{"version", "version", -1, false},
                              Column{"exit_code", "exit_code", 0, false},
                              Column{"reason", "reason", -1}};
using Row = std::array<std::string, kColumns.size()>;

std::string cell_of(const BatchMission& mission, const Column& column) {
  if (column.key == nullptr) return mission.mission.name;
  if (column.decimals < 0) return text_in(mission.status, column.key);
  if (!mission.status.contains(column.key) || !mission.status[column.key].is_number()) return "";
  return format("%.*f", column.decimals, mission.status[column.key].get<double>());
}

Row row_of(const BatchMission& mission) {
  Row row;
  for (std::size_t i = 0; i < row.size(); ++i) row[i] = cell_of(mission, kColumns[i]);
  return row;
}

/// Quotes as RFC 4180.
std::string csv_cell(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string csv_line(const Row& row) {
  std::string line;
  for (std::size_t i = 0; i < row.size(); ++i) line += (i > 0 ? "," : "") + csv_cell(row[i]);
  return line + "\n";
}

Row head() {
  Row row;
  std::transform(kColumns.begin(), kColumns.end(), row.begin(), [](const Column& column) { return column.name; });
  return row;
}

constexpr const char* kBegin =
    "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
    "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
    "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n"
    "<title>Batch</title>\n<style>\n"
    ":root { color-scheme: light; }\n"
    "body { font: 16px/1.5 system-ui, sans-serif; color: #1b2126; background: #fff; max-width: 75rem; margin: 0 auto; "
    "padding: 0.5rem 1rem; }\n"
    ".table { overflow-x: auto; }\n"
    "table { border-collapse: collapse; }\n"
    "th, td { text-align: left; padding: 0.2rem 1rem 0.2rem 0; border-bottom: 1px solid #c9d0d5; vertical-align: top; "
    "overflow-wrap: anywhere; }\n"
    ".number { text-align: right; white-space: nowrap; }\n"
    ".failed { color: #a11b14; font-weight: 600; }\n"
    "a { color: #0b57a4; }\n"
    "</style>\n</head>\n<body>\n<main>\n";

std::string cell(const std::string& html, const char* kind = "") {
  return (*kind != '\0' ? "<td class=\"" + std::string(kind) + "\">" : "<td>") + html + "</td>";
}

/// HTML link; "" if the file is missing.
std::string link(const fs::path& from, const fs::path& to, const std::string& words) {
  if (!is_file(to)) return "";
  const std::string address = web::relative_address(to.lexically_relative(from).generic_string());
  return "<a href=\"" + web::html_text(address) + "\">" + web::html_text(words) + "</a>";
}

std::string html_row(const BatchMission& mission, const fs::path& folder) {
  const Row row = row_of(mission);
  const std::optional<fs::path> report = report_of(mission);
  std::string name = report ? link(folder, *report, row[0]) : "";
  if (name.empty()) name = web::html_text(row[0]);
  std::string html = "<tr>" + cell(name);
  for (std::size_t i = 1; i < row.size(); ++i) {
    const bool is_failed = i == 1 && row[1] == kFailed;
    if (kColumns[i].is_brief)
      html += cell(web::html_text(row[i]), is_failed ? "failed" : kColumns[i].decimals >= 0 ? "number" : "");
  }
  std::vector<fs::path> paths = clouds_of(mission);
  paths.insert(paths.end(), {stats_of(mission.folder), log_of(mission.folder)});
  std::string files;
  for (const fs::path& path : paths) {
    const std::string one = link(folder, path, path.filename().string());
    files += (files.empty() || one.empty() ? "" : ", ") + one;
  }
  return html + cell(files) + "</tr>\n";
}

}  // namespace

std::size_t count(const BatchMissions& missions, const char* state) {
  return static_cast<std::size_t>(std::count_if(missions.begin(), missions.end(),
                                                [&](const BatchMission& it) { return has_state(it.status, state); }));
}

std::string summary(const BatchMissions& missions) {
  std::string text = std::to_string(count(missions, kDone)) + " of " + std::to_string(missions.size()) +
                     " missions done, " + std::to_string(count(missions, kFailed)) + " failed";
  for (const char* state : {kRunning, kInterrupted, kWaiting}) {
    const std::size_t others = count(missions, state);
    if (others > 0) text += ", " + std::to_string(others) + " " + state;
  }
  return text;
}

std::string table_text(const BatchMissions& missions) {
  std::vector<Row> rows{head()};
  for (const BatchMission& mission : missions) {
    rows.push_back(row_of(mission));
    for (std::size_t i = 0; i < kColumns.size(); ++i) {
      if (kColumns[i].decimals >= 0 && rows.back()[i].empty()) rows.back()[i] = "-";
    }
  }
  std::array<std::size_t, kColumns.size()> widths = {};
  for (const Row& row : rows) {
    for (std::size_t i = 0; i < widths.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  std::string text;
  for (const Row& row : rows) {
    std::string line;
    for (std::size_t i = 0; i < widths.size(); ++i) {
      if (!kColumns[i].is_brief) continue;
      const std::string padding(widths[i] - row[i].size(), ' ');
      line += (i > 0 ? "  " : "") + (kColumns[i].decimals >= 0 ? padding + row[i] : row[i] + padding);
    }
    text += line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
  }
  return text;
}

std::string checks_text(const BatchMissions& missions) {
  std::string text;
  for (const BatchMission& mission : missions) {
    const std::string state = text_in(mission.status, "state"), reason = text_in(mission.status, "reason");
    text += mission.mission.name + ": " +
            (state == kDone     ? "ok"
             : state == kFailed ? "refused"
                                : state) +
            (reason.empty() ? "" : ": " + reason) + "\n";
  }
  return text + std::to_string(count(missions, kDone)) + " of " + std::to_string(missions.size()) +
         " missions can be run, " + std::to_string(count(missions, kFailed)) + " refused";
}

std::string csv_text(const BatchMissions& missions) {
  std::string text = csv_line(head());
  for (const BatchMission& mission : missions) text += csv_line(row_of(mission));
  return text;
}

std::string page_text(const BatchMissions& missions, const std::string& manifest, const fs::path& folder) {
  std::string html = kBegin;
  html += "<h1>Batch " + web::html_text(manifest) + "</h1>\n<p>" + web::html_text(summary(missions)) + "</p>\n";
  html += "<div class=\"table\" tabindex=\"0\" role=\"region\" aria-label=\"Missions\"><table>\n<thead><tr>";
  for (const Column& column : kColumns) {
    if (column.is_brief) html += "<th scope=\"col\">" + std::string(column.name) + "</th>";
  }
  html += "<th scope=\"col\">files</th></tr></thead>\n<tbody>\n";
  for (const BatchMission& mission : missions) html += html_row(mission, folder);
  html += "</tbody></table></div>\n";
  html += "<p>A mission's name leads to its report, made with <code>batch --report NAME.html</code>. " +
          web::html_text(version_text()) + "</p>\n</main>\n</body>\n</html>\n";
  return html;
}

}  // namespace pmsp::tool
