// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "agreement.h"
#include "fusion_weight.h"
#include "stage.h"
#include "suppression.h"
#include "surfel.h"

// Fusion of a pixel: average over the agreeing maps of its window, independent of the order of keyframes.
namespace pmsp::kernels {

/// Map of the fusion window.
template <class ViewTypes>
struct FusionView {
  FilteredMap<typename ViewTypes::Map> map;
  const std::uint32_t* color;  ///< per pixel red, green, blue, from the lowest byte
  Rigid other_from_first;      ///< from the first keyframe's unit into the other's: the rotation times `scale_ratio`
  float scale_ratio;           ///< first keyframe's scale / the other's
};

struct FusionLimits {
  float max_relative_depth;
  float min_cos_normals;
  float min_confidence;
  float suppression;  ///< see is_best_around; 0 = disabled
};

constexpr int kMaxAgree = 32;  ///< maximum number of other maps: one bit each

template <class F>
PMSP_HD Vec3<F> color_of(const UIntOf<F>& color) {
  using U = UIntOf<F>;
  return {from_uint<F>(U(color & U(255U))), from_uint<F>(U((color >> 8) & U(255U))),
          from_uint<F>(U((color >> 16) & U(255U)))};
}

/// Points of a keyframe in row order (pmsp::SurfelMap).
struct SurfelArrays {
  std::uint32_t* surfels;
  std::uint32_t* details;
  std::uint8_t* statuses;
  std::uint8_t* agree;  ///< `agree_bytes` per pixel, lowest first; bit k: others[k]
  int agree_bytes;
};

/// Read-only SurfelArrays.
struct ConstSurfelArrays {
  const std::uint32_t* surfels;
  const std::uint32_t* details;
  const std::uint8_t* statuses;
  const std::uint8_t* agree;
  int agree_bytes;
  float lens;  ///< distance of the forward lens in front of the camera's centre
};

/// Fuses the pixels of a keyframe; a stage. Counts points.
template <class ViewTypes>
struct FusePixels {
  static constexpr int kCounts = 1;

  FusionView<ViewTypes> first;
  GridView grid;
  FusionView<ViewTypes> others[kMaxAgree];
  int count;  ///< of `others`
  FusionLimits limits;
  float pose_error;  ///< of the first map's keyframe [rad]; not yet in the confidences, added to those of the points
  SurfelArrays to;

  PMSP_HD int width() const { return grid.width; }
  PMSP_HD int height() const { return grid.height; }

  template <class F>
  PMSP_HD void operator()(const RowPixels<F>& at, MaskOf<F>* counted) const {
    using U = UIntOf<F>;
    const Vec3<F> bearing = bearing_at(grid, at);
    const Vec3<F> found = plane_at<F>(first.map, at.index);
    const F confidence = gather<F>(first.map.confidence, at.index);
    MaskOf<F> known = (dot(found, bearing) >= F(kFarLimit)) & (confidence >= F(limits.min_confidence));
    const Vec3<F> plane = select(known, found, bearing);
    const F depth = F(1) / dot(plane, bearing);
    if (limits.suppression > 0.0F && any(known)) {
      known = known & is_best_around(first.map, grid, at, bearing, depth, confidence, limits.suppression);
    }
    counted[0] = known;
    if (!any(known)) return put(at, {U(0U), U(0U)}, U(0U), U(0U));
    const Vec3<F> normal = F(-1) * normalized(plane);
    F weights = fusion_weight(confidence, depth);
    F depths = weights * depth;
    Vec3<F> normals = weights * normal;
    Vec3<F> colors = weights * color_of<F>(gather_words<F>(first.color, at.index));
    U agree(0U);
    F maps(0);
    F square_gain(0);
    for (int k = 0; k < count; ++k) {
      const FusionView<ViewTypes>& other = others[k];
      const Agreement<F> seen = agreement(bearing, depth, other.map, other.other_from_first);
      const MaskOf<F> near = known & (abs(seen.depth_ratio - F(1)) <= F(limits.max_relative_depth));
      if (!any(near)) continue;
      maps = maps + select(near, F(1), F(0));
      square_gain = square_gain + select(near, seen.parallax_gain * seen.parallax_gain, F(0));
      const Vec3<F> there = select(near, plane_at<F>(other.map, seen.index), plane);
      const Vec3<F> turned =
          F(1.0F / other.scale_ratio) * rotate_back(other.other_from_first, Vec3<F>(F(-1) * normalized(there)));
      const MaskOf<F> same = near & (dot(turned, normal) >= F(limits.min_cos_normals));
      const Vec3<F> p = transform(other.other_from_first, Vec3<F>(depth * bearing));
      const F depth_ratio = select(same, seen.depth_ratio, F(1));
      const F other_depth = sqrt(dot(p, p)) / (F(other.scale_ratio) * depth_ratio);  // in the first keyframe's unit
      const F weight = select(same, fusion_weight(gather<F>(other.map.confidence, seen.index), other_depth), F(0));
      weights = weights + weight;
      depths = fma(weight, seen.implied_depth, depths);
      normals = fma(weight, turned, normals);
      colors = fma(weight, color_of<F>(gather_words<F>(other.color, seen.index)), colors);
      agree = agree | select_bits<F>(same, U(1U << static_cast<unsigned>(k)));
    }
    const F share = F(1) / weights;
    F with_pose = confidence;
    if (pose_error > 0.0F) {
      with_pose = confidence_of_error(add_pose_error(error_of_confidence(confidence), square_gain, maps, pose_error));
    }
    const PackedPoint<U> point = pack_point(F(depths * share), normalized(normals), Vec3<F>(share * colors), with_pose);
    put(at, {select_bits<F>(known, point.surfel), select_bits<F>(known, point.detail)},
        select_bits<F>(known, pack_status(with_pose, PointStatus::kOpen)), agree);
  }

 private:
  template <class F>
  PMSP_HD void put(const RowPixels<F>& at, const PackedPoint<UIntOf<F>>& point, const UIntOf<F>& status,
                   const UIntOf<F>& agree) const {
    store<F>(point.surfel, to.surfels + at.first, at.count);
    store<F>(point.detail, to.details + at.first, at.count);
    store_bytes<F>(status, to.statuses + at.first, 1, at.count);
    std::uint8_t* const bytes =
        to.agree + static_cast<std::size_t>(at.first) * static_cast<std::size_t>(to.agree_bytes);
    for (int i = 0; i < to.agree_bytes; ++i) store_bytes<F>(agree >> (8 * i), bytes + i, to.agree_bytes, at.count);
  }
};

/// Point of a keyframe for output, in the camera frame.
struct EmittedPoint {
  Vec3<float> position, normal;
  std::uint8_t color[3];
  float confidence;
  std::uint32_t agree;  ///< bit k: `others[k]` of FusePixels
};
PMSP_HD EmittedPoint emitted_point(const ConstSurfelArrays& map, const GridView& grid, int pixel) {
  const PackedPoint<std::uint32_t> packed{map.surfels[pixel], map.details[pixel]};
  EmittedPoint point{};
  point.position =
      depth_of_surfel<float>(packed.surfel) * bearing_at<float>(grid, pixel % grid.width, pixel / grid.width);
  point.position.z += signed_lens_offset(point.position.z, map.lens);
  point.normal = normal_of(packed);
  for (unsigned i = 0; i < 3; ++i) point.color[i] = static_cast<std::uint8_t>(packed.detail >> (8U * i));
  point.confidence = confidence_of_level<float>(static_cast<std::uint32_t>(map.statuses[pixel]) >> 2U);
  const std::uint8_t* const agree =
      map.agree + static_cast<std::size_t>(pixel) * static_cast<std::size_t>(map.agree_bytes);
  for (int i = 0; i < map.agree_bytes; ++i) point.agree |= static_cast<std::uint32_t>(agree[i]) << (8 * i);
  return point;
}

}  // namespace pmsp::kernels
