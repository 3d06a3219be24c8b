// SPDX-License-Identifier: BSD-2-Clause
#include "sphere/image_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

#include "elementary.h"
#include "plane_prior.h"

namespace pmsp {
namespace {

constexpr int kPatches = 384;              // on the whole sphere
constexpr std::size_t kLeastPatches = 64;  // minimum number for an estimate
constexpr double kMaxSinLat = 0.9;         // maximum; beyond it, rows are averaged, which reduces noise
constexpr double kDarkest = 8.0;           // limits of the mean gray value of a patch; sensors clip beyond
constexpr double kBrightest = 245.0;
constexpr int kMostRows = 16;  // maximum rows that are read of a square; more would reduce noise little further
constexpr double kLeastTexturedShare = 0.05;  // share of the patches

/// Mean gray value of a square; none if a pixel is masked. x wraps.
std::optional<float> mean_gray(ImageView<const Rgb> image, ImageView<const std::uint8_t> mask, double x, double y,
                               int side) {
  const int x0 = static_cast<int>(std::floor(x - 0.5 * side + 0.5)) % image.width;
  const int left = x0 < 0 ? x0 + image.width : x0;
  const int top = std::clamp(static_cast<int>(std::floor(y - 0.5 * side + 0.5)), 0, image.height - side);
  const int skip = std::max(1, side / kMostRows);
  int red = 0;
  int green = 0;
  int blue = 0;
  int count = 0;
  for (int row = top; row < top + side; row += skip) {
    const Rgb* const pixels = image.row(row);
    for (int i = 0; i < side; i += skip) {
      const int column = left + i < image.width ? left + i : left + i - image.width;
      if (!mask.empty() && mask(column, row) == 0) return std::nullopt;
      ++count;
      const Rgb& pixel = pixels[column];
      red += pixel.r;
      green += pixel.g;
      blue += pixel.b;
    }
  }
  const float sum =
      0.299F * static_cast<float>(red) + 0.587F * static_cast<float>(green) + 0.114F * static_cast<float>(blue);
  return sum / static_cast<float>(count);
}

/// Variance around a linear ramp, of the samples of a patch.
std::optional<float> variance_in(const std::array<float, kernels::kPatchSamples>& grays) {
  float sum = 0.0F;
  float sum_x = 0.0F;
  float sum_y = 0.0F;
  float spread = 0.0F;
  for (int k = 0; k < kernels::kPatchSamples; ++k) {
    const float x = kernels::patch_offset(k % kernels::kPatchSide);
    const float gray = grays[static_cast<std::size_t>(k)];
    sum += gray;
    sum_x += x * gray;
    sum_y += kernels::patch_offset(k / kernels::kPatchSide) * gray;
    spread += x * x;
  }
  const float mean = sum / static_cast<float>(kernels::kPatchSamples);
  if (mean < kDarkest || mean > kBrightest) return std::nullopt;
  float square = 0.0F;
  for (const float gray : grays) square += (gray - mean) * (gray - mean);
  const float of_ramp = (sum_x * sum_x + sum_y * sum_y) / spread;
  return std::max(square - of_ramp, 0.0F) / static_cast<float>(kernels::kPatchSamples);
}

/// Layout of patches in an image, for pixels of another width.
struct PatchGrid {
  PatchGrid(const ImageView<const Rgb>& image, int width) {
    const double ratio = static_cast<double>(image.width) / width;
    step = kernels::kTexturePixels * ratio;
    // Samples are interpolated linearly between those pixels, which averages over more than one of them.
    side = std::clamp(static_cast<int>(std::lround(1.25 * ratio)), 1, std::min(image.width, image.height));
  }

  double step;  ///< between samples [px of the image]
  int side;     ///< of the square of a sample [px of the image]
};

/// Variance of patch i on a Fibonacci lattice.
std::optional<float> variance_at(int i, const PatchGrid& grid, const ImageView<const Rgb>& image,
                                 const ImageView<const std::uint8_t>& mask) {
  const double sin_lat = 1.0 - (2.0 * i + 1.0) / kPatches;
  if (std::abs(sin_lat) > kMaxSinLat) return std::nullopt;
  const double turns = i * 0.6180339887498949;
  const double x = (turns - std::floor(turns)) * image.width;
  const double y = (0.5 - std::asin(sin_lat) / kernels::kPi) * image.height;
  const double across = grid.step / std::sqrt(1.0 - sin_lat * sin_lat);
  std::array<float, kernels::kPatchSamples> grays{};
  for (int count = 0; count < kernels::kPatchSamples; ++count) {
    const double right = kernels::patch_offset(count % kernels::kPatchSide);
    const double down = kernels::patch_offset(count / kernels::kPatchSide);
    const auto gray = mean_gray(image, mask, x + across * right, y + grid.step * down, grid.side);
    if (!gray) return std::nullopt;
    grays[static_cast<std::size_t>(count)] = *gray;
  }
  return variance_in(grays);
}

float least_textured_variance(const std::array<std::optional<float>, kPatches>& found) {
  std::vector<float> variances;
  for (const std::optional<float>& variance : found) {
    if (variance) variances.push_back(*variance);
  }
  if (variances.size() < kLeastPatches) return 0.0F;
  const auto barest =
      variances.begin() + static_cast<std::ptrdiff_t>(kLeastTexturedShare * static_cast<double>(variances.size()));
  std::nth_element(variances.begin(), barest, variances.end());
  return *barest;
}

}  // namespace

float image_noise(ImageView<const Rgb> image, ImageView<const std::uint8_t> mask, int width, int matched_width,
                  ThreadPool& pool) {
  const std::array<PatchGrid, 2> grids{PatchGrid(image, width), PatchGrid(image, matched_width)};
  const std::size_t count = matched_width == width ? 1 : grids.size();
  std::array<std::array<std::optional<float>, kPatches>, grids.size()> found;
  constexpr int kPatchesPerTask = 24;
  constexpr int kPatchShares = kPatches / kPatchesPerTask;
  pool.for_each(static_cast<int>(count) * kPatchShares, [&](int task) {
    const std::size_t of = static_cast<std::size_t>(task / kPatchShares);
    const int first = task % kPatchShares * kPatchesPerTask;
    for (int i = first; i < first + kPatchesPerTask; ++i)
      found[of][static_cast<std::size_t>(i)] = variance_at(i, grids[of], image, mask);
  });
  float noise = 0.0F;
  for (std::size_t of = 0; of < count; ++of) noise = std::max(noise, least_textured_variance(found[of]));
  return noise;
}

}  // namespace pmsp
