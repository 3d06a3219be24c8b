// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>

#include <cmath>
#include <fstream>

#include "elementary.h"
#include "eval/eval_flight.h"
#include "pmsp-eval/cloud_measures.h"
#include "pmsp-eval/ground_truth.h"
#include "pmsp-eval/surface.h"
#include "pmsp-eval/view_measures.h"
#include "pmsp/error.h"
#include "support/temp_dir.h"

using namespace pmsp::eval;
using pmsp_test::Flight;
using pmsp_test::TempDir;

namespace {

constexpr int kViewHeight = 90;

/// A flight with its truth on disk, and the measures of clouds made for it.
class Bench {
 public:
  explicit Bench(const Flight& f, int truth_height = 120) : flight(f) {
    flight.write_truth(folder_.path(), truth_height);
    truth = std::make_unique<GroundTruth>(folder_.path(), TruthOptions{});
    alignment = align(flight.keyframes(), truth->trajectory());
    surface = build_surface(*truth, surface_options());
    view_options.height = kViewHeight;
    measure_options.max_points = 0;
    measure_options.max_truth = 0;
  }

  static SurfaceOptions surface_options() {
    SurfaceOptions options;
    options.voxel_m = 0.02;
    return options;
  }

  AlignedCloud aligned(const std::vector<Eigen::Vector3d>& points) const {
    return align_cloud(points, flight.keyframes(), alignment.truth_from_map, truth->origin());
  }
  CloudMeasures measure(const std::vector<Eigen::Vector3d>& points) const {
    return measure_cloud(aligned(points), surface, measure_options);
  }
  ViewMeasures views(const std::vector<Eigen::Vector3d>& points) const {
    return measure_views(aligned(points), alignment, *truth, view_options);
  }

  Flight flight;
  std::unique_ptr<GroundTruth> truth;
  Alignment alignment;
  Surface surface;
  CloudMeasureOptions measure_options;
  ViewOptions view_options;

 private:
  TempDir folder_;
};

std::vector<Eigen::Vector3d> in_map(const Flight& flight, std::vector<Eigen::Vector3d> points) {
  for (auto& p : points) p = flight.to_map(p);
  return points;
}

const CloudScore& at(const std::vector<CloudScore>& scores, double threshold) {
  for (const CloudScore& score : scores) {
    if (std::abs(score.threshold - threshold) < 1e-12) return score;
  }
  FAIL("no such threshold");
  return scores.front();
}

}  // namespace

TEST_CASE("a perfect cloud of a room reaches one everywhere") {
  const Bench bench(Flight(pmsp_test::box({2.0, 1.5, 3.0}), 7, 1.0));
  const auto cloud = bench.flight.points(2 * kViewHeight + kViewHeight);
  const ViewMeasures views = bench.views(cloud);
  CHECK(views.with_truth == 7);
  CHECK(views.mean.hit == Approx(1.0));
  CHECK(views.mean.hit_solid_angle == Approx(1.0));
  REQUIRE(views.mean.correct.has_value());
  CHECK(views.mean.correct->share > 0.999);
  CHECK(views.mean.correct->of_hit > 0.999);
  CHECK(views.mean.correct->error_median < 0.02);

  const CloudMeasures measures = bench.measure(cloud);
  CHECK(measures.points == cloud.size());
  CHECK(measures.error_median_m < 0.001);
  CHECK(at(measures.relative, 0.02).accuracy > 0.998);  // range maps of 120 rows leave the room's corners vague
  CHECK(at(measures.relative, 0.02).completeness > 0.999);
  CHECK(at(measures.relative, 0.02).f_visible() > 0.998);
  CHECK(at(measures.relative, 0.01).f() > 0.99);
  CHECK(at(measures.absolute, 0.05).f() > 0.999);
}

TEST_CASE("a cloud 3 % too far away is right at 5 % and wrong below") {
  Bench bench(Flight(pmsp_test::sphere(4.0), 5, 0.15));
  const auto cloud = in_map(bench.flight, pmsp_test::sphere_points(4.0 * 1.03, 0.02));
  const CloudMeasures measures = bench.measure(cloud);
  for (const double threshold : {0.01, 0.02}) {
    CHECK(at(measures.relative, threshold).accuracy == 0.0);
    CHECK(at(measures.relative, threshold).completeness == 0.0);
    CHECK(at(measures.relative, threshold).f() == 0.0);
  }
  CHECK(at(measures.relative, 0.05).accuracy == 1.0);
  CHECK(at(measures.relative, 0.05).completeness == 1.0);
  CHECK(at(measures.relative, 0.05).f_visible() == 1.0);
  CHECK(measures.error_median_m == Approx(0.12).margin(0.002));
  CHECK(at(measures.absolute, 0.10).f() == 0.0);

  CHECK(bench.views(cloud).mean.correct->share == Approx(bench.views(cloud).mean.hit));
  CHECK(bench.views(cloud).mean.correct->error_median == Approx(0.03).margin(0.001));
  bench.view_options.max_relative_error = 0.02;
  CHECK(bench.views(cloud).mean.correct->share == 0.0);
}

TEST_CASE("half a cloud is half complete and fully accurate") {
  const Bench bench(Flight(pmsp_test::sphere(4.0), 5, 0.15));
  auto points = pmsp_test::sphere_points(4.0, 0.02);
  const auto whole = bench.measure(in_map(bench.flight, points));
  const auto keep = std::remove_if(points.begin(), points.end(), [](const auto& p) { return p.x() < 0.0; });
  points.erase(keep, points.end());
  const auto half = bench.measure(in_map(bench.flight, points));
  // Points just inside the cut also cover a rim of the missing half: 1 % of a radius, half a percent of the sphere.
  const double expected = 0.505;
  CHECK(at(whole.relative, 0.01).completeness == 1.0);
  CHECK(at(half.relative, 0.01).completeness == Approx(expected).margin(0.01));
  CHECK(at(half.relative, 0.01).completeness_visible == Approx(expected).margin(0.01));
  CHECK(at(half.relative, 0.01).accuracy == 1.0);
  CHECK(at(half.relative, 0.01).f() == Approx(2.0 * expected / (1.0 + expected)).margin(0.01));
  const View view = bench.views(in_map(bench.flight, points)).mean;
  CHECK(view.hit == Approx(0.5).margin(0.02));
  CHECK(view.correct->of_hit == 1.0);
}

TEST_CASE("duplicate points change nothing") {
  const Bench bench(Flight(pmsp_test::sphere(4.0), 5, 0.15));
  auto points = in_map(bench.flight, pmsp_test::sphere_points(4.02, 0.05));
  const auto once = bench.measure(points);
  const auto once_views = bench.views(points);
  points.insert(points.end(), points.begin(), points.end());
  const auto twice = bench.measure(points);
  const auto twice_views = bench.views(points);
  CHECK(twice.points == 2 * once.points);
  for (std::size_t i = 0; i < once.relative.size(); ++i) {
    CHECK(twice.relative[i].completeness == once.relative[i].completeness);
    CHECK(twice.relative[i].completeness_visible == once.relative[i].completeness_visible);
    CHECK(twice.relative[i].accuracy == once.relative[i].accuracy);
  }
  CHECK(twice_views.mean.hit == once_views.mean.hit);
  CHECK(twice_views.mean.correct->share == once_views.mean.correct->share);
}

TEST_CASE("a hole at the pole counts by its solid angle") {
  // One camera in the middle of the sphere, upright: rows above 60 degrees of latitude are a sixth of all rows and
  // (1 - sin 60) / 2 of the sphere.
  auto points = pmsp_test::sphere_points(4.0, 0.01);
  points.erase(std::remove_if(points.begin(), points.end(),
                              [](const auto& p) { return p.y() < -4.0 * std::sin(60.0 / 180.0 * pmsp::kernels::kPi); }),
               points.end());
  std::vector<Eigen::Vector3f> cloud;
  for (const auto& p : points) cloud.push_back(p.cast<float>());
  const pmsp::Image<float> range = render_range(cloud, pmsp::RigidTransform(), 60);
  int empty_rows = 0;
  for (int y = 0; y < 60; ++y) {
    bool empty = true;
    for (int x = 0; x < 120; ++x) empty = empty && range(x, y) == 0.0F;
    if (empty) ++empty_rows;
  }
  CHECK(empty_rows == 10);
  CHECK(range(0, 0) == 0.0F);
  CHECK(range(0, 10) == Approx(4.0F));
}

TEST_CASE("the nearest point of a pixel hides those behind it") {
  const std::vector<Eigen::Vector3f> cloud = {{0, 0, 5}, {0, 0, 2}, {0, 0, 3}, {-0.001F, 0, -7}};
  const pmsp::Image<float> range = render_range(cloud, pmsp::RigidTransform(), 10);
  CHECK(range(10, 5) == 2.0F);
  CHECK(range(0, 5) == 7.0F);
  int hits = 0;
  for (const float r : range.pixels()) hits += r > 0.0F ? 1 : 0;
  CHECK(hits == 2);
}

TEST_CASE("outliers lower accuracy only") {
  const Bench bench(Flight(pmsp_test::sphere(4.0), 5, 0.15));
  auto points = pmsp_test::sphere_points(4.0, 0.02);
  const std::size_t good = points.size();
  for (std::size_t i = 0; i < good; i += 4) points.push_back(1.5 * points[i]);
  const CloudMeasures measures = bench.measure(in_map(bench.flight, points));
  const double expected = static_cast<double>(good) / static_cast<double>(points.size());
  CHECK(at(measures.relative, 0.05).accuracy == Approx(expected));
  CHECK(at(measures.relative, 0.05).completeness == 1.0);
}

TEST_CASE("true surface samples lie on the surface and are weighted by the observed area") {
  const Bench bench(Flight(pmsp_test::sphere(4.0), 3, 0.15));
  REQUIRE(bench.surface.positions.size() > 5000);
  REQUIRE(bench.surface.normals.size() == bench.surface.positions.size());
  const Eigen::Vector3f origin = bench.truth->origin().cast<float>();
  double weight = 0.0;
  for (std::size_t i = 0; i < bench.surface.positions.size(); ++i) {
    const Eigen::Vector3f p = bench.surface.positions[i] + origin;
    CHECK(p.norm() == Approx(4.0F).margin(0.001));
    CHECK(std::abs(bench.surface.normals[i].dot(p.normalized())) > 0.99F);
    weight += bench.surface.weights[i];
  }
  // Every second of 240 columns and every second of 120 rows, in three maps.
  double expected = 0.0;
  for (int y = 0; y < 120; y += 2) expected += 3 * 120 * std::sin((y + 0.5) / 120 * pmsp::kernels::kPi);
  CHECK(weight == Approx(expected).epsilon(1e-4));
}

TEST_CASE("figures do not depend on the number of threads") {
  Bench bench(Flight(pmsp_test::box({2.0, 1.5, 3.0}), 5, 1.0));
  const auto points = bench.flight.points(60, 1.01);
  bench.measure_options.max_points = 10000;
  bench.measure_options.max_truth = 10000;
  const auto many = bench.measure(points);
  bench.measure_options.threads = 1;
  bench.view_options.threads = 1;
  const auto one = bench.measure(points);
  CHECK(one.error_median_m == many.error_median_m);
  CHECK(one.relative[0].accuracy == many.relative[0].accuracy);
  CHECK(one.relative[0].completeness_visible == many.relative[0].completeness_visible);
}

TEST_CASE("clouds without a usable point are refused") {
  const Bench bench(Flight(pmsp_test::sphere(4.0), 3, 0.15));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(bench.aligned({}), pmsp::InvalidInput);
  CHECK_THROWS_AS(bench.aligned({{nan, 0, 0}}), pmsp::InvalidInput);
  const AlignedCloud cloud = bench.aligned({{nan, 0, 0}, {1, 2, 3}});
  CHECK(cloud.dropped == 1);
  CHECK(cloud.points.size() == 1);
}

TEST_CASE("surface out of range of all keyframes is ignored and must not be all of it") {
  Bench bench(Flight(pmsp_test::sphere(4.0), 3, 0.15));
  bench.measure_options.max_range_m = 3.0;
  CHECK_THROWS_WITH(bench.measure(bench.flight.points(20)), Catch::Contains("--max-range"));
}

TEST_CASE("points at absurd distances are wrong, not fatal") {
  const Bench bench(Flight(pmsp_test::sphere(4.0), 3, 0.15));
  auto points = bench.flight.points(20);
  const std::size_t good = points.size();
  points.push_back({1e30, 0, 0});
  points.push_back({0, 1e300, 0});  // no float32
  const AlignedCloud cloud = bench.aligned(points);
  CHECK(cloud.dropped == 1);
  const CloudMeasures measures = measure_cloud(cloud, bench.surface, bench.measure_options);
  CHECK(at(measures.relative, 0.05).accuracy == Approx(static_cast<double>(good) / static_cast<double>(good + 1)));
  CHECK(bench.views(points).mean.correct->of_hit > 0.99);
}

TEST_CASE("a point in a wall's plane, but far beside the wall, is wrong") {
  Surface wall;  // two metres ahead, one metre wide and high
  for (int j = -10; j <= 10; ++j) {
    for (int i = -10; i <= 10; ++i) {
      wall.positions.push_back({0.05F * static_cast<float>(i), 0.05F * static_cast<float>(j), 2.0F});
      wall.normals.push_back({0.0F, 0.0F, -1.0F});
      wall.weights.push_back(1.0F);
      wall.spacings.push_back(0.05F);
    }
  }
  AlignedCloud cloud;
  cloud.keyframes.resize(1);
  cloud.points = {{0.02F, 0.02F, 2.0F}, {0.55F, 0.0F, 2.0F}, {1.5F, 0.0F, 2.0F}, {0.0F, -2.5F, 2.0F}};
  CHECK(at(measure_cloud(cloud, wall).relative, 0.05).accuracy == 0.5);
  CHECK(at(measure_cloud(cloud, wall).absolute, 0.1).accuracy == 0.5);
}

TEST_CASE("a scan is a truth for accuracy and completeness, not for visibility") {
  const TempDir folder;
  const Flight flight(pmsp_test::sphere(2.0), 5, 0.5);
  write_tum(folder / "traj_tum.txt", flight.truth());
  const auto write_scan = [&](const std::string& name, const std::vector<Eigen::Vector3d>& points) {
    std::ofstream file(folder / name);
    file << "ply\nformat ascii 1.0\nelement vertex " << points.size()
         << "\nproperty double x\nproperty double y\nproperty double z\nend_header\n";
    for (const auto& p : points) file << p.x() << ' ' << p.y() << ' ' << p.z() << '\n';
  };
  auto scan = pmsp_test::sphere_points(2.0, 0.02);
  scan.emplace_back(90.0, 0.0, 0.0);  // farther than anything is measured
  write_scan("cloud.ply", scan);
  const GroundTruth truth(folder.path(), {});
  CHECK(truth.range_maps().empty());
  CHECK(truth.cloud() == folder / "cloud.ply");
  const Surface surface = build_surface(truth, Bench::surface_options());
  REQUIRE(surface.positions.size() > 10000);
  CHECK(surface.weights.empty());
  for (std::size_t i = 0; i < surface.positions.size(); i += 97) {
    const Eigen::Vector3f radial = (surface.positions[i] + truth.origin().cast<float>()).normalized();
    CHECK(std::abs(surface.normals[i].dot(radial)) > 0.995F);
    CHECK(surface.spacings[i] > 0.01F);
    CHECK(surface.spacings[i] < 0.05F);
  }

  // A cloud of one half, 3 cm too far out.
  std::vector<Eigen::Vector3d> points;
  for (const Eigen::Vector3d& p : pmsp_test::sphere_points(2.03, 0.02)) {
    if (p.z() > 0.0) points.push_back(p);
  }
  CloudMeasureOptions options;
  options.absolute_m = {0.02, 0.05};
  options.max_points = options.max_truth = 0;
  const CloudMeasures m = measure_cloud(align_cloud(points, flight.truth(), {}, truth.origin()), surface, options);
  CHECK(m.error_median_m == Approx(0.03).margin(0.002));
  CHECK(at(m.absolute, 0.02).accuracy == 0.0);
  CHECK(at(m.absolute, 0.05).accuracy == 1.0);
  CHECK(at(m.absolute, 0.05).completeness == Approx(0.5).margin(0.02));
  CHECK(std::isnan(at(m.absolute, 0.05).completeness_visible));
  CHECK(std::isnan(at(m.absolute, 0.05).f_visible()));

  write_scan("cloud.ply", {{90.0, 0.0, 0.0}});
  CHECK_THROWS_WITH(build_surface(truth), Catch::Contains("cloud.ply") && Catch::Contains("frame and unit"));
  pmsp_test::write_text(folder / "cloud.ply", "ply\nbroken");
  CHECK_THROWS_AS(build_surface(truth), pmsp::InvalidInput);
}
