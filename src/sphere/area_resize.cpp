// SPDX-License-Identifier: BSD-2-Clause
#include "sphere/area_resize.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "pmsp/stages.h"

namespace pmsp {
namespace {

/// Weighted sum of source rows, for one target row.
void join_rows(ImageView<const Rgb> image, const ResampleSpan& rows, std::vector<Eigen::Vector3f>& sum) {
  std::fill(sum.begin(), sum.end(), Eigen::Vector3f::Zero());
  float* const channels = sum[0].data();
  for (std::size_t i = 0; i < rows.weights.size(); ++i) {
    const int y = std::clamp(rows.first + static_cast<int>(i), 0, image.height - 1);
    const float weight = rows.weights[i];
    const std::uint8_t* bytes = &image.row(y)->r;
    for (std::size_t k = 0; k < 3 * sum.size(); ++k) channels[k] += weight * static_cast<float>(bytes[k]);
  }
}

/// The same for gray values.
void join_rows(ImageView<const Rgb> image, const ResampleSpan& rows, std::vector<float>& sum) {
  std::fill(sum.begin(), sum.end(), 0.0F);
  for (std::size_t i = 0; i < rows.weights.size(); ++i) {
    const Rgb* const pixels = image.row(std::clamp(rows.first + static_cast<int>(i), 0, image.height - 1));
    const float weight = rows.weights[i];
    for (std::size_t k = 0; k < sum.size(); ++k) {
      sum[k] += weight * luma({static_cast<float>(pixels[k].r), static_cast<float>(pixels[k].g),
                               static_cast<float>(pixels[k].b)});
    }
  }
}

template <class Value>
Image<Value> resize(ImageView<const Rgb> image, int width, int height, const Value& zero, ThreadPool& pool) {
  const std::vector<ResampleSpan> columns = resample_spans(image.width, width);
  const std::vector<ResampleSpan> rows = resample_spans(image.height, height);
  Image<Value> result(width, height, zero);
  constexpr int kRowsPerTask = 16;  // rows share one buffer
  pool.for_each((height + kRowsPerTask - 1) / kRowsPerTask, [&](int task) {
    std::vector<Value> sum(static_cast<std::size_t>(image.width), zero);
    for (int y = task * kRowsPerTask; y < std::min(height, (task + 1) * kRowsPerTask); ++y) {
      join_rows(image, rows[static_cast<std::size_t>(y)], sum);
      for (int x = 0; x < width; ++x) {
        const ResampleSpan& span = columns[static_cast<std::size_t>(x)];
        Value value = zero;
        for (std::size_t i = 0; i < span.weights.size(); ++i) {
          const int column = (span.first + static_cast<int>(i) + image.width) % image.width;
          value += span.weights[i] * sum[static_cast<std::size_t>(column)];
        }
        result(x, y) = value;
      }
    }
  });
  return result;
}

}  // namespace

std::vector<ResampleSpan> resample_spans(int source, int target) {
  std::vector<ResampleSpan> spans(static_cast<std::size_t>(target));
  const double scale = static_cast<double>(source) / target;
  for (int i = 0; i < target; ++i) {
    ResampleSpan& span = spans[static_cast<std::size_t>(i)];
    if (scale >= 1.0) {
      const double low = i * scale;
      const double high = std::min<double>((i + 1) * scale, source);
      span.first = static_cast<int>(low + 1e-9);  // i * scale may miss a whole number by a rounding error
      for (int k = span.first; k < high; ++k) {
        const double share = std::min(k + 1.0, high) - std::max<double>(k, low);
        if (share > 1e-9) span.weights.push_back(static_cast<float>(share / scale));
      }
    } else {
      const double center = (i + 0.5) * scale - 0.5;
      span.first = static_cast<int>(std::floor(center));
      const float second = static_cast<float>(center - span.first);
      span.weights = {1.0F - second, second};
    }
  }
  return spans;
}

Image<Eigen::Vector3f> area_resize(ImageView<const Rgb> image, int width, int height, ThreadPool& pool) {
  return resize<Eigen::Vector3f>(image, width, height, Eigen::Vector3f::Zero(), pool);
}

Image<float> area_resize_gray(ImageView<const Rgb> image, int width, int height, ThreadPool& pool) {
  return resize<float>(image, width, height, 0.0F, pool);
}

Image<std::uint8_t> shrink_mask(ImageView<const std::uint8_t> mask, int width, int height) {
  Image<std::uint8_t> result(width, height, 255);
  for (int y = 0; y < height; ++y) {
    const int y0 = static_cast<int>(static_cast<std::int64_t>(y) * mask.height / height);
    const int y1 = static_cast<int>((static_cast<std::int64_t>(y + 1) * mask.height + height - 1) / height);
    for (int x = 0; x < width; ++x) {
      const int x0 = static_cast<int>(static_cast<std::int64_t>(x) * mask.width / width);
      const int x1 = static_cast<int>((static_cast<std::int64_t>(x + 1) * mask.width + width - 1) / width);
      bool usable = true;
      for (int row = y0; row < y1 && usable; ++row) {
        for (int column = x0; column < x1; ++column) usable = usable && mask(column, row) != 0;
      }
      if (!usable) result(x, y) = 0;
    }
  }
  return result;
}

}  // namespace pmsp
