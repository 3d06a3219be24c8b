// SPDX-License-Identifier: BSD-2-Clause
#include "batch_tables.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <optional>
#include <system_error>

#include "arguments.h"
#include "web/web_path.h"

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;

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
  char text[400];
  std::snprintf(text, sizeof(text), "%.*f", column.decimals, mission.status[column.key].get<double>());
  return text;
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
  std::error_code ignored;
  if (!fs::is_regular_file(to, ignored)) return "";
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
  return static_cast<std::size_t>(std::count_if(
      missions.begin(), missions.end(), [&](const BatchMission& it) { return text_in(it.status, "state") == state; }));
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
