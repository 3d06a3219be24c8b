// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include <Eigen/Geometry>

#include "confidence.h"
#include "core/helpers.h"
#include "core/on_depth_maps.h"
#include "core/recording.h"
#include "elementary.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"
#include "synth/rng.h"

using namespace pmsp;
using namespace pmsp::test;
using Eigen::Vector3d;

namespace {

constexpr int kWidth = 160;

const synth::Mission& sphere() {
  static const synth::Mission kSphere = synth::sphere_inside(small_recipe(kWidth, 3));
  return kSphere;
}

/// Fuses the maps of a mission, all of them in one window; every pixel keeps its point.
class Fusion {
 public:
  explicit Fusion(const synth::Mission& mission, float confidence = 1.0F) : maps(truth_maps(mission, confidence)) {
    for (const synth::Frame& frame : mission.frames) colors.push_back(frame.image);
  }

  KeyframeCloud fuse_one(std::size_t i, const FusionOptions& options = {}, int threads = 2) {
    std::vector<FusedDepth> window;
    for (std::size_t k = 0; k < maps.size(); ++k) window.push_back({&maps[k], &colors[k], {maps[k].cam_from_world}});
    const SurfelMap points = fuse_pixels(window, i, options, Executor(threads));
    return extract_points({&points, &points.statuses, {maps[i].cam_from_world}});
  }

  std::vector<KeyframeCloud> fuse_all(const FusionOptions& options = {}, int threads = 2) {
    std::vector<KeyframeCloud> clouds;
    for (std::size_t i = 0; i < maps.size(); ++i) clouds.push_back(fuse_one(i, options, threads));
    return clouds;
  }

  std::vector<DepthMap> maps;
  std::vector<Image<Rgb>> colors;
};

std::size_t count(const std::vector<KeyframeCloud>& clouds) {
  std::size_t sum = 0;
  for (const KeyframeCloud& cloud : clouds) sum += cloud.points.size();
  return sum;
}

Vector3d in_world(const KeyframeCloud& cloud, const CloudPoint& point) {
  return cloud.cam_from_world.inverse() * point.position.cast<double>();
}

/// Distance from the true surface along the ray, relative to the range.
double error_of(const synth::Scene& scene, const KeyframeCloud& cloud, const CloudPoint& point) {
  const Vector3d center = cloud.cam_from_world.center();
  const auto hit = scene.intersect(center, in_world(cloud, point) - center);
  return hit ? std::abs(static_cast<double>(point.position.norm()) / hit->distance - 1.0) : 1.0;
}

}  // namespace

TEST_CASE("fused points lie on the true surfaces, with true normals", "[fusion]") {
  const synth::Mission mission = synth::textured_room(small_recipe(kWidth, 4));
  const std::vector<KeyframeCloud> clouds = Fusion(mission).fuse_all();
  std::size_t far = 0;
  std::size_t turned = 0;
  for (std::size_t k = 0; k < clouds.size(); ++k) {
    CHECK(clouds[k].keyframe_id == mission.frames[k].id);
    CHECK(clouds[k].cam_from_world.rotation == mission.frames[k].cam_from_world.rotation);
    const Vector3d center = clouds[k].cam_from_world.center();
    for (const CloudPoint& point : clouds[k].points) {
      far += error_of(mission.scene, clouds[k], point) > 0.003 ? 1 : 0;
      const auto hit = mission.scene.intersect(center, in_world(clouds[k], point) - center);
      const Vector3d normal = clouds[k].cam_from_world.rotation.transpose() * point.normal.cast<double>();
      REQUIRE(normal.norm() == Approx(1.0).epsilon(1e-4));
      turned += normal.dot(hit->normal) < 0.996 ? 1 : 0;  // 5 degrees
    }
  }
  CHECK(far < count(clouds) / 50);  // at edges, where maps agree within the tolerance but not exactly
  CHECK(turned < count(clouds) / 25);
}

TEST_CASE("a single depth map gives one unchanged point per depth", "[fusion]") {
  Fusion fusion(sphere(), 0.7F);
  fusion.maps.resize(1);
  fusion.maps[0].depth(3, 3) = 0.0F;
  const KeyframeCloud cloud = fusion.fuse_one(0);
  REQUIRE(cloud.points.size() == fusion.maps[0].depth.size() - 1);
  const auto at = static_cast<std::size_t>(20 * kWidth + 33 - 1);
  const CloudPoint& point = cloud.points[at];
  const Vector3d expected =
      static_cast<double>(fusion.maps[0].depth(33, 20)) * bearing_of(fusion.maps[0].depth, 33, 20);
  CHECK((point.position.cast<double>() - expected).norm() < 1.4e-4 * expected.norm());  // as stored
  CHECK(point.normal.dot(fusion.maps[0].normal(33, 20)) > 0.9998F);
  CHECK(point.color == fusion.colors[0](33, 20));
  CHECK(point.views == 1);
  CHECK(point.confidence == Approx(0.7F).margin(0.5 / 63));
}

TEST_CASE("a fused position is nearer to the truth than its inputs", "[fusion]") {
  constexpr double kNoise = 0.004;
  const synth::Mission mission = synth::sphere_inside(small_recipe(kWidth, 5));
  Fusion fusion(mission);
  for (std::size_t k = 0; k < fusion.maps.size(); ++k) {
    for (std::size_t i = 0; i < fusion.maps[k].depth.size(); ++i) {
      fusion.maps[k].depth.pixels()[i] *= static_cast<float>(1.0 + kNoise * synth::gaussian(50 + k, i));
    }
  }
  const KeyframeCloud cloud = fusion.fuse_one(2);
  double squares = 0.0;
  for (const CloudPoint& point : cloud.points) squares += std::pow(error_of(mission.scene, cloud, point), 2);
  const double rms = std::sqrt(squares / static_cast<double>(cloud.points.size()));
  CAPTURE(rms);
  CHECK(rms < 0.65 * kNoise);  // five independent ones: 0.45 at best
}

TEST_CASE("views counts the agreeing depth maps", "[fusion]") {
  Fusion fusion(sphere());
  for (float& depth : fusion.maps[2].depth.pixels()) depth *= 1.5F;  // another surface
  const KeyframeCloud cloud = fusion.fuse_one(0);
  const auto two =
      std::count_if(cloud.points.begin(), cloud.points.end(), [](const CloudPoint& p) { return p.views == 2; });
  CHECK(static_cast<double>(two) > 0.97 * static_cast<double>(cloud.points.size()));
  const KeyframeCloud all = Fusion(sphere()).fuse_one(0);
  const auto three =
      std::count_if(all.points.begin(), all.points.end(), [](const CloudPoint& p) { return p.views == 3; });
  CHECK(static_cast<double>(three) > 0.99 * static_cast<double>(all.points.size()));
}

TEST_CASE("surfaces whose normals differ by more than 60 degrees are not averaged", "[fusion]") {
  /// Share of the points of the first keyframe that so many maps agree on, where the others' surfaces are turned
  /// through the same points.
  const auto share = [](double turned_deg, int views) {
    Fusion fusion(sphere());
    const float cosine = static_cast<float>(std::cos(turned_deg * kernels::kPi / 180.0));
    const float sine = std::sqrt(1.0F - cosine * cosine);
    for (std::size_t k = 1; k < 3; ++k) {
      for (int y = 0; y < kWidth / 2; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          const Eigen::Vector3f b = bearing_of(fusion.maps[k].depth, x, y).cast<float>();
          fusion.maps[k].normal(x, y) = -cosine * b + sine * b.unitOrthogonal();
        }
      }
    }
    const KeyframeCloud cloud = fusion.fuse_one(0);
    const auto count =
        std::count_if(cloud.points.begin(), cloud.points.end(), [&](const CloudPoint& p) { return p.views == views; });
    return static_cast<double>(count) / static_cast<double>(cloud.points.size());
  };
  CHECK(share(70.0, 1) > 0.5);
  CHECK(share(45.0, 3) > 0.9);
}

TEST_CASE("a fused normal lies between the agreeing normals", "[fusion]") {
  Fusion fusion(sphere());
  fusion.maps.resize(2);
  for (Eigen::Vector3f& normal : fusion.maps[1].normal.pixels()) {  // turned by 20 degrees
    normal = (normal + 0.364F * normal.unitOrthogonal()).normalized();
  }
  const KeyframeCloud cloud = fusion.fuse_one(0);
  REQUIRE(cloud.pixels.size() == cloud.points.size());
  int between = 0, all = 0;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    if (cloud.points[i].views != 2) continue;
    ++all;
    const float cosine = cloud.points[i].normal.dot(fusion.maps[0].normal.pixels()[cloud.pixels[i]]);
    between += cosine < 0.998F && cosine > 0.96F ? 1 : 0;  // 3.6 to 16 degrees
  }
  CHECK(all > 1000);
  CHECK(between > 0.9 * all);
}

TEST_CASE("colours are averaged with the inverse square of the expected errors", "[fusion]") {
  Fusion fusion(sphere());
  fusion.maps.resize(2);
  fusion.colors[0] = Image<Rgb>(kWidth, kWidth / 2, {100, 0, 200});
  fusion.colors[1] = Image<Rgb>(kWidth, kWidth / 2, {200, 0, 100});
  for (float& confidence : fusion.maps[0].confidence.pixels()) confidence = 5.0F / 6.0F;  // expected error 0.1 %
  for (float& confidence : fusion.maps[1].confidence.pixels()) confidence = 5.0F / 7.0F;  // 0.2 %
  const double first_weight = 1.0 / (0.1 * 0.1 + 0.1 * 0.1);                              // the common error: 0.1 %
  const double second_weight = 1.0 / (0.2 * 0.2 + 0.1 * 0.1);
  const KeyframeCloud cloud = fusion.fuse_one(0);
  int wrong = 0;
  const Vector3d other = cloud.cam_from_world * fusion.maps[1].cam_from_world.center();
  for (const CloudPoint& point : cloud.points) {
    if (point.views != 2) continue;
    const double first = first_weight / static_cast<double>(point.position.squaredNorm());
    const double second = second_weight / (point.position.cast<double>() - other).squaredNorm();
    const double red = (100.0 * first + 200.0 * second) / (first + second);
    wrong += std::abs(point.color.r - red) > 3.0 || std::abs(point.color.b - (300.0 - red)) > 3.0 || point.color.g != 0
                 ? 1
                 : 0;
  }
  CHECK(wrong == 0);
}

TEST_CASE("depth maps of very low confidence give finite points", "[fusion]") {
  FusionOptions options;
  options.min_confidence = 0.0;
  const KeyframeCloud cloud = Fusion(sphere(), 1e-9F).fuse_one(0, options);
  REQUIRE(cloud.points.size() == sphere().frames[0].depth.size());
  for (const CloudPoint& point : cloud.points) REQUIRE(error_of(sphere().scene, cloud, point) < 0.003);
}

TEST_CASE("points below the minimum confidence are not written", "[fusion]") {
  FusionOptions options;
  options.min_confidence = 0.5;
  Fusion fusion(sphere(), 0.49F);
  CHECK(count(fusion.fuse_all(options)) == 0);
  Fusion above(sphere(), 0.51F);
  CHECK(count(above.fuse_all(options)) > 0);
}

namespace {

/// Pixels that make no point, of a depth map all of whose expected errors are `error` but for one pixel's.
std::vector<std::size_t> suppressed(double error, std::size_t special, double its_error, const FusionOptions& options,
                                    float its_depth = 1.0F) {
  using kernels::confidence_of_error;
  Fusion fusion(sphere(), confidence_of_error(static_cast<float>(error)));
  fusion.maps.resize(1);
  fusion.maps[0].confidence.pixels()[special] = confidence_of_error(static_cast<float>(its_error));
  fusion.maps[0].depth.pixels()[special] *= its_depth;
  std::vector<bool> has_point(fusion.maps[0].depth.size(), false);
  const KeyframeCloud cloud = fusion.fuse_one(0, options);
  for (const std::uint32_t pixel : cloud.pixels) has_point[pixel] = true;
  std::vector<std::size_t> none;
  for (std::size_t i = 0; i < has_point.size(); ++i) {
    if (!has_point[i]) none.push_back(i);
  }
  return none;
}

}  // namespace

TEST_CASE("a pixel is dropped for a clearly more accurate one within its expected error", "[fusion]") {
  constexpr std::size_t kMiddle = kWidth * (kWidth / 4) + kWidth / 2;
  const double pixel = 2.0 * kernels::kPi / kWidth;
  FusionOptions options;
  options.min_confidence = 0.0;
  using Pixels = std::vector<std::size_t>;
  CHECK(suppressed(0.01, kMiddle, 1.5 * pixel, options) == Pixels{});
  options.suppression = 1.0;
  CHECK(suppressed(0.01, kMiddle, 1.5 * pixel, options) == Pixels{kMiddle});
  SECTION("not one whose error is less than a pixel wide") {
    CHECK(suppressed(0.01, kMiddle, 0.9 * pixel, options) == Pixels{});
    options.suppression = 2.0;
    CHECK(suppressed(0.01, kMiddle, 0.9 * pixel, options) == Pixels{kMiddle});
  }
  SECTION("not for one that is slightly more accurate") {
    CHECK(suppressed(0.8 * 1.5 * pixel, kMiddle, 1.5 * pixel, options) == Pixels{});
    CHECK(suppressed(0.6 * 1.5 * pixel, kMiddle, 1.5 * pixel, options) == Pixels{kMiddle});
  }
  SECTION("not where its depth is on another surface") {
    CHECK(suppressed(0.01, kMiddle, 1.5 * pixel, options, 1.1F) == Pixels{});
    CHECK(suppressed(0.01, kMiddle, 1.5 * pixel, options, 0.9F) == Pixels{});
    CHECK(suppressed(0.01, kMiddle, 1.5 * pixel, options, 1.05F) == Pixels{kMiddle});
  }
  SECTION("not for one that is farther away") {
    const std::size_t count = suppressed(1.5 * pixel, kMiddle, 0.01, options).size();
    CHECK(count == 8);
    CHECK(suppressed(2.5 * pixel, kMiddle, 0.01, options).size() == 16);
    CHECK(suppressed(9.0 * pixel, kMiddle, 0.01, options).size() == 16);  // no farther than two pixels
  }
  SECTION("across the seam, too") {
    const Pixels around = suppressed(1.5 * pixel, kMiddle - kWidth / 2, 0.01, options);
    CHECK(around.size() == 8);
    CHECK(std::count(around.begin(), around.end(), kMiddle - kWidth / 2 + kWidth - 1) == 1);
  }
}

TEST_CASE("near the poles the expected error spans more columns", "[fusion]") {
  constexpr std::size_t kRow = 6;  // cosine of the latitude: 0.25
  const double pixel = 2.0 * kernels::kPi / kWidth;
  FusionOptions options;
  options.min_confidence = 0.0;
  options.suppression = 1.0;
  const std::size_t middle = kRow * kWidth + 80;
  const std::vector<std::size_t> around = suppressed(1.2 * pixel, middle, 0.01, options);
  CHECK(around.size() == 8);
  std::size_t widest = 0;
  for (const std::size_t i : around) {
    const std::size_t column = i % kWidth;
    widest = std::max(widest, column > 80 ? column - 80 : 80 - column);
  }
  CHECK(widest == 4);
}

TEST_CASE("fusion gives the same points for any number of threads", "[fusion]") {
  const synth::Mission mission = synth::textured_room(small_recipe(kWidth, 4));
  const std::vector<KeyframeCloud> one = Fusion(mission, 0.6F).fuse_all({}, 1);
  for (const int threads : {2, 5}) {
    const std::vector<KeyframeCloud> several = Fusion(mission, 0.6F).fuse_all({}, threads);
    for (std::size_t k = 0; k < one.size(); ++k) CHECK(same(one[k], several[k]));
  }
}

TEST_CASE("fusion refuses invalid options and an unknown keyframe", "[fusion]") {
  Fusion fusion(sphere());
  CHECK_THROWS_AS(fusion.fuse_one(3), InvalidInput);
  FusionOptions options;
  options.spacing_px = -1.0;
  CHECK_THROWS_AS(fusion.fuse_one(0, options), InvalidOption);
}

TEST_CASE("fusion refuses missing depth maps and different sizes", "[fusion]") {
  Fusion fusion(sphere());
  CHECK_NOTHROW(fusion.fuse_one(0));
  fusion.colors[2] = Image<Rgb>(kWidth, kWidth / 2 - 2);
  CHECK_THROWS_AS(fusion.fuse_one(0), InvalidInput);
  CHECK_THROWS_AS(fuse_pixels({{&fusion.maps[0], nullptr, {}}}, 0, {}, Executor(1)), InvalidInput);
}

TEST_CASE("points are transformed to the world by the given pose", "[fusion]") {
  KeyframeCloud cloud;
  CloudPoint point;
  point.position = {1.0F, 2.0F, 3.0F};
  point.normal = {0.0F, 0.0F, -1.0F};
  point.views = 4;
  cloud.points = {point};
  RigidTransform cam_from_world;
  cam_from_world.rotation << 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0;
  cam_from_world.translation = {10.0, 20.0, 30.0};
  const std::vector<CloudPoint> world = transform_points(cloud, {cam_from_world});
  REQUIRE(world.size() == 1);
  CHECK((cam_from_world * world[0].position.cast<double>() - Eigen::Vector3d(1.0, 2.0, 3.0)).norm() < 1e-5);
  CHECK((world[0].normal - Eigen::Vector3f(1.0F, 0.0F, 0.0F)).norm() < 1e-6F);
  CHECK(world[0].views == 4);
  const std::vector<CloudPoint> longer = transform_points(cloud, {cam_from_world, 2.0});
  CHECK((cam_from_world * longer[0].position.cast<double>() - Eigen::Vector3d(2.0, 4.0, 6.0)).norm() < 1e-5);
}
