// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <string>

#include "batch_arguments.h"

namespace pmsp::tool {

/// A script for bash: it submits tools/slurm/batch.sbatch, as an array over `missions` and for their table after it.
std::string slurm_script(const BatchArguments& batch, std::size_t missions);

/// Runs it. Throws OutputError where that fails.
void submit(const std::string& script);

}  // namespace pmsp::tool
