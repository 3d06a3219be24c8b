// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>

#include "depth_evidence.h"
#include "elementary.h"
#include "sphere/panorama_data.h"

using namespace pmsp;
using pmsp::kernels::Vec3;
namespace k = pmsp::kernels;

namespace {

constexpr int kWidth = 640;
constexpr int kHeight = 320;
const float kSpacing = static_cast<float>(std::tan(1.2 * 2.0 * k::kPi / kWidth));

/// A panorama whose gray values follow from longitude and latitude [rad].
CubeMap picture(const std::function<double(double, double)>& gray_at) {
  ThreadPool pool(1);
  Image<float> gray(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double lon = ((x + 0.5) / kWidth - 0.5) * 2.0 * k::kPi;
      const double lat = (0.5 - (y + 0.5) / kHeight) * k::kPi;
      gray(x, y) = static_cast<float>(gray_at(lon, lat));
    }
  }
  return make_cube_map(gray, cube_size_for(kWidth), pool);
}

k::DepthEvidence<float> evidence(const CubeMap& image, double lon, double lat, const k::Baselines& baselines) {
  const auto f = [](double value) { return static_cast<float>(value); };
  const k::PatchFrame<float> frame =
      k::patch_frame(f(std::sin(lon)), f(std::cos(lon)), f(std::sin(lat)), f(std::cos(lat)), kSpacing);
  return k::depth_evidence(image.view(), frame, kSpacing, baselines);
}

k::Baselines along(float x, float y, float z) { return {{{x, y, z}}, 1}; }

double longitude(const Vec3<float>& p) { return std::atan2(static_cast<double>(p.x), static_cast<double>(p.z)); }

/// Dark below the horizon, bright above.
double level_edge(double /*lon*/, double lat) { return 120.0 + 20.0 * std::tanh(lat * 200.0); }
/// Dark to the left of straight ahead, bright to the right.
double upright_edge(double lon, double /*lat*/) { return 120.0 + 20.0 * std::tanh(lon * 200.0); }

}  // namespace

TEST_CASE("an edge along the baseline does not determine depth and one across it does", "[evidence]") {
  const CubeMap level = picture(level_edge);
  const CubeMap upright = picture(upright_edge);
  const k::Baselines sideways = along(0.5F, 0.0F, 0.0F);
  const k::Baselines upwards = along(0.0F, -0.5F, 0.0F);
  CHECK(evidence(level, 0.0, 0.0, sideways).certainty < 1.0F);
  CHECK(evidence(upright, 0.0, 0.0, upwards).certainty < 1.0F);
  CHECK(evidence(upright, 0.0, 0.0, sideways).certainty > 100.0F);
  CHECK(evidence(level, 0.0, 0.0, upwards).certainty > 100.0F);
  CHECK(evidence(level, 0.0, 0.0, sideways).variance ==
        Approx(evidence(level, 0.0, 0.0, upwards).variance).epsilon(0.05));
}

TEST_CASE("of several baselines the one with the largest parallax counts", "[evidence]") {
  const CubeMap upright = picture(upright_edge);
  k::Baselines both = along(0.0F, -0.5F, 0.0F);
  both.to[both.count++] = {0.7F, 0.0F, 0.0F};
  CHECK(evidence(upright, 0.0, 0.0, both).certainty ==
        Approx(evidence(upright, 0.0, 0.0, along(0.7F, 0.0F, 0.0F)).certainty));
  CHECK(evidence(upright, 0.0, 0.0, along(1.0F, 0.0F, 0.0F)).certainty ==
        Approx(4.0F * evidence(upright, 0.0, 0.0, along(0.5F, 0.0F, 0.0F)).certainty).epsilon(1e-3));
  // Straight ahead there is no parallax from one behind the other.
  CHECK(evidence(upright, 0.0, 0.0, along(0.0F, 0.0F, 1.0F)).certainty == Approx(0.0).margin(1e-3));
}

TEST_CASE("beside an edge the depth of the edge is known, not that of the pixel", "[evidence]") {
  const CubeMap upright = picture(upright_edge);
  const k::Baselines sideways = along(0.5F, 0.0F, 0.0F);
  const double step = 2.0 * k::kPi / kWidth;
  const auto on = evidence(upright, 0.0, 0.2, sideways);
  for (const double pixels : {-2.0, -1.0, 1.0, 2.0}) {
    CAPTURE(pixels);
    const auto wrapped_pixel = evidence(upright, pixels * step, 0.2, sideways);
    CHECK(wrapped_pixel.certainty < 0.6F * on.certainty);
    CHECK(longitude(wrapped_pixel.best) == Approx(0.0).margin(0.25 * step));
  }
}

TEST_CASE("a brightness gradient is no texture", "[evidence]") {
  const CubeMap ramp = picture([](double lon, double lat) { return 100.0 + 30.0 * lon + 20.0 * lat; });
  CHECK(evidence(ramp, 0.3, 0.1, along(0.5F, 0.1F, 0.0F)).variance < 0.01F);
}

TEST_CASE("errors grow with depth and with the patch difference", "[evidence]") {
  const float near = k::matching_error(50.0F, 400.0F, 0.95F, kSpacing, 1.0F);
  CHECK(k::matching_error(50.0F, 400.0F, 0.95F, kSpacing, 0.5F) == Approx(2.0F * near).epsilon(1e-3));
  CHECK(k::matching_error(50.0F, 100.0F, 0.95F, kSpacing, 1.0F) == Approx(2.0F * near).epsilon(1e-3));
  CHECK(k::matching_error(50.0F, 400.0F, 0.8F, kSpacing, 1.0F) == Approx(2.0F * near).epsilon(1e-3));
  CHECK(k::matching_error(50.0F, 400.0F, 1.3F, kSpacing, 1.0F) == Approx(k::kLeastMatchingError / 20.0F).epsilon(1e-3));
  // Of what matches perfectly, a finer map makes no smaller error.
  CHECK(k::matching_error(50.0F, 400.0F, 1.0F, 0.3F * kSpacing, 1.0F) ==
        k::matching_error(50.0F, 400.0F, 1.0F, kSpacing, 1.0F));
  CHECK(k::matching_error(50.0F, 0.0F, 0.9F, kSpacing, 1.0F) > 1e3F);
}
