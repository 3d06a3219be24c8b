// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

namespace pmsp {

/// One 8-bit colour. Memory order is red, green, blue, without padding (3 bytes).
struct Rgb {
  std::uint8_t r = 0;
  std::uint8_t g = 0;
  std::uint8_t b = 0;
};
static_assert(sizeof(Rgb) == 3, "Rgb is read from and written to packed image rows");

inline bool operator==(const Rgb& a, const Rgb& b) { return a.r == b.r && a.g == b.g && a.b == b.b; }
inline bool operator!=(const Rgb& a, const Rgb& b) { return !(a == b); }

/// A rectangle of pixels that someone else owns: row-major, `height` rows of `width` elements, row y starts at
/// `data + y * stride`. An empty view (`data == nullptr`) means "not given".
template <class T>
struct ImageView {
  T* data = nullptr;
  int width = 0;              ///< [px]
  int height = 0;             ///< [px]
  std::ptrdiff_t stride = 0;  ///< elements from one row to the next, >= width

  ImageView() = default;
  ImageView(T* pixels, int w, int h) : ImageView(pixels, w, h, w) {}
  ImageView(T* pixels, int w, int h, std::ptrdiff_t row_stride)
      : data(pixels), width(w), height(h), stride(row_stride) {}

  /// A view of mutable pixels converts to a view of const ones.
  operator ImageView<const T>() const { return {data, width, height, stride}; }  // NOLINT(google-explicit-constructor)

  bool empty() const { return data == nullptr || width <= 0 || height <= 0; }
  T* row(int y) const { return data + y * stride; }
  T& operator()(int x, int y) const { return data[y * stride + x]; }
};

/// Owns a row-major image without row padding; element (x, y) is `pixels()[y * width() + x]`.
template <class T>
class Image {
 public:
  Image() = default;
  /// Elements are copies of `fill`. Fixed-size Eigen vectors have no initial value of their own: give them one.
  Image(int width, int height, const T& fill = T())
      : width_(width),
        height_(height),
        pixels_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), fill) {}

  int width() const { return width_; }
  int height() const { return height_; }
  bool empty() const { return pixels_.empty(); }
  std::size_t size() const { return pixels_.size(); }

  T& operator()(int x, int y) { return pixels_[index(x, y)]; }
  const T& operator()(int x, int y) const { return pixels_[index(x, y)]; }
  T* row(int y) { return pixels_.data() + index(0, y); }
  const T* row(int y) const { return pixels_.data() + index(0, y); }

  std::vector<T>& pixels() { return pixels_; }
  const std::vector<T>& pixels() const { return pixels_; }

  ImageView<T> view() { return {pixels_.data(), width_, height_}; }
  ImageView<const T> view() const { return {pixels_.data(), width_, height_}; }

 private:
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
  }

  int width_ = 0;
  int height_ = 0;
  std::vector<T> pixels_;
};

}  // namespace pmsp
