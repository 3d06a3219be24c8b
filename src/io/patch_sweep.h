// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "pmsp/types.h"

namespace pmsp::io {

/// A panorama in gray, 512 pixels across at most, with columns repeated beyond both ends and rows beyond the first and
/// the last one; and where its textured patches are.
class SweepImage {
 public:
  /// `mask`: 0 = ignore, the same size, empty = use all.
  SweepImage(ImageView<const Rgb> image, ImageView<const std::uint8_t> mask);

  static constexpr int kMargin = 64;  ///< of repeated columns on either side [px]
  static constexpr int kBorder = 16;  ///< of repeated rows above and below [px]

  int width() const { return width_; }
  int height() const { return height_; }
  int stride() const { return width_ + 2 * kMargin; }
  const std::uint8_t* pixel(int x, int y) const {
    return gray_.data() + static_cast<std::ptrdiff_t>(y + kBorder) * stride() + x + kMargin;
  }

  /// The most textured pixel of each square, away from the poles and what the mask ignores: its centre [px].
  const std::vector<Eigen::Vector2f>& corners() const { return corners_; }

 private:
  int width_ = 0;
  int height_ = 0;
  std::vector<std::uint8_t> gray_;
  std::vector<Eigen::Vector2f> corners_;
};

/// A keyframe as some pose has it.
struct SweepView {
  RigidTransform cam_from_world;
  std::shared_ptr<const SweepImage> image;
};

/// A place that several views show, the one that it was looked for from first.
struct SweepPoint {
  Eigen::Vector3d position_world;
  std::vector<std::size_t> views;
};

/// Looks for patches of views in their nearest neighbours, over all depths.
class PatchSweep {
 public:
  explicit PatchSweep(std::vector<SweepView> views);

  std::size_t size() const { return views_.size(); }
  std::size_t patches(std::size_t i) const { return views_[i].image->corners().size(); }  ///< textured or not

  /// Looks for the patches `first`, `first + stride`, ... of view i; appends those that are found at one depth. Returns
  /// the number of patches.
  std::size_t look(std::size_t i, std::size_t first, std::size_t stride, std::vector<SweepPoint>& found) const;

 private:
  double distance(std::size_t i, std::size_t k) const { return (centers_[i] - centers_[k]).norm(); }
  std::vector<std::size_t> neighbours_of(std::size_t i) const;

  std::vector<SweepView> views_;
  std::vector<Eigen::Vector3d> centers_;
};

}  // namespace pmsp::io
