// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <memory>
#include <string>

#include "arguments.h"
#include "pmsp/io/image_source.h"
#include "pmsp/io/map.h"
#include "pmsp/io/mask.h"
#include "workspace/workspace.h"

namespace pmsp::tool {

// Each throws what exit_code_of() knows.
void run(const Arguments& arguments);
/// run --shard
void run_shard(const Arguments& arguments);
void merge(const Arguments& arguments);
void info(const Arguments& arguments);
void config(const Arguments& arguments);

/// Has a command line of its own, from which it makes those of `run`. Returns the exit code.
int batch(int argc, const char* const* argv);

/// Likewise: the page of a cloud or of a workspace.
int report(int argc, const char* const* argv);

/// Likewise: a folder over HTTP until a signal comes.
int serve(int argc, const char* const* argv);

/// What --images or --video names; nullptr without either.
std::unique_ptr<ImageSource> open_images(const Arguments& arguments, const SlamMap& map);

/// What --mask and --mask-nadir say. Throws as MaskSource.
MaskSource open_masks(const Arguments& arguments);

/// The same as text that changes with it; of a folder of masks not those in it. "" = there is none.
std::string masks_text(const Arguments& arguments, workspace::Workspace& workspace);

}  // namespace pmsp::tool
