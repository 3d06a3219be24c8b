// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <iterator>
#include <map>
#include <numeric>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "core/helpers.h"
#include "core/on_depth_maps.h"
#include "duplicates.h"
#include "elementary.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"
#include "synth/rng.h"

using namespace pmsp;
using namespace pmsp::test;
using Eigen::Vector3d;

namespace {

constexpr int kWidth = 160;
constexpr double kPixel = 2.0 * kernels::kPi / kWidth;  // [rad]

RigidTransform at(const Vector3d& center, double yaw_deg = 0.0) {
  const RigidTransform level{Eigen::Matrix3d::Identity(), -center};
  return synth::yawed(level, yaw_deg);
}

/// Depth maps of a scene and their points: each keyframe is compared with all within `reach` in the list.
class Owners {
 public:
  Owners(const synth::Scene& scene, const std::vector<RigidTransform>& cameras, double noise = 0.0) {
    for (std::size_t k = 0; k < cameras.size(); ++k) {
      const synth::RenderedView view = synth::render(scene, cameras[k], kWidth, kWidth / 2, {1});
      DepthMap map;
      map.keyframe_id = static_cast<std::int64_t>(10 + k);
      map.cam_from_world = cameras[k];
      map.depth = view.depth;
      map.normal = view.normal;
      map.confidence = Image<float>(kWidth, kWidth / 2);
      for (std::size_t i = 0; i < map.depth.size(); ++i) {
        if (map.depth.pixels()[i] <= 0.0F) continue;
        map.depth.pixels()[i] *= static_cast<float>(1.0 + noise * synth::gaussian(70 + k, i));
        map.confidence.pixels()[i] = static_cast<float>(0.7 + 0.03 * synth::gaussian(170 + k, i));
      }
      maps.push_back(map);
      colors.push_back(view.image);
      poses.push_back({cameras[k], 1.0});
    }
  }

  std::size_t size() const { return maps.size(); }

  /// Keyframes that keyframe i is compared with.
  std::vector<std::size_t> viewers(std::size_t i) const {
    std::vector<std::size_t> asked;
    for (std::size_t k = 0; k < size(); ++k) {
      if (k != i && (k > i ? k - i : i - k) <= reach) asked.push_back(k);
    }
    return asked;
  }

  void make(int threads = 2) {
    const Executor executor(threads);
    std::vector<RangeMap> range_maps;
    surfels.clear();
    for (std::size_t i = 0; i < size(); ++i) {
      std::vector<FusedDepth> window;
      std::size_t current = 0;
      for (std::size_t k = i - std::min<std::size_t>(i, 2); k < std::min(size(), i + 3); ++k) {
        if (k == i) current = window.size();
        window.push_back({&maps[k], &colors[k], poses[k]});
      }
      surfels.push_back(fuse_pixels(window, current, fusion, executor));
      range_maps.push_back(range_map(maps[i], executor));
    }
    for (std::size_t i = 0; i < size(); ++i) {
      std::vector<PosedRangeMap> asked;
      for (const std::size_t k : viewers(i)) asked.push_back({&range_maps[k], poses[k]});
      surfels[i].statuses = free_space_filter(surfels[i], poses[i], asked, free_space, executor);
    }
    eligible = 0.0;
    for (const SurfelMap& map : surfels) {
      eligible += static_cast<double>(count(map.statuses, [](int status) { return status != 0; }));
    }
    std::vector<std::vector<std::uint32_t>> still(size());
    for (int round = 0; round < rounds; ++round) {
      std::vector<Image<std::uint8_t>> next;
      for (std::size_t i = 0; i < size(); ++i) {
        std::vector<PosedSurfels> asked;
        for (const std::size_t k : viewers(i)) asked.push_back({&surfels[k], &surfels[k].statuses, poses[k]});
        next.push_back(
            duplicate_round({&surfels[i], &surfels[i].statuses, poses[i]}, still[i], asked, fusion, executor));
      }
      for (std::size_t i = 0; i < size(); ++i) surfels[i].statuses = next[i];
    }
    clouds.clear();
    for (std::size_t i = 0; i < size(); ++i)
      clouds.push_back(extract_points({&surfels[i], &surfels[i].statuses, poses[i]}));
  }

  template <class Counts>
  static std::size_t count(const Image<std::uint8_t>& statuses, const Counts& counts) {
    return static_cast<std::size_t>(std::count_if(statuses.pixels().begin(), statuses.pixels().end(),
                                                  [&](std::uint8_t packed) { return counts(packed & 3); }));
  }

  double points() const {
    return std::accumulate(clouds.begin(), clouds.end(), 0.0, [](double sum, const KeyframeCloud& keyed) {
      return sum + static_cast<double>(keyed.points.size());
    });
  }

  /// Points in the world, with normals and the size of their pixels.
  struct Placed {
    Vector3d position, normal;
    double footprint;
    std::size_t keyframe;
  };
  Placed placed(std::size_t keyframe, const Eigen::Vector3f& position, const Eigen::Vector3f& normal) const {
    const RigidTransform world_from_cam = poses[keyframe].cam_from_world.inverse();
    const Vector3d in_camera = poses[keyframe].scale * position.cast<double>();
    return {world_from_cam * in_camera, world_from_cam.rotation * normal.cast<double>(), in_camera.norm() * kPixel,
            keyframe};
  }
  std::vector<Placed> all() const {
    std::vector<Placed> points;
    for (std::size_t k = 0; k < size(); ++k) {
      for (const CloudPoint& point : clouds[k].points) points.push_back(placed(k, point.position, point.normal));
    }
    return points;
  }

  /// Share of the dropped pixels without a point of any keyframe within two spacings of their own pixels, across the
  /// ray, on their side of the surface.
  double uncovered() const;

  /// Pairs of points of different keyframes closer than half the finer pixel spacing, per point.
  double near_pairs() const;

  FusionOptions fusion;
  FreeSpaceOptions free_space;
  std::size_t reach = 1000;
  int rounds = 4;
  std::vector<DepthMap> maps;
  std::vector<Image<Rgb>> colors;
  std::vector<KeyframePose> poses;
  std::vector<SurfelMap> surfels;
  std::vector<KeyframeCloud> clouds;
  double eligible = 0.0;
};

/// Finds points near a position.
class Neighbourhood {
 public:
  Neighbourhood(const std::vector<Owners::Placed>& points, double cell) : points_(points), cell_(cell) {
    for (std::size_t i = 0; i < points.size(); ++i) cells_[cell_of(points[i].position)].push_back(i);
  }

  /// Whether `wanted` holds for a point of the cells around.
  bool any(const Vector3d& position, const std::function<bool(const Owners::Placed&)>& wanted) const {
    const std::array<int, 3> center = cell_of(position);
    for (int i = 0; i < 27; ++i) {
      const auto found = cells_.find({center[0] + i % 3 - 1, center[1] + i / 3 % 3 - 1, center[2] + i / 9 - 1});
      if (found == cells_.end()) continue;
      if (std::any_of(found->second.begin(), found->second.end(), [&](std::size_t k) { return wanted(points_[k]); })) {
        return true;
      }
    }
    return false;
  }

 private:
  std::array<int, 3> cell_of(const Vector3d& p) const {
    return {static_cast<int>(std::floor(p.x() / cell_)), static_cast<int>(std::floor(p.y() / cell_)),
            static_cast<int>(std::floor(p.z() / cell_))};
  }
  const std::vector<Owners::Placed>& points_;
  double cell_;
  std::map<std::array<int, 3>, std::vector<std::size_t>> cells_;
};

double Owners::uncovered() const {
  const std::vector<Placed> points = all();
  const Neighbourhood near(points, 0.25);
  std::size_t dropped = 0;
  std::size_t alone = 0;
  for (std::size_t k = 0; k < size(); ++k) {
    for (int y = 0; y < kWidth / 2; ++y) {
      for (int x = (y + static_cast<int>(k)) % 3; x < kWidth; x += 3) {
        if ((surfels[k].statuses(x, y) & 3) != 3) continue;
        const Eigen::Vector3f bearing = bearing_of(maps[k].depth, x, y).cast<float>();
        const Placed pixel = placed(k, maps[k].depth(x, y) * bearing, maps[k].normal(x, y));
        const Vector3d ray = (pixel.position - poses[k].cam_from_world.center()).normalized();
        ++dropped;
        alone += near.any(pixel.position,
                          [&](const Placed& point) {
                            const Vector3d apart = point.position - pixel.position;
                            return point.normal.dot(pixel.normal) > 0.0 &&
                                   apart.cross(ray).norm() <= 2.0 * fusion.spacing_px * pixel.footprint &&
                                   std::abs(apart.dot(ray)) < 0.06 * pixel.footprint / kPixel;
                          })
                     ? 0
                     : 1;
      }
    }
  }
  return static_cast<double>(alone) / std::max(1.0, static_cast<double>(dropped));
}

double Owners::near_pairs() const {
  const std::vector<Placed> points = all();
  const Neighbourhood near(points, 0.1);
  std::size_t close = 0;
  for (const Placed& a : points) {
    close += near.any(a.position,
                      [&](const Placed& b) {
                        return a.keyframe != b.keyframe && a.normal.dot(b.normal) > 0.5 &&
                               (a.position - b.position).norm() <
                                   0.5 * fusion.spacing_px * std::min(a.footprint, b.footprint);
                      })
                 ? 1
                 : 0;
  }
  return static_cast<double>(close) / std::max(1.0, static_cast<double>(points.size()));
}

synth::Scene box(const Vector3d& half_size) {
  synth::Scene scene;
  scene.add(synth::Box{Vector3d::Zero(), half_size, Eigen::Matrix3d::Identity()}, synth::textured(1));
  return scene;
}

std::vector<RigidTransform> along(const Vector3d& start, const Vector3d& step, int count) {
  std::vector<RigidTransform> poses;
  for (int k = 0; k < count; ++k) poses.push_back(at(start + k * step, 17.0 * k));
  return poses;
}

/// Keyframe, pixel of every point.
std::vector<std::pair<std::int64_t, std::uint32_t>> keys(const Owners& duplicate_views) {
  std::vector<std::pair<std::int64_t, std::uint32_t>> keys;
  for (const KeyframeCloud& keyed : duplicate_views.clouds) {
    for (const std::uint32_t pixel : keyed.pixels) keys.emplace_back(keyed.keyframe_id, pixel);
  }
  std::sort(keys.begin(), keys.end());
  return keys;
}

}  // namespace

TEST_CASE("duplicate removal keeps each place of a room exactly once", "[duplicates]" PMSP_ACCURACY) {
  Owners room(box({2.0, 1.5, 4.0}), along({0.1, 0.05, -1.5}, {0.03, 0.02, 0.35}, 8), 0.002);
  room.fusion.spacing_px = GENERATE(0.3, 0.75);
  room.make();
  CAPTURE(room.eligible, room.points(), room.uncovered(), room.near_pairs());
  CHECK(room.eligible > 0.98 * static_cast<double>(room.size() * room.maps[0].depth.size()));
  CHECK(room.points() < 0.8 * room.eligible);
  CHECK(room.uncovered() < 0.001);
  CHECK(room.near_pairs() < 0.08);
}

TEST_CASE("a slanted floor is one surface at any viewing angle", "[duplicates]") {
  synth::Scene scene;
  const Vector3d up = Vector3d(0.25, -1.0, 0.2).normalized();
  scene.add(synth::Plane{{0.0, 0.6, 0.0}, up}, synth::textured(1));
  Owners floor(scene, along({0.0, 0.0, 0.0}, {0.0, 0.0, 0.25}, 8));
  for (DepthMap& map : floor.maps) {  // it extends to the horizon
    for (std::size_t i = 0; i < map.depth.size(); ++i) {
      if (map.depth.pixels()[i] > 6.0F) map.depth.pixels()[i] = map.confidence.pixels()[i] = 0.0F;
    }
  }
  floor.make();
  CAPTURE(floor.eligible, floor.points());
  CHECK(floor.uncovered() < 0.002);
  CHECK(floor.near_pairs() < 0.05);
  CHECK(floor.points() < 0.8 * floor.eligible);
}

TEST_CASE("a thin wall keeps the points of both its sides", "[duplicates]") {
  synth::Scene scene = box({3.0, 1.5, 3.0});
  scene.add(synth::Box{Vector3d::Zero(), {0.004, 1.4, 1.5}, Eigen::Matrix3d::Identity()}, synth::textured(2));
  std::vector<RigidTransform> poses;
  for (int k = 0; k < 3; ++k) poses.push_back(at({-1.2, 0.1 * k, -0.2 + 0.2 * k}, 5.0 * k));
  for (int k = 0; k < 3; ++k) poses.push_back(at({1.2, 0.1 * k, -0.2 + 0.2 * k}, 5.0 * k));
  Owners wall(scene, poses);
  wall.make();
  std::size_t left = 0;
  std::size_t right = 0;
  for (const Owners::Placed& point : wall.all()) {
    if (std::abs(point.position.x()) > 0.05 || std::abs(point.position.z()) > 1.4) continue;
    (point.normal.x() < 0.0 ? left : right) += 1;
  }
  CAPTURE(left, right);
  CHECK(left > 500);
  CHECK(right > 500);
  CHECK(wall.uncovered() < 0.001);
}

TEST_CASE("an object parallel to a wall behind it removes no points of the wall", "[duplicates]") {
  synth::Scene scene = box({3.0, 1.5, 4.0});
  scene.add(synth::Box{{0.0, 0.0, 1.5}, {0.5, 0.5, 0.02}, Eigen::Matrix3d::Identity()}, synth::textured(2));
  // Each of them sees some of the wall that the board hides from the other, which samples the board more finely.
  Owners duplicate_views(scene, {at({-1.0, 0.0, 0.0}), at({1.0, 0.0, 0.0})});
  duplicate_views.make();
  CHECK(duplicate_views.points() < 0.95 * duplicate_views.eligible);
  CHECK(duplicate_views.uncovered() < 0.001);
}

TEST_CASE("a point lies on a surface by either of the two normals", "[duplicates]") {
  namespace k = kernels;
  using V = k::Vec3<float>;
  k::DuplicateView other{};
  other.map = {nullptr, nullptr, kWidth, kWidth / 2, 1.0F};
  for (const int i : {0, 4, 8}) other.other_from_first.r[i] = 1.0F;
  other.scale_ratio = 1.0F;
  const k::DuplicateLimits limits{1.0F, 0.02F, 0.5F};
  const V ahead{0.0F, 0.0F, 1.0F};
  const auto stands = [&](const V& owner_normal, const V& claim_normal, const V& apart) {
    const std::uint32_t surfel = k::pack_point<float>(2.0F, owner_normal, {0.0F, 0.0F, 0.0F}, 0.7F).surfel;
    const auto off = k::off_surface<float>(2.0F, claim_normal, ahead, 0.7F, limits.max_relative_depth);
    return k::is_duplicate<float>(surfel, k::pack_status<float>(0.7F, k::PointStatus::kKept), ahead,
                                  2.0F * ahead - apart, claim_normal, off, 1e9F, other, limits);
  };
  const V level{0.0F, 0.0F, -1.0F};
  const V slanted{0.6F, 0.0F, -0.8F};
  const V wrapped_pixel{0.1F, 0.0F, 0.0F};
  CHECK(stands(level, level, wrapped_pixel));
  CHECK(stands(level, slanted, wrapped_pixel));
  CHECK(stands(slanted, level, wrapped_pixel));
  CHECK_FALSE(stands(slanted, slanted, wrapped_pixel));
  CHECK_FALSE(stands(level, level, {0.0F, 0.0F, 0.1F}));
}

TEST_CASE("points seen at a quarter of the distance replace the coarser ones", "[duplicates]") {
  const bool near_first = GENERATE(true, false);
  std::vector<RigidTransform> poses = {at({0.0, 0.0, 3.0}), at({0.3, 0.0, 3.1}), at({0.0, 0.0, 0.0}),
                                       at({0.3, 0.1, 0.1})};
  if (!near_first) std::reverse(poses.begin(), poses.end());
  Owners duplicate_views(box({3.0, 3.0, 4.0}), poses);  // wall at z = 4: 1 and 4 away
  duplicate_views.make();
  std::array<double, 2> made{};
  for (const Owners::Placed& point : duplicate_views.all()) {
    if (point.position.z() < 3.99 || point.position.head<2>().norm() > 1.0) continue;
    const bool from_near = poses[point.keyframe].center().z() > 2.0;
    ++made[from_near ? 0 : 1];
  }
  CAPTURE(made[0], made[1]);
  CHECK(made[0] > 800);
  CHECK(made[1] < 0.01 * made[0]);
  CHECK(duplicate_views.uncovered() < 0.001);
}

TEST_CASE("sixty keyframes that hover give about as many points as a few", "[duplicates]" PMSP_ACCURACY) {
  std::vector<RigidTransform> poses;
  for (int k = 0; k < 60; ++k) {
    poses.push_back(at(
        {0.02 * synth::gaussian(1, static_cast<std::size_t>(k)), 0.02 * synth::gaussian(2, static_cast<std::size_t>(k)),
         0.02 * synth::gaussian(3, static_cast<std::size_t>(k))},
        2.0 * k));
  }
  Owners hover(box({2.0, 1.5, 3.0}), poses);
  hover.reach = 12;  // compared with 24
  hover.make();
  CAPTURE(hover.eligible, hover.points(), hover.uncovered(), hover.near_pairs());
  CHECK(hover.uncovered() < 0.002);
  CHECK(hover.near_pairs() < 0.8);  // of keyframes not compared with each other
  CHECK(hover.points() < 0.25 * hover.eligible);
  CHECK(hover.points() > static_cast<double>(hover.maps[0].depth.size()));
}

TEST_CASE("the order of keyframes in memory changes nothing", "[duplicates]") {
  const std::vector<RigidTransform> poses = along({0.1, 0.05, -1.0}, {0.03, 0.02, 0.4}, 5);
  Owners one(box({2.0, 1.5, 4.0}), poses, 0.002);
  one.make();
  Owners other = one;
  const Executor executor(3);
  std::vector<std::size_t> order = {3, 0, 4, 1, 2};
  // Fusion's windows are in time; the steps after it know no order at all.
  const std::vector<RangeMap> range_maps = [&] {
    std::vector<RangeMap> made;
    for (const DepthMap& map : one.maps) made.push_back(range_map(map, executor));
    return made;
  }();
  Owners fresh(box({2.0, 1.5, 4.0}), poses, 0.002);
  fresh.rounds = 0;
  fresh.make();
  std::map<std::size_t, SurfelMap> surfels;
  for (const std::size_t i : order) {
    std::vector<FusedDepth> window;
    std::size_t current = 0;
    for (std::size_t k = i - std::min<std::size_t>(i, 2); k < std::min<std::size_t>(5, i + 3); ++k) {
      if (k == i) current = window.size();
      window.push_back({&one.maps[k], &one.colors[k], one.poses[k]});
    }
    surfels[i] = fuse_pixels(window, current, one.fusion, executor);
    std::vector<PosedRangeMap> asked;
    for (const std::size_t k : order) {
      if (k != i) asked.push_back({&range_maps[k], one.poses[k]});
    }
    surfels[i].statuses = free_space_filter(surfels[i], one.poses[i], asked, one.free_space, executor);
  }
  std::map<std::size_t, std::vector<std::uint32_t>> still;
  for (int round = 0; round < one.rounds; ++round) {
    std::map<std::size_t, Image<std::uint8_t>> next;
    for (const std::size_t i : order) {
      std::vector<PosedSurfels> asked;
      for (const std::size_t k : order) {
        if (k != i) asked.push_back({&surfels[k], &surfels[k].statuses, one.poses[k]});
      }
      next[i] =
          duplicate_round({&surfels[i], &surfels[i].statuses, one.poses[i]}, still[i], asked, one.fusion, executor);
    }
    for (const std::size_t i : order) surfels[i].statuses = next[i];
  }
  other.clouds.clear();
  for (const std::size_t i : order)
    other.clouds.push_back(extract_points({&surfels[i], &surfels[i].statuses, one.poses[i]}));
  // Sums over viewers are rounded in another order, which may tip what lies on the limit.
  const auto mine = keys(one);
  const auto theirs = keys(other);
  std::vector<std::pair<std::int64_t, std::uint32_t>> differ;
  std::set_symmetric_difference(mine.begin(), mine.end(), theirs.begin(), theirs.end(), std::back_inserter(differ));
  CHECK(differ.empty());
}

TEST_CASE("of two equal views of a place the earlier keyframe keeps its points", "[duplicates]") {
  Owners twins(box({2.0, 1.5, 3.0}), {at({0.1, 0.0, -0.6}), at({0.1, 0.0, -0.6})});
  twins.maps[1].confidence = twins.maps[0].confidence;
  twins.make();
  CHECK(twins.clouds[0].points.size() > 1000);
  CHECK(twins.clouds[1].points.empty());
}

TEST_CASE("leaving out any keyframe loses no place that others see", "[duplicates]" PMSP_ACCURACY) {
  const std::vector<RigidTransform> poses = along({0.1, 0.05, -1.0}, {0.03, 0.02, 0.4}, 6);
  for (std::size_t gone = 0; gone < poses.size(); ++gone) {
    std::vector<RigidTransform> rest = poses;
    rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(gone));
    Owners duplicate_views(box({2.0, 1.5, 4.0}), rest, 0.002);
    duplicate_views.make();
    CAPTURE(gone);
    CHECK(duplicate_views.uncovered() < 0.001);
    CHECK(duplicate_views.near_pairs() < 0.05);
  }
}

TEST_CASE("a duplicate has a kept point in a keyframe it was compared with", "[duplicates]") {
  Owners room(box({2.0, 1.5, 4.0}), along({0.1, 0.05, -1.5}, {0.03, 0.02, 0.35}, 8), 0.002);
  room.rounds = 1;
  room.make();
  // The first round has no kept points yet: it drops nothing.
  for (const SurfelMap& map : room.surfels) {
    CHECK(Owners::count(map.statuses, [](int status) { return status == 3; }) == 0);
  }
  room.rounds = 12;
  room.make();
  std::size_t open = 0;
  for (const SurfelMap& map : room.surfels) {
    open += Owners::count(map.statuses, [](int status) { return status == 1; });
  }
  CHECK(open == 0);  // no two depend on each other
  CHECK(room.uncovered() < 0.001);
}

TEST_CASE("a rigid motion of all poses keeps the same points", "[duplicates]") {
  Owners room(box({2.0, 1.5, 4.0}), along({0.1, 0.05, -1.0}, {0.03, 0.02, 0.4}, 5), 0.002);
  room.make();
  const double before = room.points();
  RigidTransform moved;
  moved.rotation = Eigen::AngleAxisd(0.7, Vector3d(1.0, 2.0, 3.0).normalized()).toRotationMatrix();
  moved.translation = {5.0, -3.0, 8.0};
  for (KeyframePose& pose : room.poses) pose.cam_from_world = pose.cam_from_world * moved.inverse();
  room.make();
  CHECK(std::abs(room.points() / before - 1.0) < 0.01);
  CHECK(room.uncovered() < 0.001);
}

TEST_CASE("duplicates aligned by a pose correction are removed and separated ones are kept", "[duplicates]") {
  // Two passes of one place. The second drifted away; the loop closure moves it back.
  const synth::Scene scene = box({2.0, 1.5, 3.0});
  std::vector<RigidTransform> poses = along({0.1, 0.0, -0.6}, {0.0, 0.0, 0.4}, 3);
  for (int k = 0; k < 3; ++k) poses.push_back(at({-0.1, 0.1, -0.5 + 0.4 * k}, 100.0));
  Owners closed(scene, poses, 0.001);
  closed.make();
  const double together = closed.points();
  for (std::size_t k = 3; k < 6; ++k) {
    closed.poses[k].cam_from_world.translation += closed.poses[k].cam_from_world.rotation * Vector3d(20.0, 0.0, 0.0);
  }
  closed.make();
  CHECK(closed.points() > 1.2 * together);
  CHECK(closed.uncovered() < 0.001);
}

TEST_CASE("a keyframe of another scale gives the same duplicates", "[duplicates]") {
  Owners room(box({2.0, 1.5, 4.0}), along({0.1, 0.05, -1.0}, {0.03, 0.02, 0.4}, 5), 0.002);
  room.make();
  const auto before = keys(room);
  for (float& depth : room.maps[2].depth.pixels()) depth *= 0.5F;  // in units twice as long
  room.poses[2].scale = 2.0;
  room.make();
  CHECK(keys(room) == before);  // powers of two change no rounding
  const KeyframeCloud& keyed = room.clouds[2];
  REQUIRE(!keyed.points.empty());
  for (std::size_t i = 0; i < keyed.pixels.size(); i += 97) {
    const float depth = room.maps[2].depth.pixels()[keyed.pixels[i]];
    CHECK(keyed.points[i].position.norm() == Approx(depth).epsilon(0.02));
  }
  room.poses[2].scale = 1.0;  // and without its scale it is at the wrong place
  room.make();
  CHECK(keys(room) != before);
}

TEST_CASE("points contain their pixel and the agreeing keyframes", "[duplicates]") {
  Owners room(box({2.0, 1.5, 4.0}), along({0.1, 0.05, -1.0}, {0.03, 0.02, 0.4}, 5));
  for (float& depth : room.maps[1].depth.pixels()) depth *= 1.5F;  // another surface
  room.make();
  const KeyframeCloud& keyed = room.clouds[0];
  REQUIRE(keyed.window_ids == std::vector<std::int64_t>{11, 12});
  std::size_t only_the_other = 0;
  for (std::size_t i = 0; i < keyed.pixels.size(); ++i) {
    const int x = static_cast<int>(keyed.pixels[i]) % kWidth;
    const int y = static_cast<int>(keyed.pixels[i]) / kWidth;
    const Vector3d bearing = bearing_of(room.maps[0].depth, x, y);
    REQUIRE(keyed.points[i].position.cast<double>().normalized().dot(bearing) > 1.0 - 1e-9);
    only_the_other += keyed.agree[i] == 2U && keyed.points[i].views == 2 ? 1 : 0;
  }
  CHECK(static_cast<double>(only_the_other) > 0.95 * static_cast<double>(keyed.pixels.size()));
}

TEST_CASE("duplicate removal gives the same points for any number of threads", "[duplicates]") {
  Owners room(box({2.0, 1.5, 4.0}), along({0.1, 0.05, -1.0}, {0.03, 0.02, 0.4}, 4), 0.002);
  room.make(1);
  const auto one = keys(room);
  room.make(5);
  CHECK(keys(room) == one);
}

TEST_CASE("points that others see through are neither kept nor duplicates of others", "[duplicates]") {
  Owners room(box({2.0, 1.5, 4.0}), along({0.1, 0.05, -1.0}, {0.03, 0.02, 0.4}, 5));
  for (int x = 0; x < 20; ++x) {  // a floater in the first map
    for (int y = 30; y < 50; ++y) room.maps[0].depth(x, y) *= 0.6F;
  }
  room.make();
  for (int x = 2; x < 18; ++x) {
    for (int y = 32; y < 48; ++y) CHECK(room.surfels[0].statuses(x, y) == 0);
  }
  CHECK(room.uncovered() < 0.001);
  room.free_space.enabled = false;
  room.make();
  CHECK((room.surfels[0].statuses(10, 40) & 3) == 2);
}

TEST_CASE("points below the minimum confidence are neither kept nor duplicates of others", "[duplicates]") {
  Owners room(box({2.0, 1.5, 4.0}), along({0.1, 0.05, -1.0}, {0.03, 0.02, 0.4}, 2));
  for (float& confidence : room.maps[0].confidence.pixels()) confidence = 0.2F;
  room.fusion.min_confidence = 0.5;
  room.make();
  CHECK(room.clouds[0].points.empty());
  CHECK(static_cast<double>(room.clouds[1].points.size()) > 0.95 * static_cast<double>(room.maps[1].depth.size()));
}

TEST_CASE("duplicate removal refuses inconsistent input", "[duplicates]") {
  Owners room(box({2.0, 1.5, 4.0}), along({0.1, 0.05, -1.0}, {0.03, 0.02, 0.4}, 2));
  room.make();
  const Executor executor(1);
  const FusedDepth map{&room.maps[0], &room.colors[0], room.poses[0]};
  CHECK_THROWS_AS(fuse_pixels({map}, 1, {}, executor), InvalidInput);
  CHECK_THROWS_AS(fuse_pixels({{&room.maps[0], nullptr, {}}}, 0, {}, executor), InvalidInput);
  CHECK_THROWS_AS(fuse_pixels(std::vector<FusedDepth>(34, map), 0, {}, executor), InvalidInput);
  FusedDepth flat = map;
  flat.pose.scale = 0.0;
  CHECK_THROWS_AS(fuse_pixels({flat}, 0, {}, executor), InvalidInput);
  FusionOptions options;
  options.spacing_px = -1.0;
  CHECK_THROWS_AS(fuse_pixels({map}, 0, options, executor), InvalidOption);
  CHECK_THROWS_AS(free_space_filter(room.surfels[0], room.poses[0], {{nullptr, {}}}, {}, executor), InvalidInput);
  const SurfelMap small{1, Image<std::uint32_t>(8, 4), Image<std::uint8_t>(8, 4), Image<std::uint32_t>(8, 4), {}, {}};
  const SurfelMap& own = room.surfels[0];
  const SurfelMap& other = room.surfels[1];
  const PosedSurfels reference{&own, &own.statuses, room.poses[0]};
  std::vector<std::uint32_t> asked;
  CHECK_THROWS_AS(duplicate_round(reference, asked, {{&small, &small.statuses, {}}}, {}, executor), InvalidInput);
  CHECK_THROWS_AS(duplicate_round(reference, asked, {{&other, &small.statuses, {}}}, {}, executor), InvalidInput);
  CHECK_THROWS_AS(duplicate_round({&own, nullptr, {}}, asked, {}, {}, executor), InvalidInput);
  CHECK_THROWS_AS(extract_points({&own, &small.statuses, {}}), InvalidInput);
  const Image<std::uint8_t> judged[] = {free_space_filter(own, room.poses[0], {}, {}, executor),
                                        free_space_filter(other, room.poses[1], {}, {}, executor)};
  const PosedSurfels stale{&other, &judged[1], room.poses[1]};  // it stays as it was before the round
  duplicate_round(stale, asked, {{&own, &judged[0], room.poses[0]}}, {}, executor);
  REQUIRE(!asked.empty());
  CHECK_THROWS_AS(duplicate_round(stale, asked, {}, {}, executor), InvalidInput);
}
