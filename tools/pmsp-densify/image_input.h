// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <memory>
#include <string>

#include "arguments.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"
#include "workspace/workspace.h"

namespace pmsp::tool {

/// What --images or --video names; nullptr without either.
std::unique_ptr<ImageSource> open_images(const Arguments& arguments, const SlamMap& map);

struct ImageSize {
  int width = 0;
  int height = 0;
};
/// Of the first image that is left, which is decoded; none where it cannot be read.
ImageSize first_size(ImageSource& source);

/// What --mask, --mask-nadir, --mask-zenith and --no-masks say, and which masks the map names.
MaskOptions mask_options(const Arguments& arguments, const SlamMap& map, const ImageSource& source);

/// Masks that are the same for all images, as text that changes with them. "" = there is none.
std::string masks_text(const Arguments& arguments, workspace::Workspace& workspace);

}  // namespace pmsp::tool
