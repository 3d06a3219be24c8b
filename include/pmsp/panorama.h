// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <memory>

#include "pmsp/executor.h"
#include "pmsp/image.h"

namespace pmsp {

/// A keyframe's image made ready for matching at one resolution: colours on the grid of the depth map, and gray values
/// on the six faces of a cube, which is how neighbours are looked up (one division instead of two arcus functions a
/// sample). Resampling averages over each pixel's area; near the poles, where columns crowd, over an area as wide as at
/// the equator.
class Panorama {
 public:
  /// `image`: equirectangular, any even size. `mask`: same size or empty; 0 = ignore. `width`, `height`: of the depth
  /// map, even. Throws InvalidInput.
  Panorama(ImageView<const Rgb> image, ImageView<const std::uint8_t> mask, int width, int height,
           const Executor& executor);
  ~Panorama();
  Panorama(Panorama&&) noexcept;
  Panorama& operator=(Panorama&&) noexcept;

  int width() const;
  int height() const;

  /// Colours, `width` x `height`.
  const Image<Rgb>& color() const;

  /// Hands the colours over, for a panorama that is only matched with from now on. It keeps its size.
  Image<Rgb> take_color();

  /// Frees what is matched with, for a panorama whose colours only are asked for from now on.
  void release_gray();

  /// Keeps what is matched with in a quarter of the memory, for a panorama that is rarely matched with from now on:
  /// only by way of `unpacked`.
  void pack_gray();
  bool packed() const;
  /// What is matched with, without the colours.
  Panorama unpacked(const Executor& executor) const;

  /// 255 where a depth is wanted, 0 where the mask forbids it (a pixel that covers any masked pixel is masked); `width`
  /// x `height`; empty without a mask.
  const Image<std::uint8_t>& usable() const;
  void release_usable();

  struct Data;
  const Data& data() const { return *data_; }  ///< for the stages

 private:
  Panorama();

  std::unique_ptr<Data> data_;
};

}  // namespace pmsp
