// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "match.h"
#include "patchmatch/match_setup.h"
#include "plane.h"

using namespace pmsp;

TEST_CASE("planes are allowed up to a slant of 80 degrees and within the depth range", "[patchmatch]") {
  const kernels::PlaneLimits limits = plane_limits({0.5, 20.0});
  const kernels::Vec3<float> bearing{0.0F, 0.0F, 1.0F};
  const auto allowed = [&](double depth, double slant_deg) {
    const double slant = slant_deg * kernels::kPi / 180.0;
    const kernels::Vec3<float> normal{static_cast<float>(std::sin(slant)), 0.0F, static_cast<float>(-std::cos(slant))};
    return kernels::is_allowed(kernels::plane_from(static_cast<float>(1.0 / depth), normal, bearing), bearing, limits);
  };
  CHECK(allowed(3.0, 0.0));
  CHECK(allowed(3.0, 79.0));
  CHECK_FALSE(allowed(3.0, 81.0));
  CHECK(allowed(0.51, 40.0));
  CHECK_FALSE(allowed(0.49, 40.0));
  CHECK(allowed(19.8, 40.0));
  CHECK_FALSE(allowed(20.2, 40.0));
}

TEST_CASE("no two passes draw the same random numbers", "[patchmatch]") {
  PatchMatchOptions options;
  options.iterations = 3;
  options.geometric_passes = 3;
  int next = 0;
  for (int pass = 0; pass <= options.geometric_passes; ++pass) {
    const Iterations iterations = iterations_of(options, pass);
    CHECK(iterations.first == next);
    CHECK(iterations.count == (pass == 0 ? 3 : kGeometricIterations));
    next += iterations.count;
  }
}

TEST_CASE("the texture threshold exceeds noise and strong texture is never taken for noise", "[patchmatch]") {
  CHECK(textured_variance(0.0F) == textured_variance(0.5F));
  CHECK(textured_variance(1.5F) > 2.0F * 1.5F);
  CHECK(textured_variance(3.0F) > textured_variance(1.5F));
  CHECK(textured_variance(1000.0F) == textured_variance(50.0F));
  PatchMatchOptions options;
  CHECK(patch_params(options, 640, 0.0F).fine_variance == textured_variance(0.0F));
  CHECK(patch_params(options, 640, 2.0F).fine_variance == textured_variance(2.0F));
  options.fine_patch = 1.0;
  CHECK(patch_params(options, 640, 2.0F).fine_variance < 0.0F);
}

TEST_CASE("no two hypotheses of a pixel draw the same random numbers", "[patchmatch]") {
  kernels::MatchArgs<kernels::CubeView> match_args{};
  match_args.limits = plane_limits({0.5, 50.0});
  match_args.random = patchmatch_key(1, 7);
  match_args.refinements = 4;
  const kernels::Vec3<float> ahead{0.0F, 0.0F, 1.0F};
  const kernels::Hypothesis<float> best{{0.0F, 0.0F, 0.25F}, 0.5F};
  std::vector<std::array<float, 8>> drawn;  // of eight pixels, relative to the largest step in depth
  for (int iteration = 0; iteration < 8; ++iteration) {
    for (int draw = 0; draw < match_args.refinements; ++draw) {
      const float step = 0.06F / static_cast<float>(1 << (std::min(iteration, 3) + draw));
      std::array<float, 8> steps{};
      for (std::uint32_t pixel = 0; pixel < 8; ++pixel) {
        const auto plane = kernels::refined<float>(best, pixel, iteration, draw, ahead, match_args);
        steps[pixel] = (plane.z / best.plane.z - 1.0F) / step;
        CHECK(std::abs(steps[pixel]) < 1.001F);
      }
      for (const std::array<float, 8>& before : drawn) {
        float most = 0.0F;
        for (std::size_t i = 0; i < 8; ++i) most = std::max(most, std::abs(steps[i] - before[i]));
        CHECK(most > 0.05F);
      }
      drawn.push_back(steps);
    }
  }
}
