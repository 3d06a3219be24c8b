// SPDX-License-Identifier: BSD-2-Clause
#include "image_decode.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <initializer_list>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "exif.h"
#include "jpeg_segments.h"
#include "panorama_size.h"
#include "pmsp/error.h"
#include "zip_member.h"

namespace pmsp::io {
namespace {

constexpr std::uintmax_t kMaxFileBytes = std::uintmax_t{1} << 30;
constexpr std::uint64_t kMaxPixels = std::uint64_t{16384} * 8192;

std::vector<std::uint8_t> read_bytes(const std::filesystem::path& path) {
  if (!archive_of(path).empty()) {
    const std::string bytes = read_zip_member(path);
    return {bytes.begin(), bytes.end()};
  }
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error) throw IoError(path.string() + ": cannot be read: " + error.message());
  if (size == 0) throw IoError(path.string() + ": the file is empty; expected an image");
  if (size > kMaxFileBytes)
    throw IoError(path.string() + ": " + std::to_string(size) + " bytes; expected at most 1 GiB for an image");
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(size));
  std::ifstream file(path, std::ios::binary);
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (!file)
    throw IoError(path.string() + ": cannot be read: only " + std::to_string(file.gcount()) + " of " +
                  std::to_string(size) + " bytes");
  return bytes;
}

/// Header data of a JPEG or PNG; size 0 = other format or broken.
struct ImageHeader {
  std::uint64_t width = 0;
  std::uint64_t height = 0;
  bool is_jpeg = false;
  bool truncated = false;  ///< JPEG without end-of-image marker
};

ImageHeader jpeg_header(const std::vector<std::uint8_t>& bytes) {
  constexpr std::uint8_t kMark = 0xFF, kEnd = 0xD9, kTables = 0xC4, kExtension = 0xC8, kCoding = 0xCC;
  ImageHeader header;
  header.is_jpeg = true;
  std::size_t at = each_jpeg_segment(bytes, [&](std::uint8_t kind, std::size_t segment, std::size_t /*size*/) {
    const bool is_frame = (kind & 0xF0U) == 0xC0U && kind != kTables && kind != kExtension && kind != kCoding;
    if (!is_frame) return;
    header.height = big_endian(bytes, segment + 1, 2);
    header.width = big_endian(bytes, segment + 3, 2);
  });
  header.truncated = true;
  for (; at + 1 < bytes.size() && header.truncated; ++at)
    header.truncated = bytes[at] != kMark || bytes[at + 1] != kEnd;
  return header;
}

/// Number after a key in the XMP data of a JPEG, attribute or element; nullopt = none.
std::optional<double> xmp_number(const std::string& text, const std::string& key) {
  const std::size_t at = text.find(key);
  if (at == std::string::npos) return std::nullopt;
  const std::size_t number = text.find_first_of("0123456789", at + key.size());
  if (number == std::string::npos || number > at + key.size() + 4) return std::nullopt;  // ="4096" or >4096
  return std::strtod(text.substr(number, 20).c_str(), nullptr);
}

/// Throws InvalidInput for partial panoramas according to the XMP data of cameras and stitchers: as full ones they
/// would be distorted. Data are stale if the image has the shape of a full panorama and not the size of the part:
/// programs that pad or resize an image do not update them.
void refuse_crop(const std::filesystem::path& path, const std::vector<std::uint8_t>& bytes, const ImageHeader& header) {
  const std::string_view all(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::size_t begin = all.find("<x:xmpmeta");
  const std::size_t end = begin == std::string_view::npos ? begin : all.find("</x:xmpmeta>", begin);
  if (end == std::string_view::npos) return;
  const std::string text(all.substr(begin, end - begin));
  const auto full_width = xmp_number(text, "GPano:FullPanoWidthPixels");
  const auto full_height = xmp_number(text, "GPano:FullPanoHeightPixels");
  const auto width = xmp_number(text, "GPano:CroppedAreaImageWidthPixels");
  const auto height = xmp_number(text, "GPano:CroppedAreaImageHeightPixels");
  if (!full_width || !full_height || !width || !height || (*width >= *full_width && *height >= *full_height)) return;
  const auto pixels = [](std::uint64_t size) { return static_cast<std::int64_t>(size); };
  const bool is_part = std::llround(*width) == pixels(header.width) && std::llround(*height) == pixels(header.height);
  if (!is_part && is_panorama_size(pixels(header.width), pixels(header.height))) return;
  const auto size = [](double w, double h) {
    return std::to_string(std::llround(w)) + "x" + std::to_string(std::llround(h));
  };
  throw InvalidInput(path.string() + ": is a part of a panorama: " + size(*width, *height) + " of " +
                     size(*full_width, *full_height) +
                     " pixels by its GPano data (CroppedArea...); expected the whole sphere; pad it with black to "
                     "that size, reconstruct the map from such images, and mask the black (--mask)");
}

ImageHeader header_of(const std::vector<std::uint8_t>& bytes) {
  const auto starts_with = [&](std::initializer_list<std::uint8_t> magic) {
    return bytes.size() >= magic.size() && std::equal(magic.begin(), magic.end(), bytes.begin());
  };
  if (starts_with({0xFF, 0xD8}) && bytes.size() >= 4) return jpeg_header(bytes);
  if (starts_with({0x89, 'P', 'N', 'G'})) return {big_endian(bytes, 16, 4), big_endian(bytes, 20, 4), false, false};
  return {};
}

/// Applies the EXIF orientation: transposition (5 to 8), then rotation or mirroring.
cv::Mat upright(const std::filesystem::path& path, const cv::Mat& image, int orientation) {
  constexpr int kAboutX = 0, kAboutY = 1, kBoth = -1;
  cv::Mat turned = image;
  const bool is_quarter = orientation >= 5;
  if (is_quarter && image.cols > image.rows) {
    throw InvalidInput(path.string() + ": EXIF orientation " + std::to_string(orientation) +
                       " rotates it by 90 degrees, to " + std::to_string(image.rows) + "x" +
                       std::to_string(image.cols) +
                       "; expected a panorama that is twice as wide as high; remove the orientation, or rotate the "
                       "image and reconstruct the map");
  }
  if (is_quarter) cv::transpose(image, turned);
  cv::Mat result = turned;
  if (orientation == 2 || orientation == 6) cv::flip(turned, result, kAboutY);
  if (orientation == 3 || orientation == 7) cv::flip(turned, result, kBoth);
  if (orientation == 4 || orientation == 8) cv::flip(turned, result, kAboutX);
  return result;
}

}  // namespace

cv::Mat decode_image_file(const std::filesystem::path& path, int imread_flags) {
  const std::vector<std::uint8_t> bytes = read_bytes(path);
  const ImageHeader header = header_of(bytes);
  if (header.width * header.height > kMaxPixels)  // small files may declare gigabytes, which OpenCV would allocate
    throw IoError(path.string() + ": is " + std::to_string(header.width) + "x" + std::to_string(header.height) +
                  " pixels; expected at most 16384x8192");
  if (header.is_jpeg) refuse_crop(path, bytes, header);
  if (header.truncated)
    throw IoError(path.string() + ": the JPEG ends after " + std::to_string(bytes.size()) +
                  " bytes without its end marker; copy the file again");
  cv::Mat image;
  try {
    image = cv::imdecode(bytes, imread_flags | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const std::exception& error) {
    throw IoError(path.string() + ": cannot be decoded: " + error.what());
  }
  if (image.empty()) throw IoError(path.string() + ": cannot be decoded: broken, or no image format that OpenCV reads");
  return upright(path, image, read_exif(bytes).orientation);
}

std::vector<unsigned char> encoded(const std::string& extension, const cv::Mat& image, const std::string& error,
                                   const std::vector<int>& parameters) {
  std::vector<unsigned char> bytes;
  if (!cv::imencode(extension, image, bytes, parameters)) throw OutputError(error);
  return bytes;
}

Image<Rgb> rgb_from_bgr(const cv::Mat& bgr) {
  if (bgr.type() != CV_8UC3) throw InvalidInput("a decoded image is not 8-bit colour");
  cv::Mat panorama = bgr;
  if (is_panorama_size(bgr.cols, bgr.rows)) {
    const int height = panorama_height(bgr.cols, bgr.rows);
    const bool is_whole = bgr.cols == 2 * height && bgr.rows == height;
    if (!is_whole) cv::resize(bgr, panorama, {2 * height, height}, 0.0, 0.0, cv::INTER_LINEAR);
  }
  Image<Rgb> rgb(panorama.cols, panorama.rows);
  for (int y = 0; y < panorama.rows; ++y) {
    const auto* in = panorama.ptr<cv::Vec3b>(y);
    Rgb* out = rgb.row(y);
    for (int x = 0; x < panorama.cols; ++x) out[x] = {in[x][2], in[x][1], in[x][0]};
  }
  return rgb;
}

void check_image_size(const std::string& what, int width, int height, const MapCamera& camera) {
  if (is_panorama_size(width, height) && is_panorama_size(camera.width, camera.height)) return;
  if (width > 0 && height > 0 &&
      static_cast<std::int64_t>(width) * camera.height == static_cast<std::int64_t>(height) * camera.width)
    return;
  throw InvalidInput(what + ": is " + std::to_string(width) + "x" + std::to_string(height) +
                     ", but the map's camera '" + camera.name + "' has " + std::to_string(camera.width) + "x" +
                     std::to_string(camera.height) + "; expected that size or the same shape scaled");
}

}  // namespace pmsp::io
