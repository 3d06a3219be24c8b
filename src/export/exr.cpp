// SPDX-License-Identifier: BSD-2-Clause
// OpenEXR 2, single part, scan lines, uncompressed ("OpenEXR File Layout").
#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "export/files.h"
#include "export/little_endian.h"
#include "pmsp/error.h"
#include "pmsp/io/depth.h"

namespace pmsp {
namespace {

constexpr std::int32_t kMagic = 20000630, kVersion = 2, kFloat = 2;

std::string exr_attribute(const char* name, const char* type, const std::string& value) {
  std::string text = std::string(name) + '\0' + type + '\0';
  append_little(text, static_cast<std::int32_t>(value.size()));
  return text + value;
}

std::string channel_list(const std::vector<ImageChannel>& channels) {
  std::string text;
  for (const ImageChannel& channel : channels) {
    text += channel.name + '\0';
    append_little(text, kFloat);
    append_little(text, std::int32_t{0});  // pLinear and three reserved bytes
    append_little(text, std::int32_t{1});  // x sampling
    append_little(text, std::int32_t{1});  // y sampling
  }
  return text + '\0';
}

std::string header(const std::vector<ImageChannel>& channels, int width, int height) {
  std::string window, one, zeros;
  for (const int value : {0, 0, width - 1, height - 1}) append_little(window, std::int32_t{value});
  append_little(one, 1.0F);
  for (int i = 0; i < 2; ++i) append_little(zeros, 0.0F);
  const std::string none(1, '\0');  // compression: none; line order: increasing y
  std::string text;
  append_little(text, kMagic);
  append_little(text, kVersion);
  return text + exr_attribute("channels", "chlist", channel_list(channels)) +
         exr_attribute("compression", "compression", none) + exr_attribute("dataWindow", "box2i", window) +
         exr_attribute("displayWindow", "box2i", window) + exr_attribute("lineOrder", "lineOrder", none) +
         exr_attribute("pixelAspectRatio", "float", one) + exr_attribute("screenWindowCenter", "v2f", zeros) +
         exr_attribute("screenWindowWidth", "float", one) + '\0';
}

}  // namespace

void write_exr(const std::filesystem::path& path, std::vector<ImageChannel> channels) {
  const int width = channels.empty() ? 0 : channels.front().values.width();
  const int height = channels.empty() ? 0 : channels.front().values.height();
  for (const ImageChannel& channel : channels) {
    const bool fits = channel.values.width() == width && channel.values.height() == height && width > 0;
    if (!fits || channel.name.empty() || channel.name.size() > 31) {
      throw InvalidInput(path.string() + ": EXR wants channels with names of 1 to 31 letters, all of one size");
    }
  }
  if (channels.empty()) throw InvalidInput(path.string() + ": an image without channels cannot be written as EXR");
  std::sort(channels.begin(), channels.end(),
            [](const ImageChannel& a, const ImageChannel& b) { return a.name < b.name; });
  std::string text = header(channels, width, height);
  const std::size_t row_bytes = channels.size() * static_cast<std::size_t>(width) * sizeof(float);
  const std::size_t first = text.size() + static_cast<std::size_t>(height) * sizeof(std::uint64_t);
  for (int y = 0; y < height; ++y) {
    append_little(text, std::uint64_t{first + static_cast<std::size_t>(y) * (row_bytes + 2 * sizeof(std::int32_t))});
  }
  AtomicFile file(path);
  file.write(text);
  for (int y = 0; y < height; ++y) {
    text.clear();
    append_little(text, std::int32_t{y});
    append_little(text, static_cast<std::int32_t>(row_bytes));
    for (const ImageChannel& channel : channels) {
      for (int x = 0; x < width; ++x) append_little(text, channel.values.row(y)[x]);
    }
    file.write(text);
  }
  file.commit();
}

void write_depth_exr(const std::filesystem::path& path, const DepthMap& map) {
  std::vector<ImageChannel> channels{{"Z", map.depth}, {"confidence", map.confidence}};
  const char* const kNames[] = {"N.X", "N.Y", "N.Z"};
  for (int i = 0; i < 3; ++i) {
    Image<float> values(map.normal.width(), map.normal.height());
    for (std::size_t k = 0; k < values.size(); ++k) values.pixels()[k] = map.normal.pixels()[k][i];
    channels.push_back({kNames[i], std::move(values)});
  }
  write_exr(path, std::move(channels));
}

}  // namespace pmsp
