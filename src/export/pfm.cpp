// SPDX-License-Identifier: BSD-2-Clause
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "export/files.h"
#include "export/little_endian.h"
#include "io/binary_input.h"
#include "pmsp/error.h"
#include "pmsp/io/depth.h"
#include "util/number_from.h"

namespace pmsp {
namespace {

constexpr int kMaxSide = 1 << 20;
constexpr std::size_t kLongestWord = 64;  ///< of the header

static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float), "rows of Vector3f are written as packed floats");

template <class T>
void write(const std::filesystem::path& path, const Image<T>& image, const char* magic) {
  if (image.empty()) throw InvalidInput(path.string() + ": an image without pixels cannot be written as PFM");
  AtomicFile file(path);
  file.write(std::string(magic) + "\n" + std::to_string(image.width()) + " " + std::to_string(image.height()) +
             "\n-1.0\n");
  std::vector<char> row(static_cast<std::size_t>(image.width()) * sizeof(T));
  for (int y = image.height() - 1; y >= 0; --y) {
    const auto* const values = reinterpret_cast<const float*>(image.row(y));
    char* at = row.data();
    for (std::size_t i = 0; i < row.size() / sizeof(float); ++i) at = put_little(at, values[i]);
    file.write(row.data(), row.size());
  }
  file.commit();
}

/// Returns the next word of the header, empty if it is too long.
std::string read_word(BinaryInput& in) {
  std::string word = in.word(kLongestWord + 1);
  return word.size() <= kLongestWord ? word : "";
}

int read_side(BinaryInput& in) {
  const std::optional<int> side = plain_number_from<int>(read_word(in));
  if (!side || *side < 1 || *side > kMaxSide) {
    in.fail("the PFM header names no valid size; expected width and height from 1 to " + std::to_string(kMaxSide));
  }
  return *side;
}

template <class T>
Image<T> read(const std::filesystem::path& path, const std::string& magic, const char* channels, const T& zero) {
  BinaryInput in(path);
  const std::string found = read_word(in);
  if (found != "Pf" && found != "PF") in.fail("is no PFM: it does not start with Pf or PF");
  if (found != magic) in.fail(std::string("has the wrong number of channels; expected ") + channels);
  const int width = read_side(in);
  const int height = read_side(in);
  const std::optional<double> scale = plain_number_from<double>(read_word(in));
  if (!scale || !std::isfinite(*scale) || *scale == 0.0) {
    in.fail("the PFM header has no valid scale; expected a number other than 0");
  }
  const std::uint64_t row_bytes = static_cast<std::uint64_t>(width) * sizeof(T);
  const std::uint64_t expected = in.position() + row_bytes * static_cast<unsigned>(height);
  if (in.size() < expected) {
    in.fail("ends at byte " + std::to_string(in.size()) + ", but " + std::to_string(width) + " x " +
            std::to_string(height) + " pixels need " + std::to_string(expected) + "; is it cut off?");
  }
  Image<T> image(width, height, zero);
  for (int y = height - 1; y >= 0; --y) {
    auto* const values = reinterpret_cast<float*>(image.row(y));
    const char* const row = in.take(static_cast<std::size_t>(row_bytes));
    for (std::size_t i = 0; i < row_bytes / sizeof(float); ++i) {
      values[i] = get_number<float>(row + i * sizeof(float), *scale > 0.0);
    }
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
