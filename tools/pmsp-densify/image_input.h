// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <memory>
#include <string>

#include "arguments.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"
#include "workspace/workspace.h"

namespace pmsp::tool {

/// Opens --images or --video; nullptr without either.
std::unique_ptr<ImageSource> open_images(const Arguments& arguments, const SlamMap& map);

struct ImageSize {
  int width = 0;
  int height = 0;
};
/// Decodes the first remaining image; {} if unreadable.
ImageSize first_size(ImageSource& source);

/// Returns the options --mask, --mask-nadir, --mask-zenith and --no-masks, and the masks named in the map.
MaskOptions mask_options(const Arguments& arguments, const SlamMap& map, const ImageSource& source);

/// Returns the common masks of all images as text that changes with them. "" = none.
std::string masks_text(const Arguments& arguments, workspace::Workspace& workspace);

}  // namespace pmsp::tool
