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
  } catch (const std::exception&) {  // reported by the run
  }
  return {};
}

MaskOptions mask_options(const Arguments& arguments, const SlamMap& map, const ImageSource& source) {
  MaskOptions options{arguments.mask, arguments.images, arguments.mask_nadir, arguments.mask_zenith,
                      !arguments.no_masks};
  for (const std::int64_t id : source.keyframe_ids()) {
    const MapKeyframe* keyframe = map.find_keyframe(id);
    if (keyframe != nullptr && !keyframe->mask.empty()) options.named[source.origin(id).file] = keyframe->mask;
  }
  return options;
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
  if (arguments.mask_zenith > 0.0) text += ", zenith " + nlohmann::json(arguments.mask_zenith).dump();
  return text;
}

std::unique_ptr<ImageSource> open_images(const Arguments& arguments, const SlamMap& map) {
  const bool allow_missing = arguments.allow_missing || arguments.growing || arguments.follow;  // more will follow
  if (!arguments.images.empty()) {
    ImageFolderOptions options;
    options.fps = arguments.fps;
    options.frame_offset = arguments.frame_offset;
    options.allow_missing = allow_missing;
    return open_image_folder(map, arguments.images, options);
  }
  if (arguments.video.empty()) return nullptr;
  VideoOptions options;
  options.fps = arguments.fps;
  options.frame_offset = arguments.frame_offset;
  options.presentation_times = arguments.presentation_times;
  options.allow_missing = allow_missing;
  return open_video(map, arguments.video, options);
}

}  // namespace pmsp::tool
