// SPDX-License-Identifier: BSD-2-Clause
#include "batch_page.h"

#include <filesystem>
#include <optional>
#include <system_error>

#include "arguments.h"
#include "batch_run.h"
#include "pmsp/io/files.h"
#include "progress.h"
#include "web_path.h"

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;

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

/// "" where there is no such file or folder.
std::string link(const fs::path& from, const fs::path& to, const std::string& words) {
  std::error_code ignored;
  if (!fs::exists(to, ignored)) return "";
  const std::string address = relative_address(to.lexically_relative(from).generic_string());
  return "<a href=\"" + html_text(address) + "\">" + html_text(words) + "</a>";
}

/// "48 of 54", from its statistics; "" where they do not say.
std::string depth_maps_of(const fs::path& folder) {
  try {
    const nlohmann::json keyframes = nlohmann::json::parse(read_whole_file(stats_of(folder))).at("keyframes");
    return count_text(keyframes.at("depth_maps").get<std::int64_t>()) + " of " +
           count_text(keyframes.at("in_map").get<std::int64_t>());
  } catch (const std::exception&) {
    return "";
  }
}

std::string row_of(const BatchMission& mission, const BatchArguments& batch) {
  const MissionStatus& s = mission.status;
  const bool is_done = s.state == MissionState::kDone;
  const bool has_ended = !s.started.empty() && !s.finished.empty();
  const fs::path& from = batch.output;
  const std::optional<fs::path> report = report_of(mission, batch);
  std::string files;
  const auto add = [&files](const std::string& one) { files += (files.empty() || one.empty() ? "" : ", ") + one; };
  if (mission.has_folder || !s.started.empty()) {
    for (const fs::path& cloud : clouds_of(mission, batch)) {
      std::error_code ignored;  // a folder is no page; who has the files finds it there
      if (!fs::is_directory(cloud, ignored)) add(link(from, cloud, cloud.filename().string()));
    }
    add(link(from, stats_of(mission.folder), "statistics"));
    add(link(from, log_of(mission.folder), "log"));
  }
  const std::string name = report ? link(from, *report, mission.mission.name) : "";
  return "<tr>" + cell(name.empty() ? html_text(mission.mission.name) : name) +
         cell(name_of(s.state), s.state == MissionState::kFailed ? "failed" : "") +
         cell(s.points ? count_text(*s.points) : "", "number") +
         cell(is_done ? depth_maps_of(mission.folder) : "", "number") +
         cell(has_ended ? duration_text(s.seconds) : "", "number") +
         cell(has_ended ? count_text(static_cast<std::int64_t>(s.peak_memory_mib)) + " MiB" : "", "number") +
         cell(files) + cell(html_text(s.reason)) + "</tr>\n";
}

}  // namespace

std::string batch_page(const BatchReport& report, const BatchArguments& batch) {
  std::string html = kBegin;
  html += "<h1>Batch " + html_text(report.manifest) + "</h1>\n<p>" + html_text(summary(report)) + "</p>\n";
  html += "<div class=\"table\" tabindex=\"0\" role=\"region\" aria-label=\"Missions\"><table>\n<thead><tr>";
  for (const char* column : {"Mission", "State", "Points", "Depth maps", "Time", "Memory", "Files", "Why it failed"}) {
    html += "<th scope=\"col\">" + std::string(column) + "</th>";
  }
  html += "</tr></thead>\n<tbody>\n";
  for (const BatchMission& mission : report.missions) html += row_of(mission, batch);
  html += "</tbody></table></div>\n";
  html += "<p>A mission's name leads to its report where <code>batch --report NAME.html</code> asked for one. " +
          html_text(version_text()) + "</p>\n</main>\n</body>\n</html>\n";
  return html;
}

}  // namespace pmsp::tool
