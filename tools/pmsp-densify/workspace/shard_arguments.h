// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>

#include <CLI/CLI.hpp>

#include "arguments.h"
#include "workspace/shards.h"

namespace pmsp::tool {

/// --shard and --wave.
void add_shard_options(CLI::App& run, Arguments& arguments);
/// Throws UsageError where other options do not go with them. `names_output`: whether a cloud was asked for.
void check_shard(Arguments& arguments, bool names_output);

/// What `option` says: "2/7", or "auto", which asks the environment of a SLURM array job. Throws UsageError.
workspace::Shard shard_from(const std::string& text, const std::string& option);

}  // namespace pmsp::tool
