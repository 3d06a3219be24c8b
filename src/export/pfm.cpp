// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <string>
#include <system_error>

#include "export/files.h"
#include "pmsp/error.h"
#include "pmsp/io/depth.h"

namespace pmsp {
namespace {

constexpr int kMaxSide = 1 << 20;

static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float), "rows of Vector3f are written as packed floats");

constexpr bool host_is_big_endian() {
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
  return true;
#else
  return false;
#endif
}

void swap_floats(std::vector<char>& row) {
  for (std::size_t i = 0; i + 4 <= row.size(); i += 4) {
    std::reverse(row.begin() + static_cast<std::ptrdiff_t>(i), row.begin() + static_cast<std::ptrdiff_t>(i) + 4);
  }
}

template <class T>
void write(const std::filesystem::path& path, const Image<T>& image, const char* magic) {
  if (image.empty()) throw InvalidInput(path.string() + ": an image without pixels cannot be written as PFM");
  AtomicFile file(path);
  file.write(std::string(magic) + "\n" + std::to_string(image.width()) + " " + std::to_string(image.height()) +
             "\n-1.0\n");
  std::vector<char> row(static_cast<std::size_t>(image.width()) * sizeof(T));
  for (int y = image.height() - 1; y >= 0; --y) {
    std::memcpy(row.data(), static_cast<const void*>(image.row(y)), row.size());
    if (host_is_big_endian()) swap_floats(row);
    file.write(row.data(), row.size());
  }
  file.commit();
}

// Reads a word of the header and exactly one blank after it, since the pixels may follow.
std::string header_word(std::ifstream& stream) {
  std::string word;
  for (int c = stream.get(); stream; c = stream.get()) {
    const bool blank = c == ' ' || c == '\n' || c == '\t' || c == '\r';
    if (blank && !word.empty()) return word;
    if (!blank) word.push_back(static_cast<char>(c));
    if (word.size() > 64) break;
  }
  return {};
}

int side_from(const std::string& word, const std::string& name) {
  int value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size() || value < 1 || value > kMaxSide) {
    throw InvalidInput(name + ": the PFM header names no valid size; expected width and height from 1 to " +
                       std::to_string(kMaxSide));
  }
  return value;
}

template <class T>
Image<T> read(const std::filesystem::path& path, const std::string& magic, const char* channels, const T& zero) {
  const std::string name = path.string();
  require_regular_file(path);
  std::error_code error;
  std::ifstream stream(path, std::ios::binary);
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (!stream || error) throw IoError(name + ": cannot be opened for reading");
  const std::string found = header_word(stream);
  if (found != "Pf" && found != "PF") throw InvalidInput(name + ": is no PFM: it does not start with Pf or PF");
  if (found != magic) throw InvalidInput(name + ": has the wrong number of channels; expected " + channels);
  const int width = side_from(header_word(stream), name);
  const int height = side_from(header_word(stream), name);
  const std::string scale_word = header_word(stream);
  double scale = 0.0;
  const auto parsed = std::from_chars(scale_word.data(), scale_word.data() + scale_word.size(), scale);
  if (parsed.ec != std::errc() || parsed.ptr != scale_word.data() + scale_word.size() || !std::isfinite(scale) ||
      scale == 0.0) {
    throw InvalidInput(name + ": the PFM header has no valid scale; expected a number other than 0");
  }
  const std::uintmax_t row_bytes = static_cast<std::uintmax_t>(width) * sizeof(T);
  const std::uintmax_t expected =
      static_cast<std::uintmax_t>(stream.tellg()) + row_bytes * static_cast<unsigned>(height);
  if (size < expected) {
    throw InvalidInput(name + ": ends at byte " + std::to_string(size) + ", but " + std::to_string(width) + " x " +
                       std::to_string(height) + " pixels need " + std::to_string(expected) + "; is it cut off?");
  }
  Image<T> image(width, height, zero);
  std::vector<char> row(static_cast<std::size_t>(row_bytes));
  for (int y = height - 1; y >= 0; --y) {
    if (!stream.read(row.data(), static_cast<std::streamsize>(row.size()))) throw IoError(name + ": cannot be read");
    if ((scale > 0.0) != host_is_big_endian()) swap_floats(row);
    std::memcpy(static_cast<void*>(image.row(y)), row.data(), row.size());
  }
  return image;
}

}  // namespace

void write_pfm(const std::filesystem::path& path, const Image<float>& image) { write(path, image, "Pf"); }
void write_pfm(const std::filesystem::path& path, const Image<Eigen::Vector3f>& image) { write(path, image, "PF"); }
Image<float> read_pfm(const std::filesystem::path& path) { return read<float>(path, "Pf", "one (Pf)", 0.0F); }
Image<Eigen::Vector3f> read_pfm3(const std::filesystem::path& path) {
  return read<Eigen::Vector3f>(path, "PF", "three (PF)", Eigen::Vector3f::Zero());
}

}  // namespace pmsp
