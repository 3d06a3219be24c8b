// SPDX-License-Identifier: BSD-2-Clause
//
// pmsp-gpu-sampling: which form of the panorama, which place of the reference patch and which block shape suit
// PatchMatch on a GPU, by measurement. Needs no input and none of the library but kernels/*.h. One command builds it:
//   nvcc -std=c++17 -O3 -arch=sm_90 -I kernels -o pmsp-gpu-sampling tools/pmsp-bench/gpu_sampling.cu
// Results are compared with double precision on the CPU before anything is timed. Figures: kernels/PERFORMANCE.md.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <random>
#include <string>

#include "gpu_sampling_kernels.cuh"

namespace sampling {
namespace {

struct Settings {
  int runs = 15;
  bool online = true, native = true, accuracy = true;
  std::string json;
};

/// Milliseconds of a launch: median of the runs after three that don't count, and (largest - smallest) / median.
struct Timing {
  double ms = 0, spread = 0;
};
Timing time_of(int runs, const std::function<void()>& launch) {
  cudaEvent_t start = nullptr;
  cudaEvent_t stop = nullptr;
  CUDA_CHECK(cudaEventCreate(&start));
  CUDA_CHECK(cudaEventCreate(&stop));
  for (int i = 0; i < 3; ++i) launch();
  std::vector<float> ms(static_cast<std::size_t>(runs));
  for (float& t : ms) {
    CUDA_CHECK(cudaEventRecord(start));
    launch();
    CUDA_CHECK(cudaGetLastError());
    CUDA_CHECK(cudaEventRecord(stop));
    CUDA_CHECK(cudaEventSynchronize(stop));
    CUDA_CHECK(cudaEventElapsedTime(&t, start, stop));
  }
  CUDA_CHECK(cudaEventDestroy(start));
  CUDA_CHECK(cudaEventDestroy(stop));
  std::sort(ms.begin(), ms.end());
  const double median = ms[ms.size() / 2];
  return {median, (ms.back() - ms.front()) / median};
}

// ---------------------------------------------------------------------------------------------------------------------
// Ceilings

enum class Op { kFma, kHalfFma, kReciprocal, kByteToFloat, kFloatToInt };

template <Op kOp>
__device__ __forceinline__ float step(float x, float a) {
  if constexpr (kOp == Op::kFma) return ::fmaf(x, a, 0.5F);
  if constexpr (kOp == Op::kReciprocal) return reciprocal(x);
  if constexpr (kOp == Op::kByteToFloat) return static_cast<float>(__float_as_uint(x) & 255U);
  if constexpr (kOp == Op::kFloatToInt) return __int_as_float(__float2int_rz(x));
  if constexpr (kOp == Op::kHalfFma) {
    __half2 v;
    ::memcpy(&v, &x, sizeof(v));
    v = __hfma2(v, __float2half2_rn(0.75F), __float2half2_rn(0.5F));
    ::memcpy(&x, &v, sizeof(v));
    return x;
  }
}
constexpr int kChains = 8;
constexpr int kSteps = 4096;
template <Op kOp>
__global__ void arithmetic(float* out, float a) {
  float x[kChains];
  for (int k = 0; k < kChains; ++k) x[k] = static_cast<float>(threadIdx.x + k) + 1.25F;
#pragma unroll 16
  for (int i = 0; i < kSteps; ++i) {
#pragma unroll
    for (int k = 0; k < kChains; ++k) x[k] = step<kOp>(x[k], a);
  }
  float sum = 0;
  for (int k = 0; k < kChains; ++k) sum += x[k];
  out[blockIdx.x * blockDim.x + threadIdx.x] = sum;
}

constexpr int kReads = 1024;
/// A warp's threads lie side by side, all walk half a texel a step over a region of 16 x 16 texels.
template <class Read>
__global__ void texture_rate(Read read, float* out) {
  const float x = static_cast<float>((blockIdx.x * 32) % 128 + threadIdx.x % 32) + 20.3F;
  const float y = static_cast<float>((blockIdx.x * 7) % 128 + threadIdx.x / 32) + 20.4F;
  float sum[4] = {0, 0, 0, 0};
#pragma unroll 2
  for (int i = 0; i < kReads / 16; ++i) {
    const float v = y + static_cast<float>(i & 31) * 0.5F;
#pragma unroll
    for (int k = 0; k < 16; ++k) sum[k & 3] += read(x + static_cast<float>(k) * 0.5F, v);
  }
  out[blockIdx.x * blockDim.x + threadIdx.x] = sum[0] + sum[1] + sum[2] + sum[3];
}
struct ReadTexture {
  cudaTextureObject_t texture;
  __device__ float operator()(float x, float y) const { return tex2D<float>(texture, x, y); }
};
struct ReadGather {
  cudaTextureObject_t texture;
  __device__ float operator()(float x, float y) const {
    const float4 t = tex2Dgather<float4>(texture, x, y, 0);
    return (t.x + t.y) + (t.z + t.w);
  }
};
struct ReadLayered {
  cudaTextureObject_t texture;
  __device__ float operator()(float x, float y) const { return tex2DLayered<float>(texture, x, y, 4); }
};
struct ReadCube {
  cudaTextureObject_t texture;
  float scale;
  __device__ float operator()(float x, float y) const { return texCubemap<float>(texture, x * scale, y * scale, 1.0F); }
};
struct ReadQuad {
  const std::uint32_t* quads;
  int pitch;
  __device__ float operator()(float x, float y) const {
    return __uint_as_float(__ldg(quads + whole_part(y).bits * pitch + whole_part(x).bits));
  }
};

__global__ void shared_rate(float* out) {
  __shared__ float values[36 * 128];
  for (int k = 0; k < 36; ++k) values[k * 128 + threadIdx.x] = static_cast<float>(threadIdx.x * k);
  __syncthreads();
  float sum[4] = {0, 0, 0, 0};
  const volatile float* own = values + threadIdx.x;
#pragma unroll 1
  for (int i = 0; i < kReads / 32; ++i) {
#pragma unroll
    for (int k = 0; k < 32; ++k) sum[k & 3] += own[k * 128];
  }
  out[blockIdx.x * blockDim.x + threadIdx.x] = sum[0] + sum[1] + sum[2] + sum[3];
}

__global__ void l1_rate(const float4* in, float* out) {
  const float4* own = in + (blockIdx.x % 4) * 1024 + threadIdx.x;
  float sum[4] = {0, 0, 0, 0};
#pragma unroll 1
  for (int i = 0; i < kReads / 8; ++i) {
#pragma unroll
    for (int k = 0; k < 8; ++k) {
      float4 v;
      asm volatile("ld.global.nc.v4.f32 {%0, %1, %2, %3}, [%4];"
                   : "=f"(v.x), "=f"(v.y), "=f"(v.z), "=f"(v.w)
                   : "l"(own + k * 128));
      sum[k & 3] += (v.x + v.y) + (v.z + v.w);
    }
  }
  out[blockIdx.x * blockDim.x + threadIdx.x] = sum[0] + sum[1] + sum[2] + sum[3];
}

struct Ceiling {
  std::string name, unit;
  double value, spread;
};

Picture picture_of(int width, float deviation, const Rigid& from_scene, unsigned seed) {
  Picture picture{};
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(0.0F, 1.0F);
  std::normal_distribution<float> normal;
  for (int k = 0; k < kWaves; ++k) {
    const float wavelength = 5.0F * std::pow(12.0F, uniform(random));  // pixels, 5 to 60
    float* w = picture.wave[k];
    for (int i = 0; i < 3; ++i) w[i] = normal(random);
    const float scale = static_cast<float>(width) / wavelength / std::sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
    for (int i = 0; i < 3; ++i) w[i] *= scale;
    picture.phase[k] = 6.2831853F * uniform(random);
  }
  picture.amplitude = deviation * std::sqrt(2.0F / static_cast<float>(kWaves));
  picture.from_scene = from_scene;
  return picture;
}

Rigid turn_about(double x, double y, double z, double tx, double ty, double tz) {
  const double angle = std::sqrt(x * x + y * y + z * z);
  const double s = angle > 0 ? std::sin(angle) / angle : 1.0;
  const double c = angle > 0 ? (1 - std::cos(angle)) / (angle * angle) : 0.5;
  const double cosine = std::cos(angle);
  const auto f = [](double v) { return static_cast<float>(v); };
  return {
      {f(cosine + c * x * x), f(c * x * y - s * z), f(c * x * z + s * y), f(c * x * y + s * z), f(cosine + c * y * y),
       f(c * y * z - s * x), f(c * x * z - s * y), f(c * y * z + s * x), f(cosine + c * z * z)},
      {f(tx), f(ty), f(tz)}};
}

std::vector<Ceiling> measure_ceilings(int runs, int multiprocessors) {
  std::vector<Ceiling> all;
  const unsigned blocks = static_cast<unsigned>(multiprocessors) * 64;
  const double threads = 128.0 * blocks;
  const auto out = device_array<float>(static_cast<std::size_t>(blocks) * 128);
  const auto add = [&](const char* name, const char* unit, double per_launch, const std::function<void()>& launch) {
    const Timing t = time_of(runs, launch);
    all.push_back({name, unit, per_launch / (t.ms * 1e6), t.spread});
  };
  const double operations = threads * kChains * kSteps;
  add("fp32 multiply-add", "G/s", operations, [&] { arithmetic<Op::kFma><<<blocks, 128>>>(out.get(), 0.75F); });
  add("half2 multiply-add", "G/s", operations, [&] { arithmetic<Op::kHalfFma><<<blocks, 128>>>(out.get(), 0.75F); });
  add("rcp.approx", "G/s", operations, [&] { arithmetic<Op::kReciprocal><<<blocks, 128>>>(out.get(), 0.75F); });
  add("byte to float", "G/s", operations, [&] { arithmetic<Op::kByteToFloat><<<blocks, 128>>>(out.get(), 0.75F); });
  add("float to int", "G/s", operations, [&] { arithmetic<Op::kFloatToInt><<<blocks, 128>>>(out.get(), 0.75F); });

  const std::size_t bytes = std::size_t{2} << 30U;
  const auto from = device_array<char>(bytes);
  const auto to = device_array<char>(bytes);
  CUDA_CHECK(cudaMemset(from.get(), 0x5a, bytes));
  add("copy, read + written", "GB/s", 2.0 * static_cast<double>(bytes),
      [&] { CUDA_CHECK(cudaMemcpyAsync(to.get(), from.get(), bytes, cudaMemcpyDeviceToDevice)); });
  add("L1, 16-byte reads", "GB/s", threads * kReads * 16,
      [&] { l1_rate<<<blocks, 128>>>(reinterpret_cast<const float4*>(from.get()), out.get()); });
  add("shared, 4-byte reads", "GB/s", threads * kReads * 4, [&] { shared_rate<<<blocks, 128>>>(out.get()); });

  const Picture picture = picture_of(640, 20, turn_about(0, 0, 0, 0, 0, 0), 1);
  const Panorama panorama(640, 320, picture);
  const Image& image = panorama.image();
  const int side = image.pitch;
  const StripMap map{face_size_for(640), kApron};
  const auto strip16 = filled<std::uint16_t>(map, side, side, 6, picture);
  const auto strip_half = filled<__half>(map, side, side, 6, picture);
  const auto strip_float = filled<float>(map, side, side, 6, picture);
  Texture texture16, texture_half, texture_float;
  texture16.create(strip16.get(), side, 6 * side, 0, 0, false, false);
  texture_half.create(strip_half.get(), side, 6 * side, 0, 0, false, false);
  texture_float.create(strip_float.get(), side, 6 * side, 0, 0, false, false);
  const auto add_texture = [&](const char* name, auto read) {
    add(name, "G/s", threads * kReads, [&] { texture_rate<<<blocks, 128>>>(read, out.get()); });
  };
  add_texture("texture 2-D u8", ReadTexture{image.strip});
  add_texture("texture 2-D u16", ReadTexture{texture16.get()});
  add_texture("texture 2-D half", ReadTexture{texture_half.get()});
  add_texture("texture 2-D float", ReadTexture{texture_float.get()});
  add_texture("texture 2-D layered u8", ReadLayered{image.layered});
  add_texture("texture gather u8", ReadGather{image.strip});
  add_texture("cube map u8", ReadCube{image.cube8, 0.004F});
  add_texture("cube map u16", ReadCube{image.cube16, 0.004F});
  add_texture("packed quads, plain reads", ReadQuad{image.quads, image.pitch});
  return all;
}

// ---------------------------------------------------------------------------------------------------------------------
// Reference in double precision

/// Texels of one form on the host, as gray levels.
struct HostTexels {
  int width = 0, height = 0;
  std::vector<float> gray;
  double at(int i, int j) const { return gray[static_cast<std::size_t>(j) * width + i]; }
};
template <class T, class Map>
HostTexels host_texels(const Map& map, int width, int height, int faces, const Picture& picture) {
  const auto texels = filled<T>(map, width, height, faces, picture);
  const std::size_t count = static_cast<std::size_t>(width) * height * faces;
  std::vector<T> raw(count);
  CUDA_CHECK(cudaMemcpy(raw.data(), texels.get(), count * sizeof(T), cudaMemcpyDeviceToHost));
  HostTexels out{width, height * faces, std::vector<float>(count)};
  const double scale = std::is_same_v<T, std::uint16_t> ? 1.0 / 257.0 : 1.0;
  for (std::size_t k = 0; k < count; ++k) out.gray[k] = static_cast<float>(static_cast<double>(raw[k]) * scale);
  return out;
}

/// Exact bilinear interpolation and how much its four texels differ.
struct Exact {
  double gray, range;
};
Exact bilinear_exact(const HostTexels& t, double u, double v, bool wrap) {
  const double fu = std::floor(u);
  const double fv = std::floor(v);
  const auto column = [&](int i) { return wrap ? (i + t.width) % t.width : std::clamp(i, 0, t.width - 1); };
  const auto row = [&](int j) { return std::clamp(j, 0, t.height - 1); };
  const int i = static_cast<int>(fu);
  const int j = static_cast<int>(fv);
  const double t00 = t.at(column(i), row(j));
  const double t10 = t.at(column(i + 1), row(j));
  const double t01 = t.at(column(i), row(j + 1));
  const double t11 = t.at(column(i + 1), row(j + 1));
  const double upper = t00 + (u - fu) * (t10 - t00);
  const double lower = t01 + (u - fu) * (t11 - t01);
  return {upper + (v - fv) * (lower - upper), std::max({t00, t10, t01, t11}) - std::min({t00, t10, t01, t11})};
}

struct HostFace {
  int face;
  double a, b;  ///< in [-1, 1]
};
HostFace host_face(const Vec3<double>& p) {
  const double ax = std::abs(p.x);
  const double ay = std::abs(p.y);
  const double az = std::abs(p.z);
  const double lead = std::max({ax, ay, az});
  if (ax == lead) return {p.x < 0 ? 1 : 0, p.y / lead, p.z / lead};
  if (ay == lead) return {p.y < 0 ? 3 : 2, p.x / lead, p.z / lead};
  return {p.z < 0 ? 5 : 4, p.x / lead, p.y / lead};
}

enum class Form { kEquirect, kStrip, kOctahedral };

Exact reference_gray(Form form, const HostTexels& t, const Vec3<double>& p) {
  if (form == Form::kEquirect) {
    const double u = t.width * (std::atan2(p.x, p.z) / (2 * kPi) + 0.5) - 0.5;
    const double v = t.height * (std::atan2(p.y, std::hypot(p.x, p.z)) / kPi + 0.5) - 0.5;
    return bilinear_exact(t, u, v, true);
  }
  if (form == Form::kOctahedral) {
    const double sum = std::abs(p.x) + std::abs(p.y) + std::abs(p.z);
    double a = p.x / sum;
    double b = p.z / sum;
    if (p.y < 0) {
      const double folded = std::copysign(1 - std::abs(b), a);
      b = std::copysign(1 - std::abs(a), b);
      a = folded;
    }
    const double half = 0.5 * (t.width - 2);
    return bilinear_exact(t, (a + 1) * half + 0.5, (b + 1) * half + 0.5, false);
  }
  const HostFace f = host_face(p);
  const double half = 0.5 * (t.width - 2 * kApron);
  return bilinear_exact(t, (f.a + 1) * half + kApron - 0.5, f.face * t.width + (f.b + 1) * half + kApron - 0.5, false);
}

HostTexels host_form(Form form, int width, int height, const Picture& picture) {
  if (form == Form::kEquirect) return host_texels<std::uint8_t>(EquirectMap{width, height}, width, height, 1, picture);
  if (form == Form::kOctahedral) {
    const int size = octahedral_size_for(width);
    return host_texels<std::uint8_t>(OctahedralMap{size}, size + 2, size + 2, 1, picture);
  }
  const int size = face_size_for(width);
  return host_texels<std::uint8_t>(StripMap{size, kApron}, size + 2 * kApron, size + 2 * kApron, 6, picture);
}

using HostLook = std::function<double(const Vec3<double>&)>;

/// A reference patch and its scores, in double precision.
class HostPatch {
 public:
  HostPatch(const Problem& problem, int x, int y, const HostLook& look)
      : problem_(problem), frame_(frame_of<double>(problem, x, y)) {
    const double center = look(frame_.bearing);
    double sum = 0;
    double sum_gray = 0;
    double sum_square = 0;
    std::array<double, kSamples> gray{};
    for (int k = 0; k < kSamples; ++k) {
      const double i = offset_of(k % kSide);
      const double j = offset_of(k / kSide);
      gray[k] = look(fma(i, frame_.right, fma(j, frame_.down, frame_.bearing))) - center;
      weight_[k] = std::exp((i * i + j * j) * problem.space_factor + gray[k] * gray[k] * problem.color_factor);
      sum += weight_[k];
      sum_gray += weight_[k] * gray[k];
      sum_square += weight_[k] * gray[k] * gray[k];
    }
    const double mean = sum_gray / sum;
    const double variance = std::max(sum_square / sum - mean * mean, 0.0);
    for (int k = 0; k < kSamples; ++k) {
      weight_[k] /= sum;
      contrast_[k] = weight_[k] * (gray[k] - mean) / std::sqrt(variance + problem.min_variance);
    }
  }
  const PixelFrame<double>& frame() const { return frame_; }

  PixelFrame<double> in_view(int view, const Vec3<double>& plane) const {
    const Rigid& turn = problem_.view_from_ref[view];
    const Vec3<double> t = translation<double>(turn);
    const auto move = [&](const Vec3<double>& p) { return fma(dot(plane, p), t, rotate(turn, p)); };
    return {move(frame_.bearing), move(frame_.right), move(frame_.down)};
  }

  double score(int view, const Vec3<double>& plane, const HostLook& look) const {
    const PixelFrame<double> h = in_view(view, plane);
    std::array<double, kSamples> gray{};
    double mean = 0;
    for (int k = 0; k < kSamples; ++k) {
      gray[k] = look(fma(static_cast<double>(offset_of(k % kSide)), h.right,
                         fma(static_cast<double>(offset_of(k / kSide)), h.down, h.bearing)));
      mean += weight_[k] * gray[k];
    }
    double variance = 0;
    double product = 0;
    for (int k = 0; k < kSamples; ++k) {
      variance += weight_[k] * (gray[k] - mean) * (gray[k] - mean);
      product += contrast_[k] * (gray[k] - mean);
    }
    return product / std::sqrt(variance + problem_.min_variance);
  }

 private:
  const Problem& problem_;
  PixelFrame<double> frame_;
  std::array<double, kSamples> weight_{}, contrast_{};
};

/// Whether a patch stays on the face of its centre, extended by so many texels.
bool stays_on_face(const PixelFrame<double>& h, int face_size, double apron) {
  const int face = host_face(h.bearing).face;
  const double limit = 1 + 2 * apron / face_size;
  for (int k = 0; k < 4; ++k) {
    const Vec3<double> p = fma((k & 1) != 0 ? 2.5 : -2.5, h.right, fma((k & 2) != 0 ? 2.5 : -2.5, h.down, h.bearing));
    const double lead = (face < 2 ? p.x : face < 4 ? p.y : p.z) * ((face & 1) != 0 ? -1 : 1);
    const double a = face < 2 ? p.y : p.x;
    const double b = face < 4 ? p.z : p.y;
    if (!(std::max(std::abs(a), std::abs(b)) <= limit * lead)) return false;
  }
  return true;
}

// ---------------------------------------------------------------------------------------------------------------------
// The problem

/// Reference and two views of a scene at infinity.
class Scene {
 public:
  Scene(int width, int height, float deviation) {
    const Rigid turns[kViews] = {turn_about(0.02, 0.15, -0.03, 0.3, 0.02, 0.1),
                                 turn_about(-0.03, -0.12, 0.02, -0.28, 0.03, -0.12)};
    pictures_[0] = picture_of(width, deviation, turn_about(0, 0, 0, 0, 0, 0), 7);
    problem_.width = width;
    problem_.height = height;
    for (int view = 0; view < kViews; ++view) {
      pictures_[view + 1] = picture_of(width, deviation, turns[view], 7);
      problem_.view_from_ref[view] = turns[view];
    }
    for (int k = 0; k <= kViews; ++k) {
      panoramas_[k] = std::make_unique<Panorama>(width, height, pictures_[k]);
      (k == 0 ? problem_.reference : problem_.view[k - 1]) = panoramas_[k]->image();
    }
    problem_.spacing = static_cast<float>(2.0 * 2.0 * kPi / width);
    problem_.color_factor = -1.0F / (2.0F * 20.0F * 20.0F);
    problem_.space_factor = -1.0F / (2.0F * 2.5F * 2.5F);
    problem_.min_variance = 0.1F;
    problem_.limits = {0.02F, 2.0F, 0.03F};
    problem_.log_depth_span = std::log(100.0F);
    problem_.random = random_key(1, 2, 3);
  }
  const Problem& problem() const { return problem_; }
  const Picture& picture(int k) const { return pictures_[k]; }  ///< 0: reference

 private:
  Picture pictures_[kViews + 1];
  std::unique_ptr<Panorama> panoramas_[kViews + 1];
  Problem problem_{};
};

/// One kernel and how it is launched.
struct Variant {
  std::string look, store;
  Form form;
  void (*kernel)(Problem, Pass, float4*);
  dim3 block;
  int shared_per_thread;
  double score_tolerance;
  int shared() const { return shared_per_thread * static_cast<int>(block.x * block.y); }
};

template <class Look>
struct Name;
#define NAME_LOOK(type, name, map)             \
  template <>                                  \
  struct Name<type> {                          \
    static constexpr const char* kText = name; \
    static constexpr Form kForm = Form::map;   \
  };
NAME_LOOK(EquirectLibrary, "1 equirect atan2f", kEquirect)
NAME_LOOK(EquirectPolynomial, "2 equirect polynomial", kEquirect)
NAME_LOOK(Cube8, "3 cube map u8", kStrip)
NAME_LOOK(Cube16, "4 cube map u16", kStrip)
NAME_LOOK(Octahedral, "5 octahedral", kOctahedral)
NAME_LOOK(Quads<true>, "6a quads, as cube.h", kStrip)
NAME_LOOK(Quads<false>, "6b quads, fast rcp", kStrip)
NAME_LOOK(PatchQuads, "6c quads, face/patch", kStrip)
NAME_LOOK(PatchQuadsHalf, "6d 6c, half lerp", kStrip)
NAME_LOOK(Layered, "7a layered, fallback", kStrip)
NAME_LOOK(Strip<true>, "7b strip, fallback", kStrip)
NAME_LOOK(Strip<false>, "7c strip, rejecting", kStrip)
NAME_LOOK(Gather, "7d strip, gather", kStrip)
NAME_LOOK(Hybrid, "8 7c + 1/3 quads", kStrip)
#undef NAME_LOOK

using HalfRegisters = Registers<false>;
using BrainRegisters = Registers<true>;
using HalfShared = Shared<false, 1>;
using HalfSharedUnrolled = Shared<false, kSide>;
using BrainShared = Shared<true, 1>;
using BrainSharedUnrolled = Shared<true, kSide>;

template <class Look, class Store, int kThreads, int kMinBlocks>
Variant variant(const char* store, int block_x = 32) {
  const dim3 block(static_cast<unsigned>(block_x), static_cast<unsigned>(kThreads / block_x));
  return {Name<Look>::kText,   store, Name<Look>::kForm, &match<Look, Store, kThreads, kMinBlocks>, block,
          Store::kSharedBytes, 0.02};
}

template <class Look>
void add_look(std::vector<Variant>& all) {
  all.push_back(variant<Look, HalfRegisters, 128, 5>("b half2 registers"));
  all.push_back(variant<Look, HalfShared, 128, 8>("c half2 shared"));
}
template <class Look>
void add_stores(std::vector<Variant>& all) {
  all.push_back(variant<Look, BrainRegisters, 128, 5>("b' bf16 registers"));
  all.push_back(variant<Look, BrainRegisters, 128, 6>("b' bf16 registers"));
  all.push_back(variant<Look, BrainShared, 128, 8>("c' bf16 shared"));
  all.push_back(variant<Look, BrainShared, 128, 10>("c' bf16 shared"));
  all.push_back(variant<Look, BrainShared, 128, 12>("c' bf16 shared"));
  all.push_back(variant<Look, BrainSharedUnrolled, 128, 8>("c' bf16 sh. unrolled"));
}
template <class Look>
void add_shapes(std::vector<Variant>& all) {
  all.push_back(variant<Look, BrainShared, 128, 8>("c' bf16 shared", 16));
  all.push_back(variant<Look, BrainShared, 128, 8>("c' bf16 shared", 8));
  all.push_back(variant<Look, BrainShared, 128, 8>("c' bf16 shared", 64));
  all.push_back(variant<Look, BrainShared, 256, 4>("c' bf16 shared", 32));
}

std::vector<Variant> all_variants() {
  std::vector<Variant> all;
  add_look<EquirectLibrary>(all);
  add_look<EquirectPolynomial>(all);
  add_look<Cube8>(all);
  add_look<Cube16>(all);
  add_look<Octahedral>(all);
  add_look<Quads<true>>(all);
  add_look<Quads<false>>(all);
  add_look<PatchQuads>(all);
  add_look<PatchQuadsHalf>(all);
  add_look<Layered>(all);
  add_look<Strip<true>>(all);
  add_look<Strip<false>>(all);
  add_look<Gather>(all);
  add_look<Hybrid>(all);
  all.push_back(variant<Cube8, FloatArrays, 128, 4>("a float arrays"));
  all.push_back(variant<Cube8, FloatArrays, 128, 6>("a float arrays"));
  all.push_back(variant<Cube8, FloatArrays, 128, 8>("a float arrays"));
  all.push_back(variant<Cube8, HalfRegisters, 128, 4>("b half2 registers"));
  all.push_back(variant<Cube8, HalfRegisters, 128, 6>("b half2 registers"));
  all.push_back(variant<Cube8, HalfRegisters, 128, 8>("b half2 registers"));
  all.push_back(variant<Cube8, HalfShared, 128, 5>("c half2 shared"));
  all.push_back(variant<Cube8, HalfShared, 128, 10>("c half2 shared"));
  all.push_back(variant<Cube8, HalfShared, 128, 12>("c half2 shared"));
  all.push_back(variant<Cube8, HalfSharedUnrolled, 128, 8>("c half2 sh. unrolled"));
  all.push_back(variant<Cube8, SharedFloats, 128, 5>("d float2 shared"));
  all.push_back(variant<Cube8, SharedFloats, 128, 6>("d float2 shared"));
  add_stores<Cube8>(all);
  add_stores<Strip<false>>(all);
  add_stores<PatchQuadsHalf>(all);
  add_shapes<Cube8>(all);
  add_shapes<Strip<false>>(all);
  return all;
}

/// Small blocks, which share the few pixels of a pass more evenly among the multiprocessors.
void add_passes(std::vector<Variant>& all) {
  all.push_back(variant<Strip<false>, BrainShared, 64, 14>("c' bf16 shared"));
  all.push_back(variant<Cube8, BrainShared, 64, 14>("c' bf16 shared"));
  all.push_back(variant<PatchQuadsHalf, BrainShared, 64, 14>("c' bf16 shared"));
  all.push_back(variant<Strip<false>, BrainShared, 32, 25>("c' bf16 shared"));
  all.push_back(variant<Strip<false>, BrainShared, 128, 7>("c' bf16 shared"));
}

constexpr int kHypotheses = 57;  // one random, then 4 iterations of 8 neighbours and 6 random steps

struct Row {
  std::string look, store, size;
  dim3 block;
  int registers = 0, local_bytes = 0, blocks_per_multiprocessor = 0;
  double ms = 0, spread = 0, samples = 0;  ///< 10^9 samples a second
  double worst_score_error = 0;
};

/// Best scores of some pixels in double precision.
class Expected {
 public:
  Expected(const Scene& scene, Form form) {
    const Problem& problem = scene.problem();
    std::vector<HostTexels> texels;
    for (int k = 0; k <= kViews; ++k) {
      texels.push_back(host_form(form, problem.width, problem.height, scene.picture(k)));
    }
    const auto look = [&](int k) {
      return [&texels, k, form](const Vec3<double>& p) { return reference_gray(form, texels[k], p).gray; };
    };
    std::mt19937 random(11);
    for (int n = 0; n < 48; ++n) {
      const int x = static_cast<int>(random() % static_cast<unsigned>(problem.width));
      const int y = static_cast<int>(random() % static_cast<unsigned>(problem.height));
      const std::uint32_t pixel = static_cast<std::uint32_t>(y * problem.width + x);
      const HostPatch patch(problem, x, y, look(0));
      double best = -2;
      for (int h = 0; h < kHypotheses; ++h) {
        const Vec3<double> plane = hypothesis<double>(problem, pixel, h, patch.frame().bearing);
        double score[kViews];
        for (int view = 0; view < kViews; ++view) {
          score[view] = patch.score(view, plane, look(view + 1));
          const int size = face_size_for(problem.width);
          leaving_face += stays_on_face(patch.in_view(view, plane), size, 0) ? 0 : 1;
          leaving_apron += stays_on_face(patch.in_view(view, plane), size, kApron - 1) ? 0 : 1;
        }
        best = std::max(best, 0.5 * std::max(score[0], score[1]) + 0.25 * (score[0] + score[1]));
      }
      pixels.push_back(pixel);
      scores.push_back(best);
    }
    leaving_face /= 48.0 * kHypotheses * kViews;
    leaving_apron /= 48.0 * kHypotheses * kViews;
  }
  std::vector<std::uint32_t> pixels;
  std::vector<double> scores;
  double leaving_face = 0, leaving_apron = 0;  ///< share of the patches
};

double worst_error(const std::vector<float4>& best, const Expected& expected) {
  for (const float4& b : best) {
    if (!std::isfinite(b.w) || !std::isfinite(b.x)) return 1e9;
  }
  double worst = 0;
  for (std::size_t k = 0; k < expected.pixels.size(); ++k) {
    worst = std::max(worst, std::abs(best[expected.pixels[k]].w - expected.scores[k]));
  }
  return worst;
}

/// All hypotheses in one launch, or as PatchMatch does it: four iterations of two passes, half of the pixels each.
void launch_match(const Variant& v, const Problem& problem, bool iterations, float4* best) {
  const unsigned columns = static_cast<unsigned>(iterations ? problem.width / 2 : problem.width);
  const dim3 grid((columns + v.block.x - 1) / v.block.x,
                  (static_cast<unsigned>(problem.height) + v.block.y - 1) / v.block.y);
  const auto launch = [&](const Pass& pass) {
    v.kernel<<<grid, v.block, v.shared()>>>(problem, pass, best);
    CUDA_CHECK(cudaGetLastError());
  };
  if (!iterations) return launch({0, kHypotheses, -1});
  for (int first = 0; first < kHypotheses; first += kHypotheses / 4 + (first == 0 ? 1 : 0)) {
    const int last = std::min(first + kHypotheses / 4 + (first == 0 ? 1 : 0), kHypotheses);
    for (int colour = 0; colour < 2; ++colour) launch({first, last, colour});
  }
}

/// No more of the L1 cache as shared memory than the resident blocks need.
void prefer_shared(const Variant& v, int blocks) {
  int limit = 0;
  CUDA_CHECK(cudaDeviceGetAttribute(&limit, cudaDevAttrMaxSharedMemoryPerMultiprocessor, 0));
  const int needed = v.shared() == 0 ? 0 : blocks * (v.shared() + 1024);  // each block has 1 KiB of the system's
  const int percent = std::min(100, (100 * needed + limit - 1) / limit);
  CUDA_CHECK(cudaFuncSetAttribute(v.kernel, cudaFuncAttributePreferredSharedMemoryCarveout, percent));
}

Row run(const Variant& v, const Scene& scene, const Expected& expected, int runs, bool iterations) {
  const Problem& problem = scene.problem();
  Row row;
  row.look = v.look;
  row.store = v.store;
  row.size = std::to_string(problem.width) + (iterations ? " r/b" : " all");
  row.block = v.block;
  cudaFuncAttributes attributes{};
  CUDA_CHECK(cudaFuncGetAttributes(&attributes, v.kernel));
  row.registers = attributes.numRegs;
  row.local_bytes = static_cast<int>(attributes.localSizeBytes);
  CUDA_CHECK(cudaFuncSetAttribute(v.kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, v.shared()));
  CUDA_CHECK(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&row.blocks_per_multiprocessor, v.kernel,
                                                           static_cast<int>(v.block.x * v.block.y), v.shared()));
  prefer_shared(v, row.blocks_per_multiprocessor);
  const std::size_t pixels = static_cast<std::size_t>(problem.width) * problem.height;
  const auto best = device_array<float4>(pixels);
  const auto launch = [&] { launch_match(v, problem, iterations, best.get()); };
  CUDA_CHECK(cudaMemset(best.get(), 0xff, pixels * sizeof(float4)));  // NaN
  launch();
  std::vector<float4> host(pixels);
  CUDA_CHECK(cudaMemcpy(host.data(), best.get(), pixels * sizeof(float4), cudaMemcpyDeviceToHost));
  row.worst_score_error = worst_error(host, expected);
  if (!(row.worst_score_error <= v.score_tolerance)) return row;  // not timed
  const Timing t = time_of(runs, launch);
  row.ms = t.ms;
  row.spread = t.spread;
  row.samples = static_cast<double>(pixels) * kHypotheses * kViews * kSamples / (t.ms * 1e6);
  return row;
}

// ---------------------------------------------------------------------------------------------------------------------
// Single look-ups against double precision

template <class T>
DeviceArray<T> uploaded(const std::vector<T>& values) {
  auto out = device_array<T>(values.size());
  CUDA_CHECK(cudaMemcpy(out.get(), values.data(), values.size() * sizeof(T), cudaMemcpyHostToDevice));
  return out;
}
std::vector<float> downloaded(const DeviceArray<float>& values, std::size_t count) {
  std::vector<float> out(count);
  CUDA_CHECK(cudaMemcpy(out.data(), values.get(), count * sizeof(float), cudaMemcpyDeviceToHost));
  return out;
}

std::vector<float3> random_directions(int count) {
  std::mt19937 random(static_cast<unsigned>(std::random_device{}()));
  std::normal_distribution<float> normal;
  std::vector<float3> out(static_cast<std::size_t>(count));
  for (float3& d : out) d = make_float3(normal(random), normal(random), normal(random));
  return out;
}
Vec3<double> as_double(const float3& d) { return {d.x, d.y, d.z}; }

template <class Look>
std::vector<float> looked_up(const Image& image, const std::vector<float3>& directions) {
  const auto in = uploaded(directions);
  auto out = device_array<float>(directions.size());
  CUDA_CHECK(cudaMemset(out.get(), 0xff, directions.size() * sizeof(float)));
  const int count = static_cast<int>(directions.size());
  look_up<Look><<<(count + 127) / 128, 128>>>(image, in.get(), out.get(), count);
  CUDA_CHECK(cudaGetLastError());
  return downloaded(out, directions.size());
}

/// Error against exact bilinear interpolation of the same texels (where no face border is near) and, everywhere,
/// against the picture itself. False if either is more than the look-up's arithmetic explains.
template <class Look>
bool check_look(const Scene& scene, bool exact_weights) {
  constexpr Form kForm = Name<Look>::kForm;
  const Problem& problem = scene.problem();
  const Picture& picture = scene.picture(0);
  const HostTexels texels = host_form(kForm, problem.width, problem.height, picture);
  const std::vector<float3> directions = random_directions(20000);
  const std::vector<float> gray = looked_up<Look>(problem.reference, directions);
  const double border = 1.0 - 2.5 / face_size_for(problem.width);
  double worst = 0;
  double seam = 0;
  double reference_seam = 0;
  bool good = true;
  for (std::size_t k = 0; k < directions.size(); ++k) {
    const Vec3<double> p = as_double(directions[k]);
    const Exact exact = reference_gray(kForm, texels, p);
    const double truth = gray_of<double>(picture, p);
    const double error = std::abs(gray[k] - exact.gray);
    seam = std::max(seam, std::abs(gray[k] - truth));
    reference_seam = std::max(reference_seam, std::abs(exact.gray - truth));
    good = good && std::isfinite(gray[k]);
    const HostFace f = host_face(p);
    if (kForm == Form::kStrip && std::max(std::abs(f.a), std::abs(f.b)) > border) continue;
    worst = std::max(worst, error);
    // Close to the poles the arcsine has few correct digits.
    const double steps = kForm == Form::kEquirect ? 16.0 : 2.0;
    good = good && error <= (exact_weights ? 0.02 : 0.1) + exact.range * (exact_weights ? 1e-3 : steps / 256.0);
  }
  good = good && seam <= 2 * reference_seam + 1;
  std::printf("  %-22s max error %7.4f gray levels, to the picture %6.3f (exact bilinear %6.3f)  %s\n",
              Name<Look>::kText, worst, seam, reference_seam, good ? "ok" : "WRONG");
  return good;
}

bool check_looks(const Scene& scene) {
  std::printf("Look-ups against double precision, 20000 random directions\n");
  bool good = true;
  good = check_look<EquirectLibrary>(scene, false) && good;
  good = check_look<EquirectPolynomial>(scene, false) && good;
  good = check_look<Cube8>(scene, false) && good;
  good = check_look<Octahedral>(scene, false) && good;
  good = check_look<Quads<true>>(scene, true) && good;
  good = check_look<Quads<false>>(scene, true) && good;
  good = check_look<PatchQuads>(scene, true) && good;
  good = check_look<PatchQuadsHalf>(scene, false) && good;
  good = check_look<Layered>(scene, false) && good;
  good = check_look<Strip<false>>(scene, false) && good;
  good = check_look<Gather>(scene, true) && good;
  good = check_look<Hybrid>(scene, false) && good;
  return good;
}

// ---------------------------------------------------------------------------------------------------------------------
// Accuracy

struct AccuracyRow {
  double deviation;
  std::string look, store;
  double gray_rms = 0, gray_max = 0;    ///< against exact bilinear on texels without rounding [gray levels]
  double score_rms = 0, score_max = 0;  ///< against the same patches in double precision on those texels
  double peak_median = 0, peak_90 = 0;  ///< error of the best parallax [pixels]
};

constexpr int kScan = 41;  ///< parallaxes from -1 to 1 pixel

/// Patches that stay on one face in both images, with planes around infinity, the truth.
struct Scans {
  std::vector<int2> pixels;  ///< kScan times each
  std::vector<float3> planes;
};
Scans make_scans(const Problem& problem, int count) {
  Scans scans;
  std::mt19937 random(5);
  const HostLook flat = [](const Vec3<double>&) { return 128.0; };
  while (static_cast<int>(scans.pixels.size()) < count * kScan) {
    const int x = static_cast<int>(random() % static_cast<unsigned>(problem.width));
    const int y = static_cast<int>(random() % static_cast<unsigned>(problem.height));
    const HostPatch patch(problem, x, y, flat);
    const PixelFrame<double>& frame = patch.frame();
    const int size = face_size_for(problem.width);
    if (!stays_on_face(frame, size, -2) || !stays_on_face(patch.in_view(0, {0, 0, 0}), size, -6)) continue;
    const Vec3<double> b = rotate(problem.view_from_ref[0], frame.bearing);
    const Vec3<double> t = translation<double>(problem.view_from_ref[0]);
    const double across = std::sqrt(std::max(dot(t, t) - dot(t, b) * dot(t, b), 0.0));
    if (across < 0.3 * std::sqrt(dot(t, t))) continue;
    const double pixel = 2 * kPi / problem.width / across;  // inverse depth that moves by one pixel
    for (int k = 0; k < kScan; ++k) {
      const Vec3<double> plane = (pixel * (2.0 * k / (kScan - 1) - 1)) * frame.bearing;
      scans.pixels.push_back(make_int2(x, y));
      scans.planes.push_back(
          make_float3(static_cast<float>(plane.x), static_cast<float>(plane.y), static_cast<float>(plane.z)));
    }
  }
  return scans;
}

/// Parallax of the largest score [pixels], refined by the parabola through it and its neighbours.
double peak_of(const double* scores) {
  const int best = static_cast<int>(std::max_element(scores, scores + kScan) - scores);
  double offset = 0;
  if (best > 0 && best + 1 < kScan) {
    const double bend = scores[best - 1] - 2 * scores[best] + scores[best + 1];
    if (bend < 0) offset = 0.5 * (scores[best - 1] - scores[best + 1]) / bend;
  }
  return 2.0 * (best + offset) / (kScan - 1) - 1;
}

void compare_scores(AccuracyRow& row, const std::vector<double>& scores, const std::vector<double>& truth) {
  std::vector<double> peaks;
  double square = 0;
  for (std::size_t k = 0; k < scores.size(); ++k) {
    const double error = std::abs(scores[k] - truth[k]);
    row.score_max = std::max(row.score_max, std::isfinite(error) ? error : 1e9);
    square += error * error;
    if (k % kScan == 0) peaks.push_back(std::abs(peak_of(&scores[k])));
  }
  row.score_rms = std::sqrt(square / static_cast<double>(scores.size()));
  std::sort(peaks.begin(), peaks.end());
  row.peak_median = peaks[peaks.size() / 2];
  row.peak_90 = peaks[peaks.size() * 9 / 10];
}

void compare_gray(AccuracyRow& row, const std::vector<double>& gray, const std::vector<double>& truth) {
  double square = 0;
  for (std::size_t k = 0; k < gray.size(); ++k) {
    const double error = std::abs(gray[k] - truth[k]);
    row.gray_max = std::max(row.gray_max, error);
    square += error * error;
  }
  row.gray_rms = std::sqrt(square / static_cast<double>(gray.size()));
}

/// Results on the host from texels of one type.
struct HostResult {
  std::vector<double> gray, scores;
};
template <class T>
HostResult on_host(const Scene& scene, const Scans& scans, const std::vector<float3>& directions) {
  const Problem& problem = scene.problem();
  const int size = face_size_for(problem.width);
  const int side = size + 2 * kApron;
  const HostTexels reference = host_texels<T>(StripMap{size, kApron}, side, side, 6, scene.picture(0));
  const HostTexels view = host_texels<T>(StripMap{size, kApron}, side, side, 6, scene.picture(1));
  const HostLook look_reference = [&](const Vec3<double>& p) {
    return reference_gray(Form::kStrip, reference, p).gray;
  };
  const HostLook look_view = [&](const Vec3<double>& p) { return reference_gray(Form::kStrip, view, p).gray; };
  HostResult result;
  for (const float3& d : directions) result.gray.push_back(look_reference(as_double(d)));
  for (std::size_t k = 0; k < scans.pixels.size(); k += kScan) {
    const HostPatch patch(problem, scans.pixels[k].x, scans.pixels[k].y, look_reference);
    for (std::size_t i = k; i < k + kScan; ++i) {
      result.scores.push_back(patch.score(0, as_double(scans.planes[i]), look_view));
    }
  }
  return result;
}

template <class Look, class Store>
AccuracyRow on_device(const Scene& scene, const Scans& scans, const std::vector<float3>& directions,
                      const HostResult& truth, double deviation, const char* store) {
  AccuracyRow row{deviation, Name<Look>::kText, store};
  const std::vector<float> gray = looked_up<Look>(scene.problem().reference, directions);
  compare_gray(row, {gray.begin(), gray.end()}, truth.gray);
  const int count = static_cast<int>(scans.pixels.size());
  const auto pixels = uploaded(scans.pixels);
  const auto planes = uploaded(scans.planes);
  auto out = device_array<float>(scans.pixels.size());
  CUDA_CHECK(cudaMemset(out.get(), 0xff, scans.pixels.size() * sizeof(float)));
  score_planes<Look, Store><<<(count + 63) / 64, 64, 64 * Store::kSharedBytes>>>(scene.problem(), pixels.get(),
                                                                                 planes.get(), out.get(), count);
  CUDA_CHECK(cudaGetLastError());
  const std::vector<float> scores = downloaded(out, scans.pixels.size());
  compare_scores(row, {scores.begin(), scores.end()}, truth.scores);
  return row;
}

AccuracyRow host_row(const char* name, double deviation, const HostResult& result, const HostResult& truth) {
  AccuracyRow row{deviation, name, "double, CPU"};
  compare_gray(row, result.gray, truth.gray);
  compare_scores(row, result.scores, truth.scores);
  return row;
}

std::vector<AccuracyRow> measure_accuracy() {
  std::vector<AccuracyRow> rows;
  for (const float deviation : {1.0F, 3.0F, 10.0F, 30.0F}) {
    const Scene scene(640, 320, deviation);
    const Scans scans = make_scans(scene.problem(), 512);
    std::vector<float3> directions;
    for (const float3& d : random_directions(20000)) {
      const HostFace f = host_face(as_double(d));
      if (std::max(std::abs(f.a), std::abs(f.b)) < 0.97) directions.push_back(d);
    }
    const HostResult truth = on_host<float>(scene, scans, directions);
    rows.push_back(host_row("texels unrounded", deviation, truth, truth));
    rows.push_back(host_row("u16, exact bilinear", deviation, on_host<std::uint16_t>(scene, scans, directions), truth));
    rows.push_back(host_row("u8, exact bilinear", deviation, on_host<std::uint8_t>(scene, scans, directions), truth));
#define DEVICE_ROW(look, store, name) \
  rows.push_back(on_device<look, store>(scene, scans, directions, truth, deviation, name))
    DEVICE_ROW(Cube16, SharedFloats, "float");
    DEVICE_ROW(Cube16, HalfShared, "half2");
    DEVICE_ROW(Cube16, BrainShared, "bf16");
    DEVICE_ROW(Cube8, SharedFloats, "float");
    DEVICE_ROW(Strip<false>, SharedFloats, "float");
    DEVICE_ROW(Gather, SharedFloats, "float");
    DEVICE_ROW(PatchQuads, SharedFloats, "float");
    DEVICE_ROW(PatchQuadsHalf, SharedFloats, "float");
#undef DEVICE_ROW
  }
  return rows;
}

// ---------------------------------------------------------------------------------------------------------------------
// Report

double ceiling(const std::vector<Ceiling>& all, const char* name) {
  for (const Ceiling& c : all) {
    if (c.name == name) return c.value;
  }
  return 0;
}

void print_row(const Row& row, double texture, double instructions) {
  std::printf("%-9s %-22s %-21s %3ux%-2u %4d %5d %6d ", row.size.c_str(), row.look.c_str(), row.store.c_str(),
              row.block.x, row.block.y, row.registers, row.local_bytes,
              row.blocks_per_multiprocessor * static_cast<int>(row.block.x * row.block.y));
  if (row.ms == 0) {
    std::printf("  WRONG: score off by %g\n", row.worst_score_error);
    return;
  }
  std::printf("%9.3f %5.1f%% %7.0f %6.0f%% %7.1f %8.5f\n", row.ms, 100 * row.spread, row.samples,
              100 * row.samples / texture, instructions / row.samples, row.worst_score_error);
}

void write_json(const std::string& path, const cudaDeviceProp& device, const std::vector<Ceiling>& ceilings,
                const std::vector<Row>& rows, const std::vector<AccuracyRow>& accuracy) {
  std::FILE* file = std::fopen(path.c_str(), "w");
  if (file == nullptr) {
    std::fprintf(stderr, "pmsp-gpu-sampling: cannot write %s\n", path.c_str());
    std::exit(1);
  }
  std::fprintf(file, "{\"device\": \"%s\", \"multiprocessors\": %d,\n\"ceilings\": [\n", device.name,
               device.multiProcessorCount);
  const char* separator = "";
  for (const Ceiling& c : ceilings) {
    std::fprintf(file, "%s{\"name\": \"%s\", \"unit\": \"%s\", \"value\": %g, \"spread\": %g}", separator,
                 c.name.c_str(), c.unit.c_str(), c.value, c.spread);
    separator = ",\n";
  }
  std::fprintf(file, "],\n\"runs\": [\n");
  separator = "";
  for (const Row& r : rows) {
    std::fprintf(file,
                 "%s{\"size\": \"%s\", \"look\": \"%s\", \"store\": \"%s\", \"block\": [%u, %u], \"registers\": %d, "
                 "\"local_bytes\": %d, \"blocks\": %d, \"ms\": %g, \"spread\": %g, \"gsamples\": %g, "
                 "\"score_error\": %g}",
                 separator, r.size.c_str(), r.look.c_str(), r.store.c_str(), r.block.x, r.block.y, r.registers,
                 r.local_bytes, r.blocks_per_multiprocessor, r.ms, r.spread, r.samples, r.worst_score_error);
    separator = ",\n";
  }
  std::fprintf(file, "],\n\"accuracy\": [\n");
  separator = "";
  for (const AccuracyRow& a : accuracy) {
    std::fprintf(file,
                 "%s{\"deviation\": %g, \"look\": \"%s\", \"store\": \"%s\", \"gray_rms\": %g, \"gray_max\": %g, "
                 "\"score_rms\": %g, \"score_max\": %g, \"peak_median\": %g, \"peak_90\": %g}",
                 separator, a.deviation, a.look.c_str(), a.store.c_str(), a.gray_rms, a.gray_max, a.score_rms,
                 a.score_max, a.peak_median, a.peak_90);
    separator = ",\n";
  }
  std::fprintf(file, "]}\n");
  if (std::fclose(file) != 0) std::exit(1);
}

/// The fastest variant of each look-up.
std::vector<Variant> winners(const std::vector<Variant>& variants, const std::vector<Row>& rows) {
  std::vector<Variant> best;
  std::vector<double> ms;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (rows[k].ms == 0) continue;
    std::size_t at = 0;
    while (at < best.size() && best[at].look != rows[k].look) ++at;
    if (at == best.size()) {
      best.push_back(variants[k]);
      ms.push_back(rows[k].ms);
    } else if (rows[k].ms < ms[at]) {
      best[at] = variants[k];
      ms[at] = rows[k].ms;
    }
  }
  return best;
}

constexpr const char* kUsage =
    "pmsp-gpu-sampling [--runs N] [--json FILE] [--no-native] [--no-online] [--no-accuracy]\n"
    "Times image look-ups and homes of the reference patch on the present CUDA device.\n";

Settings settings_from(int argc, char** argv) {
  Settings s;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--runs" && i + 1 < argc) {
      s.runs = std::max(1, std::atoi(argv[++i]));
    } else if (argument == "--json" && i + 1 < argc) {
      s.json = argv[++i];
    } else if (argument == "--no-native") {
      s.native = false;
    } else if (argument == "--no-online") {
      s.online = false;
    } else if (argument == "--no-accuracy") {
      s.accuracy = false;
    } else {
      const bool help = argument == "--help";
      const bool lacks_value = argument == "--runs" || argument == "--json";
      if (!help) std::fprintf(stderr, "%s: %s\n", argv[i], lacks_value ? "its value is missing" : "no such argument");
      std::fputs(kUsage, help ? stdout : stderr);
      std::exit(help ? 0 : 2);
    }
  }
  return s;
}

std::vector<Row> run_all(const std::vector<Variant>& variants, int width, int height, const Settings& settings,
                         double texture, double instructions, bool iterations) {
  const Scene scene(width, height, 20);
  const Expected expected[3] = {Expected(scene, Form::kEquirect), Expected(scene, Form::kStrip),
                                Expected(scene, Form::kOctahedral)};
  std::printf("%dx%d: %.1f %% of the patches leave their face, %.1f %% its apron of %d texels\n", width, height,
              100 * expected[1].leaving_face, 100 * expected[1].leaving_apron, kApron);
  std::vector<Row> rows;
  for (const Variant& v : variants) {
    rows.push_back(run(v, scene, expected[static_cast<int>(v.form)], settings.runs, iterations));
    print_row(rows.back(), texture, instructions);
    std::fflush(stdout);
  }
  return rows;
}

int run_main(const Settings& settings) {
  int devices = 0;
  if (cudaGetDeviceCount(&devices) != cudaSuccess || devices == 0) {
    std::fprintf(stderr, "pmsp-gpu-sampling: no CUDA device\n");
    return 77;
  }
  cudaDeviceProp device{};
  CUDA_CHECK(cudaGetDeviceProperties(&device, 0));
  std::printf("%s, compute capability %d.%d, %d multiprocessors, L2 %d MiB; median of %d runs\n", device.name,
              device.major, device.minor, device.multiProcessorCount, device.l2CacheSize >> 20, settings.runs);

  const std::vector<Ceiling> ceilings = measure_ceilings(settings.runs, device.multiProcessorCount);
  std::printf("\nCeilings\n");
  for (const Ceiling& c : ceilings) {
    std::printf("  %-26s %9.1f %-5s (spread %.1f %%)\n", c.name.c_str(), c.value, c.unit.c_str(), 100 * c.spread);
  }
  const double texture = ceiling(ceilings, "texture 2-D u8");
  const double instructions = ceiling(ceilings, "fp32 multiply-add");

  std::printf("\n");
  const bool good = check_looks(Scene(640, 320, 20));

  std::printf(
      "\n%d hypotheses x %d views x %d samples, all pixels in one launch or red and black in 4 iterations (r/b).\n"
      "slots: fp32 instructions that would fit into a sample's time\n",
      kHypotheses, kViews, kSamples);
  std::printf("%-9s %-22s %-21s %6s %4s %5s %6s %9s %6s %7s %7s %7s %8s\n", "size", "look-up", "reference patch",
              "block", "regs", "local", "thr/SM", "ms", "spread", "G/s", "of tex", "slots", "error");
  const std::vector<Variant> variants = all_variants();
  std::vector<Row> rows;
  std::vector<Variant> best = variants;
  const auto add_rows = [&](int width, bool iterations) {
    const std::vector<Row> more = run_all(best, width, width / 2, settings, texture, instructions, iterations);
    rows.insert(rows.end(), more.begin(), more.end());
  };
  if (settings.online) {
    add_rows(640, false);
    best = winners(variants, rows);
    add_passes(best);
    add_rows(640, true);
  }
  if (settings.native) add_rows(5760, false);

  std::vector<AccuracyRow> accuracy;
  if (settings.accuracy) {
    accuracy = measure_accuracy();
    std::printf(
        "\nAccuracy against unrounded texels and double precision; peak: error of the best parallax [pixels]\n");
    std::printf("%4s %-22s %-12s %9s %9s %10s %10s %8s %8s\n", "std", "look-up", "patch", "gray rms", "gray max",
                "score rms", "score max", "peak 50%", "peak 90%");
    for (const AccuracyRow& a : accuracy) {
      std::printf("%4.0f %-22s %-12s %9.4f %9.4f %10.6f %10.6f %8.4f %8.4f\n", a.deviation, a.look.c_str(),
                  a.store.c_str(), a.gray_rms, a.gray_max, a.score_rms, a.score_max, a.peak_median, a.peak_90);
    }
  }
  if (!settings.json.empty()) write_json(settings.json, device, ceilings, rows, accuracy);
  const bool all_right = good && std::all_of(rows.begin(), rows.end(), [](const Row& r) { return r.ms > 0; });
  if (!all_right) std::printf("\nSOME RESULTS ARE WRONG\n");
  return all_right ? 0 : 1;
}

}  // namespace
}  // namespace sampling

int main(int argc, char** argv) { return sampling::run_main(sampling::settings_from(argc, argv)); }
