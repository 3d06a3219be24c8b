// SPDX-License-Identifier: BSD-2-Clause
#include "batch_slurm.h"

#include <sys/wait.h>
#include <algorithm>
#include <cstdio>
#include <vector>

#include "batch_options.h"
#include "batch_sbatch.h"
#include "pmsp/error.h"

namespace pmsp::tool {
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
