// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "cpu/lanes.h"
#include "elementary.h"
#include "kernels/kernel_helpers.h"
#include "match.h"
#include "sphere/panorama_data.h"
#include "support/fused_float.h"

// Kernels over batches against the same kernels over floats, function by function. The batch is the widest that this
// file is compiled for; like the float beside it, it fuses multiply-adds where the compiler aims at a machine that
// does. (The instruction sets that are chosen at run time: tests/core/test_instruction_sets.cpp.)
using namespace pmsp;
using pmsp::kernels::select;
using pmsp::kernels::Vec3;
using pmsp::test::cast;
using pmsp::test::Draws;
using Fused = pmsp::test::fused::Float;
namespace k = pmsp::kernels;

namespace {

using Batch = xsimd::batch<float, xsimd::default_arch>;

template <class F>
Vec3<F> at(const std::vector<Vec3<float>>& values, std::size_t first) {
  using cpu::load;
  float lanes[3][cpu::lanes<F>()];
  for (std::size_t i = 0; i < static_cast<std::size_t>(cpu::lanes<F>()); ++i) {
    lanes[0][i] = values[first + i].x;
    lanes[1][i] = values[first + i].y;
    lanes[2][i] = values[first + i].z;
  }
  Vec3<F> result;
  load(result.x, lanes[0]);
  load(result.y, lanes[1]);
  load(result.z, lanes[2]);
  return result;
}

/// `function` (of a Vec3<F> and its number) of all values; the result's coordinates one after another.
template <class F, class Function>
std::vector<float> of_all(const std::vector<Vec3<float>>& values, const Function& function) {
  constexpr std::size_t kStep = static_cast<std::size_t>(cpu::lanes<F>());
  std::vector<float> results(3 * values.size());
  for (std::size_t i = 0; i < values.size(); i += kStep) {
    const k::UIntOf<F> number = k::as_uint<F>(cpu::columns_from<F>(static_cast<int>(i), static_cast<int>(i + kStep)));
    const Vec3<F> result = function(at<F>(values, i), number);
    float lanes[3][kStep];
    k::store<F>(result.x, lanes[0], static_cast<int>(kStep));
    k::store<F>(result.y, lanes[1], static_cast<int>(kStep));
    k::store<F>(result.z, lanes[2], static_cast<int>(kStep));
    for (std::size_t lane = 0; lane < kStep; ++lane) {
      for (std::size_t c = 0; c < 3; ++c) results[3 * (i + lane) + c] = lanes[c][lane];
    }
  }
  return results;
}

/// How many floats lie between two.
std::int64_t steps_between(float a, float b) {
  const auto ordered = [](float value) {
    std::int32_t bits = 0;
    std::memcpy(&bits, &value, sizeof(bits));
    return static_cast<std::int64_t>(bits < 0 ? std::numeric_limits<std::int32_t>::min() - bits : bits);
  };
  return std::abs(ordered(a) - ordered(b));
}

template <class Function>
void check_bits(const std::vector<Vec3<float>>& values, const Function& function) {
  const std::vector<float> expected = of_all<float>(values, function);
  const std::vector<float> lanes = of_all<Batch>(values, function);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    if (std::memcmp(&lanes[i], &expected[i], sizeof(float)) == 0) continue;
    INFO("coordinate " << i % 3 << " of value " << i / 3);
    REQUIRE(lanes[i] == expected[i]);
    FAIL("signs of zero differ");
  }
}

/// The largest number of floats between what fused and plain multiply-adds give.
template <class Function>
std::int64_t worst_steps(const std::vector<Vec3<float>>& values, const Function& function) {
  const std::vector<float> plain = of_all<float>(values, function);
  const std::vector<float> fused = of_all<Fused>(values, function);
  std::int64_t worst = 0;
  for (std::size_t i = 0; i < plain.size(); ++i) worst = std::max(worst, steps_between(plain[i], fused[i]));
  return worst;
}

constexpr std::size_t kValues = 48000;  // a multiple of all numbers of lanes

std::vector<Vec3<float>> directions(std::uint64_t seed) {
  Draws draws(seed);
  std::vector<Vec3<float>> values(kValues);
  for (Vec3<float>& value : values) value = cast<float>(draws.direction());
  return values;
}

/// x in the range of exp, y and z of any sign and of many magnitudes.
std::vector<Vec3<float>> arguments() {
  Draws draws(21);
  const auto number = [&] { return static_cast<float>(draws.gaussian() * std::pow(10.0, draws.uniform(-6.0, 6.0))); };
  std::vector<Vec3<float>> values(kValues);
  for (Vec3<float>& value : values) value = {static_cast<float>(draws.uniform(-80.0, 80.0)), number(), number()};
  const float special[] = {0.0F, -0.0F, 1.0F, -1.0F};
  for (std::size_t i = 0; i < 16; ++i) values[i] = {special[i / 4], special[i % 4], special[i / 4]};
  return values;
}

struct Elementary {
  template <class F>
  Vec3<F> operator()(const Vec3<F>& p, const k::UIntOf<F>& /*number*/) const {
    const F falling = select(p.x < F(0), p.x, F(0) - p.x);
    return {k::exp(p.x), k::atan_unit(k::exp(falling)), k::atan2(p.y, p.z)};
  }
};

struct Projected {
  template <class F>
  Vec3<F> operator()(const Vec3<F>& p, const k::UIntOf<F>& /*number*/) const {
    const k::Pixel<F> at = k::project(p, F(640), F(320));
    return {at.x, at.y, k::from_int<F>(k::pixel_index(p, 640, 320))};
  }
};

struct RandomPlane {
  template <class F>
  Vec3<F> operator()(const Vec3<F>& bearing, const k::UIntOf<F>& number) const {
    return k::random_plane<F>(k::random_key(1, 2, 3), number, 0, bearing, {0.05F, 2.0F, 0.03F}, 3.7F);
  }
};

struct Perturbed {
  template <class F>
  Vec3<F> operator()(const Vec3<F>& bearing, const k::UIntOf<F>& number) const {
    const Vec3<F> plane = RandomPlane()(bearing, number);
    return k::perturbed(plane, k::random_key(1, 2, 3), number, 4, bearing, F(0.06F), F(0.9F));
  }
};

CubeMap noise() {
  ThreadPool pool(1);
  Draws draws(22);
  Image<float> gray(160, 80);
  for (float& value : gray.pixels()) value = static_cast<float>(draws.uniform(0.0, 255.0));
  return make_cube_map(gray, cube_size_for(gray.width()), pool);
}

/// A patch's variance, one of its weights, and a plane's score in another view with a depth map of its own.
struct Scored {
  template <class F>
  Vec3<F> operator()(const Vec3<F>& bearing, const k::UIntOf<F>& number) const {
    const F spacing(params.spacing);
    const Vec3<F> aside = k::normalized(k::cross(bearing, Vec3<F>{F(0.6F), F(0), F(0.8F)}));
    const k::PatchFrame<F> frame{bearing, spacing * aside, spacing * k::cross(bearing, aside)};
    k::ReferencePatch<F> patch;
    k::load_patch(patch, image, frame, params, bearing.x > F(0));
    const Vec3<F> plane = RandomPlane()(bearing, number);
    const k::SourceView<k::CubeView> views[] = {view, view, view};
    k::ViewWeights<F> weights;
    k::set_equal_weights(weights);
    const F own = k::plane_score(patch, frame, views, 3, F(1.1F) * plane, params, weights, true);
    return {patch.variance + own, patch.weight(7) + weights.of[1],
            k::plane_score(patch, frame, views, 3, plane, params, weights, false)};
  }

  k::CubeView image;
  k::SourceView<k::CubeView> view;
  k::PatchParams params;
};

}  // namespace

TEST_CASE("batches give the bits of floats: exp, atan_unit, atan2", "[simd]") { check_bits(arguments(), Elementary()); }

TEST_CASE("batches give the bits of floats: projection, pixels", "[simd]") { check_bits(directions(23), Projected()); }

TEST_CASE("batches give the bits of floats: random planes and steps", "[simd]") {
  check_bits(directions(24), RandomPlane());
  check_bits(directions(25), Perturbed());
}

TEST_CASE("batches give the bits of floats: patches and their scores", "[simd]") {
  const CubeMap image = noise();
  Scored scored{image.view(), {}, test::patch_params(160)};
  scored.params.min_sigma_color = 10.0F;
  scored.params.disagreement_cost = 0.3F;
  scored.params.disagreement_tolerance = 0.02F;
  const std::vector<float> x(160 * 80, 0.1F);
  const std::vector<float> y(160 * 80, -0.3F);
  const std::vector<float> z(160 * 80, 0.5F);
  scored.view = {
      image.view(), CubeMap().view(), to_rigid(Draws(27).transform(0.5, 0.3)), {x.data(), y.data(), z.data(), 160, 80}};
  check_bits(directions(28), scored);
}

TEST_CASE("min and max of equal numbers and of NaN: batches as floats", "[simd]") {
  const float nan = std::nanf("");
  const std::vector<float> numbers = {0.0F, -0.0F, 1.0F, nan};
  for (const float a : numbers) {
    for (const float b : numbers) {
      INFO(a << ", " << b);
      const auto equal = [](float expected, const Batch& lanes) {
        const float lane = lanes.get(0);
        return std::memcmp(&lane, &expected, sizeof(float)) == 0;
      };
      CHECK(equal(k::min(a, b), min(Batch(a), Batch(b))));
      CHECK(equal(k::max(a, b), max(Batch(a), Batch(b))));
    }
  }
}

TEST_CASE("fused and plain multiply-adds: exp, atan_unit and atan2 within two units in the last place", "[simd]") {
  CHECK(worst_steps(arguments(), Elementary()) <= 2);
}

TEST_CASE("fused and plain multiply-adds: projections within a thousandth of a pixel", "[simd]") {
  const std::vector<float> plain = of_all<float>(directions(29), Projected());
  const std::vector<float> fused = of_all<Fused>(directions(29), Projected());
  float worst = 0.0F;
  for (std::size_t i = 0; i < plain.size(); ++i) {
    if (i % 3 < 2) worst = std::max(worst, std::fabs(plain[i] - fused[i]));  // of the third, the pixel, little is sure
  }
  CHECK(worst < 1e-3F);
}
