// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "vec3.h"

// From one camera's frame into another's. Many 360-degree cameras have two lenses, back to back and a finger apart, and
// their panorama is stitched as if both were in one place: the forward half of it (z > 0) is seen from a little in
// front of the camera's centre, the other half from as much behind it. Bearings, depths and planes of a pixel are
// therefore those of its lens: the frame of a pixel has the camera's axes and its lens for an origin. Whatever goes
// from one keyframe to another goes from lens to lens; where the direction points tells which lenses these are.
namespace pmsp::kernels {

/// `target_from_source` in single precision: the same for all pixels of a keyframe. Rotation row-major.
struct Rigid {
  float r[9];
  float t[3];  ///< from centre to centre
  /// Place of the source's forward lens, turned into the target's frame and unit; 0 = one centre.
  float source_lens[3];
  float target_lens;  ///< how far in front of its centre the target's forward lens lies
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

/// What the lens that looks in a direction of that z has of what the forward one has.
template <class F>
PMSP_HD F of_lens(const F& z, const F& forward) {
  return select(z < F(0), F(0) - forward, forward);
}

/// From lens to lens, for what the source sees along `bearing`, `inverse_depth` away. `turned`: `bearing`, rotated.
template <class F>
PMSP_HD Vec3<F> translation(const Rigid& m, const Vec3<F>& bearing, const Vec3<F>& turned, const F& inverse_depth) {
  const Vec3<F> t{F(m.t[0]) + of_lens(bearing.z, F(m.source_lens[0])),
                  F(m.t[1]) + of_lens(bearing.z, F(m.source_lens[1])),
                  F(m.t[2]) + of_lens(bearing.z, F(m.source_lens[2]))};
  return {t.x, t.y, t.z - of_lens(fma(inverse_depth, t.z, turned.z), F(m.target_lens))};
}

/// A point as its lens in the source sees it, as its lens in the target sees it.
template <class F>
PMSP_HD Vec3<F> transform(const Rigid& m, const Vec3<F>& a) {
  const Vec3<F> turned = rotate(m, a);
  return turned + translation(m, a, turned, F(1));
}

}  // namespace pmsp::kernels
