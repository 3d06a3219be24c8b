// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>

#include <Eigen/Geometry>

#include "confidence.h"
#include "core/helpers.h"
#include "core/on_depth_maps.h"
#include "core/recording.h"
#include "elementary.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"
#include "synth/rng.h"
#include "util/median_of.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

using Where = std::function<bool(int, int)>;

/// Result of an ideal PatchMatch pass: the truth where there is texture, random depths with this score elsewhere.
DepthMap map_without_textureless(const synth::Frame& frame, const Where& textureless, float score = 0.3F) {
  DepthMap map = truth_map(frame, 0.95F);
  for (int y = 0; y < map.depth.height(); ++y) {
    for (int x = 0; x < map.depth.width(); ++x) {
      if (!textureless(x, y)) continue;
      const auto draw = static_cast<std::uint64_t>(y * map.depth.width() + x);
      map.depth(x, y) = static_cast<float>(1.0 + 4.0 * synth::uniform(3, draw));
      map.normal(x, y) = -bearing_of(map.depth, x, y).cast<float>();
      map.confidence(x, y) = score;
    }
  }
  return map;
}

PlaneImage priors_of(const synth::Frame& frame, const DepthMap& map, int threads = 0) {
  const Executor executor(threads);
  const Panorama panorama(frame.image.view(), {}, map.depth.width(), map.depth.height(), executor);
  return plane_priors(map, panorama, places_around({map.cam_from_world}), {0.3, 30.0}, executor);
}

/// Ranges at which the priors meet their pixels' rays; 0 = no prior.
Image<float> ranges(const PlaneImage& priors) {
  Image<float> result(priors.width(), priors.height(), 0.0F);
  for (int y = 0; y < priors.height(); ++y) {
    for (int x = 0; x < priors.width(); ++x) {
      const double inverse = priors(x, y).cast<double>().dot(bearing_of(result, x, y));
      if (inverse > 0.0) result(x, y) = static_cast<float>(1.0 / inverse);
    }
  }
  return result;
}

struct Found {
  double share = 0.0;   ///< of the pixels, those with a prior
  double within = 0.0;  ///< of these, those within 3 % of the truth
};

Found free_space_filter(const Image<float>& priors, const Image<float>& truth, const Where& counts) {
  int pixels = 0;
  int present = 0;
  int good = 0;
  for (int y = 0; y < priors.height(); ++y) {
    for (int x = 0; x < priors.width(); ++x) {
      if (!counts(x, y)) continue;
      ++pixels;
      if (!(priors(x, y) > 0.0F)) continue;
      ++present;
      good += std::abs(priors(x, y) - truth(x, y)) <= 0.03F * truth(x, y) ? 1 : 0;
    }
  }
  return {static_cast<double>(present) / std::max(pixels, 1), static_cast<double>(good) / std::max(present, 1)};
}

/// A textured mission whose image is a single colour at some pixels.
synth::Frame with_textureless(synth::Frame frame, const Where& textureless) {
  for (int y = 0; y < frame.image.height(); ++y) {
    for (int x = 0; x < frame.image.width(); ++x) {
      if (textureless(x, y)) frame.image(x, y) = {200, 200, 200};
    }
  }
  return frame;
}

/// Latitude of a pixel [deg].
double latitude_of(const synth::Frame& frame, int y) { return 90.0 - 180.0 * (y + 0.5) / frame.image.height(); }

/// Angle from a direction in the camera [deg].
double degrees_from(const synth::Frame& frame, int x, int y, const Eigen::Vector3d& direction) {
  const double cosine = direction.normalized().dot(bearing_of(frame.depth, x, y));
  return std::acos(std::clamp(cosine, -1.0, 1.0)) * 180.0 / kernels::kPi;
}

synth::Frame frame_of(const synth::Mission& mission) { return mission.frames[0]; }

constexpr int kWidth = 256;

}  // namespace

TEST_CASE("a textureless patch of a wall gets the wall's plane anywhere on the sphere", "[priors]") {
  const synth::Frame textured = frame_of(synth::empty_room(small_recipe(kWidth, 1)));
  const Eigen::Vector3d up(0.0, -1.0, 0.0);
  const Eigen::Vector3d seam(0.05, 0.0, -1.0);
  const Eigen::Vector3d right(1.0, 0.1, 0.1);
  for (const Eigen::Vector3d& direction : {up, seam, right}) {
    CAPTURE(direction.transpose());
    const Where textureless = [&](int x, int y) { return degrees_from(textured, x, y, direction) < 16.0; };
    const Where inner = [&](int x, int y) { return degrees_from(textured, x, y, direction) < 8.0; };
    const Where outside = [&](int x, int y) { return degrees_from(textured, x, y, direction) > 24.0; };
    const synth::Frame frame = with_textureless(textured, textureless);
    const Image<float> priors = ranges(priors_of(frame, map_without_textureless(frame, textureless)));
    const Found found = free_space_filter(priors, frame.depth, inner);
    CAPTURE(found.share, found.within);
    CHECK(found.share > 0.98);
    CHECK(found.within > 0.98);
    CHECK(free_space_filter(priors, frame.depth, outside).share < 0.02);  // textured
  }
}

TEST_CASE("image noise does not make a bare wall textured", "[priors]") {
  const synth::Frame textured = frame_of(synth::empty_room(small_recipe(kWidth, 1)));
  const Eigen::Vector3d up(0.0, -1.0, 0.0);
  const Where textureless = [&](int x, int y) { return degrees_from(textured, x, y, up) < 40.0; };
  synth::Frame frame = with_textureless(textured, textureless);
  for (int y = 0; y < frame.image.height(); ++y) {
    for (int x = 0; x < frame.image.width(); ++x) {
      const double noise = 3.0 * synth::gaussian(5, static_cast<std::uint64_t>(y * frame.image.width() + x));
      for (std::uint8_t* channel : {&frame.image(x, y).r, &frame.image(x, y).g, &frame.image(x, y).b}) {
        *channel = static_cast<std::uint8_t>(std::clamp(*channel + noise, 0.0, 255.0));
      }
    }
  }
  const Image<float> priors = ranges(priors_of(frame, map_without_textureless(frame, textureless, 0.98F)));
  const Found found =
      free_space_filter(priors, frame.depth, [&](int x, int y) { return degrees_from(frame, x, y, up) < 34.0; });
  CHECK(found.share > 0.98);  // pixels textured by noise get none
  CHECK(found.within > 0.9);
}

TEST_CASE("isolated matched pixels support no plane", "[priors]") {
  const synth::Frame textured = frame_of(synth::empty_room(small_recipe(kWidth, 1)));
  const Eigen::Vector3d right(1.0, 0.1, 0.1);
  const auto degrees = [&](int x, int y) { return degrees_from(textured, x, y, right); };
  synth::Frame frame = with_textureless(textured, [&](int x, int y) { return degrees(x, y) < 16.0; });
  DepthMap map = map_without_textureless(frame, [&](int x, int y) { return degrees(x, y) < 16.0; });
  for (int y = 0; y < map.depth.height(); ++y) {
    for (int x = 0; x < map.depth.width(); ++x) {
      if (degrees(x, y) < 9.0 || degrees(x, y) > 14.0 || x % 4 != 0 || y % 4 != 0) continue;
      frame.image(x, y) = {20, 20, 20};
      map.confidence(x, y) = 0.95F;
    }
  }
  const Found found =
      free_space_filter(ranges(priors_of(frame, map)), frame.depth, [&](int x, int y) { return degrees(x, y) < 7.0; });
  CAPTURE(found.share, found.within);
  CHECK(found.share > 0.95);
  CHECK(found.within > 0.95);
}

TEST_CASE("the wall's plane continues behind a near object", "[priors]") {
  synth::Scene scene;
  scene.add(synth::Box{Eigen::Vector3d::Zero(), {4.0, 3.0, 3.0}, Eigen::Matrix3d::Identity()}, synth::textured(1));
  scene.add(synth::Box{{0.0, 0.0, 1.5}, {0.15, 0.15, 0.15}, Eigen::Matrix3d::Identity()}, synth::textured(2));
  const synth::Mission mission = synth::make_mission(scene, {RigidTransform{}}, kWidth, kWidth / 2);
  const synth::Frame textured = frame_of(mission);
  const auto on_wall = [&](int x, int y) { return textured.surface(x, y) / 8 == 0; };
  const Where textureless = [&](int x, int y) {
    return on_wall(x, y) && degrees_from(textured, x, y, Eigen::Vector3d::UnitZ()) < 40.0;
  };
  const synth::Frame frame = with_textureless(textured, textureless);
  const Where ring = [&](int x, int y) {  // away from the texture at both rims
    const double degrees = degrees_from(textured, x, y, Eigen::Vector3d::UnitZ());
    return degrees > 18.0 && degrees < 30.0;
  };
  const Found found =
      free_space_filter(ranges(priors_of(frame, map_without_textureless(frame, textureless))), frame.depth, ring);
  CAPTURE(found.share, found.within);
  CHECK(found.share > 0.9);
  CHECK(found.within > 0.97);
}

TEST_CASE("no prior planes for the sky or without reliable pixels", "[priors]") {
  const synth::Frame textured = frame_of(synth::floor_at_nadir(small_recipe(kWidth, 1)));
  const Where sky = [&](int, int y) { return latitude_of(textured, y) > 0.0; };
  const Where clearly = [&](int, int y) { return latitude_of(textured, y) > 4.0; };
  const synth::Frame frame = with_textureless(textured, sky);
  DepthMap map = map_without_textureless(frame, sky);
  CHECK(free_space_filter(ranges(priors_of(frame, map)), frame.depth, clearly).share == 0.0);
  std::fill(map.confidence.pixels().begin(), map.confidence.pixels().end(), 0.4F);
  CHECK(filled(ranges(priors_of(frame, map))) == 0.0);
}

TEST_CASE("a brightness gradient along a wall is no texture", "[priors]") {
  const synth::Frame textured = frame_of(synth::empty_room(small_recipe(kWidth, 1)));
  const Where textureless = [&](int x, int y) { return degrees_from(textured, x, y, {1.0, 0.1, 0.1}) < 16.0; };
  const Where inner = [&](int x, int y) { return degrees_from(textured, x, y, {1.0, 0.1, 0.1}) < 8.0; };
  synth::Frame frame = textured;
  for (int y = 0; y < frame.image.height(); ++y) {
    for (int x = 0; x < frame.image.width(); ++x) {
      const auto gray = static_cast<std::uint8_t>(100 + (512 * y) / frame.image.height() % 200);  // 8 levels a row
      if (textureless(x, y)) frame.image(x, y) = {gray, gray, gray};
    }
  }
  const DepthMap map = map_without_textureless(frame, textureless);
  CHECK(free_space_filter(ranges(priors_of(frame, map)), frame.depth, inner).share > 0.9);
}

TEST_CASE("prior planes do not depend on the number of threads and need maps of the image's size", "[priors]") {
  const synth::Frame frame = frame_of(synth::painted_room(small_recipe(96, 1)));
  const DepthMap map = truth_map(frame, 0.95F);
  CHECK(same(ranges(priors_of(frame, map, 1)), ranges(priors_of(frame, map, 3))));
  const Executor executor(1);
  const Panorama other(frame.image.view(), {}, 48, 24, executor);
  const std::vector<KeyframePose> places = places_around({map.cam_from_world});
  CHECK_THROWS_AS(plane_priors(map, other, places, {0.3, 30.0}, executor), InvalidInput);
  const Panorama panorama(frame.image.view(), {}, 96, 48, executor);
  CHECK_THROWS_AS(plane_priors(map, panorama, {}, {0.3, 30.0}, executor), InvalidInput);
  CHECK_THROWS_AS(plane_priors(map, panorama, std::vector<KeyframePose>(9, places[0]), {0.3, 30.0}, executor),
                  InvalidInput);
}

TEST_CASE("scores without prior planes are the patch scores", "[priors]") {
  const Executor executor(1);
  PlaneMap map(64, 32);
  PlaneMap priors(64, 32);
  // A wall ahead at 2, seen by all pixels of the front; of the priors, one agrees, one is off by half of the tolerance
  // of 3 %, one by more than that, and one is missing.
  const int x = 32;
  const float off[] = {1.0F, 1.015F, 1.05F, 0.0F};
  for (int i = 0; i < 4; ++i) {
    map.z(x, 14 + i) = 0.5F;
    map.score(x, 14 + i) = 0.8F;
    priors.z(x, 14 + i) = 0.5F / (off[i] > 0.0F ? off[i] : 1.0F);
    if (off[i] == 0.0F) priors.z(x, 14 + i) = 0.0F;
  }
  map.z(x + 1, 14) = priors.z(x + 1, 14) = 0.5F;
  map.score(x + 1, 14) = 0.2F;
  map.keyframe_id = 7;
  const PlaneMap without = subtract_priors(map, priors, executor);
  CHECK(without.score(x, 14) == Approx(0.5F));
  CHECK(without.score(x, 15) == Approx(0.65F).margin(0.01));
  CHECK(without.score(x, 16) == 0.8F);
  CHECK(without.score(x, 17) == 0.8F);
  CHECK(without.score(x + 1, 14) == 0.0F);  // less than nothing is nothing, as after the median filter
  CHECK(without.z(x, 14) == 0.5F);
  CHECK(without.z(0, 0) == 0.0F);
  CHECK(without.score(0, 0) == 0.0F);
  CHECK(without.keyframe_id == 7);
  for (float& score : map.score.pixels()) score += 0.4F;
  const PlaneMap high = subtract_priors(median_filter(map, {}, executor), priors, executor);
  CHECK(high.score(x, 14) == Approx(0.9F));  // 1.2 is no more than 1 only without what the prior added
  CHECK(high.score(x, 16) == 1.0F);
  CHECK_THROWS_AS(subtract_priors(map, PlaneMap(32, 16), executor), InvalidInput);
}

TEST_CASE("prior planes give painted walls their depth and can be disabled", "[priors]" PMSP_ACCURACY) {
  synth::Recipe recipe = small_recipe(640, 4);
  recipe.mission.render.noise_sigma = 2.0;
  const synth::Mission mission = synth::painted_room(recipe);
  const synth::Frame& frame = mission.frames[1];
  DepthMap filtered;
  const auto raw_depth = [&](bool with_priors) {
    DensifierOptions options = preset(Quality::kOnline);
    options.advanced.patchmatch.plane_priors = with_priors;
    Image<float> depth;
    DensifierCallbacks callbacks;
    callbacks.raw_depth = [&](const DepthMap& map) {
      if (map.keyframe_id == frame.id) depth = map.depth;
    };
    callbacks.filtered_depth = [&](const DepthMap& map) {
      if (map.keyframe_id == frame.id && with_priors) filtered = map;
    };
    Densifier densifier(options, callbacks);
    fly_through(densifier, mission);
    return depth;
  };
  const Image<float> with = raw_depth(true);
  const Image<float> without = raw_depth(false);
  const auto wall = [&](const Image<float>& depth) {
    return synth::share_within(depth, frame.depth, 0.03, [&](int x, int y) { return frame.surface(x, y) / 8 == 0; });
  };
  const auto rest = [&](const Image<float>& depth) {
    return synth::share_within(depth, frame.depth, 0.03, [&](int x, int y) { return frame.surface(x, y) / 8 != 0; });
  };
  CAPTURE(wall(with), wall(without), rest(with), rest(without));
  CHECK(wall(with) > wall(without) + 0.2);
  CHECK(rest(with) > rest(without) - 0.01);

  // Errors common to maps with the same prior planes do not show in their differences, but must lower the confidence.
  std::vector<double> found;
  std::vector<double> told;
  for (int y = 0; y < frame.depth.height(); ++y) {
    for (int x = 0; x < frame.depth.width(); ++x) {
      if (frame.surface(x, y) / 8 != 0 || !(filtered.depth(x, y) > 0.0F)) continue;
      found.push_back(std::abs(filtered.depth(x, y) / frame.depth(x, y) - 1.0F));
      told.push_back(kernels::error_of_confidence(filtered.confidence(x, y)));
    }
  }
  REQUIRE(found.size() > 10000U);
  CHECK(median(found) < 1.5 * median(told));
}
