// SPDX-License-Identifier: BSD-2-Clause
#include "shard_arguments.h"

#include <cstdlib>
#include <optional>

#include "exit_code.h"
#include "numbers.h"

namespace pmsp::tool {
namespace {

std::optional<int> number_in_environment(const char* name) {
  const char* const text = std::getenv(name);
  return text == nullptr ? std::nullopt : number_from<int>(text);
}

/// Array tasks may be numbered from any minimum in any steps.
workspace::Shard shard_of_array_task(const std::string& option) {
  const auto id = number_in_environment("SLURM_ARRAY_TASK_ID");
  const auto count = number_in_environment("SLURM_ARRAY_TASK_COUNT");
  if (!id || !count) {
    throw UsageError(
        option +
        " auto: SLURM_ARRAY_TASK_ID or SLURM_ARRAY_TASK_COUNT is not set to a number; expected a job array "
        "(sbatch --array=0-6), or " +
        option + " K/N");
  }
  const int first = number_in_environment("SLURM_ARRAY_TASK_MIN").value_or(0);
  const int step = number_in_environment("SLURM_ARRAY_TASK_STEP").value_or(1);
  const workspace::Shard shard{step > 0 ? (*id - first) / step : -1, *count};
  if (shard.index >= 0 && shard.index < shard.count) return shard;
  throw UsageError(option + " auto: task " + std::to_string(*id) + " of an array of " + std::to_string(*count) +
                   " that begins at " + std::to_string(first) +
                   " is none of them; expected tasks without gaps (sbatch --array=0-6), or " + option + " K/N");
}

workspace::Wave wave_from(const std::string& text) {
  for (const workspace::Wave wave : {workspace::Wave::kPlanes, workspace::Wave::kPoints}) {
    if (text == name_of(wave)) return wave;
  }
  throw UsageError("--wave is \"" + text + "\"; expected planes or points");
}

}  // namespace

workspace::Shard shard_from(const std::string& text, const std::string& option) {
  if (text == "auto") return shard_of_array_task(option);
  const std::size_t slash = text.find('/');
  if (slash != std::string::npos) {
    const auto index = number_from<int>(text.substr(0, slash));
    const auto count = number_from<int>(text.substr(slash + 1));
    constexpr int kMost = 1000000;
    if (index && count && *index >= 0 && *index < *count && *count <= kMost) return {*index, *count};
  }
  throw UsageError(option + " is \"" + text + "\"; expected K/N, from 0/N to N-1/N, such as 2/7, or auto");
}

void add_shard_options(CLI::App& run, Arguments& a) {
  const char* group = "Shards";
  run.add_option_function<std::string>(
         "--shard", [&a](const std::string& text) { a.shard = shard_from(text, "--shard"); },
         "With --workspace: compute one of N shares of the mission, number K from 0, without a cloud; `merge` joins "
         "them. auto: K and N of this task of a SLURM job array")
      ->type_name("K/N")
      ->group(group);
  run.add_option_function<std::string>(
         "--wave", [&a](const std::string& text) { a.wave = wave_from(text); },
         "With --shard: only planes, or only points, which need the planes of other shards [planes or points; default: "
         "both, with missing planes of other shards]")
      ->type_name("WAVE")
      ->group(group);
}

void check_shard(Arguments& a, bool names_output) {
  if (!a.shard) {
    if (a.wave) throw UsageError("--wave needs --shard K/N");
    return;
  }
  if (a.workspace.empty()) throw UsageError("--shard needs --workspace DIR, which all shards share");
  if (a.follow) throw UsageError("--shard and --follow exclude each other");
  if (a.growing) throw UsageError("--shard and --growing exclude each other");
  if (a.delete_workspace) throw UsageError("--shard and --delete-workspace exclude each other: merge needs it");
  if (names_output || !a.depth_maps.empty() || !a.preview.empty() || !a.report.path.empty() ||
      a.cloud.double_positions) {
    throw UsageError(
        "a shard writes no cloud, depth maps, pictures or report; leave --output, --double, --depth-maps, "
        "--preview and --report out, and merge the shards: pmsp-densify merge " +
        a.workspace.string() + " -o cloud.ply");
  }
  a.cloud.paths.clear();
}

}  // namespace pmsp::tool
