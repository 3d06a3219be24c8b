// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "core/helpers.h"
#include "core/on_depth_maps.h"
#include "pmsp/camera.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"
#include "synth/rng.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

constexpr int kWidth = 160;

const synth::Mission& room() {
  static const synth::Mission kRoom = synth::empty_room(small_recipe(kWidth, 5));
  return kRoom;
}

/// The maps besides `maps[reference]`.
std::vector<const DepthMap*> others_of(const std::vector<DepthMap>& maps, std::size_t reference) {
  std::vector<const DepthMap*> others;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    if (i != reference) others.push_back(&maps[i]);
  }
  return others;
}

DepthMap filtered(const DepthMap& map, const std::vector<const DepthMap*>& others,
                  const ConsistencyFilterOptions& options = {}, FilterStats* stats = nullptr) {
  DepthMap result = map;
  consistency_filter(result, others, options, Executor(2), stats);
  return result;
}

DepthMap without_depths(DepthMap map) {
  map.depth = Image<float>(map.depth.width(), map.depth.height(), 0.0F);
  map.normal = Image<Eigen::Vector3f>(map.depth.width(), map.depth.height(), Eigen::Vector3f::Zero());
  map.confidence = Image<float>(map.depth.width(), map.depth.height(), 0.0F);
  return map;
}

/// Expected error of a confidence, in units of that of confidence 0.5.
float reported_error(float confidence) { return 1.0F / confidence - 1.0F; }

/// Every 37th pixel: no two of them are neighbours.
void plant(DepthMap& map, float factor) {
  for (std::size_t i = 5; i < map.depth.size(); i += 37) map.depth.pixels()[i] *= factor;
}

}  // namespace

TEST_CASE("true depth maps agree with each other", "[consistency]") {
  const std::vector<std::pair<std::string, std::function<synth::Mission(const synth::Recipe&)>>> scenes = {
      {"empty_room", synth::empty_room},         {"sphere_inside", synth::sphere_inside},
      {"slanted_plane", synth::slanted_plane},   {"corridor_across_seam", synth::corridor_across_seam},
      {"floor_at_nadir", synth::floor_at_nadir}, {"textured_room", synth::textured_room}};
  for (const auto& [name, make] : scenes) {
    synth::Recipe recipe = small_recipe(kWidth, 5);
    recipe.mission.render.samples = 1;
    const synth::Mission mission = make(recipe);
    const std::vector<DepthMap> maps = truth_maps(mission);
    for (const std::size_t i : {std::size_t{0}, std::size_t{2}, std::size_t{4}}) {
      FilterStats stats;
      const DepthMap map = filtered(maps[i], others_of(maps, i), {}, &stats);
      INFO(name << ", map " << i);
      CHECK(stats.before == static_cast<std::int64_t>(map.depth.size()));
      const bool occlusions = name == "textured_room";
      CHECK(static_cast<double>(stats.after) >= (occlusions ? 0.95 : 0.995) * static_cast<double>(stats.before));
    }
  }
}

TEST_CASE("a floor seen at grazing angles does not disagree with itself", "[consistency]") {
  synth::Scene scene;
  scene.add(synth::Plane{Eigen::Vector3d(0.0, 1.0, 0.0), -Eigen::Vector3d::UnitY()}, synth::textured(1));
  scene.add(synth::Sphere{Eigen::Vector3d::Zero(), 9.0}, synth::textured(2));
  synth::Flight flight;
  flight.keyframes = 5;
  flight.step = 0.2;
  const synth::Mission mission =
      synth::make_mission(scene, synth::fly(flight), kWidth, kWidth / 2, small_recipe(kWidth).mission);
  const std::vector<DepthMap> maps = truth_maps(mission);
  const DepthMap map = filtered(maps[2], others_of(maps, 2));
  const synth::Frame& frame = mission.frames[2];
  const auto is_grazing = [&](int x, int y) { return frame.surface(x, y) == 0 && frame.depth(x, y) > 3.0F; };
  const Image<float>& depth = map.depth;
  CHECK(synth::share_within(depth, frame.depth, 0.0, is_grazing) > 0.97);
  // One row of pixels covers more than a tenth of the range there: no depth of a pixel is that of its neighbour.
  CHECK(frame.depth(80, 44) > 1.1F * frame.depth(80, 45));
}

TEST_CASE("wrong depths are dropped and kept depths are unchanged", "[consistency]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  for (const float factor : {0.5F, 0.92F, 1.08F, 3.0F}) {
    INFO(factor);
    DepthMap planted = maps[2];
    plant(planted, factor);
    const DepthMap map = filtered(planted, others_of(maps, 2));
    int survived = 0;
    int lost = 0;
    for (std::size_t i = 0; i < map.depth.size(); ++i) {
      const bool wrong = planted.depth.pixels()[i] != maps[2].depth.pixels()[i];
      const float depth = map.depth.pixels()[i];
      survived += wrong && depth > 0.0F ? 1 : 0;
      lost += !wrong && (depth != maps[2].depth.pixels()[i] || map.normal.pixels()[i] != maps[2].normal.pixels()[i])
                  ? 1
                  : 0;
      if (depth <= 0.0F) REQUIRE((map.normal.pixels()[i].norm() == 0.0F && map.confidence.pixels()[i] == 0.0F));
    }
    CHECK(survived <= 2);
    CHECK(lost <= static_cast<int>(map.depth.size()) / 500);
  }
}

TEST_CASE("deviations within the tolerance or a pixel's angle stay", "[consistency]") {
  const std::vector<DepthMap> maps = truth_maps(synth::sphere_inside(small_recipe(kWidth, 5)));
  const auto kept = [&](double deviation, double tolerance) {
    DepthMap deviating = maps[2];
    for (float& depth : deviating.depth.pixels()) depth *= static_cast<float>(1.0 + deviation);
    ConsistencyFilterOptions options;
    options.max_relative_depth = tolerance;
    return filled(filtered(deviating, others_of(maps, 2), options).depth);
  };
  const double pixel_angle = static_cast<double>(EIGEN_PI) / (kWidth / 2);
  CHECK(kept(0.9 * pixel_angle, 0.002) > 0.99);
  CHECK(kept(1.2 * pixel_angle, 0.002) < 0.1);
  CHECK(kept(1.2 * pixel_angle, 1.5 * pixel_angle) > 0.99);
}

TEST_CASE("more views must agree than see through the point", "[consistency]") {
  const DepthMap truth = truth_maps(room())[2];
  DepthMap nearer = truth;  // seen by three keyframes in one place
  for (float& depth : nearer.depth.pixels()) depth *= 0.8F;
  CHECK(filled(filtered(nearer, {&nearer, &nearer}).depth) > 0.995);
  CHECK(filled(filtered(nearer, {&nearer, &nearer, &truth}).depth) > 0.995);
  CHECK(filled(filtered(nearer, {&nearer, &nearer, &truth, &truth}).depth) < 0.005);
  CHECK(filled(filtered(truth, {&truth, &truth, &nearer, &nearer}).depth) > 0.995);  // occluded only
}

TEST_CASE("many far keyframes that miss a surface do not remove depths of near ones", "[consistency]") {
  const DepthMap near = beside_at_depth(truth_maps(room())[2], 0.0, 1.0F);
  const auto kept_against = [&](double away) {  // from this far aside, twelve views see the wall behind
    const DepthMap far = beside_at_depth(near, away, 10.0F);
    std::vector<const DepthMap*> others(12, &far);
    others.insert(others.end(), 2, &near);
    return filled(filtered(near, others).depth);
  };
  CHECK(kept_against(3.0) == 1.0);
  CHECK(kept_against(0.1) == 0.0);
}

TEST_CASE("holes neither agree nor disagree", "[consistency]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  const DepthMap hole1 = without_depths(maps[1]);
  const DepthMap hole3 = without_depths(maps[3]);
  const DepthMap hole4 = without_depths(maps[4]);
  CHECK(filled(filtered(maps[2], {&maps[0], &maps[1], &hole3, &hole4}).depth) > 0.985);  // two source views agree
  CHECK(filled(filtered(maps[2], {&maps[0], &hole1, &hole3, &hole4}).depth) > 0.985);  // the only view that can see it
  const DepthMap hole0 = without_depths(maps[0]);
  CHECK(filled(filtered(maps[2], {&hole0, &hole1, &hole3, &hole4}).depth) == 0.0);
  CHECK(filled(filtered(without_depths(maps[2]), others_of(maps, 2)).depth) == 0.0);
}

TEST_CASE("at the ends of a sequence fewer views must agree and at least one other", "[consistency]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  const DepthMap hole = without_depths(maps[1]);
  CHECK(filled(filtered(maps[0], {&maps[1], &maps[2]}).depth) > 0.995);
  CHECK(filled(filtered(maps[0], {&hole, &maps[2]}).depth) > 0.995);
  CHECK(filled(filtered(maps[0], {&hole, &hole}).depth) == 0.0);
  CHECK(filled(filtered(maps[0], {&maps[1]}).depth) > 0.995);
  CHECK(filled(filtered(maps[0], {&hole}).depth) == 0.0);
  ConsistencyFilterOptions wide;
  wide.window = 15;
  CHECK(filled(filtered(maps[0], {&hole}, wide).depth) == 0.0);
  CHECK(filled(filtered(maps[0], {&maps[1]}, wide).depth) > 0.995);
}

TEST_CASE("min_views counts the reference view", "[consistency]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  DepthMap other = maps[3];  // it neither agrees nor is occluded nor sees through
  for (float& depth : other.depth.pixels()) depth *= 1.06F;
  const std::vector<const DepthMap*> one_agrees = {&maps[1], &other, &other, &other};
  ConsistencyFilterOptions options = {};
  for (const auto& [min_views, kept] : {std::pair{1, true}, {2, true}, {3, false}, {5, false}}) {
    INFO(min_views);
    options.min_views = min_views;
    CHECK((filled(filtered(maps[2], one_agrees, options).depth) > 0.995) == kept);
  }
  options.min_views = 5;
  CHECK(filled(filtered(maps[2], others_of(maps, 2), options).depth) > 0.98);
}

TEST_CASE("confidence grows with the number of agreeing views and their agreement", "[consistency]") {
  const std::vector<DepthMap> maps = truth_maps(synth::sphere_inside(small_recipe(kWidth, 5)), 0.8F);
  const DepthMap hole = without_depths(maps[1]);
  std::vector<DepthMap> noisy = maps;
  for (std::size_t k = 0; k < maps.size(); ++k) {
    for (std::size_t i = 0; i < maps[k].depth.size(); ++i) {
      noisy[k].depth.pixels()[i] *= static_cast<float>(1.0 + 0.003 * synth::gaussian(k, i));
    }
  }
  const auto told = [](const DepthMap& map) { return reported_error(map.confidence(kWidth / 4, kWidth / 4)); };
  const float all = told(filtered(maps[2], others_of(maps, 2)));
  const float half = told(filtered(maps[2], {&maps[0], &hole, &maps[3], &hole}));
  const float scattered = told(filtered(noisy[2], others_of(noisy, 2)));
  CAPTURE(all, half, scattered);
  CHECK(all > 0.0F);
  CHECK(half > 1.9F * all);
  CHECK(scattered > 1.9F * all);
  CHECK(half < 9.0F);
}

TEST_CASE("confidence is low on rough surfaces", "[consistency]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  DepthMap rough = maps[2];
  const int x = kWidth / 4;
  const int y = kWidth / 4;
  for (std::size_t i = 0; i < rough.depth.size(); ++i) {
    rough.depth.pixels()[i] *= static_cast<float>(1.0 + 0.007 * synth::gaussian(4, i));
  }
  rough.depth(x, y) = maps[2].depth(x, y);  // agrees as before
  const auto told = [&](const DepthMap& map) {
    return reported_error(filtered(map, others_of(maps, 2)).confidence(x, y));
  };
  CHECK(told(rough) > 2.0F * told(maps[2]));
}

TEST_CASE("confidence is low where there is little parallax", "[consistency]") {
  const synth::Mission mission = synth::sphere_inside(small_recipe(kWidth, 5));
  const std::vector<DepthMap> maps = truth_maps(mission);
  const DepthMap map = filtered(maps[2], others_of(maps, 2));
  double ahead = 0.0;
  double aside = 0.0;
  int ahead_count = 0;
  int aside_count = 0;
  for (int y = 0; y < map.depth.height(); ++y) {
    for (int x = 0; x < map.depth.width(); ++x) {
      const double degrees = degrees_from_motion(mission, 2, x, y);
      const double told = static_cast<double>(reported_error(map.confidence(x, y)));
      if (degrees < 10.0) ahead += told, ++ahead_count;
      if (degrees > 70.0) aside += told, ++aside_count;
    }
  }
  CAPTURE(ahead / ahead_count, aside / aside_count);
  CHECK(ahead / ahead_count > 1.6 * aside / aside_count);
}

TEST_CASE("pose errors lower the confidence according to the parallax", "[consistency]") {
  const std::vector<DepthMap> maps = truth_maps(synth::sphere_inside(small_recipe(kWidth, 5)));
  const Executor executor(2);
  std::vector<PlaneMap> planes;
  for (const DepthMap& map : maps) planes.push_back(plane_map_of(map, executor));
  const auto confidences = [&](double pose_error) {
    return pmsp::consistency_filter(planes[2], {&planes[0], &planes[1], &planes[3], &planes[4]}, {}, executor, nullptr,
                                    pose_error);
  };
  const Image<float> exact = confidences(0.0);
  const Image<float> off = confidences(0.002);
  for (const auto& [x, y] : {std::pair{kWidth / 4, kWidth / 4}, {kWidth / 3, kWidth / 5}, {kWidth / 2, kWidth / 8}}) {
    const auto error = [x = x, y = y](const Image<float>& map) {
      return 0.005 * (1.0 / static_cast<double>(map(x, y)) - 1.0);
    };
    const RigidTransform world_from_cam = maps[2].cam_from_world.inverse();
    const Eigen::Vector3d ray = world_from_cam.rotation * bearing_from_pixel({x + 0.5, y + 0.5}, kWidth, kWidth / 2);
    const double depth = static_cast<double>(maps[2].depth(x, y));
    double square_gain = 0.0;  // by how much the other's direction to the point turns, over a relative change of depth
    for (const std::size_t k : {0, 1, 3, 4}) {
      const Eigen::Vector3d from = world_from_cam.translation + depth * ray - maps[k].cam_from_world.center();
      square_gain += std::pow(depth * ray.cross(from).norm() / from.squaredNorm(), 2) / 4.0;
    }
    const double added = std::sqrt(std::pow(error(off), 2) - std::pow(error(exact), 2));
    CHECK(added == Approx(std::sqrt(2.0) * 0.002 / std::sqrt(square_gain)).epsilon(0.01));
  }
  for (const double bad : {-1e-6, 1.5, std::nan("")}) CHECK_THROWS_AS(confidences(bad), InvalidInput);
}

TEST_CASE("thin structures may be off by two pixels but edges of wide ones may not", "[consistency]") {
  const DepthMap wall = truth_maps(synth::sphere_inside(small_recipe(kWidth, 1)))[0];
  constexpr int kTop = 20;
  constexpr int kBottom = 60;
  const auto with_thing = [&](int left, int wide) {  // upright, before the wall
    DepthMap map = wall;
    for (int y = kTop; y < kBottom; ++y) {
      for (int x = left; x < left + wide; ++x) map.depth((x + kWidth) % kWidth, y) *= 0.7F;
    }
    return map;
  };
  const auto kept = [&](const DepthMap& map, const std::vector<const DepthMap*>& others, int from, int until) {
    const DepthMap result = filtered(map, others);
    int count = 0;
    for (int x = from; x < until; ++x) count += result.depth((x + kWidth) % kWidth, 40) > 0.0F ? 1 : 0;
    return count;
  };
  for (const int left : {60, -1}) {  // the latter on the seam
    const DepthMap right2 = with_thing(left + 2, 2);
    const DepthMap left2 = with_thing(left - 2, 2);
    CHECK(kept(with_thing(left, 2), {&right2, &right2, &left2, &left2}, left, left + 2) == 2);
    const DepthMap right4 = with_thing(left + 4, 2);
    CHECK(kept(with_thing(left, 2), {&right4, &right4, &right4, &right4}, left, left + 2) == 0);
    CHECK(kept(with_thing(left, 2), {&wall, &wall, &wall, &wall}, left, left + 2) == 0);
    const DepthMap wide = with_thing(left + 2, 12);
    CHECK(kept(with_thing(left, 14), {&wide, &wide, &wide, &wide}, left, left + 2) == 0);
    CHECK(kept(with_thing(left, 14), {&wide, &wide, &wide, &wide}, left + 2, left + 14) == 12);
  }
}

TEST_CASE("errors of matched depths fall as confidence rises", "[consistency]" PMSP_ACCURACY) {
  const synth::Mission mission = synth::textured_room(small_recipe(320, 5));
  std::vector<DepthMap> maps;
  for (std::size_t k = 0; k < mission.frames.size(); ++k) {
    MatchSetup setup;
    if (k == 0) setup.neighbours = {1, 2};
    if (k == 4) setup.neighbours = {2, 3};
    maps.push_back(match(mission, k, setup));
  }
  const DepthMap map = filtered(maps[2], others_of(maps, 2));
  std::vector<std::pair<float, double>> pixels;  // confidence, error
  for (std::size_t i = 0; i < map.depth.size(); ++i) {
    const double truth = static_cast<double>(mission.frames[2].depth.pixels()[i]);
    const double depth = static_cast<double>(map.depth.pixels()[i]);
    if (depth > 0.0) pixels.emplace_back(map.confidence.pixels()[i], std::abs(depth / truth - 1.0));
  }
  std::sort(pixels.begin(), pixels.end());
  constexpr std::size_t kParts = 5;
  double median_before = 1.0;
  double p90_before = 1.0;
  for (std::size_t part = 0; part < kParts; ++part) {
    std::vector<double> errors;
    double expected = 0.0;
    for (std::size_t i = pixels.size() * part / kParts; i < pixels.size() * (part + 1) / kParts; ++i) {
      errors.push_back(pixels[i].second);
      expected += 0.005 * (1.0 / static_cast<double>(pixels[i].first) - 1.0);
    }
    std::sort(errors.begin(), errors.end());
    const double median = errors[errors.size() / 2];
    const double p90 = errors[errors.size() * 9 / 10];
    expected /= static_cast<double>(errors.size());
    CAPTURE(part, median, p90, expected);
    CHECK(median < median_before);
    CHECK(p90 < p90_before);
    CHECK(median > expected / 4.0);
    CHECK(median < expected * 2.0);
    median_before = median;
    p90_before = p90;
  }
}

TEST_CASE("a disabled consistency filter changes nothing and invalid options are refused", "[consistency]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  const DepthMap hole = without_depths(maps[1]);
  ConsistencyFilterOptions options;
  options.enabled = false;
  CHECK(same(filtered(maps[2], {&hole, &hole}, options), maps[2]));
  options.min_views = 6;
  CHECK_THROWS_AS(filtered(maps[2], {&hole}, options), InvalidOption);
}

TEST_CASE("the consistency filter refuses depth maps of different sizes", "[consistency]") {
  DepthMap map = truth_map(synth::sphere_inside(small_recipe(64, 1)).frames[0]);
  const DepthMap other = truth_map(synth::sphere_inside(small_recipe(32, 1)).frames[0]);
  CHECK_THROWS_AS(consistency_filter(map, {&other}, {}, Executor(1)), InvalidInput);
}

TEST_CASE("the consistency filter gives the same bytes for any number of threads", "[consistency]") {
  std::vector<DepthMap> maps = truth_maps(room());
  for (std::size_t k = 0; k < maps.size(); ++k) {
    for (std::size_t i = 0; i < maps[k].depth.size(); ++i) {
      maps[k].depth.pixels()[i] *= static_cast<float>(1.0 + 0.015 * synth::gaussian(k, i));
    }
  }
  DepthMap one = maps[2];
  consistency_filter(one, others_of(maps, 2), {}, Executor(1));
  CHECK(filled(one.depth) < 0.99);
  DepthMap five = maps[2];
  consistency_filter(five, others_of(maps, 2), {}, Executor(5));
  CHECK(same(one, five));
  for (const Simd simd : available_simd()) {
    DepthMap map = maps[2];
    consistency_filter(map, others_of(maps, 2), {}, Executor(2, simd));
    INFO(name_of(simd));
    CHECK(agreement(map.depth, one.depth, 0.001) > 0.995);
  }
}

TEST_CASE("where few views can see a depth all of these must agree", "[consistency]") {
  const std::vector<DepthMap> maps = truth_maps(room());
  const auto kept = [&](int agreeing, float factor_of_others) {
    std::vector<DepthMap> others;
    for (const DepthMap* other : others_of(maps, 2)) others.push_back(*other);
    for (std::size_t i = static_cast<std::size_t>(agreeing); i < others.size(); ++i) {
      for (float& depth : others[i].depth.pixels()) depth *= factor_of_others;
    }
    std::vector<const DepthMap*> pointers;
    for (const DepthMap& other : others) pointers.push_back(&other);
    return filled(filtered(maps[2], pointers).depth);
  };
  CHECK(kept(1, 0.5F) > 0.95);  // occluded from all others
  CHECK(kept(0, 0.5F) < 0.05);
  CHECK(kept(1, 2.0F) < 0.05);  // all others see through it
  CHECK(kept(2, 0.5F) > 0.95);
}

TEST_CASE("far pixels agree in any map units and floaters in front of them are dropped", "[consistency]") {
  const auto map_of = [](float inverse_depth, double scale) {
    PlaneMap map(kWidth, kWidth / 2);
    map.scale = scale;
    for (int y = 0; y < map.height(); ++y) {
      for (int x = 0; x < map.width(); ++x) {
        const Eigen::Vector3d bearing = bearing_from_pixel({x + 0.5, y + 0.5}, map.width(), map.height());
        map.x(x, y) = inverse_depth * static_cast<float>(bearing.x());
        map.y(x, y) = inverse_depth * static_cast<float>(bearing.y());
        map.z(x, y) = inverse_depth * static_cast<float>(bearing.z());
        map.score(x, y) = 1.0F;
      }
    }
    return map;
  };
  const PlaneMap far = map_of(1e-12F, 1.0);
  const PlaneMap far_in_other_unit = map_of(1e-12F, 3.7);
  const PlaneMap near = map_of(0.2F, 1.0);
  const std::vector<const PlaneMap*> sky = {&far, &far_in_other_unit, &far, &far_in_other_unit};
  const auto confident = [&](const PlaneMap& map, const std::vector<const PlaneMap*>& others) {
    const Image<float> confidence = consistency_filter(map, others, {}, Executor(2));
    return std::count_if(confidence.pixels().begin(), confidence.pixels().end(), [](float c) { return c > 0.0F; });
  };
  const auto all = static_cast<std::ptrdiff_t>(kWidth * kWidth / 2);
  CHECK(confident(far, sky) == all);
  CHECK(confident(near, {&near, &near, &far, &far}) == 0);
  CHECK(confident(near, {&near, &near, &near, &far}) == all);
  CHECK(filled(depth_map_of(far, nullptr, Executor(2)).depth) == 0.0);
}
