// SPDX-License-Identifier: BSD-2-Clause
#include "page_depth.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <zlib.h>

#include "export/little_endian.h"
#include "pmsp/error.h"

namespace pmsp::tool {
namespace {

constexpr int kMostColumns = 1024;
constexpr double kCodesPerUnit = 1024.0;  // of the logarithm
constexpr double kMostCode = 32767.0;

std::string deflated(const std::string& bytes) {
  uLongf length = ::compressBound(static_cast<uLong>(bytes.size()));
  std::string packed(length, '\0');
  if (::compress2(reinterpret_cast<Bytef*>(packed.data()), &length, reinterpret_cast<const Bytef*>(bytes.data()),
                  static_cast<uLong>(bytes.size()), Z_BEST_COMPRESSION) != Z_OK) {
    throw OutputError("a depth map for the report cannot be compressed; memory may be exhausted");
  }
  packed.resize(length);
  return packed;
}

}  // namespace

std::string page_depth(ImageView<const float> depths, ImageView<const float> confidences, double scale) {
  const int columns = depths.width, rows = depths.height;
  float least = 0.0F;
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      if (const float depth = depths(x, y); depth > 0.0F && (least == 0.0F || depth < least)) least = depth;
    }
  }
  if (!(least > 0.0F)) return {};
  const int width = std::min(columns, kMostColumns), height = std::max(1, rows * width / columns);
  const std::size_t count = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  std::string planes(3 * count, '\0');
  int previous = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const int x = static_cast<int>(i) % width, y = static_cast<int>(i) / width;
    const int column = (2 * x + 1) * columns / (2 * width), row = (2 * y + 1) * rows / (2 * height);
    const float depth = depths(column, row);
    if (!(depth > 0.0F)) continue;
    const double code = std::round(kCodesPerUnit * std::log(static_cast<double>(depth) / static_cast<double>(least)));
    const int current = static_cast<int>(std::clamp(code, 0.0, kMostCode));
    const int difference = current - previous;
    const auto folded = static_cast<unsigned>(difference >= 0 ? 2 * difference : -2 * difference - 1);
    previous = current;
    const double root = std::sqrt(static_cast<double>(confidences(column, row)));
    planes[i] = static_cast<char>(folded & 255U);
    planes[count + i] = static_cast<char>(folded >> 8U);
    planes[2 * count + i] = static_cast<char>(std::clamp(std::lround(15.0 * root), 1L, 15L));
  }
  std::string bytes;
  append_little(bytes, static_cast<std::uint32_t>(width));
  append_little(bytes, static_cast<std::uint32_t>(height));
  append_little(bytes, static_cast<double>(least) * scale);
  return bytes + deflated(planes);
}

}  // namespace pmsp::tool
