// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "gpu_sampling_images.cuh"
#include "plane.h"

// The patch look-up of kernels/patch.h with the image look-up, and the place of the reference patch, as parameters.
namespace sampling {

using namespace pmsp::kernels;

constexpr int kSide = 6;
constexpr int kSamples = kSide * kSide;
constexpr int kViews = 2;

/// 1 / x to 1 unit in the last place: one instruction.
__device__ __forceinline__ float reciprocal(float x) {
  float r;
  asm("rcp.approx.ftz.f32 %0, %1;" : "=f"(r) : "f"(x));
  return r;
}

struct Homography {
  Vec3<float> center, right, down;
};

__device__ __forceinline__ int face_of(const Vec3<float>& p) {
  const float ax = ::fabsf(p.x);
  const float ay = ::fabsf(p.y);
  const float az = ::fabsf(p.z);
  const float lead = ::fmaxf(ax, ::fmaxf(ay, az));
  const bool along_x = ax == lead;
  const bool along_y = ay == lead;
  const float signed_lead = along_x ? p.x : along_y ? p.y : p.z;
  return (along_x ? 0 : along_y ? 2 : 4) + (signed_lead < 0.0F ? 1 : 0);
}
/// Face coordinates of a direction: the two other coordinates, then the magnitude of the leading one.
__device__ __forceinline__ Vec3<float> on_face(const Vec3<float>& p, int face) {
  const float lead = face < 2 ? p.x : face < 4 ? p.y : p.z;
  return {face < 2 ? p.y : p.x, face < 4 ? p.z : p.y, (face & 1) != 0 ? -lead : lead};
}

// Look-ups. at(): a direction of any length. Those with kPerPatch choose the face once a patch and fold the texel
// address into the homography: then at_face() has left one reciprocal and two products.

struct PerSample {
  static constexpr bool kPerPatch = false;
  static constexpr bool kFallback = false;
  static constexpr float kScale = 255.0F;
};

/// 1: 2-D texture, the library's atan2f and asinf.
struct EquirectLibrary : PerSample {
  static __device__ __forceinline__ float at(const Image& image, const Vec3<float>& p) {
    const float u = ::fmaf(::atan2f(p.x, p.z), static_cast<float>(0.5 / kPi), 0.5F);
    const float v = ::fmaf(::asinf(p.y * ::rsqrtf(dot(p, p))), static_cast<float>(1.0 / kPi), 0.5F);
    return tex2D<float>(image.equirect, u, v);
  }
};

/// 2: the polynomial of kernels/elementary.h, with approximate divisions.
struct EquirectPolynomial : PerSample {
  static __device__ __forceinline__ float angle(float y, float x) {
    const float ax = ::fabsf(x);
    const float ay = ::fabsf(y);
    float a = atan_unit(::fminf(ax, ay) * reciprocal(::fmaxf(::fmaxf(ax, ay), 1e-30F)));
    a = ay > ax ? static_cast<float>(kPi / 2) - a : a;
    a = x < 0.0F ? static_cast<float>(kPi) - a : a;
    return ::copysignf(a, y);
  }
  static __device__ __forceinline__ float at(const Image& image, const Vec3<float>& p) {
    const float horizontal = __fsqrt_rn(::fmaf(p.x, p.x, p.z * p.z));
    return tex2D<float>(image.equirect, ::fmaf(angle(p.x, p.z), static_cast<float>(0.5 / kPi), 0.5F),
                        ::fmaf(angle(p.y, horizontal), static_cast<float>(1.0 / kPi), 0.5F));
  }
};

/// 3, 4: hardware cube map.
struct Cube8 : PerSample {
  static __device__ __forceinline__ float at(const Image& image, const Vec3<float>& p) {
    return texCubemap<float>(image.cube8, p.x, p.y, p.z);
  }
};
struct Cube16 : PerSample {
  static __device__ __forceinline__ float at(const Image& image, const Vec3<float>& p) {
    return texCubemap<float>(image.cube16, p.x, p.y, p.z);
  }
};

/// 5: octahedral map around y.
struct Octahedral : PerSample {
  static __device__ __forceinline__ float at(const Image& image, const Vec3<float>& p) {
    const float scale = reciprocal(::fabsf(p.x) + ::fabsf(p.y) + ::fabsf(p.z));
    const float a = p.x * scale;
    const float b = p.z * scale;
    const float folded_a = ::copysignf(1.0F - ::fabsf(b), a);
    const float folded_b = ::copysignf(1.0F - ::fabsf(a), b);
    const float half = image.octahedral_half;
    return tex2D<float>(image.octahedral, ::fmaf(p.y < 0.0F ? folded_a : a, half, half + 1.0F),
                        ::fmaf(p.y < 0.0F ? folded_b : b, half, half + 1.0F));
  }
};

__device__ __forceinline__ std::uint32_t quad_at(const Image& image, int i, int j) {
  return __ldg(image.quads + j * image.pitch + i);
}
__device__ __forceinline__ float bilinear(std::uint32_t quad, float fu, float fv) {
  const float t00 = static_cast<float>(quad & 255U);
  const float t10 = static_cast<float>(quad >> 8 & 255U);
  const float t01 = static_cast<float>(quad >> 16 & 255U);
  const float t11 = static_cast<float>(quad >> 24);
  const float upper = ::fmaf(fu, t10 - t00, t00);
  const float lower = ::fmaf(fu, t11 - t01, t01);
  return ::fmaf(fv, lower - upper, upper);
}

/// 6: sample() of kernels/cube.h, texels at cell centres. Exact: with a correctly rounded division, as nvcc compiles
/// it.
template <bool kExactDivision>
struct Quads : PerSample {
  static constexpr float kScale = 1.0F;
  static __device__ __forceinline__ float at(const Image& image, const Vec3<float>& p) {
    const int face = face_of(p);
    const Vec3<float> q = on_face(p, face);
    const float scale = kExactDivision ? image.half_size / q.z : image.half_size * reciprocal(q.z);
    const float bias = image.half_size + static_cast<float>(kApron) - 0.5F;
    const float u = ::fmaf(q.x, scale, bias);
    const float v = ::fmaf(q.y, scale, bias);
    const int i = static_cast<int>(u);
    const int j = static_cast<int>(v);
    const std::uint32_t quad = quad_at(image, i, face * image.pitch + j);
    return bilinear(quad, u - static_cast<float>(i), v - static_cast<float>(j));
  }
};

struct PerPatch : PerSample {
  static constexpr bool kPerPatch = true;
  static constexpr float kBias = 0.0F;  ///< of a texel centre's coordinates against the texture's

  /// Directions to homogeneous texel coordinates on the strip. False where the patch leaves the face and its apron.
  template <class Look>
  static __device__ __forceinline__ bool enter(const Image& image, Homography& h, int& face) {
    face = face_of(h.center);
    const Vec3<float> c = on_face(h.center, face);
    const Vec3<float> r = on_face(h.right, face);
    const Vec3<float> d = on_face(h.down, face);
    const float limit = (image.half_size + static_cast<float>(kApron - 1)) / image.half_size;
    bool inside = true;
#pragma unroll
    for (int k = 0; k < 4; ++k) {
      const Vec3<float> corner = fma((k & 1) != 0 ? 2.5F : -2.5F, r, fma((k & 2) != 0 ? 2.5F : -2.5F, d, c));
      inside = inside && ::fmaxf(::fabsf(corner.x), ::fabsf(corner.y)) <= limit * corner.z;
    }
    const float u = image.half_size + static_cast<float>(kApron) - Look::kBias;
    const float v = Look::kLayered ? u : ::fmaf(static_cast<float>(face), image.tile, u);
    const auto fold = [&](const Vec3<float>& p) -> Vec3<float> {
      return {::fmaf(image.half_size, p.x, u * p.z), ::fmaf(image.half_size, p.y, v * p.z), p.z};
    };
    h = {fold(c), fold(r), fold(d)};
    return inside;
  }
  static constexpr bool kLayered = false;
};

/// One direction on the strip, for reference patches and where a patch leaves its face.
struct StripSample : PerSample {
  static __device__ __forceinline__ float at(const Image& image, const Vec3<float>& p) {
    const int face = face_of(p);
    const Vec3<float> q = on_face(p, face);
    const float scale = image.half_size * reciprocal(q.z);
    const float bias = image.half_size + static_cast<float>(kApron);
    return tex2D<float>(image.strip, ::fmaf(q.x, scale, bias),
                        ::fmaf(q.y, scale, ::fmaf(static_cast<float>(face), image.tile, bias)));
  }
};

/// 7: 2-D texture of one face a patch; the other patches sample by sample (kFallback) or not at all.
template <bool kWithFallback>
struct Strip : PerPatch {
  static constexpr bool kFallback = kWithFallback;
  static __device__ __forceinline__ float at(const Image& image, const Vec3<float>& p) {
    return StripSample::at(image, p);
  }
  static __device__ __forceinline__ float at_face(const Image& image, const Vec3<float>& h, int, int) {
    const float scale = reciprocal(h.z);
    return tex2D<float>(image.strip, h.x * scale, h.y * scale);
  }
};
struct Layered : Strip<true> {
  static constexpr bool kLayered = true;
  static __device__ __forceinline__ float at_face(const Image& image, const Vec3<float>& h, int face, int) {
    const float scale = reciprocal(h.z);
    return tex2DLayered<float>(image.layered, h.x * scale, h.y * scale, face);
  }
};

/// Whole part of 0 <= x < 2^22 by the adder: `bits` holds it in its low 23 bits.
struct Whole {
  float value;
  std::int32_t bits;
};
__device__ __forceinline__ Whole whole_part(float x) {
  const float shifted = __fadd_rd(x, 8388608.0F);
  return {shifted - 8388608.0F, __float_as_int(shifted) & 0x7fffff};
}

/// The four texels from the texture unit, exact weights by arithmetic.
struct Gather : Strip<false> {
  static constexpr float kBias = 0.5F;
  static __device__ __forceinline__ float at_face(const Image& image, const Vec3<float>& h, int, int) {
    const float scale = reciprocal(h.z);
    const float u = h.x * scale;
    const float v = h.y * scale;
    const float iu = whole_part(u).value;
    const float iv = whole_part(v).value;
    const float4 t = tex2Dgather<float4>(image.strip, iu + 1.0F, iv + 1.0F, 0);  // (0,1) (1,1) (1,0) (0,0)
    const float upper = ::fmaf(u - iu, t.z - t.w, t.w);
    const float lower = ::fmaf(u - iu, t.y - t.x, t.x);
    return ::fmaf(v - iv, lower - upper, upper);
  }
};

/// Packed quads, the face once a patch.
struct PatchQuads : PerPatch {
  static constexpr float kScale = 1.0F;
  static constexpr float kBias = 0.5F;
  static __device__ __forceinline__ float at(const Image& image, const Vec3<float>& p) {
    return Quads<false>::at(image, p);
  }
  static __device__ __forceinline__ float at_face(const Image& image, const Vec3<float>& h, int, int) {
    const float scale = reciprocal(h.z);
    const Whole iu = whole_part(h.x * scale);
    const Whole iv = whole_part(h.y * scale);
    return bilinear(quad_at(image, iu.bits, iv.bits), ::fmaf(h.x, scale, -iu.value), ::fmaf(h.y, scale, -iv.value));
  }
};

/// The same with the vertical step in half precision: bytes become halves (1024 + byte) by permutation.
struct PatchQuadsHalf : PatchQuads {
  static __device__ __forceinline__ __half2 halves(std::uint32_t bits) {
    __half2 value;
    ::memcpy(&value, &bits, sizeof(value));
    return value;
  }
  static __device__ __forceinline__ float at_face(const Image& image, const Vec3<float>& h, int, int) {
    const float scale = reciprocal(h.z);
    const Whole iu = whole_part(h.x * scale);
    const Whole iv = whole_part(h.y * scale);
    const std::uint32_t quad = quad_at(image, iu.bits, iv.bits);
    const __half2 upper = halves(__byte_perm(quad, 0x64646464U, 0x4140));
    const __half2 lower = halves(__byte_perm(quad, 0x64646464U, 0x4342));
    const __half2 fv = __float2half2_rn(::fmaf(h.y, scale, -iv.value));
    const __half2 column = __hfma2(fv, __hsub2(lower, upper), __hsub2(upper, __float2half2_rn(1024.0F)));
    const float2 t = __half22float2(column);
    return ::fmaf(::fmaf(h.x, scale, -iu.value), t.y - t.x, t.x);
  }
};

/// Two of three samples by the texture unit, the third from the quads: both pipes at work.
struct Hybrid : Strip<false> {
  static __device__ __forceinline__ float at_face(const Image& image, const Vec3<float>& h, int, int column) {
    const float scale = reciprocal(h.z);
    const float u = h.x * scale;
    const float v = h.y * scale;
    if (column % 3 != 2) return tex2D<float>(image.strip, u, v);
    const Whole iu = whole_part(u - 0.5F);
    const Whole iv = whole_part(v - 0.5F);
    return bilinear(quad_at(image, iu.bits, iv.bits), u - 0.5F - iu.value, v - 0.5F - iv.value) * (1.0F / 255.0F);
  }
};

// Places of the reference patch's weight and contrast. kRows rows of six samples are unrolled.

struct Pair {
  float weight, contrast;
};
__device__ __forceinline__ std::uint32_t half_bits(const Pair& p) {
  const __half2 v = __floats2half2_rn(p.weight, p.contrast);
  std::uint32_t bits;
  ::memcpy(&bits, &v, sizeof(bits));
  return bits;
}
__device__ __forceinline__ Pair from_half_bits(std::uint32_t bits) {
  __half2 v;
  ::memcpy(&v, &bits, sizeof(bits));
  const float2 f = __half22float2(v);
  return {f.x, f.y};
}
/// Contrast as a float whose low 16 bits are the weight as bfloat16: nearest such float; unpacked by one shift.
__device__ __forceinline__ std::uint32_t brain_bits(const Pair& p) {
  const std::uint32_t low = (__float_as_uint(p.weight) + 0x8000U) >> 16;
  return ((__float_as_uint(p.contrast) - low + 0x8000U) & 0xffff0000U) | low;
}
__device__ __forceinline__ Pair from_brain_bits(std::uint32_t bits) {
  return {__uint_as_float(bits << 16), __uint_as_float(bits)};
}

struct FloatArrays {  // a
  static constexpr int kRows = 1;
  static constexpr int kSharedBytes = 0;
  float weight[kSamples], contrast[kSamples];
  __device__ explicit FloatArrays(char*) {}
  __device__ __forceinline__ void set(int k, const Pair& p) {
    weight[k] = p.weight;
    contrast[k] = p.contrast;
  }
  __device__ __forceinline__ Pair get(int k) const { return {weight[k], contrast[k]}; }
};

template <bool kBrain>
struct Registers {  // b
  static constexpr int kRows = kSide;
  static constexpr int kSharedBytes = 0;
  std::uint32_t bits[kSamples];
  __device__ explicit Registers(char*) {}
  __device__ __forceinline__ void set(int k, const Pair& p) { bits[k] = kBrain ? brain_bits(p) : half_bits(p); }
  __device__ __forceinline__ Pair get(int k) const {
    return kBrain ? from_brain_bits(bits[k]) : from_half_bits(bits[k]);
  }
};

template <bool kBrain, int kUnrolledRows>
struct Shared {  // c
  static constexpr int kRows = kUnrolledRows;
  static constexpr int kSharedBytes = kSamples * 4;
  std::uint32_t* own;
  int stride;
  __device__ explicit Shared(char* memory)
      : own(reinterpret_cast<std::uint32_t*>(memory) + threadIdx.y * blockDim.x + threadIdx.x),
        stride(static_cast<int>(blockDim.x * blockDim.y)) {}
  __device__ __forceinline__ void set(int k, const Pair& p) { own[k * stride] = kBrain ? brain_bits(p) : half_bits(p); }
  __device__ __forceinline__ Pair get(int k) const {
    return kBrain ? from_brain_bits(own[k * stride]) : from_half_bits(own[k * stride]);
  }
};

struct SharedFloats {  // d
  static constexpr int kRows = 1;
  static constexpr int kSharedBytes = kSamples * 8;
  float2* own;
  int stride;
  __device__ explicit SharedFloats(char* memory)
      : own(reinterpret_cast<float2*>(memory) + threadIdx.y * blockDim.x + threadIdx.x),
        stride(static_cast<int>(blockDim.x * blockDim.y)) {}
  __device__ __forceinline__ void set(int k, const Pair& p) { own[k * stride] = make_float2(p.weight, p.contrast); }
  __device__ __forceinline__ Pair get(int k) const {
    const float2 v = own[k * stride];
    return {v.x, v.y};
  }
};

/// All of one matching problem.
struct Problem {
  Image reference;
  Image view[kViews];
  Rigid view_from_ref[kViews];
  int width, height;
  float spacing;       ///< of samples on the tangent plane
  float color_factor;  ///< -1 / (2 sigma_color^2)
  float space_factor;  ///< -1 / (2 sigma_space^2) [samples]
  float min_variance;
  PlaneLimits limits;
  float log_depth_span;
  RandomKey random;
};

PMSP_HD float offset_of(int i) { return static_cast<float>(i) - 2.5F; }

/// Sums that make up for the rounding of stored weights and contrasts.
struct Stored {
  float inverse_weight;  ///< 1 / sum of the stored weights
  float contrast;        ///< sum of the stored contrasts
};

/// reference_patch() of kernels/patch.h. Samples twice instead of holding gray levels and weights in registers.
template <class Look, class Store>
__device__ __forceinline__ Stored take_reference(const Problem& problem, const Homography& frame, Store& store) {
  const float center = Look::at(problem.reference, frame.center) * Look::kScale;
  const auto sample_at = [&](int i, int j, float& weight) {
    const float x = offset_of(i);
    const float y = offset_of(j);
    const Vec3<float> p = fma(x, frame.right, fma(y, frame.down, frame.center));
    const float gray = Look::at(problem.reference, p) * Look::kScale - center;
    weight = __expf((x * x + y * y) * problem.space_factor + gray * gray * problem.color_factor);
    return gray;
  };
  float sum = 0;
  float sum_gray = 0;
  float sum_square = 0;
#pragma unroll 1
  for (int j = 0; j < kSide; ++j) {
#pragma unroll 2
    for (int i = 0; i < kSide; ++i) {
      float weight = 0;
      const float gray = sample_at(i, j, weight);
      sum += weight;
      sum_gray += weight * gray;
      sum_square += weight * gray * gray;
    }
  }
  const float scale = 1.0F / sum;
  const float mean = sum_gray * scale;
  const float deviation = ::rsqrtf(::fmaxf(sum_square * scale - mean * mean, 0.0F) + problem.min_variance);
  float kept_weight = 0;
  float kept_contrast = 0;
#pragma unroll Store::kRows
  for (int j = 0; j < kSide; ++j) {
#pragma unroll
    for (int i = 0; i < kSide; ++i) {
      float weight = 0;
      const float gray = sample_at(i, j, weight);
      weight *= scale;
      store.set(j * kSide + i, {weight, weight * (gray - mean) * deviation});
      const Pair kept = store.get(j * kSide + i);
      kept_weight += kept.weight;
      kept_contrast += kept.contrast;
    }
  }
  return {1.0F / kept_weight, kept_contrast};
}

struct Sums {
  float gray = 0, square = 0, product = 0;
};

template <class Store, class Sampler>
__device__ __forceinline__ Sums walk(const Store& store, const Homography& h, const Sampler& gray_at) {
  Sums sums;
  Vec3<float> left = fma(offset_of(0), h.right, fma(offset_of(0), h.down, h.center));
#pragma unroll Store::kRows
  for (int j = 0; j < kSide; ++j) {
    Vec3<float> p = left;
#pragma unroll
    for (int i = 0; i < kSide; ++i) {
      const Pair pair = store.get(j * kSide + i);
      const float gray = gray_at(p, i);
      const float weighted = pair.weight * gray;
      sums.gray += weighted;
      sums.square = ::fmaf(weighted, gray, sums.square);
      sums.product = ::fmaf(pair.contrast, gray, sums.product);
      p = p + h.right;
    }
    left = left + h.down;
  }
  return sums;
}

/// view_score() of kernels/patch.h.
template <class Look, class Store>
__device__ __forceinline__ float score_in_view(const Problem& problem, int view, const Store& store,
                                               const Stored& stored, const Homography& frame, const Homography& turned,
                                               const Vec3<float>& plane) {
  const Image& image = problem.view[view];
  const Vec3<float> t = translation<float>(problem.view_from_ref[view]);
  Homography h{fma(dot(plane, frame.center), t, turned.center), fma(dot(plane, frame.right), t, turned.right),
               fma(dot(plane, frame.down), t, turned.down)};
  Sums sums;
  if constexpr (Look::kPerPatch) {
    Homography texels = h;
    int face = 0;
    const bool inside = PerPatch::enter<Look>(image, texels, face);
    if (inside) {
      sums = walk(store, texels, [&](const Vec3<float>& p, int i) { return Look::at_face(image, p, face, i); });
    } else if constexpr (Look::kFallback) {
      sums = walk(store, h, [&](const Vec3<float>& p, int) { return Look::at(image, p); });
    } else {
      return -1.0F;
    }
  } else {
    sums = walk(store, h, [&](const Vec3<float>& p, int) { return Look::at(image, p); });
  }
  const float mean = sums.gray * stored.inverse_weight;
  const float variance = ::fmaxf(sums.square * stored.inverse_weight - mean * mean, 0.0F);
  const float product = sums.product - stored.contrast * mean;
  return Look::kScale * product * ::rsqrtf(Look::kScale * Look::kScale * variance + problem.min_variance);
}

template <class F>
struct PixelFrame {
  Vec3<F> bearing, right, down;
};
/// Bearing and tangent vectors of a pixel, as kernels/equirect.h.
template <class F>
PMSP_HD PixelFrame<F> frame_of(const Problem& problem, int x, int y) {
  const F longitude = F(kPi) * (F(2) * (F(x) + F(0.5)) / F(problem.width) - F(1));
  const F latitude = F(kPi) * (F(0.5) - (F(y) + F(0.5)) / F(problem.height));
  const F sin_lon = ::sin(longitude);
  const F cos_lon = ::cos(longitude);
  const F sin_lat = ::sin(latitude);
  const F cos_lat = ::cos(latitude);
  const F s(problem.spacing);
  return {{cos_lat * sin_lon, F(0) - sin_lat, cos_lat * cos_lon},
          {s * cos_lon, F(0), F(0) - s * sin_lon},
          {s * sin_lat * sin_lon, s * cos_lat, s * sin_lat * cos_lon}};
}

/// The surface that hypotheses scatter about: faces the camera, depth varies smoothly.
template <class F>
PMSP_HD Vec3<F> base_plane(const Vec3<F>& bearing) {
  const F inverse_depth = F(0.2F) + F(0.05F) * bearing.x - F(0.05F) * bearing.y * bearing.z;
  return inverse_depth * bearing;
}

/// Hypothesis h of a pixel: one random plane, then as many planes of the kind that neighbours hand over (close to the
/// surface) as random steps away from it.
template <class F>
PMSP_HD Vec3<F> hypothesis(const Problem& problem, std::uint32_t pixel, int h, const Vec3<F>& bearing) {
  const std::uint32_t draw = 4U * static_cast<std::uint32_t>(h);
  if (h == 0) {
    return random_plane<F>(problem.random, pixel, draw, bearing, problem.limits, problem.log_depth_span);
  }
  const Vec3<F> base = base_plane(bearing);
  if ((h & 1) != 0) return (F(1) + F(0.02F) * uniform_signed<F>(problem.random, pixel, draw)) * base;
  return perturbed<F>(base, problem.random, pixel, draw, bearing, F(0.06F), F(0.45F));
}

/// One launch: which hypotheses (those before `first` have been scored), and which pixels: all, or those of one colour
/// of the checkerboard, packed as PatchMatch's passes have them.
struct Pass {
  int first, last;
  int colour;  ///< -1: all
};

template <class Look, class Store, int kThreads, int kMinBlocks>
__global__ __launch_bounds__(kThreads, kMinBlocks) void match(const __grid_constant__ Problem problem, const Pass pass,
                                                              float4* best) {
  extern __shared__ char memory[];
  int x = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  if (pass.colour >= 0) x = 2 * x + ((y + pass.colour) & 1);
  if (x >= problem.width || y >= problem.height) return;
  const std::uint32_t pixel = static_cast<std::uint32_t>(y * problem.width + x);
  const PixelFrame<float> own = frame_of<float>(problem, x, y);
  const Homography frame{own.bearing, own.right, own.down};
  Store store(memory);
  const Stored stored = take_reference<Look>(problem, frame, store);
  float4 kept = pass.first == 0 ? make_float4(0, 0, 0, -2.0F) : best[pixel];
#pragma unroll 1
  for (int h = pass.first; h < pass.last; ++h) {
    const Vec3<float> plane = hypothesis<float>(problem, pixel, h, frame.center);
    float sum = 0;
    float better = -1;
#pragma unroll 1
    for (int view = 0; view < kViews; ++view) {
      const Rigid& turn = problem.view_from_ref[view];
      const Homography turned{rotate(turn, frame.center), rotate(turn, frame.right), rotate(turn, frame.down)};
      const float score = score_in_view<Look>(problem, view, store, stored, frame, turned, plane);
      sum += score;
      better = ::fmaxf(better, score);
    }
    const float score = 0.5F * better + 0.25F * sum;
    if (score > kept.w) kept = make_float4(plane.x, plane.y, plane.z, score);
  }
  best[pixel] = kept;
}

/// Gray levels in given directions; per-patch look-ups by a patch that consists of that direction.
template <class Look>
__global__ void look_up(const __grid_constant__ Image image, const float3* directions, float* gray, int count) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k >= count) return;
  const Vec3<float> p{directions[k].x, directions[k].y, directions[k].z};
  float value = 0;
  if constexpr (Look::kPerPatch) {
    Homography h{p, {0, 0, 0}, {0, 0, 0}};
    int face = 0;
    PerPatch::enter<Look>(image, h, face);
    value = Look::at_face(image, h.center, face, k % kSide);
  } else {
    value = Look::at(image, p);
  }
  gray[k] = Look::kScale * value;
}

/// Score of given planes at given pixels in view 0.
template <class Look, class Store>
__global__ void score_planes(const __grid_constant__ Problem problem, const int2* pixels, const float3* planes,
                             float* scores, int count) {
  extern __shared__ char memory[];
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k >= count) return;
  const PixelFrame<float> own = frame_of<float>(problem, pixels[k].x, pixels[k].y);
  const Homography frame{own.bearing, own.right, own.down};
  Store store(memory);
  const Stored stored = take_reference<Look>(problem, frame, store);
  const Rigid& turn = problem.view_from_ref[0];
  const Homography turned{rotate(turn, frame.center), rotate(turn, frame.right), rotate(turn, frame.down)};
  scores[k] = score_in_view<Look>(problem, 0, store, stored, frame, turned, {planes[k].x, planes[k].y, planes[k].z});
}

}  // namespace sampling
