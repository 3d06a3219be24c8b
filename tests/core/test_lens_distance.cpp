// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cmath>
#include <numeric>
#include <vector>

#include "core/recording.h"
#include "pmsp/calibration.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

constexpr double kDistance = 0.03;

synth::Mission room(double lens_distance, int width) {
  synth::Recipe recipe;
  recipe.keyframes = 10;
  recipe.width = width;
  recipe.height = width / 2;
  recipe.mission.render.samples = 2;
  recipe.mission.render.lens_distance = lens_distance;
  return synth::textured_room(recipe);
}

LensDistance estimated(const synth::Mission& mission, int threads = 0) {
  LensDistanceEstimator estimator;
  for (std::size_t i = 0; i < mission.frames.size(); ++i) estimator.add(keyframe_of(mission, i));
  return estimator.estimate(Executor(threads));
}

/// Median distance of the points from the surfaces, relative to that from the camera.
double error_of_points(const synth::Mission& mission, double lens_distance) {
  DensifierOptions options = preset(Quality::kOnline);
  options.width = 320;
  options.height = 160;
  options.lens_distance = lens_distance;
  return median_surface_error(mission.scene, densify(mission, options).clouds);
}

}  // namespace

TEST_CASE("the lens distance is estimated from the images", PMSP_ACCURACY) {
  const synth::Mission two = room(kDistance, 1280);
  const LensDistance found = estimated(two);
  CAPTURE(found.distance, found.standard_error, found.shift_px, found.landmarks);
  CHECK(found.significant);
  CHECK(found.distance == Approx(kDistance).epsilon(0.12));
  const LensDistance alone = estimated(two, 1);
  CHECK(alone.distance == found.distance);
  CHECK(alone.standard_error == found.standard_error);

  const LensDistance behind = estimated(room(-kDistance, 1280));
  CHECK(behind.significant);
  CHECK(behind.distance == Approx(-kDistance).epsilon(0.12));
}

TEST_CASE("a single-centre camera has no lens distance", PMSP_ACCURACY) {
  const LensDistance found = estimated(room(0.0, 1280));
  CAPTURE(found.distance, found.standard_error, found.landmarks);
  CHECK_FALSE(found.significant);
  CHECK(std::abs(found.distance) < 0.1 * kDistance);
}

TEST_CASE("without evidence there is no lens distance") {
  CHECK_FALSE(LensDistanceEstimator().estimate(Executor(1)).significant);
  synth::Mission mission = room(kDistance, 64);
  mission.frames.resize(2);
  const LensDistance found = estimated(mission);
  CHECK_FALSE(found.significant);
  CHECK(found.distance == 0.0);
}

TEST_CASE("masked pixels do not affect the lens distance") {
  const synth::Mission two = room(kDistance, 640);
  CHECK(estimated(two).landmarks > 20);
  Image<std::uint8_t> mask(640, 320, 255);
  for (int y = 0; y < mask.height(); ++y) {
    for (int x = 0; x < mask.width(); ++x) {
      if (x < 160 || x >= 480) mask(x, y) = 0;  // the whole hemisphere of the backward lens
    }
  }
  LensDistanceEstimator estimator;
  for (std::size_t i = 0; i < two.frames.size(); ++i) {
    Keyframe keyframe = keyframe_of(two, i);
    keyframe.mask = static_cast<const Image<std::uint8_t>&>(mask).view();
    estimator.add(keyframe);
  }
  CHECK(estimator.estimate(Executor(2)).landmarks == 0);
}

TEST_CASE("points lie on the surfaces when the lens distance is set", PMSP_ACCURACY) {
  const double one_centre = error_of_points(room(0.0, 640), 0.0);
  const synth::Mission two = room(kDistance, 640);
  const double ignored = error_of_points(two, 0.0);
  const double corrected = error_of_points(two, kDistance);
  CAPTURE(one_centre, ignored, corrected);
  CHECK(corrected < 0.6 * ignored);
  CHECK(corrected < 1.3 * one_centre);
}

TEST_CASE("subsequences of a mission suffice to estimate the lens distance") {
  std::vector<std::int64_t> ids(1000);
  std::iota(ids.begin(), ids.end(), 5);
  const std::vector<std::int64_t> chosen = keyframes_for_lens_distance(ids);
  REQUIRE(chosen.size() == 24);
  CHECK(chosen.front() == 5);
  CHECK(chosen.back() == 1004);
  CHECK(std::is_sorted(chosen.begin(), chosen.end()));
  ids.resize(24);
  CHECK(keyframes_for_lens_distance(ids) == ids);
}
