// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "vec3.h"

// Encoding of a pixel's point: 32 bits for other keyframes, 32 bits for the point itself, and 8 bits for its status.
namespace pmsp::kernels {

/// Status of a pixel's point.
enum class PointStatus : std::uint8_t {
  kNone = 0,     ///< no point: no depth, confidence too low, or removed by the free-space test
  kOpen = 1,     ///< undecided in duplicate removal
  kKept = 2,     ///< point of the cloud
  kDropped = 3,  ///< duplicate of a kept point
};

/// Confidence, 0 to 1, in steps of 1/63, rounded.
template <class F>
PMSP_HD UIntOf<F> confidence_level(const F& confidence) {
  return to_uint(fma(F(63), min(max(confidence, F(0)), F(1)), F(0.5F)));
}
template <class F>
PMSP_HD F confidence_of_level(const UIntOf<F>& level) {
  return F(1.0F / 63.0F) * from_uint<F>(level);
}
/// Upper 6 bits: confidence_level. Lower 2 bits: status.
template <class F>
PMSP_HD UIntOf<F> pack_status(const F& confidence, PointStatus status) {
  return (confidence_level(confidence) << 2) | UIntOf<F>(static_cast<std::uint32_t>(status));
}
PMSP_HD PointStatus status_of(std::uint8_t packed) { return static_cast<PointStatus>(packed & 3U); }
PMSP_HD std::uint8_t with_status(std::uint8_t packed, PointStatus status) {
  return static_cast<std::uint8_t>((packed & 0xfcU) | static_cast<unsigned>(status));
}

/// Whether a pixel has a point after the last round: kept or open.
PMSP_HD bool makes_point(std::uint8_t packed) {
  return status_of(packed) == PointStatus::kKept || status_of(packed) == PointStatus::kOpen;
}

/// Point of a pixel. All bits are 0 if there is none.
template <class U>
struct PackedPoint {
  /// Upper 20 bits: depth as a float without its sign, rounded to 12 bits of mantissa (0.013 %). Lower 12 bits: normal
  /// on an octahedron, 6 bits per axis (2 degrees).
  U surfel;
  /// From the lowest bit: red, green, blue of 8 bits; confidence of the depth map, 6 bits; one more bit for each of the
  /// normal's two axes.
  U detail;
};

constexpr std::uint32_t kNormalBits = 0xfffU;  ///< of a surfel; the others hold the depth
constexpr float kHalfSteps = 63.0F;  ///< half the steps of an axis; whole, so that normals along axes are exact

/// `depth` > 0; `normal` unit; `color` 0 to 255.
template <class F>
PMSP_HD PackedPoint<UIntOf<F>> pack_point(const F& depth, const Vec3<F>& normal, const Vec3<F>& color,
                                          const F& confidence) {
  using U = UIntOf<F>;
  const F scale = F(1) / max(abs(normal.x) + abs(normal.y) + abs(normal.z), F(1e-30F));
  const F u = scale * normal.x;
  const F v = scale * normal.y;
  const auto behind = normal.z < F(0);
  const F folded_u = (F(1) - abs(v)) * select(u < F(0), F(-1), F(1));
  const F folded_v = (F(1) - abs(u)) * select(v < F(0), F(-1), F(1));
  const U column = to_uint(fma(F(kHalfSteps), select(behind, folded_u, u), F(kHalfSteps + 0.5F)));
  const U row = to_uint(fma(F(kHalfSteps), select(behind, folded_v, v), F(kHalfSteps + 0.5F)));
  const U rounded = bits_of(depth) + U(1U << 10U);
  const U rgb =
      to_uint(F(color.x + F(0.5F))) | (to_uint(F(color.y + F(0.5F))) << 8) | (to_uint(F(color.z + F(0.5F))) << 16);
  return {((rounded << 1) & U(~kNormalBits)) | ((column >> 1) << 6) | (row >> 1),
          rgb | (confidence_level(confidence) << 24) | ((column & U(1)) << 31) | ((row & U(1)) << 30)};
}

template <class F>
PMSP_HD F depth_of_surfel(const UIntOf<F>& surfel) {
  return of_bits<F>(UIntOf<F>((surfel & UIntOf<F>(~kNormalBits)) >> 1));
}

/// Unit normal from octahedron coordinates [steps].
template <class F>
PMSP_HD Vec3<F> normal_of_steps(const F& column, const F& row) {
  const F u = fma(column, F(1.0F / kHalfSteps), F(-1));
  const F v = fma(row, F(1.0F / kHalfSteps), F(-1));
  const F z = F(1) - abs(u) - abs(v);
  const F fold = max(F(0) - z, F(0));
  return normalized(Vec3<F>{u + select(u < F(0), fold, F(0) - fold), v + select(v < F(0), fold, F(0) - fold), z});
}

/// Normal in the precision for other keyframes.
template <class F>
PMSP_HD Vec3<F> normal_of_surfel(const UIntOf<F>& surfel) {
  using U = UIntOf<F>;
  const F column = from_uint<F>(U((surfel >> 6) & U(63U)));
  const F row = from_uint<F>(U(surfel & U(63U)));
  return normal_of_steps<F>(fma(F(2), column, F(0.5F)), fma(F(2), row, F(0.5F)));
}

PMSP_HD Vec3<float> normal_of(const PackedPoint<std::uint32_t>& point) {
  const std::uint32_t column = (((point.surfel >> 6U) & 63U) << 1U) | (point.detail >> 31U);
  const std::uint32_t row = ((point.surfel & 63U) << 1U) | ((point.detail >> 30U) & 1U);
  return normal_of_steps<float>(static_cast<float>(column), static_cast<float>(row));
}

/// Confidence of the depth map.
template <class F>
PMSP_HD F own_confidence(const UIntOf<F>& detail) {
  return confidence_of_level<F>(UIntOf<F>((detail >> 24) & UIntOf<F>(63U)));
}

}  // namespace pmsp::kernels
