// SPDX-License-Identifier: BSD-2-Clause
#include "live/live_image.h"

#include <cstddef>
#include <string>

#include "densifier_checks.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

std::ptrdiff_t bytes_of(PixelFormat format) { return format == PixelFormat::kGray ? 1 : 3; }

std::ptrdiff_t stride_of(const LiveImage& image) {
  return image.stride != 0 ? image.stride : bytes_of(image.format) * image.width;
}

}  // namespace

ImageView<const Rgb> rgb_view(const LiveImage& image, Image<Rgb>& converted) {
  const std::ptrdiff_t stride = stride_of(image);
  if (image.format == PixelFormat::kRgb && stride % 3 == 0) {
    return {reinterpret_cast<const Rgb*>(image.data), image.width, image.height, stride / 3};
  }
  converted = Image<Rgb>(image.width, image.height);
  for (int y = 0; y < image.height; ++y) {
    const std::uint8_t* from = image.data + y * stride;
    Rgb* const to = converted.row(y);
    for (int x = 0; x < image.width; ++x, from += bytes_of(image.format)) {
      switch (image.format) {
        case PixelFormat::kRgb:
          to[x] = {from[0], from[1], from[2]};
          break;
        case PixelFormat::kBgr:
          to[x] = {from[2], from[1], from[0]};
          break;
        case PixelFormat::kGray:
          to[x] = {from[0], from[0], from[0]};
          break;
      }
    }
  }
  return static_cast<const Image<Rgb>&>(converted).view();
}

void check_image(const LiveKeyframe& keyframe, const Image<std::uint8_t>* mask) {
  const std::string who = "keyframe " + std::to_string(keyframe.id) + ": ";
  const LiveImage& image = keyframe.image;
  if (image.data == nullptr || !image.owner) {
    throw InvalidInput(who + "there is no image; expected pixels, and an owner that keeps them");
  }
  check_sizes(who, image.width, image.height, mask != nullptr ? mask->view() : ImageView<const std::uint8_t>());
  if (stride_of(image) < bytes_of(image.format) * image.width) {
    throw InvalidInput(who + "rows of the image are " + std::to_string(image.stride) + " bytes apart; expected " +
                       std::to_string(bytes_of(image.format) * image.width) + " or more");
  }
  if (keyframe.prior_depth) check_prior_depth(who, keyframe.prior_depth->view());
}

}  // namespace pmsp
