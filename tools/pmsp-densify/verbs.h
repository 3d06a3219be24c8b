// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "arguments.h"

namespace pmsp::tool {

// Each throws what exit_code_of() knows.
void run(const Arguments& arguments);
/// run --shard
void run_shard(const Arguments& arguments);
/// run --print-memory
void print_memory(const Arguments& arguments);
void fuse(const Arguments& arguments);
void merge(const Arguments& arguments);
void info(const Arguments& arguments);
void config(const Arguments& arguments);

/// Has a command line of its own, from which it makes those of `run`. Returns the exit code.
int batch(int argc, const char* const* argv);

/// Likewise: the page of a cloud or of a workspace.
int report(int argc, const char* const* argv);

/// Likewise: a cloud or a workspace in other formats, another frame or unit.
int convert(int argc, const char* const* argv);

/// Likewise: a folder over HTTP until a signal comes.
int serve(int argc, const char* const* argv);

}  // namespace pmsp::tool
