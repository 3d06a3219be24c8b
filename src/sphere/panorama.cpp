// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/stages.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "cpu/executor_impl.h"
#include "elementary.h"
#include "pmsp/error.h"
#include "sphere/area_resize.h"
#include "sphere/cube_map.h"
#include "sphere/image_noise.h"
#include "sphere/panorama_data.h"
#include "util/text.h"

namespace pmsp {
namespace {

void check(ImageView<const Rgb> image, ImageView<const std::uint8_t> mask, int width, int height) {
  if (image.empty() || image.width % 2 != 0 || image.height % 2 != 0) {
    throw InvalidInput("the image is " + size_text(image.width, image.height) + "; expected an even width and height");
  }
  if (width < kMinPanoramaWidth || height < kMinPanoramaHeight || width % 2 != 0 || height % 2 != 0) {
    throw InvalidInput("the depth map is to be " + size_text(width, height) +
                       "; expected an even width from 16 and an even height from 8");
  }
  if (!mask.empty() && (mask.width != image.width || mask.height != image.height)) {
    throw InvalidInput("the mask is " + size_text(mask.width, mask.height) + ", the image " +
                       size_text(image.width, image.height) + "; expected equal sizes");
  }
}

Image<float> gray_of(const Image<Eigen::Vector3f>& color) {
  Image<float> gray(color.width(), color.height());
  for (std::size_t i = 0; i < gray.pixels().size(); ++i) gray.pixels()[i] = luma(color.pixels()[i]);
  return gray;
}

/// Averages each row over as many pixels as one equatorial pixel is wide there, by sliding sums.
void equalize_rows(Image<float>& gray, ThreadPool& pool) {
  const int width = gray.width();
  pool.for_each(gray.height(), [&](int y) {
    const double lat = (0.5 - (y + 0.5) / gray.height()) * kernels::kPi;
    const double span = std::min(1.0 / std::cos(lat), 0.5 * width);
    const int reach = static_cast<int>((span - 1.0) / 2.0);                      // whole pixels to each side
    const float rest = static_cast<float>(((span - 1.0) / 2.0 - reach) / span);  // weight of the partial ones
    const float whole = static_cast<float>(1.0 / span);
    if (reach == 0 && rest < 0.02F) return;
    const std::vector<float> row(gray.row(y), gray.row(y) + width);
    const auto at = [&](int x) { return row[static_cast<std::size_t>((x + width) % width)]; };
    double sum = 0.0;
    for (int x = -reach; x <= reach; ++x) sum += at(x);
    for (int x = 0; x < width; ++x) {
      gray(x, y) = whole * static_cast<float>(sum) + rest * (at(x - reach - 1) + at(x + reach + 1));
      sum += static_cast<double>(at(x + reach + 1)) - at(x - reach);
    }
  });
}

}  // namespace

PanoramaData prepare_panorama(ImageView<const Rgb> image, ImageView<const std::uint8_t> mask, int width, int height,
                              double image_scale, const Executor& executor, std::optional<CubeNodes>& nodes) {
  check(image, mask, width, height);
  ThreadPool& pool = pool_of(executor);
  const Image<Eigen::Vector3f> resized = area_resize(image, width, height, pool);
  PanoramaData data;
  data.width = width;
  data.height = height;
  data.color = Image<Rgb>(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Eigen::Vector3f& value = resized(x, y);
      const auto byte = [](float v) { return static_cast<std::uint8_t>(std::min(v + 0.5F, 255.0F)); };
      data.color(x, y) = {byte(value.x()), byte(value.y()), byte(value.z())};
    }
  }
  const ImageSize matched = matching_size(image.width, width, height, image_scale);
  Image<float> gray =
      matched.width == width ? gray_of(resized) : area_resize_gray(image, matched.width, matched.height, pool);
  equalize_rows(gray, pool);
  const int size = cube_size_for(matched.width);
  if (!nodes || !nodes->matches(size, matched.width, matched.height)) {
    nodes.emplace(size, matched.width, matched.height, pool);
  }
  data.gray = make_cube_map(gray, *nodes, pool);
  if (mask.empty()) return data;
  data.mask = shrink_mask(mask, width, height);
  data.matchable = make_matchable_cube(data.mask, cube_size_for(width), kPatchReachPx, pool);
  return data;
}

Panorama::Panorama(ImageView<const Rgb> image, ImageView<const std::uint8_t> mask, int width, int height,
                   const Executor& executor, double image_scale)
    : data_(std::make_unique<PanoramaData>()) {
  std::optional<CubeNodes> nodes;
  *data_ = prepare_panorama(image, mask, width, height, image_scale, executor, nodes);
  const int matched = matching_size(image.width, width, height, image_scale).width;
  data_->noise = image_noise(image, mask, width, matched, pool_of(executor));
}
Panorama::~Panorama() = default;
Panorama::Panorama(Panorama&&) noexcept = default;
Panorama& Panorama::operator=(Panorama&&) noexcept = default;

int Panorama::width() const { return data_->width; }
int Panorama::height() const { return data_->height; }
const Image<Rgb>& Panorama::color() const { return data_->color; }
const Image<std::uint8_t>& Panorama::mask() const { return data_->mask; }

}  // namespace pmsp
