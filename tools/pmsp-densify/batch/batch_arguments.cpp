// SPDX-License-Identifier: BSD-2-Clause
#include "batch_arguments.h"

#include <algorithm>
#include <utility>

#include <CLI/CLI.hpp>

#include "batch_options.h"
#include "batch_run.h"
#include "command_line.h"
#include "exit_code.h"
#include "numbers.h"
#include "option_table.h"
#include "shard_arguments.h"

namespace pmsp::tool {
namespace {

constexpr const char* kAbout =
    "Many missions, each in a separate process, with results, log and status in the directory DIR/NAME. The\n"
    "failure of one does not affect others. DIR records the list and the options: `batch -o DIR` resumes with them.\n";

constexpr const char* kMore =
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
  CLI::App app(kAbout, "pmsp-densify batch");
  set_up_verb(app, kMore);
  add_own(app, a);
  add_mission_options(app, "", a.options);
  spell_out_switches(words);
  if (!parse_words(app, std::move(words))) return std::nullopt;
  refuse_words_for_missions(app);
  check(a);
  return a;
}

}  // namespace pmsp::tool
