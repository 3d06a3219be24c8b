// SPDX-License-Identifier: BSD-2-Clause
#include "image_decode.h"

#include <cstdint>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <system_error>
#include <vector>

#include "pmsp/error.h"

namespace pmsp::io {
namespace {

constexpr std::uintmax_t kMaxFileBytes = std::uintmax_t{1} << 30;

std::vector<std::uint8_t> read_bytes(const std::filesystem::path& path) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error) throw IoError(path.string() + ": cannot be read: " + error.message());
  if (size == 0) throw IoError(path.string() + ": the file is empty, an image was expected");
  if (size > kMaxFileBytes)
    throw IoError(path.string() + ": " + std::to_string(size) + " bytes are too many for one image (limit 1 GiB)");
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(size));
  std::ifstream file(path, std::ios::binary);
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (!file)
    throw IoError(path.string() + ": cannot be read: only " + std::to_string(file.gcount()) + " of " +
                  std::to_string(size) + " bytes");
  return bytes;
}

/// True for a JPEG whose end-of-image marker is missing. An embedded thumbnail has such a marker of its own, so the
/// segments before the scan are skipped by their lengths.
bool is_truncated_jpeg(const std::vector<std::uint8_t>& bytes) {
  constexpr std::uint8_t kMark = 0xFF, kStart = 0xD8, kEnd = 0xD9, kScan = 0xDA;
  if (bytes.size() < 4 || bytes[0] != kMark || bytes[1] != kStart) return false;
  std::size_t at = 2;
  while (at + 4 <= bytes.size() && bytes[at] == kMark && bytes[at + 1] != kScan) {
    if (bytes[at + 1] == kMark) {  // a fill byte
      ++at;
      continue;
    }
    at += 2 + static_cast<std::size_t>(bytes[at + 2] * 256 + bytes[at + 3]);
  }
  for (; at + 1 < bytes.size(); ++at)
    if (bytes[at] == kMark && bytes[at + 1] == kEnd) return false;
  return true;
}

}  // namespace

cv::Mat decode_image_file(const std::filesystem::path& path, int imread_flags) {
  const std::vector<std::uint8_t> bytes = read_bytes(path);
  if (is_truncated_jpeg(bytes))
    throw IoError(path.string() + ": the JPEG ends after " + std::to_string(bytes.size()) +
                  " bytes without its end marker; copy the file again");
  cv::Mat image;
  try {
    image = cv::imdecode(bytes, imread_flags);
  } catch (const std::exception& error) {
    throw IoError(path.string() + ": cannot be decoded: " + error.what());
  }
  if (image.empty()) throw IoError(path.string() + ": cannot be decoded: broken, or no image format that OpenCV reads");
  return image;
}

Image<Rgb> rgb_from_bgr(const cv::Mat& bgr) {
  if (bgr.type() != CV_8UC3) throw InvalidInput("a decoded image is not 8-bit colour");
  Image<Rgb> rgb(bgr.cols, bgr.rows);
  for (int y = 0; y < bgr.rows; ++y) {
    const auto* in = bgr.ptr<cv::Vec3b>(y);
    Rgb* out = rgb.row(y);
    for (int x = 0; x < bgr.cols; ++x) out[x] = {in[x][2], in[x][1], in[x][0]};
  }
  return rgb;
}

void check_image_size(const std::string& what, int width, int height, const MapCamera& camera) {
  if (width > 0 && height > 0 &&
      static_cast<std::int64_t>(width) * camera.height == static_cast<std::int64_t>(height) * camera.width)
    return;
  throw InvalidInput(what + ": is " + std::to_string(width) + "x" + std::to_string(height) +
                     ", but the map's camera '" + camera.name + "' saw " + std::to_string(camera.width) + "x" +
                     std::to_string(camera.height) + "; expected that size or the same shape scaled");
}

}  // namespace pmsp::io
