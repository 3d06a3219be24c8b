// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cstdint>
#include <vector>

#include "fused_point.h"
#include "kernels/kernel_helpers.h"
#include "rigid.h"
#include "sphere/grid.h"
#include "util/eigen_kernels.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

Eigen::Vector3d direction(Draws& draws) {
  const kernels::Vec3<double> it = draws.direction();
  return {it.x, it.y, it.z};
}

/// A point of the camera's frame in the frame of the lens that sees it.
Eigen::Vector3d from_lens(const Eigen::Vector3d& point, double lens, bool forward) {
  return point - Eigen::Vector3d(0.0, 0.0, forward ? lens : -lens);
}

}  // namespace

TEST_CASE("a point is transformed between the lenses that see it in two keyframes") {
  Draws draws(31);
  int changed = 0;
  for (int i = 0; i < 200; ++i) {
    const double lens = 0.02;
    KeyframePose first{draws.transform(kernels::kPi, 1.0), 1.3};
    KeyframePose other{draws.transform(kernels::kPi, 1.0), 0.8};
    const RelativePose relation = pmsp::relative_pose(other, first, lens);
    const Eigen::Vector3d in_first = 3.0 * direction(draws);  // camera's frame, its unit
    const Eigen::Vector3d in_other = other_from_first(other, first) * in_first;
    if (std::abs(in_first.z()) < 0.1 || std::abs(in_other.z()) < 0.1) continue;  // which lens is plain
    const Eigen::Vector3d seen = from_lens(in_first, lens, in_first.z() > 0.0);
    const Eigen::Vector3d expected = from_lens(in_other, lens, in_other.z() > 0.0);
    const Eigen::Vector3f found = to_eigen(kernels::transform(relation.other_from_first, to_vec3(seen.cast<float>())));
    CHECK((found.cast<double>() - expected).norm() < 1e-5);

    // The same in multiples of the depth, as planes are scored.
    const double depth = seen.norm();
    const kernels::Vec3<float> bearing = to_vec3((seen / depth).cast<float>());
    const kernels::Vec3<float> turned = kernels::rotate(relation.other_from_first, bearing);
    const float inverse_depth = static_cast<float>(1.0 / depth);
    const Eigen::Vector3f shifted = to_eigen(kernels::fma(
        inverse_depth, kernels::translation(relation.other_from_first, bearing, turned, inverse_depth), turned));
    CHECK((shifted.cast<double>() * depth - expected).norm() < 1e-5);
    changed += (in_first.z() > 0.0) != (in_other.z() > 0.0);
  }
  CHECK(changed > 50);
}

TEST_CASE("points are relative to the camera's centre for either lens") {
  constexpr float kLens = 0.02F;
  const SphereGrid grid(16, 8);
  const kernels::Vec3<float> gray{90.0F, 90.0F, 90.0F};
  const auto packed = kernels::pack_point<float>(3.0F, {0.0F, -1.0F, 0.0F}, gray, 1.0F);
  const std::vector<std::uint32_t> surfels(16 * 8, packed.surfel);
  const std::vector<std::uint32_t> details(16 * 8, packed.detail);
  const std::vector<std::uint8_t> bytes(16 * 8, 0);
  for (int pixel = 0; pixel < 16 * 8; ++pixel) {
    const kernels::Vec3<float> ray = kernels::bearing_at<float>(grid.view(), pixel % 16, pixel / 16);
    const auto point = kernels::emitted_point({surfels.data(), details.data(), bytes.data(), bytes.data(), 1, kLens},
                                              grid.view(), pixel);
    const Eigen::Vector3f expected = 3.0F * to_eigen(ray) + Eigen::Vector3f(0.0F, 0.0F, ray.z > 0.0F ? kLens : -kLens);
    CHECK((to_eigen(point.position) - expected).norm() < 1e-3F);
  }
}

TEST_CASE("without a lens distance results are bit-identical") {
  Draws draws(32);
  for (int i = 0; i < 50; ++i) {
    const KeyframePose first{draws.transform(kernels::kPi, 1.0), 1.0};
    const KeyframePose other{draws.transform(kernels::kPi, 1.0), 1.0};
    const kernels::Rigid rigid = relative_pose(other, first).other_from_first;
    const kernels::Vec3<float> point = to_vec3((3.0 * direction(draws)).cast<float>());
    const kernels::Vec3<float> plain = kernels::rotate(rigid, point) + kernels::translation<float>(rigid);
    const kernels::Vec3<float> found = kernels::transform(rigid, point);
    CHECK((found.x == plain.x && found.y == plain.y && found.z == plain.z));
  }
}
