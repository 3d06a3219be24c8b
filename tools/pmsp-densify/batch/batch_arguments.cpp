// SPDX-License-Identifier: BSD-2-Clause
#include "batch_arguments.h"

#include <sys/wait.h>
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "arguments.h"
#include "batch_mission.h"
#include "batch_sbatch.h"
#include "command_line.h"
#include "exit_code.h"
#include "export/cloud_frame.h"
#include "numbers.h"
#include "option_table.h"
#include "pmsp/error.h"
#include "shard.h"

namespace pmsp::tool {

namespace fs = std::filesystem;

namespace {

/// Set by batch per mission, columns of the list, or options of batch itself.
constexpr std::array kOfBatch{"--images",    "--video",           "--output",    "--force",        "--stats",
                              "--workspace", "--growing",         "--follow",    "--until-idle",   "--progress",
                              "--quiet",     "--raw-depth-maps",  "--live-view", "--live-address", "--live-token",
                              "--live-keep", "--delete-workspace"};
constexpr std::array kMachineOptions{"--threads",   "--device",  "--backend",    "--simd",
                                     "--pipelined", "--scratch", kKeepWorkspaces};
constexpr std::array kFilesToRead{"--config",    "--mask", "--prior-depth", "--scratch",    "--align",
                                  "--transform", "--crs",  "--points",      "--image-list", "--camera-from-body"};
constexpr const char* kFormat = "--format";
constexpr std::array kFoldersForResults{"--depth-maps", "--preview", "--report-photos"};
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

/// Adds the options of `run` that missions support, except those that `app` has. Each is appended to `result` as
/// "--name=value".
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

/// Throws UsageError for remaining words: no options, or options set by batch.
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

}  // namespace

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
  for (std::size_t at = 0; at <= names.size();) {
    const std::size_t end = std::min(names.find(',', at), names.size());
    const CloudFormat* const format = find_cloud_format(names.substr(at, end - at));
    if (format == nullptr || std::find(formats.begin(), formats.end(), format) != formats.end()) {
      throw UsageError("--format is \"" + names + "\"; in a batch expected one or several of " + names_of_formats() +
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

namespace {

constexpr const char* kBatchAbout =
    "Many missions, each in a separate process, with results, log and status in the directory DIR/NAME. The\n"
    "failure of one does not affect others. DIR records the list and the options: `batch -o DIR` resumes with them.\n";

constexpr const char* kBatchMore =
    "Options of `run` (see run --help-all) apply to all missions; options of a mission override them.\n"
    "--depth-maps, --preview and --report are names inside the directories of the missions. --format ply,las selects\n"
    "the formats of the clouds, written as cloud.ply, cloud.las and so on. -o, --stats and --workspace are set by the\n"
    "batch; --growing, --follow, --raw-depth-maps and --live-view are not available.\n"
    "\n"
    "MANIFEST is JSON lines, an object per mission, or tab-separated with the names of the columns in the first line:\n"
    "name, map, images or video, mask, options. Paths are relative to the manifest. Options are an object as in\n"
    "--config, {\"quality\": \"high\", \"fusion\": {\"window\": 7}, \"fps\": 25}, or in a table words, --quality "
    "high.\n"
    "The default name is that of the map, or of the directory around map.*, reconstruction.json or sparse/0.\n"
    "\n"
    "--scan lists files *.msg, *.db and reconstruction.json (OpenSfM) and directories with a model of COLMAP, such as\n"
    "sparse/0. Inputs of each, in this order: the directory beside it with its name or the name images, keyframes\n"
    "or frames; the only other directory beside it with images; the video beside it with its name; the only other\n"
    "video beside it. A mask.png beside it is its mask. Names of missions are paths in DIR.\n"
    "\n"
    "Examples:\n"
    "  pmsp-densify batch --scan flights/ > missions.jsonl\n"
    "  pmsp-densify batch missions.jsonl -o results/ --quality normal --dry-run\n"
    "  pmsp-densify batch missions.jsonl -o results/ --quality normal --jobs 2\n"
    "  pmsp-densify batch -o results/ --retry\n"
    "  pmsp-densify batch missions.jsonl -o results/ --slurm=submit --sbatch \"--time=2:00:00 --cpus-per-task=8\"\n"
    "\n"
    "Exit codes: 0 all missions of the list are done, 7 some failed or are missing, 8 all failed (--dry-run: 0 "
    "all\n"
    "would run, 7 some, 8 none); 2 usage, 3 manifest, 6 output, 128 + n stopped by signal n (130 Ctrl-C, 143 SIGTERM)";

std::vector<int> devices_from(const std::string& text) {
  DensifierOptions options;
  find_option("device")->set(options, text, "--device");
  return options.devices;
}

ProgressMode progress_from(const std::string& name) {
  if (name == "auto" || name == "plain") return ProgressMode::kPlain;
  if (name == "json") return ProgressMode::kJson;
  if (name == "none") return ProgressMode::kNone;
  throw UsageError("--progress is \"" + name + "\"; expected plain, json or none");
}

void add_own(CLI::App& app, BatchArguments& a) {
  app.add_option("manifest", a.manifest, "List of missions; - = standard input [default the recorded list of DIR]")
      ->type_name("MANIFEST");
  app.add_option("-o,--output", a.output, "Directory of the results, for one batch at a time (except with --only)")
      ->type_name("DIR");
  app.add_flag("--dry-run", a.dry_run, "Check each mission as `info` does; nothing is written");
  app.add_flag("--summary", a.summary, "Print the table of the missions, also during a batch; nothing is written");
  app.add_flag("--retry", a.retry, "Repeat failed missions with unchanged inputs, too");
  app.add_flag("--force", a.force,
               "Replace recorded options by the given ones, and repeat the missions that they change");
  app.add_option_function<std::string>(
         "--jobs",
         [&a](const std::string& text) { a.jobs = number_in<int>("--jobs", text, 1, 256, "a whole number, 1 to 256"); },
         "Missions at once, which share the CPUs (--threads), the GPUs (--device) and memory (--memory) [1 to 256; "
         "default 1]")
      ->type_name("N");
  app.add_option_function<std::string>(
         "--memory",
         [&a](const std::string& text) {
           a.memory = number_in<double>("--memory", text, 0.001, 1e6, "a number from 0.001 to 1000000");
         },
         "Memory of all jobs together; a mission waits until its share is free [GiB; default: the free memory at "
         "the start]")
      ->type_name("SIZE");
  app.add_option_function<std::string>(
         "--device", [&a](const std::string& text) { a.devices = devices_from(text); },
         "CUDA devices, such as 0,1, or all, assigned to jobs round-robin; each job has several if there are more "
         "devices than jobs [default: all with --jobs, else 0]")
      ->type_name("LIST");
  app.add_option_function<std::string>(
         "--only", [&a](const std::string& text) { a.only = shard_from(text, "--only"); },
         "Every N-th mission, from number K on (from 0), for several batches in one DIR. auto: K and N of this task of "
         "a SLURM job array")
      ->type_name("K/N");
  app.add_flag("--slurm{print}", a.slurm,
               "Print a script that submits a SLURM job array over the missions and the job of their table, and stop; "
               "--slurm=submit runs it")
      ->type_name("WHAT");
  app.add_option_function<std::string>(
         "--sbatch", [&a](const std::string& text) { a.sbatch = split_words(text); },
         "With --slurm: options for sbatch, such as \"--partition=gpu --gres=gpu:1\"")
      ->type_name("WORDS");
  app.add_flag_callback(
      kKeepWorkspaces, [&a] { a.options.push_back(std::string(kKeepWorkspaces) + "=true"); },
      "Keep the workspaces of finished missions (DIR/NAME/work, large) for newer maps");
  app.add_option("--scan", a.scan, "Print a manifest of the missions in this directory tree, and stop")
      ->type_name("DIR");
  app.add_option_function<std::string>(
         "--progress", [&a](const std::string& name) { a.progress = progress_from(name); },
         "plain (a line per finished mission), json (JSON lines on stdout, instead of the table) or none "
         "[default plain]")
      ->type_name("MODE");
  app.add_flag("-q,--quiet", a.quiet, "Failed missions, warnings and errors only");
}

/// Throws for invalid options of all missions, before the first run.
void check_options(const std::vector<std::string>& options) {
  std::vector<std::string> words{"", "run", "MAP", "--images=DIR"};
  const std::vector<std::string> of_run = run_options_in("", options);
  words.insert(words.end(), of_run.begin(), of_run.end());
  check_run_words(words);
}

void check(const BatchArguments& a) {
  if (!a.scan.empty()) {
    if (!a.manifest.empty() || !a.output.empty()) throw UsageError("--scan takes neither MANIFEST nor -o");
    return;
  }
  if (a.output.empty()) throw UsageError("-o DIR is missing: batch MANIFEST -o DIR");
  for (const auto& [is_given, name] : {std::pair(a.summary, "--summary"), std::pair(a.dry_run, "--dry-run")}) {
    if (is_given && a.only) throw UsageError(std::string("--only and ") + name + " exclude each other");
  }
  if (a.summary && a.dry_run) throw UsageError("--summary and --dry-run exclude each other");
  if (a.slurm.empty()) {
    if (!a.sbatch.empty()) throw UsageError("--sbatch needs --slurm");
  } else {
    if (a.slurm != "print" && a.slurm != "submit") {
      throw UsageError("--slurm is \"" + a.slurm + "\"; expected --slurm=print or --slurm=submit");
    }
    if (a.only || a.summary || a.dry_run) throw UsageError("--slurm excludes --only, --summary and --dry-run");
    if (a.manifest == "-") throw UsageError("--slurm needs a MANIFEST in a file, for its jobs");
  }
  check_options(a.options);
}

/// Command line for jobs: without the options of their submission.
std::vector<std::string> words_for_jobs(const std::vector<std::string>& words) {
  std::vector<std::string> result;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (words[i] == "--sbatch") {
      ++i;
    } else if (words[i] != "--slurm" && words[i].rfind("--slurm=", 0) != 0 && words[i].rfind("--sbatch=", 0) != 0) {
      result.push_back(words[i]);
    }
  }
  return result;
}

}  // namespace

std::optional<BatchArguments> parse_batch_arguments(int argc, const char* const* argv) {
  BatchArguments a;
  a.program = argv[0];
  std::vector<std::string> words(argv + 2, argv + argc);
  a.words = words_for_jobs(words);
  CLI::App app(kBatchAbout, "pmsp-densify batch");
  set_up_verb(app, kBatchMore);
  add_own(app, a);
  add_mission_options(app, "", a.options);
  spell_out_switches(words);
  if (!parse_words(app, std::move(words))) return std::nullopt;
  refuse_words_for_missions(app);
  check(a);
  return a;
}

namespace {

constexpr std::size_t kMostTasks = 1000;  ///< Slurm's default of MaxArraySize

}  // namespace

std::string slurm_script(const BatchArguments& batch, std::size_t missions) {
  const std::string tasks = std::to_string(std::min(missions, kMostTasks) - 1);
  const std::string folder = command_text({batch.output.string()});
  const std::string sbatch = command_text({(batch.output / "batch.sbatch").string()});
  return "#!/usr/bin/env bash\n"
         "# " +
         std::to_string(missions) +
         " missions: an array of tasks makes them, a job after it their table.\n"
         "set -euo pipefail\n"
         "export PMSP_DENSIFY=" +
         command_text({batch.program}) +
         "\n"
         "batch=(" +
         command_text(batch.words) +
         ")\n"
         "options=(" +
         command_text(batch.sbatch) +
         ")\n"
         "mkdir -p " +
         folder +
         "\n"
         "cat >" +
         sbatch + " <<'END'\n" + kBatchSbatch +
         "END\n"
         "tasks=$(sbatch --parsable --array=0-" +
         tasks + " \"${options[@]}\" " + sbatch +
         " \"${batch[@]}\" --only auto)\n"
         "table=$(sbatch --parsable --dependency=\"afterany:${tasks%%;*}\" \"${options[@]}\" " +
         sbatch +
         " \"${batch[@]}\" --summary)\n"
         "echo \"job ${tasks%%;*} makes the missions, job ${table%%;*} then their table\"\n";
}

void submit(const std::string& script) {
  std::FILE* const bash = popen("bash", "w");
  if (bash == nullptr) throw OutputError("bash cannot be started");
  const bool is_written = std::fwrite(script.data(), 1, script.size(), bash) == script.size();
  const int status = pclose(bash);
  if (is_written && WIFEXITED(status) && WEXITSTATUS(status) == 0) return;
  throw OutputError(
      "not all jobs were submitted; see the output of sbatch, and cancel the submitted ones with `scancel`");
}

}  // namespace pmsp::tool
