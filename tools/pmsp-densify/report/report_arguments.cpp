// SPDX-License-Identifier: BSD-2-Clause
#include "report_arguments.h"
#include "web/page.h"

#include <system_error>
#include <vector>

#include "command_line.h"
#include "exit_code.h"
#include "numbers.h"
#include "pmsp/error.h"

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;

constexpr const char* kAbout =
    "The page of `run --report` from a cloud (PLY, LAS, Potree) or a workspace (run --workspace), without another\n"
    "run. It omits and lists what these do not contain.\n";

constexpr const char* kMore =
    "Examples:\n"
    "  pmsp-densify report cloud.ply -o cloud.html\n"
    "  pmsp-densify report work/ -o mission.html";

std::int64_t points_from(const std::string& option, const std::string& text) {
  constexpr std::int64_t kMost = PageCloud::kMostPoints;
  return number_in<std::int64_t>(option.c_str(), text, 0, kMost, "a whole number from 0 to " + std::to_string(kMost));
}

int panoramas_from(const std::string& text) {
  return number_in("--report-panoramas", text, 0, 1000, "a whole number from 0 to 1000");
}

void add_points(CLI::App& app, const std::string& option, ReportArguments& a) {
  app.add_option_function<std::string>(
         option, [&a, option](const std::string& text) { a.points = points_from(option, text); },
         "Maximum number of points in the page, the most confident ones [0 to 5000000, 20 bytes each; default 1000000]")
      ->type_name("N")
      ->group("Output");
}

}  // namespace

void require_report_page(const char* option) {
  if (!web::has_report_page()) throw UsageError(std::string(option) + " is not in this build (PMSP_VIEWER is OFF)");
}

void add_report_options(CLI::App& app, ReportArguments& a) {
  const char* group = "Output";
  app.add_option("--report", a.path,
                 "Page for a browser, without network: options, quality, and points for viewing and measuring (HTML)")
      ->type_name("FILE")
      ->group(group);
  add_points(app, "--report-points", a);
  app.add_option_function<std::string>(
         "--report-panoramas", [&a](const std::string& text) { a.panoramas = panoramas_from(text); },
         "Keyframes with a photo in the page, at most 2048 pixels wide [0 to 1000; default 12]")
      ->type_name("N")
      ->group(group);
  app.add_option("--report-unit", a.unit,
                 "Name of the unit of lengths in the page; m is refused without --scale, --align or a scaling "
                 "--transform [default: m with one of these, else map units]")
      ->type_name("NAME")
      ->group(group);
}

std::optional<ReportVerbArguments> parse_report_arguments(int argc, const char* const* argv) {
  ReportVerbArguments a;
  bool force = false;
  CLI::App app(kAbout, "pmsp-densify report");
  set_up_verb(app, kMore);
  app.add_option("from", a.from, "Cloud or workspace")->type_name("CLOUD|WORKSPACE");
  app.add_option("-o,--output", a.report.path, "Page (HTML)")->type_name("FILE")->group("Output");
  app.add_flag("--force", force, "Overwrite an existing page")->group("Output");
  add_points(app, "--points", a.report);
  app.add_option("--unit", a.report.unit,
                 "Name of the unit of lengths; m is refused for a cloud without a scale [default: that of the cloud]")
      ->type_name("NAME")
      ->group("Output");
  if (!parse_words(app, {argv + 2, argv + argc})) return std::nullopt;
  refuse_extra_words(app);
  require_report_page("report");
  if (a.from.empty() || a.report.path.empty()) {
    throw UsageError("expected a cloud or a workspace, and -o FILE.html; see report --help");
  }
  std::error_code error;
  if (fs::equivalent(a.from, a.report.path, error)) {
    throw UsageError("-o " + a.report.path.string() + " would overwrite the input");
  }
  if (!force && fs::exists(a.report.path, error)) {
    throw OutputError(a.report.path.string() + ": exists already; --force overwrites it, or give another -o");
  }
  return a;
}

}  // namespace pmsp::tool
