// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>

#include <Eigen/Geometry>

#include "elementary.h"
#include "eval/eval_flight.h"
#include "export/fit_similarity.h"
#include "pmsp-eval/alignment.h"
#include "pmsp/error.h"

using namespace pmsp::eval;
using pmsp::Similarity;
using pmsp::umeyama;
using pmsp_test::Flight;

namespace {

Flight flight() { return Flight(pmsp_test::sphere(4.0), 9, 1.0); }

void check_same(const Similarity& actual, const Similarity& expected, double tolerance) {
  CHECK(actual.scale == Approx(expected.scale).epsilon(tolerance));
  CHECK((actual.rotation - expected.rotation).norm() < tolerance);
  CHECK((actual.translation - expected.translation).norm() < tolerance);
}

std::string message_of(const std::vector<TimedPose>& keyframes, const std::vector<TimedPose>& truth,
                       const AlignmentOptions& options = {}) {
  try {
    align(keyframes, truth, options);
  } catch (const pmsp::InvalidInput& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("alignment recovers the similarity between map and truth") {
  const Flight f = flight();
  const Alignment a = align(f.keyframes(), f.truth());
  check_same(a.truth_from_map, f.truth_from_map(), 1e-9);
  CHECK(a.method == "positions");
  CHECK(a.matched == 9);
  CHECK(a.position_rmse_m < 1e-9);
  CHECK(a.position_max_m < 1e-9);
  CHECK(a.rotation_max_deg < 1e-4);
  CHECK(a.truth_row == std::vector<int>{0, 1, 2, 3, 4, 5, 6, 7, 8});
}

TEST_CASE("umeyama never mirrors") {
  // The best orthogonal fit of a mirrored set has determinant -1; a rotation is required.
  const std::vector<Eigen::Vector3d> source = {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, 3}};
  std::vector<Eigen::Vector3d> target = source;
  for (auto& p : target) p.x() = -p.x();
  CHECK(umeyama(source, target).rotation.determinant() == Approx(1.0));
}

TEST_CASE("a straight path is aligned by its orientations") {
  Flight f = flight();
  auto keyframes = f.keyframes();
  auto truth = f.truth();
  for (std::size_t i = 0; i < truth.size(); ++i) {
    truth[i].world_from_cam.translation = Eigen::Vector3d(0.3, 0.1, 0.25 * static_cast<double>(i));
    keyframes[i].world_from_cam.translation = f.to_map(truth[i].world_from_cam.translation);
  }
  const Alignment a = align(keyframes, truth);
  CHECK(a.method == "positions and orientations");
  check_same(a.truth_from_map, f.truth_from_map(), 1e-9);
}

TEST_CASE("residuals are the position and rotation errors of the poses") {
  Flight f = flight();
  auto keyframes = f.keyframes();
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.01, Eigen::Vector3d::UnitY()).toRotationMatrix();
  for (auto& keyframe : keyframes) keyframe.world_from_cam.rotation = keyframe.world_from_cam.rotation * turn;
  const Alignment a = align(keyframes, f.truth());
  CHECK(a.rotation_median_deg == Approx(0.01 * 180.0 / pmsp::kernels::kPi).epsilon(1e-6));
  CHECK(a.position_rmse_m < 1e-9);
}

TEST_CASE("keyframes are matched by time") {
  Flight f = flight();
  auto keyframes = f.keyframes();
  AlignmentOptions options;

  SECTION("Unix times with an offset") {
    for (auto& keyframe : keyframes) keyframe.timestamp += 1763660000.25;
    CHECK(message_of(keyframes, f.truth()).find("--time-offset=-1763660000.250") != std::string::npos);
    options.time_offset = -1763660000.25;
    CHECK(align(keyframes, f.truth(), options).matched == 9);
  }
  SECTION("outside of the tolerance there is no match") {
    keyframes[4].timestamp += 0.045;
    keyframes[5].timestamp += 0.035;
    const Alignment a = align(keyframes, f.truth(), options);
    CHECK(a.matched == 8);
    CHECK(a.truth_row[4] == -1);
    CHECK(a.truth_row[5] == 5);
  }
  SECTION("a timestamp that two keyframes share matches neither") {
    keyframes[8].timestamp = keyframes[7].timestamp;
    const Alignment a = align(keyframes, f.truth(), options);
    CHECK(a.shared_timestamps == 2);
    CHECK(a.matched == 7);
    CHECK(a.truth_row[7] == -1);
    check_same(a.truth_from_map, f.truth_from_map(), 1e-9);
  }
  SECTION("two keyframes are too few") {
    keyframes.resize(2);
    CHECK(message_of(keyframes, f.truth()).find("2 of 2 keyframes") != std::string::npos);
  }
}

TEST_CASE("a map without motion cannot be aligned") {
  Flight f = flight();
  auto keyframes = f.keyframes();
  for (auto& keyframe : keyframes) keyframe.world_from_cam.translation = Eigen::Vector3d(1, 2, 3);
  CHECK(message_of(keyframes, f.truth()).find("cannot be aligned") != std::string::npos);
}

TEST_CASE("without alignment the frames are assumed equal") {
  Flight f = flight();
  AlignmentOptions options;
  options.enabled = false;
  const Alignment a = align(f.truth(), f.truth(), options);
  CHECK(a.method == "none");
  check_same(a.truth_from_map, Similarity(), 1e-12);
  CHECK(align(f.keyframes(), f.truth(), options).position_rmse_m > 0.1);
}
