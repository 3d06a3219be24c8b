// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include <zlib.h>

#include "npy.h"
#include "pmsp/io/depth.h"
#include "text_input.h"
#include "zip_member.h"

namespace pmsp {
namespace {

constexpr std::size_t kLongestName = 255;  ///< of an EXR attribute or channel
constexpr std::int64_t kMostPixels = std::int64_t{16384} * 8192;

/// Bits of an IEEE 754 half.
float from_half(std::uint16_t bits) {
  const int exponent = bits >> 10U & 0x1fU;
  const int fraction = bits & 0x3ffU;
  const float sign = (bits & 0x8000U) != 0 ? -1.0F : 1.0F;
  if (exponent == 31) return fraction != 0 ? std::nanf("") : sign * HUGE_VALF;
  if (exponent == 0) return sign * std::ldexp(static_cast<float>(fraction), -24);
  return sign * std::ldexp(static_cast<float>(fraction + 1024), exponent - 25);
}

void check_size(const BinaryInput& file, std::int64_t width, std::int64_t height) {
  if (width >= 1 && height >= 1 && width <= kMostPixels && height <= kMostPixels / width) return;
  file.refuse("the image is " + std::to_string(width) + " x " + std::to_string(height) +
              "; expected 1 to 16384 x 8192 pixels");
}

// --- EXR: "OpenEXR File Layout"; single part, scan lines
// ---------------------------------------------------------------

struct ExrChannel {
  std::string name;
  int bytes = 0;  ///< of a value
};

struct ExrHeader {
  std::vector<ExrChannel> channels;
  int compression = -1;
  std::int64_t width = 0, height = 0, first_row = 0;
};

std::vector<ExrChannel> exr_channels(BinaryInput& file) {
  std::vector<ExrChannel> channels;
  for (std::string name = file.text(kLongestName); !name.empty(); name = file.text(kLongestName)) {
    const auto type = file.number<std::int32_t>();
    file.skip(4);
    const auto columns = file.number<std::int32_t>(), rows = file.number<std::int32_t>();
    if (type < 0 || type > 2 || columns != 1 || rows != 1) {
      file.refuse("channel \"" + name + "\" is of another kind; expected values of all pixels");
    }
    channels.push_back({name, type == 1 ? 2 : type == 2 ? 4 : -4});
  }
  return channels;
}

ExrHeader exr_header(BinaryInput& file) {
  ExrHeader header;
  const auto version = file.number<std::uint32_t>();
  if ((version & 0xffU) != 2 || (version & 0x1a00U) != 0) {
    file.refuse("EXR of tiles, with several parts or of an unknown version; expected scan lines in one part");
  }
  for (std::string name = file.text(kLongestName); !name.empty(); name = file.text(kLongestName)) {
    const std::string type = file.text(kLongestName);
    const auto size = file.number<std::int32_t>();
    if (size < 0) file.refuse("attribute \"" + name + "\" has a negative size");
    const std::uint64_t end = file.position() + static_cast<std::uint64_t>(size);
    file.require(static_cast<std::uint64_t>(size));
    if (name == "channels") {
      header.channels = exr_channels(file);
    } else if (name == "compression" && size == 1) {
      header.compression = file.number<std::uint8_t>();
    } else if (name == "dataWindow" && size == 16) {
      std::array<std::int64_t, 4> window{};
      for (std::int64_t& value : window) value = file.number<std::int32_t>();
      header.first_row = window[1];
      header.width = window[2] - window[0] + 1;
      header.height = window[3] - window[1] + 1;
    }
    if (file.position() > end) file.refuse("attribute \"" + name + "\" exceeds its size");
    file.seek(end);
  }
  check_size(file, header.width, header.height);
  if (header.channels.empty()) file.refuse("the image has no channels");
  return header;
}

/// The channels that hold depth: the only one, the first of these names, or the three of a gray image.
std::vector<std::size_t> exr_depth_channels(const BinaryInput& file, const ExrHeader& header) {
  std::vector<std::size_t> found, colors;
  std::string names;
  for (std::size_t i = 0; i < header.channels.size(); ++i) {
    const std::string& name = header.channels[i].name;
    names += (names.empty() ? "" : ", ") + name;
    if (name == "R" || name == "G" || name == "B") colors.push_back(i);
  }
  if (header.channels.size() == 1) found = {0};
  for (const char* const wanted : {"Z", "depth", "Y", "V"}) {
    for (std::size_t i = 0; i < header.channels.size() && found.empty(); ++i) {
      if (header.channels[i].name == wanted) found = {i};
    }
  }
  if (found.empty() && colors.size() == 3) found = colors;
  if (found.empty()) {
    file.refuse("its channels are " + names +
                "; expected a single one, one that is named Z, depth, Y or V, or R, G and B of equal values");
  }
  if (std::any_of(found.begin(), found.end(), [&](std::size_t i) { return header.channels[i].bytes < 0; })) {
    file.refuse("its depth is in whole numbers; expected half or float");
  }
  return found;
}

/// Undoes what EXR does to bytes before zlib packs them.
void undo_prediction(std::vector<char>& bytes) {
  for (std::size_t i = 1; i < bytes.size(); ++i) {
    const int sum = static_cast<unsigned char>(bytes[i - 1]) + static_cast<unsigned char>(bytes[i]) - 128;
    bytes[i] = static_cast<char>(static_cast<unsigned char>(sum & 0xff));
  }
  std::vector<char> sorted(bytes.size());
  const std::size_t half = (bytes.size() + 1) / 2;
  for (std::size_t i = 0; i < bytes.size(); ++i) sorted[i] = bytes[i / 2 + (i % 2 == 0 ? 0 : half)];
  bytes = std::move(sorted);
}

void unpack(const BinaryInput& file, const char* packed, std::size_t size, std::vector<char>& bytes) {
  uLongf length = static_cast<uLongf>(bytes.size());
  const int result = ::uncompress(reinterpret_cast<Bytef*>(bytes.data()), &length,
                                  reinterpret_cast<const Bytef*>(packed), static_cast<uLong>(size));
  if (result != Z_OK || length != bytes.size()) file.refuse("rows cannot be unpacked; is it broken?");
  undo_prediction(bytes);
}

class ExrReader {
 public:
  explicit ExrReader(const std::filesystem::path& path) : file_(path) {
    if (!file_.take_if("\x76\x2f\x31\x01")) file_.fail("is no EXR");
  }
  const BinaryInput& file() const { return file_; }

  /// `choose(header)`: which channels are wanted, of half or float.
  template <class Choose>
  std::vector<ImageChannel> read(const Choose& choose) {
    const ExrHeader header = exr_header(file_);
    for (const std::size_t i : choose(header)) channels_.push_back(layout_of(header, i));
    constexpr int kNone = 0, kZips = 2, kZip = 3;
    if (header.compression != kNone && header.compression != kZips && header.compression != kZip) {
      file_.refuse("compression " + std::to_string(header.compression) +
                   " is not supported; expected none, ZIPS or ZIP");
    }
    std::size_t row_bytes = 0;
    for (const ExrChannel& channel : header.channels) row_bytes += bytes_of_row(channel, header);
    const std::size_t height = static_cast<std::size_t>(header.height);
    const std::size_t expansion = header.compression == kNone ? 1 : io::kMaxInflation;
    if (row_bytes > file_.size() * expansion / height) {
      file_.refuse("the file is too short for " + std::to_string(header.width) + " x " + std::to_string(header.height) +
                   " pixels; is it cut off?");
    }
    std::vector<ImageChannel> found;
    for (const Layout& channel : channels_) {
      found.push_back({channel.name, Image<float>(static_cast<int>(header.width), static_cast<int>(header.height))});
    }
    const std::size_t rows_at_once = header.compression == kZip ? 16 : 1;
    const std::size_t blocks = (height + rows_at_once - 1) / rows_at_once;
    file_.skip(blocks * sizeof(std::uint64_t));  // blocks say themselves where they belong
    std::vector<char> bytes;
    for (std::size_t block = 0; block < blocks; ++block) {
      const std::int64_t y = file_.number<std::int32_t>() - header.first_row;
      const auto size = file_.number<std::int32_t>();
      if (y < 0 || y >= header.height || size < 0) file_.refuse("a block of rows that lie outside the image");
      const std::size_t rows = std::min(rows_at_once, height - static_cast<std::size_t>(y));
      bytes.resize(rows * row_bytes);
      take_block(static_cast<std::size_t>(size), header.compression == kNone, bytes);
      for (std::size_t row = 0; row < rows; ++row) {
        take_row(bytes.data() + row * row_bytes, static_cast<int>(y) + static_cast<int>(row), found);
      }
    }
    return found;
  }

 private:
  struct Layout {
    std::string name;
    std::size_t before;  ///< bytes of a row
    bool is_half;
  };

  static std::size_t bytes_of_row(const ExrChannel& channel, const ExrHeader& header) {
    return static_cast<std::size_t>(std::abs(channel.bytes)) * static_cast<std::size_t>(header.width);
  }
  static Layout layout_of(const ExrHeader& header, std::size_t wanted) {
    std::size_t before = 0;
    for (std::size_t i = 0; i < wanted; ++i) before += bytes_of_row(header.channels[i], header);
    return {header.channels[wanted].name, before, header.channels[wanted].bytes == 2};
  }

  void take_block(std::size_t size, bool is_plain, std::vector<char>& bytes) {
    const char* const packed = file_.take(size);
    if (size >= bytes.size()) {  // not packed where that would not help
      if (size != bytes.size()) file_.refuse("a block of rows that is too long");
      std::memcpy(bytes.data(), packed, bytes.size());
    } else {
      if (is_plain) file_.refuse("a block of rows that is too short");
      unpack(file_, packed, size, bytes);
    }
  }

  void take_row(const char* bytes, int y, std::vector<ImageChannel>& to) const {
    for (std::size_t k = 0; k < to.size(); ++k) {
      const char* at = bytes + channels_[k].before;
      const bool is_half = channels_[k].is_half;
      float* const row = to[k].values.row(y);
      for (int x = 0; x < to[k].values.width(); ++x, at += is_half ? 2 : 4) {
        row[x] = is_half ? from_half(get_little<std::uint16_t>(at)) : get_little<float>(at);
      }
    }
  }

  BinaryInput file_;
  std::vector<Layout> channels_;
};

// --- NPY: "NEP 1, a simple file format for NumPy arrays"
// ---------------------------------------------------------------

/// What follows a key of the header, which is a Python dictionary.
std::string npy_value(const BinaryInput& file, const std::string& header, const std::string& key) {
  std::size_t at = header.find("'" + key + "'");
  if (at != std::string::npos) at = header.find(':', at);
  if (at != std::string::npos) at = header.find_first_not_of(' ', at + 1);
  if (at == std::string::npos) file.refuse("its header has no \"" + key + "\"");
  const char open = header[at];
  const std::size_t end = open == '('    ? header.find(')', at)
                          : open == '\'' ? header.find('\'', at + 1)
                                         : header.find_first_of(",}", at);
  if (end == std::string::npos) file.refuse("its header breaks off after \"" + key + "\"");
  const bool is_enclosed = open == '(' || open == '\'';
  return header.substr(at + (is_enclosed ? 1 : 0), end - at - (is_enclosed ? 1 : 0));
}

struct NpyHeader {
  std::string type;   ///< "<f4"
  std::string shape;  ///< "3, 5"
  std::vector<std::int64_t> sides;
};

NpyHeader npy_header(BinaryInput& file) {
  if (!file.take_if("\x93NUMPY")) file.fail("is no NPY");
  const int version = file.number<std::uint8_t>();
  file.skip(1);
  if (version < 1 || version > 3) file.refuse("version " + std::to_string(version) + " of NPY; expected 1 to 3");
  const std::size_t length = version == 1 ? file.number<std::uint16_t>() : file.number<std::uint32_t>();
  const std::string text(file.take(length), length);
  NpyHeader header{npy_value(file, text, "descr"), npy_value(file, text, "shape"), {}};
  const std::string order = npy_value(file, text, "fortran_order");
  if (order.rfind("False", 0) != 0) file.refuse("its values are in Fortran order; expected C order (row by row)");
  for (const std::string& word : words_of(header.shape, " ,")) {
    const std::optional<std::int64_t> side = plain_number_from<std::int64_t>(word);
    if (!side || *side < 0) file.refuse("its shape is (" + header.shape + "); expected whole numbers");
    header.sides.push_back(*side);
  }
  return header;
}

template <class T, class From, class Value>
void take_values(BinaryInput& file, std::vector<Value>& values, const From& from) {
  for (Value& value : values) value = from(file.number<T>());
}

template <class T, class Value>
void take_values(BinaryInput& file, std::vector<Value>& values) {
  take_values<T>(file, values, [](T value) { return static_cast<Value>(value); });
}

}  // namespace

std::vector<ImageChannel> read_exr(const std::filesystem::path& path, const std::vector<std::string>& names) {
  return ExrReader(path).read([&](const ExrHeader& header) {
    std::vector<std::size_t> wanted;
    for (std::size_t i = 0; i < header.channels.size(); ++i) {
      const bool is_named = std::find(names.begin(), names.end(), header.channels[i].name) != names.end();
      if (is_named && header.channels[i].bytes > 0) wanted.push_back(i);
    }
    return wanted;
  });
}

Image<Eigen::Vector3f> read_exr_vectors(const std::filesystem::path& path, const std::array<std::string, 3>& names) {
  const std::vector<ImageChannel> channels = read_exr(path, {names.begin(), names.end()});
  if (channels.size() != names.size()) return {};
  Image<Eigen::Vector3f> vectors(channels[0].values.width(), channels[0].values.height(), Eigen::Vector3f::Zero());
  for (const ImageChannel& channel : channels) {
    const auto axis = std::find(names.begin(), names.end(), channel.name) - names.begin();
    for (std::size_t i = 0; i < vectors.size(); ++i) vectors.pixels()[i][axis] = channel.values.pixels()[i];
  }
  return vectors;
}

Image<float> read_exr_depth(const std::filesystem::path& path) {
  ExrReader file(path);
  std::vector<ImageChannel> channels =
      file.read([&](const ExrHeader& header) { return exr_depth_channels(file.file(), header); });
  Image<float>& depth = channels.front().values;
  const auto same = [](float a, float b) { return a == b || (std::isnan(a) && std::isnan(b)); };
  for (const ImageChannel& channel : channels) {
    if (std::equal(depth.pixels().begin(), depth.pixels().end(), channel.values.pixels().begin(), same)) continue;
    file.file().refuse("its channels R, G, B differ, as in an image of colours; expected depth, the same in all three");
  }
  return std::move(depth);
}

Image<float> read_npy(const std::filesystem::path& path) {
  BinaryInput file(path);
  NpyHeader header = npy_header(file);
  std::vector<std::int64_t>& sides = header.sides;
  for (auto side = sides.begin(); sides.size() > 2 && side != sides.end();) {
    side = *side == 1 ? sides.erase(side) : side + 1;
  }
  if (sides.size() != 2) file.refuse("its shape is (" + header.shape + "); expected rows and columns");
  check_size(file, sides[1], sides[0]);
  const std::string& type = header.type;
  const std::size_t bytes = type == "<f2" ? 2 : type == "<f4" ? 4 : type == "<f8" ? 8 : 0;
  if (bytes == 0) file.refuse("its values are \"" + type + "\"; expected <f2, <f4 or <f8 (little-endian floats)");
  file.require(bytes * static_cast<std::size_t>(sides[0] * sides[1]));
  Image<float> image(static_cast<int>(sides[1]), static_cast<int>(sides[0]));
  if (bytes == 2) take_values<std::uint16_t>(file, image.pixels(), from_half);
  if (bytes == 4) take_values<float>(file, image.pixels());
  if (bytes == 8) take_values<double>(file, image.pixels());
  return image;
}

NpyArray read_npy_array(const std::filesystem::path& path) {
  BinaryInput file(path);
  const NpyHeader header = npy_header(file);
  std::uint64_t count = 1;
  for (const std::int64_t side : header.sides) {
    if (side > 0 && count > file.size() / static_cast<std::uint64_t>(side)) {
      file.refuse("its shape is (" + header.shape + "), more than the file holds; it is truncated or damaged");
    }
    count *= static_cast<std::uint64_t>(side);
  }
  NpyArray array{header.sides, {}};
  const auto take = [&](auto zero) {
    file.require(sizeof zero * count);
    array.values.resize(count);
    take_values<decltype(zero)>(file, array.values);
  };
  if (header.type == "<f4") {
    take(float{});
  } else if (header.type == "<f8") {
    take(double{});
  } else if (header.type == "<i4") {
    take(std::int32_t{});
  } else if (header.type == "<i8") {
    take(std::int64_t{});
  } else {
    file.refuse("its values are \"" + header.type + "\"; expected <f4, <f8, <i4 or <i8 (little-endian numbers)");
  }
  return array;
}

}  // namespace pmsp
