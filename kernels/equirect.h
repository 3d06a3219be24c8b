// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "elementary.h"
#include "vec3.h"

// The equirectangular camera. Axes x right, y down, z forward; longitude = atan2(x, z), latitude = -asin(y / |p|).
// Image points are measured from the upper left corner of the image: the centre of pixel (i, j) is (i + 0.5, j + 0.5).
namespace pmsp::kernels {

/// Unit bearing from the sines and cosines of a pixel's longitude and latitude.
template <class F>
PMSP_HD Vec3<F> bearing(const F& sin_lon, const F& cos_lon, const F& sin_lat, const F& cos_lat) {
  return {cos_lat * sin_lon, F(0) - sin_lat, cos_lat * cos_lon};
}

/// Unit vectors that span the tangent plane at a pixel: to the right (growing image x) and downward (growing image y).
template <class F>
PMSP_HD Vec3<F> tangent_right(const F& sin_lon, const F& cos_lon) {
  return {cos_lon, F(0), F(0) - sin_lon};
}
template <class F>
PMSP_HD Vec3<F> tangent_down(const F& sin_lon, const F& cos_lon, const F& sin_lat, const F& cos_lat) {
  return {sin_lat * sin_lon, cos_lat, sin_lat * cos_lon};
}

/// Image point.
template <class F>
struct Pixel {
  F x, y;
};

/// Projects a direction of any length > 0 to x in [0, width], y in [0, height].
template <class F>
PMSP_HD Pixel<F> project(const Vec3<F>& p, const F& width, const F& height) {
  const F longitude = kernels::atan2(p.x, p.z);
  const F minus_latitude = kernels::atan2(p.y, sqrt(fma(p.x, p.x, p.z * p.z)));
  return {width * fma(longitude, F(static_cast<float>(0.5 / kPi)), F(0.5F)),
          height * fma(minus_latitude, F(static_cast<float>(1.0 / kPi)), F(0.5F))};
}

/// As `project`, in double precision with the standard library: for the few points that need it, and as reference of
/// the tests. x in [0, width), y in [0, height].
inline Pixel<double> project_exactly(const Vec3<double>& p, int width, int height) {
  const double longitude = std::atan2(p.x, p.z);
  const double minus_latitude = std::atan2(p.y, std::hypot(p.x, p.z));
  const double x = width * (longitude / (2.0 * kPi) + 0.5);
  return {x < width ? x : 0.0, height * (minus_latitude / kPi + 0.5)};
}

/// Angle between two directions [rad], exact for small ones too.
inline double angle_between(const Vec3<double>& a, const Vec3<double>& b) {
  const Vec3<double> cross{a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
  return std::atan2(std::sqrt(dot(cross, cross)), dot(a, b));
}

/// Column (0 to width - 1) of an image x in [0, width]; the right border wraps to the left one.
template <class F>
PMSP_HD IntOf<F> column(const F& x, int width) {
  const F i = whole(x);
  return to_int(select(i < F(static_cast<float>(width)), i, F(0)));
}

/// Row (0 to height - 1) of an image y in [0, height].
template <class F>
PMSP_HD IntOf<F> row(const F& y, int height) {
  return to_int(min(whole(y), F(static_cast<float>(height - 1))));
}

/// Index, in row order, of the pixel that a direction of any length > 0 falls into.
template <class F>
PMSP_HD IntOf<F> pixel_index(const Vec3<F>& p, int width, int height) {
  const Pixel<F> at = project(p, F(static_cast<float>(width)), F(static_cast<float>(height)));
  return row(at.y, height) * IntOf<F>(width) + column(at.x, width);
}

}  // namespace pmsp::kernels
