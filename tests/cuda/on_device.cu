// SPDX-License-Identifier: BSD-2-Clause
#include "cuda/on_device.h"

#include "agreement.h"
#include "cuda/device_code.h"
#include "median.h"
#include "plane.h"
#include "random.h"

namespace pmsp::test {
namespace {

using kernels::RandomKey;
using kernels::Vec3;

constexpr int kThreads = 64;

template <class Body>
__global__ void run_all(const __grid_constant__ Body body, int count, float* out) {
  const int i = static_cast<int>(blockIdx.x * kThreads + threadIdx.x);
  if (i < count) body(i, out + static_cast<std::size_t>(i) * Body::kValues);
}

template <class Body>
std::vector<float> on_device(const Body& body, int count) {
  const cuda::DeviceArray<float> out(static_cast<std::size_t>(count) * Body::kValues);
  run_all<<<static_cast<unsigned>((count + kThreads - 1) / kThreads), kThreads>>>(body, count, out.get());
  PMSP_CUDA_LAUNCHED();
  return downloaded(out);
}

template <class Body>
std::vector<float> on_host(const Body& body, int count) {
  std::vector<float> out(static_cast<std::size_t>(count) * Body::kValues);
  for (int i = 0; i < count; ++i) body(i, out.data() + static_cast<std::size_t>(i) * Body::kValues);
  return out;
}

/// Inputs are random as well, by another key; random_draws verifies that host and device draw the same.
PMSP_HD RandomKey input_key() { return kernels::random_key(12345, 7, 99); }

PMSP_HD float input(int i, std::uint32_t draw) {
  return kernels::uniform<float>(input_key(), static_cast<std::uint32_t>(i), draw);
}

PMSP_HD Vec3<float> direction(int i) {
  const Vec3<float> v{2.0F * input(i, 0) - 1.0F, 2.0F * input(i, 1) - 1.0F, 2.0F * input(i, 2) - 1.0F};
  return kernels::normalized(v + Vec3<float>{1e-3F, 0.0F, 0.0F});
}

PMSP_HD void put(float* out, const Vec3<float>& v) {
  out[0] = v.x;
  out[1] = v.y;
  out[2] = v.z;
}

const kernels::Rigid kMoved{{0.96F, 0.0F, 0.28F, 0.0F, 1.0F, 0.0F, -0.28F, 0.0F, 0.96F}, {0.2F, -0.1F, 0.15F}};

struct RandomDraws {
  static constexpr int kValues = 2;
  PMSP_HD void operator()(int i, float* out) const {
    const RandomKey key = kernels::random_key(0x123456789abcdef0ULL, 41, 3);
    const std::uint32_t pixel = static_cast<std::uint32_t>(i);
    out[0] = kernels::uniform<float>(key, pixel, pixel % 57U);
    out[1] = kernels::uniform_signed<float>(key, pixel, 4000000000U);
  }
};

struct Planes {
  static constexpr int kValues = 10;
  kernels::Rigid moved;
  kernels::PlaneLimits limits;
  PMSP_HD void operator()(int i, float* out) const {
    const Vec3<float> bearing = direction(i);
    const std::uint32_t pixel = static_cast<std::uint32_t>(i);
    const Vec3<float> plane = kernels::random_plane<float>(input_key(), pixel, 8, bearing, limits, 4.0F);
    put(out, plane);
    put(out + 3, kernels::perturbed(plane, input_key(), pixel, 12, bearing, 0.06F, 0.5F));
    put(out + 6, kernels::moved_plane(plane, moved));
    out[9] = kernels::is_allowed(plane, bearing, limits) ? 1.0F : 0.0F;
  }
};

struct Medians {
  static constexpr int kValues = 2;
  PMSP_HD void operator()(int i, float* out) const {
    float around[9];
    float copy[9];
    for (int k = 0; k < 9; ++k) {
      const float value = input(i, static_cast<std::uint32_t>(k));
      around[k] = value < 0.2F ? 0.0F : 1.0F + 0.1F * value;
      copy[k] = around[k];
    }
    out[0] = kernels::median9(copy);
    out[1] = kernels::median_filtered(around, input(i, 9), 0.02F, 0.1F);
  }
};

struct Agreements {
  static constexpr int kValues = 3;
  kernels::PlaneMapView map;
  kernels::Rigid moved;
  PMSP_HD void operator()(int i, float* out) const {
    const auto seen = kernels::agreement(direction(i), 0.5F + 4.0F * input(i, 3), map, moved);
    out[0] = seen.depth_ratio;
    out[1] = seen.implied_depth;
    out[2] = static_cast<float>(seen.index);
  }
};

struct CubeSamples {
  static constexpr int kValues = 1;
  kernels::CubeView cube;
  PMSP_HD void operator()(int i, float* out) const { out[0] = kernels::sample(cube, direction(i)); }
};

struct TextureSamples {
  static constexpr int kValues = 1;
  cuda::TextureCube cube;
  const float* directions;
  PMSP_HD void operator()(int i, float* out) const {
    const float* d = directions + 3 * static_cast<std::size_t>(i);
    out[0] = cuda::sample(cube, Vec3<float>{d[0], d[1], d[2]});
  }
};

template <class Cube>
struct PatchScores {
  static constexpr int kValues = 2;
  kernels::MatchArgs<Cube> match_args;
  int width, height;
  float depth;
  PMSP_HD void operator()(int i, float* out) const {
    constexpr float kTurn = static_cast<float>(2.0 * kernels::kPi);
    const float lon = ((static_cast<float>(i % width) + 0.5F) / static_cast<float>(width) - 0.5F) * kTurn;
    const float lat = (0.5F - (static_cast<float>(i / width) + 0.5F) / static_cast<float>(height)) * 0.5F * kTurn;
    kernels::PixelContext<float> context;
    kernels::load_context(context, match_args, ::sinf(lon), ::cosf(lon), ::sinf(lat), ::cosf(lat));
    out[0] = context.patch.variance;
    kernels::set_equal_weights(context.weights);
    out[1] = kernels::plane_score(context.patch, context.frame, match_args.views, match_args.num_views,
                                  (1.0F / depth) * context.frame.bearing, match_args.params, context.weights, false);
  }
};

template <class Cube>
PatchScores<Cube> body_of(const Scoring<Cube>& scoring) {
  return {scoring.match_args, scoring.width, scoring.height, scoring.depth};
}

template <class Body>
Both both(const Body& body, int count) {
  return {Body::kValues, on_host(body, count), on_device(body, count)};
}

}  // namespace

Both random_draws(int count) { return both(RandomDraws{}, count); }

Both planes(int count) { return both(Planes{kMoved, {0.1F, 5.0F, 0.03F}}, count); }

Both medians(int count) { return both(Medians{}, count); }

Both agreements(int count) {
  constexpr int kWidth = 64;
  constexpr int kHeight = 32;
  std::vector<float> planes[3];
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const Vec3<float> normal = direction(i % 7 == 0 ? i : i - i % 7);
    const float inverse_depth = i % 11 == 0 ? 0.0F : 0.3F + 0.2F * input(i, 5);
    planes[0].push_back(inverse_depth * normal.x);
    planes[1].push_back(inverse_depth * normal.y);
    planes[2].push_back(inverse_depth * normal.z);
  }
  const cuda::DeviceArray<float> x = uploaded(planes[0]);
  const cuda::DeviceArray<float> y = uploaded(planes[1]);
  const cuda::DeviceArray<float> z = uploaded(planes[2]);
  const Agreements host{{planes[0].data(), planes[1].data(), planes[2].data(), kWidth, kHeight, nullptr}, kMoved};
  const Agreements device{{x.get(), y.get(), z.get(), kWidth, kHeight, nullptr}, kMoved};
  return {Agreements::kValues, on_host(host, count), on_device(device, count)};
}

Both cube_samples(const kernels::CubeView& cube, std::size_t elements, int count) {
  const auto quads = uploaded(std::vector<std::uint64_t>(cube.quads, cube.quads + elements));
  kernels::CubeView device = cube;
  device.quads = quads.get();
  return {CubeSamples::kValues, on_host(CubeSamples{cube}, count), on_device(CubeSamples{device}, count)};
}

Both patch_scores(const Scoring<kernels::CubeView>& scoring) {
  std::vector<cuda::DeviceArray<std::uint64_t>> images;
  const auto on_device_too = [&](kernels::CubeView& cube) {
    if (kernels::is_empty(cube)) return;
    images.push_back(uploaded(std::vector<std::uint64_t>(cube.quads, cube.quads + scoring.elements)));
    cube.quads = images.back().get();
  };
  Scoring<kernels::CubeView> device = scoring;
  on_device_too(device.match_args.reference);
  for (int i = 0; i < device.match_args.num_views; ++i) {
    on_device_too(device.match_args.views[i].image);
    on_device_too(device.match_args.views[i].matchable);
  }
  const int count = scoring.width * scoring.height;
  return {PatchScores<kernels::CubeView>::kValues, on_host(body_of(scoring), count), on_device(body_of(device), count)};
}

std::vector<float> patch_scores(const Scoring<cuda::TextureCube>& scoring) {
  return on_device(body_of(scoring), scoring.width * scoring.height);
}

std::vector<float> texture_samples(const cuda::TextureCube& cube, const std::vector<float>& directions) {
  const auto points = uploaded(directions);
  return on_device(TextureSamples{cube, points.get()}, static_cast<int>(directions.size() / 3));
}

}  // namespace pmsp::test
