// SPDX-License-Identifier: BSD-2-Clause
// Prior depth: alignment to landmarks, and prior planes.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <utility>

#include <catch2/catch.hpp>

#include "core/helpers.h"
#include "core/on_depth_maps.h"
#include "core/small_missions.h"
#include "pmsp/calibration.h"
#include "pmsp/camera.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"
#include "pmsp/types.h"
#include "priors/prior_setup.h"
#include "synth/rng.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

synth::Mission room() { return synth::empty_room(small_recipe(256, 3)); }

/// Landmarks on the surface that the frame shows.
Keyframe keyframe_with(const synth::Frame& frame, std::size_t landmarks = 200) {
  Keyframe keyframe;
  keyframe.cam_from_world = frame.cam_from_world;
  keyframe.image = frame.image.view();
  const RigidTransform world_from_cam = frame.cam_from_world.inverse();
  for (std::size_t i = 0; i < landmarks; ++i) {
    const int x = static_cast<int>(synth::uniform(5, 2 * i) * frame.depth.width());
    const int y = static_cast<int>((0.1 + 0.8 * synth::uniform(5, 2 * i + 1)) * frame.depth.height());
    const Eigen::Vector3d p = static_cast<double>(frame.depth(x, y)) * bearing_of(frame.depth, x, y);
    keyframe.landmarks.push_back({static_cast<std::int64_t>(i), world_from_cam * p});
  }
  return keyframe;
}

Image<float> made_of(const Image<float>& depth, const std::function<double(double)>& value) {
  Image<float> values(depth.width(), depth.height());
  for (std::size_t i = 0; i < values.size(); ++i) {
    values.pixels()[i] = static_cast<float>(value(static_cast<double>(depth.pixels()[i])));
  }
  return values;
}

double largest_error(const Image<float>& depth, const Image<float>& truth) {
  double largest = 0.0;
  for (std::size_t i = 0; i < depth.size(); ++i) {
    const double error = static_cast<double>(depth.pixels()[i] / truth.pixels()[i]) - 1.0;
    largest = std::max(largest, std::abs(error));
  }
  return largest;
}

}  // namespace

TEST_CASE("a depth image of any value type is aligned", "[prior depth]") {
  const synth::Mission mission = room();
  const synth::Frame& frame = mission.frames[0];
  const Keyframe keyframe = keyframe_with(frame);
  const std::pair<DepthModel, std::function<double(double)>> kinds[] = {
      {DepthModel::kScaled, [](double d) { return 0.37 * d; }},
      {DepthModel::kDepth, [](double d) { return 2.0 * d - 1.5; }},
      {DepthModel::kInverse, [](double d) { return 900.0 / d + 40.0; }},
      {DepthModel::kWarped, [](double d) { return 1.0 / (0.8 / d + 0.3); }}};
  for (const auto& [model, value] : kinds) {
    CAPTURE(name_of(model));
    const Image<float> values = made_of(frame.depth, value);
    const DepthAlignment alignment = align_prior_depth(values.view(), keyframe);
    CHECK(alignment.why_not.empty());
    CHECK(alignment.model == model);
    CHECK(alignment.share > 0.99);
    CHECK(largest_error(aligned_depth(values.view(), alignment), frame.depth) < 0.01);
  }
}

TEST_CASE("the alignment is robust to a third of wrong landmarks", "[prior depth]") {
  const synth::Mission mission = room();
  const synth::Frame& frame = mission.frames[0];
  Keyframe keyframe = keyframe_with(frame);
  const Eigen::Vector3d center = frame.cam_from_world.center();
  for (std::size_t i = 0; i < keyframe.landmarks.size(); i += 3) {
    Eigen::Vector3d& at = keyframe.landmarks[i].position_world;
    at = center + (0.3 + 2.0 * synth::uniform(8, i)) * (at - center);
  }
  const Image<float> values = made_of(frame.depth, [](double d) { return 5.0 / d - 0.2; });
  const DepthAlignment alignment = align_prior_depth(values.view(), keyframe);
  CHECK(alignment.why_not.empty());
  CHECK(largest_error(aligned_depth(values.view(), alignment), frame.depth) < 0.02);
}

TEST_CASE("depth images that contradict the landmarks are skipped with the reason", "[prior depth]") {
  const synth::Mission mission = room();
  const synth::Frame& frame = mission.frames[0];
  const Keyframe keyframe = keyframe_with(frame);

  Image<float> random(64, 32);
  for (std::size_t i = 0; i < random.size(); ++i) random.pixels()[i] = static_cast<float>(0.5 + synth::uniform(1, i));
  CHECK_FALSE(align_prior_depth(random.view(), keyframe).why_not.empty());

  const Image<float> flat(64, 32, 3.0F);
  CHECK_FALSE(align_prior_depth(flat.view(), keyframe).why_not.empty());

  const Image<float> none(64, 32, 0.0F);
  CHECK(align_prior_depth(none.view(), keyframe).why_not.find("0 landmarks") == 0);
  CHECK(align_prior_depth(frame.depth.view(), keyframe_with(frame, 11)).why_not.find("11 landmarks") == 0);
}

TEST_CASE("a depth image must agree with most landmarks and must not be constant", "[prior depth]") {
  const synth::Mission mission = room();
  const synth::Frame& frame = mission.frames[0];
  const Eigen::Vector3d center = frame.cam_from_world.center();
  Keyframe most_wrong = keyframe_with(frame);
  for (std::size_t i = 0; i < most_wrong.landmarks.size(); ++i) {
    Eigen::Vector3d& at = most_wrong.landmarks[i].position_world;
    if (i % 5 < 3) at = center + (0.3 + 2.0 * synth::uniform(8, i)) * (at - center);
  }
  const DepthAlignment agrees_with_few = align_prior_depth(frame.depth.view(), most_wrong);
  CHECK(agrees_with_few.share > 0.3);
  CHECK(agrees_with_few.why_not.find("it agrees with") == 0);

  Keyframe around = keyframe_with(frame);  // all about as far away
  for (std::size_t i = 0; i < around.landmarks.size(); ++i) {
    Eigen::Vector3d& at = around.landmarks[i].position_world;
    at = center + (2.9 + 0.2 * synth::uniform(9, i)) * (at - center).normalized();
  }
  const DepthAlignment flat = align_prior_depth(Image<float>(64, 32, 3.0F).view(), around);
  CHECK(flat.share > 0.99);
  CHECK(flat.why_not.find("it fits the landmarks hardly better") == 0);
}

TEST_CASE("all of many landmarks affect the alignment", "[prior depth]") {
  const synth::Mission mission = room();
  const synth::Frame& frame = mission.frames[0];
  const Eigen::Vector3d center = frame.cam_from_world.center();
  Keyframe keyframe = keyframe_with(frame, 1200);
  for (std::size_t i = 0; i < 360; ++i) {  // wrong ones
    Eigen::Vector3d& at = keyframe.landmarks[i].position_world;
    at = center + (0.3 + 2.0 * synth::uniform(8, i)) * (at - center);
  }
  const DepthAlignment alignment = align_prior_depth(frame.depth.view(), keyframe);
  CHECK(alignment.why_not.empty());
  CHECK(alignment.share > 0.65);
}

TEST_CASE("planes of a given depth are in the keyframe's unit", "[prior depth]") {
  const PriorGrid grid(64, 32);
  const Image<float> depth(128, 64, 3.0F);
  const auto plain = planes_from_prior_depth(depth.view(), 1.0, grid);
  const auto scaled = planes_from_prior_depth(depth.view(), 4.0, grid);
  REQUIRE(plain.size() == scaled.size());
  for (std::size_t i = 0; i < plain.size(); ++i) {
    CAPTURE(i);
    REQUIRE(plain[i].x * plain[i].x + plain[i].y * plain[i].y + plain[i].z * plain[i].z > 0.0F);
    CHECK(scaled[i].x == Approx(4.0F * plain[i].x).margin(1e-4));
    CHECK(scaled[i].y == Approx(4.0F * plain[i].y).margin(1e-4));
    CHECK(scaled[i].z == Approx(4.0F * plain[i].z).margin(1e-4));
  }
}

TEST_CASE("noise of landmarks is averaged in the alignment", "[prior depth]") {
  const synth::Mission mission = room();
  const synth::Frame& frame = mission.frames[0];
  const Eigen::Vector3d center = frame.cam_from_world.center();
  const std::function<double(double)> kinds[] = {[](double d) { return 5.0 / d - 0.2; },
                                                 [](double d) { return 2.0 * d - 1.5; }};
  constexpr int kTrials = 8;
  for (const auto& kind : kinds) {
    const Image<float> values = made_of(frame.depth, kind);
    double error = 0.0;
    for (int trial = 0; trial < kTrials; ++trial) {
      Keyframe keyframe = keyframe_with(frame, 400);
      for (std::size_t i = 0; i < keyframe.landmarks.size(); ++i) {
        Eigen::Vector3d& at = keyframe.landmarks[i].position_world;
        at = center + (1.0 + 0.02 * synth::gaussian(10 + static_cast<std::uint64_t>(trial), i)) * (at - center);
      }
      const DepthAlignment alignment = align_prior_depth(values.view(), keyframe);
      CHECK(alignment.why_not.empty());
      error += largest_error(aligned_depth(values.view(), alignment), frame.depth) / kTrials;
    }
    CHECK(error < 0.0042);  // the best of the lines through two landmarks: 0.006
  }
}

TEST_CASE("depths are compared with those of landmarks", "[prior depth]") {
  const synth::Mission mission = room();
  const synth::Frame& frame = mission.frames[0];
  const Image<float> depth = made_of(frame.depth, [](double d) { return 0.37 * d; });
  CHECK(depth_ratio(depth.view(), keyframe_with(frame)) == Approx(0.37).epsilon(1e-3));
  CHECK(depth_ratio(depth.view(), keyframe_with(frame, 11)) == 0.0);
}

TEST_CASE("invalid values in a depth image are no depth", "[prior depth]") {
  Image<float> values(16, 8, 2.0F);
  values(0, 0) = std::nanf("");
  values(1, 0) = HUGE_VALF;
  values(2, 0) = -3.0F;
  values(3, 0) = 0.0F;
  DepthAlignment alignment;
  alignment.scale = 1.0;
  const Image<float> depth = aligned_depth(values.view(), alignment);
  for (int x = 0; x < 4; ++x) CHECK(depth(x, 0) == 0.0F);
  CHECK(depth(4, 0) == 2.0F);
}

TEST_CASE("prior depth gives planes on unsurrounded textureless surfaces corrected by reliable pixels",
          "[prior depth]") {
  synth::Frame frame = room().frames[0];
  const int width = frame.image.width(), height = frame.image.height();
  // Everything above 10 degrees is textureless: the ceiling and the upper walls, which reliable points do not surround.
  const auto textureless = [&](int y) { return 90.0 - 180.0 * (y + 0.5) / height > 10.0; };
  DepthMap map = truth_map(frame, 0.95F);
  Image<float> given(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      given(x, y) = frame.depth(x, y) * 1.06F;  // the whole image is 6 % off
      if (!textureless(y)) continue;
      frame.image(x, y) = {200, 200, 200};
      map.depth(x, y) = 1.0F + static_cast<float>(synth::uniform(3, static_cast<std::uint64_t>(y * width + x)));
      map.confidence(x, y) = 0.3F;
    }
  }
  const Executor executor;
  const Panorama panorama(frame.image.view(), {}, width, height, executor);
  const auto share_right = [&](ImageView<const float> prior) {
    const PlaneMap planes = plane_priors(plane_map_of(map, executor), panorama, places_around({map.cam_from_world}),
                                         {0.3, 30.0}, executor, prior);
    int right = 0, wrong = 0, pixels = 0;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        if (90.0 - 180.0 * (y + 0.5) / height < 20.0) continue;
        ++pixels;
        const Eigen::Vector3d plane(planes.x(x, y), planes.y(x, y), planes.z(x, y));
        const double inverse = plane.dot(bearing_of(frame.depth, x, y));
        if (!(inverse > 0.0)) continue;
        const bool is_right = std::abs(1.0 / inverse / static_cast<double>(frame.depth(x, y)) - 1.0) < 0.03;
        ++(is_right ? right : wrong);
      }
    }
    return std::pair(static_cast<double>(right) / pixels, static_cast<double>(wrong) / pixels);
  };
  const auto without = share_right({});
  const auto with = share_right(given.view());
  CHECK(with.first > 0.8);
  CHECK(with.first > without.first + 0.2);
  CHECK(with.second < 0.16);

  Image<float> random(width, height);
  for (std::size_t i = 0; i < random.size(); ++i)
    random.pixels()[i] = static_cast<float>(1.0 + 3.0 * synth::uniform(9, i));
  const auto with_random = share_right(random.view());
  CHECK(with_random.second < without.second + 0.08);
}

TEST_CASE("the plane of a cell is that of its own surface independent of adjacent surfaces", "[prior depth]") {
  // Two spheres of radius 2 and 4, each seen on one half.
  const PriorGrid grid(256, 128);
  Image<float> depth(256, 128, 4.0F);
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width() / 2; ++x) depth(x, y) = 2.0F;
  }
  const auto planes = planes_from_prior_depth(depth.view(), 1.0, grid);
  int cells = 0;
  int right = 0;
  for (int row = grid.rows / 4; row < grid.rows * 3 / 4; ++row) {
    for (const int column : {grid.columns / 2 - 1, grid.columns / 2}) {  // on both sides of the edge
      const auto& plane = planes[static_cast<std::size_t>(row * grid.columns + column)];
      const Eigen::Vector3d bearing = bearing_from_pixel({column + 0.5, row + 0.5}, grid.columns, grid.rows);
      const double inverse_depth = Eigen::Vector3f(plane.x, plane.y, plane.z).cast<double>().dot(bearing);
      const double expected = column < grid.columns / 2 ? 0.5 : 0.25;
      ++cells;
      right += std::abs(inverse_depth / expected - 1.0) < 0.05 ? 1 : 0;
    }
  }
  CHECK(cells > 10);
  CHECK(right == cells);
}

TEST_CASE("a prior depth of too low resolution is refused", "[prior depth]") {
  const synth::Mission mission = room();
  Keyframe keyframe = keyframe_with(mission.frames[0]);
  const Image<float> tiny(8, 4, 1.0F);
  keyframe.prior_depth = tiny.view();
  Densifier densifier(small_preset(Quality::kOnline), {});
  CHECK_THROWS_AS(densifier.add(keyframe), InvalidInput);
}
