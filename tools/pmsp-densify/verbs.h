// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "arguments.h"

namespace pmsp::tool {

// Exceptions: see exit_code_of().
void run(const Arguments& arguments);
/// run --shard
void run_shard(const Arguments& arguments);
/// run --print-memory
void print_memory(const Arguments& arguments);
void fuse(const Arguments& arguments);
void merge(const Arguments& arguments);
void info(const Arguments& arguments);
void config(const Arguments& arguments);

/// Has its own command line, from which it makes those of `run`. Returns the exit code.
int batch(int argc, const char* const* argv);

/// Likewise: page of a cloud or workspace.
int report(int argc, const char* const* argv);

/// Likewise: converts a cloud or workspace to other formats, frames or units.
int convert(int argc, const char* const* argv);

/// Likewise: serves a folder over HTTP until a signal.
int serve(int argc, const char* const* argv);

}  // namespace pmsp::tool
