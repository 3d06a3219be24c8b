// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "vec3.h"

// Transformations between camera frames. Many 360-degree cameras have two lenses, back to back and some centimetres
// apart, and their panorama is stitched as if both had one centre: its forward half (z > 0) is seen from slightly in
// front of the camera's centre, the other half from as far behind it. Bearings, depths and planes of a pixel therefore
// refer to its lens: its frame has the camera's axes, and the lens as origin. Transformations between keyframes are
// from lens to lens; the direction of the point selects the lenses.
namespace pmsp::kernels {

/// `target_from_source` in single precision, common to all pixels of a keyframe. Rotation row-major.
struct Rigid {
  float r[9];
  float t[3];  ///< from centre to centre
  /// Position of the source's forward lens, rotated into the target's frame and unit; 0 = one centre.
  float source_lens[3];
  float target_lens;  ///< distance of the target's forward lens in front of its centre
};

template <class F>
PMSP_HD Vec3<F> rotate(const Rigid& m, const Vec3<F>& a) {
  return {fma(F(m.r[0]), a.x, fma(F(m.r[1]), a.y, F(m.r[2]) * a.z)),
          fma(F(m.r[3]), a.x, fma(F(m.r[4]), a.y, F(m.r[5]) * a.z)),
          fma(F(m.r[6]), a.x, fma(F(m.r[7]), a.y, F(m.r[8]) * a.z))};
}
template <class F>
PMSP_HD Vec3<F> rotate_back(const Rigid& m, const Vec3<F>& a) {
  return {fma(F(m.r[0]), a.x, fma(F(m.r[3]), a.y, F(m.r[6]) * a.z)),
          fma(F(m.r[1]), a.x, fma(F(m.r[4]), a.y, F(m.r[7]) * a.z)),
          fma(F(m.r[2]), a.x, fma(F(m.r[5]), a.y, F(m.r[8]) * a.z))};
}
/// From centre to centre.
template <class F>
PMSP_HD Vec3<F> translation(const Rigid& m) {
  return {F(m.t[0]), F(m.t[1]), F(m.t[2])};
}

/// Value for the lens of a direction with this z: `forward`, or its negative for the rear lens.
template <class F>
PMSP_HD F signed_lens_offset(const F& z, const F& forward) {
  return select(z < F(0), F(0) - forward, forward);
}

/// Translation from lens to lens, for the source's point `bearing` / `inverse_depth`. `turned`: `bearing`, rotated.
template <class F>
PMSP_HD Vec3<F> translation(const Rigid& m, const Vec3<F>& bearing, const Vec3<F>& turned, const F& inverse_depth) {
  const Vec3<F> t{F(m.t[0]) + signed_lens_offset(bearing.z, F(m.source_lens[0])),
                  F(m.t[1]) + signed_lens_offset(bearing.z, F(m.source_lens[1])),
                  F(m.t[2]) + signed_lens_offset(bearing.z, F(m.source_lens[2]))};
  return {t.x, t.y, t.z - signed_lens_offset(fma(inverse_depth, t.z, turned.z), F(m.target_lens))};
}

/// Transforms a point from its lens in the source to its lens in the target.
template <class F>
PMSP_HD Vec3<F> transform(const Rigid& m, const Vec3<F>& a) {
  const Vec3<F> turned = rotate(m, a);
  return turned + translation(m, a, turned, F(1));
}

}  // namespace pmsp::kernels
