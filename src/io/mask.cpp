// SPDX-License-Identifier: BSD-2-Clause
#include "elementary.h"
#include "pmsp/io/images.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "export/files.h"
#include "image_decode.h"
#include "mask_image.h"
#include "pmsp/error.h"
#include "util/text.h"

namespace pmsp {
namespace {

/// Source elements [begin, end) that overlap target element i when n_source are scaled to n_target.
struct Span {
  int begin, end;
};

Span covered(int i, int n_source, int n_target) {
  const std::int64_t begin = static_cast<std::int64_t>(i) * n_source / n_target;
  const std::int64_t end = ((static_cast<std::int64_t>(i) + 1) * n_source + n_target - 1) / n_target;
  return {static_cast<int>(begin), static_cast<int>(end)};
}

constexpr int kSampledPixels = 640;  ///< maximum number of columns and rows sampled
constexpr std::size_t kCommonest = 8;
constexpr double kMaxOthers = 0.1;

using Colours = std::vector<std::pair<std::uint64_t, double>>;  ///< with shares, descending

Colours count_colours(const cv::Mat& image) {
  cv::Mat some;
  cv::resize(image, some, {std::min(image.cols, kSampledPixels), std::min(image.rows, kSampledPixels)}, 0, 0,
             cv::INTER_NEAREST);
  some.convertTo(some, CV_16U);
  std::unordered_map<std::uint64_t, int> counts;
  for (int y = 0; y < some.rows; ++y) {
    const auto* row = some.ptr<std::uint16_t>(y);
    for (int x = 0; x < some.cols; ++x) {
      std::uint64_t colour = 0;
      for (int c = 0; c < some.channels(); ++c) colour = colour << 16U | row[x * some.channels() + c];
      ++counts[colour];
    }
  }
  Colours colours;
  for (const auto& [colour, count] : counts)
    colours.emplace_back(colour, static_cast<double>(count) / (static_cast<double>(some.rows) * some.cols));
  std::sort(colours.begin(), colours.end(), [](const auto& a, const auto& b) {
    return a.second != b.second ? a.second > b.second : a.first < b.first;
  });
  return colours;
}

/// Masks have few colours; soft edges and JPEG add others in few pixels.
bool is_photo(const Colours& colours) {
  double others = 0.0;
  for (std::size_t i = kCommonest; i < colours.size(); ++i) others += colours[i].second;
  return others > kMaxOthers;
}

/// "90 % #ffffff, 10 % #ff0000"
std::string text_of(const Colours& colours, const cv::Mat& image) {
  constexpr std::size_t kNamed = 3;
  std::string text;
  for (std::size_t i = 0; i < std::min(kNamed, colours.size()); ++i) {
    std::array<std::uint64_t, 3> bgr{};
    for (int c = 0; c < image.channels() && c < 3; ++c)
      bgr[static_cast<std::size_t>(c)] =
          colours[i].first >> static_cast<unsigned>(16 * (image.channels() - 1 - c)) & 0xFFFFU;
    text += format("%s%.0f %% ", i == 0 ? "" : ", ", 100.0 * colours[i].second);
    text += image.channels() == 1 ? format("gray %u", static_cast<unsigned>(bgr[0]))
                                  : format("#%02x%02x%02x", static_cast<unsigned>(bgr[2]),
                                           static_cast<unsigned>(bgr[1]), static_cast<unsigned>(bgr[0]));
  }
  return text;
}

double half_of(const cv::Mat& image) {
  return image.depth() == CV_8U ? 128.0 : image.depth() == CV_16U ? 32768.0 : 0.5;
}

/// JPEG has no exact black.
bool is_jpeg(const std::filesystem::path& path) {
  const std::string ending = lower_case(path.extension().string());
  return ending == ".jpg" || ending == ".jpeg" || ending == ".jpe";
}

/// 255 unless all channels are black.
cv::Mat usable_by_colour(const cv::Mat& colour, bool lossy) {
  cv::Mat usable(colour.rows, colour.cols, CV_8UC1, cv::Scalar(0));
  for (int c = 0; c < colour.channels(); ++c) {
    cv::Mat channel;
    cv::extractChannel(colour, channel, c);
    if (lossy) {
      usable |= channel >= half_of(colour);
    } else {
      usable |= channel != 0;
    }
  }
  return usable;
}

bool has_both(const cv::Mat& usable) {
  const int count = cv::countNonZero(usable);
  return count > 0 && count < usable.rows * usable.cols;
}

/// Mask of the alpha channel; empty if it hides nothing or everything, and is therefore no mask.
cv::Mat usable_by_alpha(const cv::Mat& image) {
  constexpr int kAlpha = 3;
  if (image.channels() <= kAlpha) return {};
  cv::Mat alpha;
  cv::extractChannel(image, alpha, kAlpha);
  cv::Mat usable = alpha >= half_of(image);
  return has_both(usable) ? usable : cv::Mat();
}

bool png_may_have_alpha(const std::vector<std::uint8_t>& bytes) {
  constexpr std::uint8_t kGrayAlpha = 4, kColourAlpha = 6;
  if (bytes.size() < 26) return false;
  if (bytes[25] == kGrayAlpha || bytes[25] == kColourAlpha) return true;
  const std::string transparent = "tRNS";
  return std::search(bytes.begin(), bytes.end(), transparent.begin(), transparent.end()) != bytes.end();
}

bool webp_may_have_alpha(const std::vector<std::uint8_t>& bytes) {
  constexpr std::uint8_t kFlag = 0x10;
  if (bytes.size() < 25 || bytes[12] != 'V' || bytes[13] != 'P' || bytes[14] != '8') return false;
  if (bytes[15] == 'X') return (bytes[20] & kFlag) != 0;
  return bytes[15] == 'L' && (bytes[24] & kFlag) != 0;
}

}  // namespace

namespace io {

MaskImage decode_mask(const std::filesystem::path& path, bool instances) {
  // Unchanged: conversions to gray or 8 bits would round small values to 0.
  const cv::Mat image = decode_image_file(path, cv::IMREAD_UNCHANGED);
  cv::Mat colour = image;
  if (image.channels() == 4) {
    const std::array<int, 6> kept{0, 0, 1, 1, 2, 2};
    colour = cv::Mat(image.rows, image.cols, CV_MAKETYPE(image.depth(), 3));
    cv::mixChannels(&image, 1, &colour, 1, kept.data(), 3);
  }
  const Colours colours = count_colours(colour);
  if (instances) return {usable_by_colour(colour, false) == 0, text_of(colours, colour)};
  const bool photo = is_photo(colours);
  MaskImage mask{usable_by_colour(colour, is_jpeg(path)), text_of(colours, colour)};
  if (photo || !has_both(mask.usable)) {
    const cv::Mat opaque = usable_by_alpha(image);
    mask.by_alpha = !opaque.empty();
    if (mask.by_alpha) mask.usable = opaque;
  }
  if (photo && !mask.by_alpha)
    throw InvalidInput(path.string() + ": is no mask: it has " + std::to_string(colours.size()) +
                       " colours, as a photo or a depth map; expected two colours: black (0) = ignored, "
                       "another one = used");
  return mask;
}

Image<std::uint8_t> scale_mask(const std::string& what, const cv::Mat& usable, int width, int height) {
  if (static_cast<std::int64_t>(usable.cols) * height != static_cast<std::int64_t>(usable.rows) * width)
    throw InvalidInput(what + ": the mask is " + std::to_string(usable.cols) + "x" + std::to_string(usable.rows) +
                       ", but the images are " + std::to_string(width) + "x" + std::to_string(height) +
                       "; expected that size or the same shape scaled");
  Image<std::uint8_t> narrow(width, usable.rows);  // minimum along rows, then along columns
  for (int y = 0; y < usable.rows; ++y) {
    const std::uint8_t* row = usable.ptr<std::uint8_t>(y);
    for (int x = 0; x < width; ++x) {
      const Span span = covered(x, usable.cols, width);
      narrow(x, y) = *std::min_element(row + span.begin, row + span.end);
    }
  }
  Image<std::uint8_t> out(width, height, 255);
  for (int y = 0; y < height; ++y) {
    const Span span = covered(y, usable.rows, height);
    for (int from = span.begin; from < span.end; ++from)
      for (int x = 0; x < width; ++x) out(x, y) = std::min(out(x, y), narrow(x, from));
  }
  return out;
}

cv::Mat image_opacity(const std::filesystem::path& image) {
  return may_have_alpha(image) ? usable_by_alpha(decode_image_file(image, cv::IMREAD_UNCHANGED)) : cv::Mat();
}

double hidden_share(ImageView<const std::uint8_t> mask) {
  double hidden = 0.0;
  double all = 0.0;
  for (int y = 0; y < mask.height; ++y) {
    const double weight = std::sin(kernels::kPi * (y + 0.5) / mask.height);
    const auto ignored = std::count(mask.row(y), mask.row(y) + mask.width, std::uint8_t{0});
    hidden += weight * static_cast<double>(ignored) / mask.width;
    all += weight;
  }
  return all > 0.0 ? hidden / all : 0.0;
}

}  // namespace io

bool may_have_alpha(const std::filesystem::path& image) {
  constexpr std::size_t kHeadBytes = std::size_t{1} << 14;
  if (is_jpeg(image) || !is_file(image)) return false;
  std::ifstream file(image, std::ios::binary);
  std::vector<std::uint8_t> bytes(kHeadBytes);
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<std::size_t>(file.gcount()));
  const auto starts_with = [&](const std::string& magic) {
    return bytes.size() > magic.size() && std::memcmp(bytes.data(), magic.data(), magic.size()) == 0;
  };
  if (starts_with("\x89PNG")) return png_may_have_alpha(bytes);
  if (starts_with("RIFF")) return webp_may_have_alpha(bytes);
  return starts_with(std::string("II*\0", 4)) || starts_with(std::string("MM\0*", 4));
}

Image<std::uint8_t> read_mask(const std::filesystem::path& path, int width, int height) {
  if (width <= 0 || height <= 0)
    throw InvalidOption("read_mask: size " + std::to_string(width) + "x" + std::to_string(height) + ", expected > 0");
  const io::MaskImage mask = io::decode_mask(path);
  Image<std::uint8_t> scaled = io::scale_mask(path.string(), mask.usable, width, height);
  if (cv::countNonZero(mask.usable) == 0)
    throw InvalidInput(path.string() +
                       ": every pixel of the mask is black (0), which is ignored; expected black = ignore, white (or "
                       "any other colour) = use");
  return scaled;
}

}  // namespace pmsp
