// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <string>

#include "batch_arguments.h"

namespace pmsp::tool {

/// Returns a bash script that submits tools/slurm/batch.sbatch as an array over `missions`, and for the table after it.
std::string slurm_script(const BatchArguments& batch, std::size_t missions);

/// Runs the script. Throws OutputError if it fails.
void submit(const std::string& script);

}  // namespace pmsp::tool
