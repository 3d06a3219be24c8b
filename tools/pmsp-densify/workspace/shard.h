// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>

#include "arguments.h"
#include "workspace/shards.h"

namespace CLI {  // NOLINT(readability-identifier-naming)
class App;
}

namespace pmsp::tool {

/// Adds --shard and --wave.
void add_shard_options(CLI::App& run, Arguments& arguments);
/// Throws UsageError for conflicting options. `names_output`: a cloud was requested.
void check_shard(Arguments& arguments, bool names_output);

/// Parses "2/7", or "auto" for the environment of a SLURM array job. Throws UsageError.
workspace::Shard shard_from(const std::string& text, const std::string& option);

}  // namespace pmsp::tool
