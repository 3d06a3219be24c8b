// SPDX-License-Identifier: BSD-2-Clause
#include "image_input.h"

#include <exception>
#include <filesystem>
#include <system_error>

#include <nlohmann/json.hpp>

namespace pmsp::tool {

ImageSize first_size(ImageSource& source) {
  try {
    if (const auto item = source.next()) return {item->image.width(), item->image.height()};
  } catch (const std::exception&) {  // a run will tell
  }
  return {};
}

MaskSource open_masks(const Arguments& arguments) {
  return MaskSource({arguments.mask, arguments.images, arguments.mask_nadir});
}

std::string masks_text(const Arguments& arguments, workspace::Workspace& workspace) {
  std::error_code ignored;
  std::string text;
  if (std::filesystem::is_directory(arguments.mask, ignored)) {
    text = "one for each image";
  } else if (!arguments.mask.empty()) {
    text = workspace.fingerprint(arguments.mask);
  }
  if (arguments.mask_nadir > 0.0) text += ", nadir " + nlohmann::json(arguments.mask_nadir).dump();
  return text;
}

std::unique_ptr<ImageSource> open_images(const Arguments& arguments, const SlamMap& map) {
  if (!arguments.images.empty()) {
    ImageFolderOptions options;
    options.fps = arguments.fps;
    options.frame_offset = arguments.frame_offset;
    return open_image_folder(map, arguments.images, options);
  }
  if (arguments.video.empty()) return nullptr;
  VideoOptions options;
  options.fps = arguments.fps;
  options.frame_offset = arguments.frame_offset;
  return open_video(map, arguments.video, options);
}

}  // namespace pmsp::tool
