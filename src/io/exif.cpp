// SPDX-License-Identifier: BSD-2-Clause
#include "exif.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <initializer_list>
#include <utility>

#include "binary_input.h"
#include "jpeg_segments.h"
#include "pmsp/io/images.h"

namespace pmsp::io {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// TIFF block with tags. Reads beyond the end give 0.
class Tiff {
 public:
  /// `byte_at`: the byte at an offset below `size`.
  Tiff(std::function<std::uint8_t(std::size_t)> byte_at, std::size_t size)
      : byte_at_(std::move(byte_at)), size_(size), little_(byte(0) == 'I' && byte(1) == 'I') {}

  bool is_valid() const { return (little_ || (byte(0) == 'M' && byte(1) == 'M')) && number(2, 2) == 42; }

  std::uint64_t number(std::size_t at, std::size_t count) const {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < count; ++i) value = value * 256 + byte(little_ ? at + count - 1 - i : at + i);
    return value;
  }

  /// Offset of a tag's entry in a directory; 0 = none.
  std::size_t find(std::size_t directory, unsigned tag) const {
    const std::uint64_t entries = number(directory, 2);
    for (std::uint64_t i = 0; i < entries && directory + 2 + 12 * i + 12 <= size_; ++i) {
      const std::size_t entry = directory + 2 + 12 * static_cast<std::size_t>(i);
      if (number(entry, 2) == tag) return entry;
    }
    return 0;
  }

  /// Unsigned rational number at an offset; NaN if invalid.
  double rational(std::size_t at) const {
    const double below = static_cast<double>(number(at + 4, 4));
    return below > 0.0 ? static_cast<double>(number(at, 4)) / below : std::nan("");
  }

  std::uint8_t byte(std::size_t at) const { return at < size_ ? byte_at_(at) : std::uint8_t{0}; }

 private:
  std::function<std::uint8_t(std::size_t)> byte_at_;
  std::size_t size_;
  bool little_;
};

constexpr std::size_t kRationals = 5;  // entry type

/// Degrees, minutes and seconds of an entry, in degrees; NaN if missing.
double angle(const Tiff& tiff, std::size_t directory, unsigned tag) {
  const std::size_t entry = tiff.find(directory, tag);
  if (entry == 0 || tiff.number(entry + 2, 2) != kRationals || tiff.number(entry + 4, 4) != 3) return std::nan("");
  const auto at = static_cast<std::size_t>(tiff.number(entry + 8, 4));
  return tiff.rational(at) + tiff.rational(at + 8) / 60.0 + tiff.rational(at + 16) / 3600.0;
}

std::optional<GpsPosition> gps_of(const Tiff& tiff, std::size_t first) {
  const std::size_t pointer = tiff.find(first, 0x8825);
  if (pointer == 0) return std::nullopt;
  const auto directory = static_cast<std::size_t>(tiff.number(pointer + 8, 4));
  const auto letter = [&](unsigned tag) {
    const std::size_t entry = tiff.find(directory, tag);
    return entry == 0 ? std::uint8_t{0} : tiff.byte(entry + 8);
  };
  const std::uint8_t north = letter(1), east = letter(3);
  GpsPosition gps{angle(tiff, directory, 2), angle(tiff, directory, 4), 0.0};
  if (!(gps.latitude_deg <= 90.0 && gps.longitude_deg <= 180.0)) return std::nullopt;
  if ((north != 'N' && north != 'S') || (east != 'E' && east != 'W')) return std::nullopt;
  if (gps.latitude_deg == 0.0 && gps.longitude_deg == 0.0) return std::nullopt;  // written by cameras without a fix
  if (north == 'S') gps.latitude_deg = -gps.latitude_deg;
  if (east == 'W') gps.longitude_deg = -gps.longitude_deg;
  const std::size_t altitude = tiff.find(directory, 6);
  if (altitude != 0 && tiff.number(altitude + 2, 2) == kRationals) {
    const double value = tiff.rational(static_cast<std::size_t>(tiff.number(altitude + 8, 4)));
    if (std::isfinite(value)) gps.altitude_m = letter(5) == 1 ? -value : value;
  }
  return gps;
}

bool has_at(const Bytes& bytes, std::size_t at, std::initializer_list<std::uint8_t> text) {
  return at <= bytes.size() && text.size() <= bytes.size() - at &&
         std::equal(text.begin(), text.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at));
}

/// Offset and size of the TIFF block; 0 = none.
std::pair<std::size_t, std::size_t> find_tiff(const Bytes& bytes) {
  if (has_at(bytes, 0, {0xFF, 0xD8})) {
    std::pair<std::size_t, std::size_t> found{0, 0};
    each_jpeg_segment(bytes, [&](std::uint8_t kind, std::size_t at, std::size_t size) {
      const std::size_t end = std::min(at + size, bytes.size());
      const bool is_exif = kind == 0xE1 && has_at(bytes, at, {'E', 'x', 'i', 'f', 0, 0});
      if (found.first == 0 && is_exif && end > at + 6) found = {at + 6, end - at - 6};
    });
    return found;
  }
  if (has_at(bytes, 0, {0x89, 'P', 'N', 'G'})) {
    for (std::size_t at = 8; at + 8 <= bytes.size();) {
      const auto size = static_cast<std::size_t>(big_endian(bytes, at, 4));
      const std::size_t begin = at + 8;
      if (has_at(bytes, at + 4, {'e', 'X', 'I', 'f'})) return {begin, std::min(size, bytes.size() - begin)};
      if (size > bytes.size() - begin) break;
      at = begin + size + 4;
    }
  }
  return {0, 0};
}

bool is_tiff_file(const Bytes& bytes) {
  return has_at(bytes, 0, {'I', 'I', 42, 0}) || has_at(bytes, 0, {'M', 'M', 0, 42});
}

/// Position only: OpenCV applies the orientation of TIFF files itself.
Exif exif_of_tiff_file(const Tiff& tiff) {
  Exif exif;
  exif.gps = gps_of(tiff, static_cast<std::size_t>(tiff.number(4, 4)));
  return exif;
}

std::function<std::uint8_t(std::size_t)> from(const Bytes& bytes, std::size_t begin) {
  return [&bytes, begin](std::size_t at) { return bytes[begin + at]; };
}

}  // namespace

Exif read_exif(const Bytes& bytes) {
  if (is_tiff_file(bytes)) return exif_of_tiff_file(Tiff(from(bytes, 0), bytes.size()));
  Exif exif;
  const auto [begin, size] = find_tiff(bytes);
  const Tiff tiff(from(bytes, begin), size);
  if (size < 8 || !tiff.is_valid()) return exif;
  const auto first = static_cast<std::size_t>(tiff.number(4, 4));
  const std::size_t entry = tiff.find(first, 0x0112);
  const std::uint64_t orientation = entry != 0 && tiff.number(entry + 2, 2) == 3 ? tiff.number(entry + 8, 2) : 1;
  if (orientation >= 1 && orientation <= 8) exif.orientation = static_cast<int>(orientation);
  exif.gps = gps_of(tiff, first);
  return exif;
}

Exif read_exif(const std::filesystem::path& path) {
  constexpr std::size_t kMost = std::size_t{1} << 20;
  BinaryInput in(path);
  const std::size_t size = static_cast<std::size_t>(std::min<std::uint64_t>(in.size(), kMost));
  const char* const begin = in.take(size);
  const Bytes bytes(begin, begin + size);
  if (is_tiff_file(bytes)) {  // tags may follow the pixels
    const auto byte_at = [&in](std::size_t at) {
      in.seek(at);
      return static_cast<std::uint8_t>(in.get());
    };
    return exif_of_tiff_file(Tiff(byte_at, static_cast<std::size_t>(in.size())));
  }
  return read_exif(bytes);
}

}  // namespace pmsp::io

bool pmsp::is_turned_by_exif(const std::filesystem::path& image) { return io::read_exif(image).orientation != 1; }
