// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "pmsp/types.h"

namespace pmsp::io {

/// Gray panorama, at most 512 pixels wide, with columns repeated on both sides and rows above and below; with its
/// textured corners.
class SweepImage {
 public:
  /// `mask`: same size, 0 = ignored, empty = none.
  SweepImage(ImageView<const Rgb> image, ImageView<const std::uint8_t> mask);

  static constexpr int kMargin = 64;  ///< repeated columns per side [px]
  static constexpr int kBorder = 16;  ///< repeated rows above and below [px]

  int width() const { return width_; }
  int height() const { return height_; }
  int stride() const { return width_ + 2 * kMargin; }
  const std::uint8_t* pixel(int x, int y) const {
    return gray_.data() + static_cast<std::ptrdiff_t>(y + kBorder) * stride() + x + kMargin;
  }

  /// Centre of the most textured pixel per square, without poles and masked pixels [px].
  const std::vector<Eigen::Vector2f>& corners() const { return corners_; }

 private:
  int width_ = 0;
  int height_ = 0;
  std::vector<std::uint8_t> gray_;
  std::vector<Eigen::Vector2f> corners_;
};

/// Keyframe with a pose hypothesis.
struct SweepView {
  RigidTransform cam_from_world;
  std::shared_ptr<const SweepImage> image;
};

/// Point observed by several views, the reference view first.
struct SweepPoint {
  Eigen::Vector3d position_world;
  std::vector<std::size_t> views;
};

/// Matches patches of views in their nearest source views, over all depths.
class PatchSweep {
 public:
  explicit PatchSweep(std::vector<SweepView> views);

  std::size_t size() const { return views_.size(); }
  std::size_t patches(std::size_t i) const { return views_[i].image->corners().size(); }  ///< textured or not

  /// Matches patches `first`, `first + stride`, ... of view i; appends those with a unique depth to `found`. Returns
  /// the number of patches tried.
  std::size_t look(std::size_t i, std::size_t first, std::size_t stride, std::vector<SweepPoint>& found) const;

 private:
  double distance(std::size_t i, std::size_t k) const { return (centers_[i] - centers_[k]).norm(); }
  std::vector<std::size_t> neighbours_of(std::size_t i) const;

  std::vector<SweepView> views_;
  std::vector<Eigen::Vector3d> centers_;
};

}  // namespace pmsp::io
