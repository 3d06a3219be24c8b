// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <cstdint>

#include <Eigen/Geometry>

#include "equirect.h"
#include "patch.h"
#include "pmsp/types.h"
#include "synth/rng.h"
#include "util/eigen_kernels.h"

/// What the tests of the kernels share. Random inputs come from a generator of their own, not from kernels/random.h.
namespace pmsp::test {

using kernels::kPi;
using kernels::Vec3;

/// A reproducible sequence of random numbers.
class Draws {
 public:
  explicit Draws(std::uint64_t seed) : seed_(seed) {}

  double uniform() { return synth::uniform(seed_, counter_++); }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  double gaussian() { return synth::gaussian(seed_ + 1000003, counter_++); }
  int below(int end) { return static_cast<int>(uniform() * end); }

  Vec3<double> direction() {
    const Vec3<double> d{gaussian(), gaussian(), gaussian()};
    return kernels::normalized(d);
  }

  /// A rotation by any angle up to `max_angle` and a translation up to `max_shift`.
  RigidTransform transform(double max_angle, double max_shift) {
    const Vec3<double> axis = direction();
    const Vec3<double> shift = direction();
    const double length = uniform(0.0, max_shift);
    RigidTransform result;
    result.rotation = Eigen::AngleAxisd(uniform(0.0, max_angle), Eigen::Vector3d(axis.x, axis.y, axis.z)).matrix();
    result.translation = length * Eigen::Vector3d(shift.x, shift.y, shift.z);
    return result;
  }

 private:
  std::uint64_t seed_;
  std::uint64_t counter_ = 0;
};

template <class To, class From>
Vec3<To> cast(const Vec3<From>& v) {
  return {static_cast<To>(v.x), static_cast<To>(v.y), static_cast<To>(v.z)};
}

inline double length(const Vec3<double>& v) { return std::sqrt(kernels::dot(v, v)); }

/// The frame of the point (x, y) of an image, in double precision: bearing, right, down.
inline kernels::PatchFrame<double> frame_at(double x, double y, int width, int height, double spacing = 1.0) {
  const double lon = (x / width - 0.5) * 2.0 * kPi;
  const double lat = (0.5 - y / height) * kPi;
  return {kernels::bearing(std::sin(lon), std::cos(lon), std::sin(lat), std::cos(lat)),
          spacing * kernels::tangent_right(std::sin(lon), std::cos(lon)),
          spacing * kernels::tangent_down(std::sin(lon), std::cos(lon), std::sin(lat), std::cos(lat))};
}

/// The patches that PatchMatchOptions' defaults stand for. The only place in these tests that knows PatchParams's
/// fields.
inline kernels::PatchParams patch_params(int width) {
  constexpr double kSpacingPx = 2.0;
  constexpr double kSigmaColor = 50.0;
  constexpr double kSigmaSpacePx = 5.0;
  kernels::PatchParams params{};
  params.spacing = static_cast<float>(std::tan(kSpacingPx * 2.0 * kPi / width));
  params.min_sigma_color = params.max_sigma_color = static_cast<float>(kSigmaColor);
  params.min_variance = 1.0F;
  for (int k = 0; k < kernels::kPatchSamples; ++k) {
    const double dx = kSpacingPx * kernels::patch_offset(k % kernels::kPatchSide);
    const double dy = kSpacingPx * kernels::patch_offset(k / kernels::kPatchSide);
    params.space_weight[k] = static_cast<float>(std::exp(-0.5 * (dx * dx + dy * dy) / (kSigmaSpacePx * kSigmaSpacePx)));
    params.fine_space_weight[k] = params.space_weight[k];
  }
  return params;
}

}  // namespace pmsp::test
