// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cuda_fp16.h>
#include <cuda_runtime.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

#include "cube.h"
#include "elementary.h"
#include "rigid.h"
#include "vec3.h"

// One panorama in all the forms whose look-ups pmsp-gpu-sampling compares. The picture is a sum of waves over the
// directions, so that every form can be filled, and checked, from its definition.
namespace sampling {

using pmsp::kernels::kPi;
using pmsp::kernels::Rigid;
using pmsp::kernels::Vec3;

inline void check(cudaError_t status, const char* call, int line) {
  if (status == cudaSuccess) return;
  std::fprintf(stderr, "pmsp-gpu-sampling: %s (line %d): %s\n", call, line, cudaGetErrorString(status));
  std::exit(1);
}
#define CUDA_CHECK(call) ::sampling::check((call), #call, __LINE__)

template <class T>
struct DeviceDelete {
  void operator()(T* p) const { cudaFree(p); }
};
template <class T>
using DeviceArray = std::unique_ptr<T[], DeviceDelete<T>>;
template <class T>
DeviceArray<T> device_array(std::size_t count) {
  T* p = nullptr;
  CUDA_CHECK(cudaMalloc(&p, count * sizeof(T)));
  return DeviceArray<T>(p);
}

constexpr int kWaves = 24;
constexpr int kApron = 24;  ///< texels that a face of the strip extends beyond its borders

/// f(d) = 128 + sum of amplitude * cos(wave . d + phase), gray levels.
struct Picture {
  float wave[kWaves][3];
  float phase[kWaves];
  float amplitude;
  Rigid from_scene;  ///< the camera's orientation; all of the scene is at infinity
};

template <class F>
__host__ __device__ F gray_of(const Picture& picture, const Vec3<F>& direction) {
  const Vec3<F> d = pmsp::kernels::rotate_back(picture.from_scene, pmsp::kernels::normalized(direction));
  F sum(0);
  for (int k = 0; k < kWaves; ++k) {
    const float* w = picture.wave[k];
    sum += ::cos(F(w[0]) * d.x + F(w[1]) * d.y + F(w[2]) * d.z + F(picture.phase[k]));
  }
  return F(128) + F(picture.amplitude) * sum;
}

/// What the kernels see of a panorama.
struct Image {
  cudaTextureObject_t equirect;  ///< u8, normalised coordinates, wraps in longitude
  cudaTextureObject_t cube8, cube16;
  cudaTextureObject_t octahedral;  ///< u8, one texel of border
  cudaTextureObject_t layered;     ///< u8, a layer a face, kApron texels of border
  cudaTextureObject_t strip;       ///< u8, the faces below one another, kApron texels of border
  const std::uint32_t* quads;      ///< of the strip: 2 x 2 texels from (i, j) on, as in kernels/cube.h
  float half_size;                 ///< of a face [texels]
  float tile;                      ///< side of a face with its borders [texels]
  std::int32_t pitch;              ///< the same
  float octahedral_half;           ///< half side of the octahedral map without border [texels]
};

// Direction of a texel centre in each form.

struct EquirectMap {
  int width, height;
  __host__ __device__ Vec3<float> direction(int i, int j, int) const {
    const float longitude = static_cast<float>(kPi) * (2.0F * (static_cast<float>(i) + 0.5F) / width - 1.0F);
    const float down = static_cast<float>(kPi) * ((static_cast<float>(j) + 0.5F) / height - 0.5F);
    return {::cosf(down) * ::sinf(longitude), ::sinf(down), ::cosf(down) * ::cosf(longitude)};
  }
};

/// Faces of kernels/cube.h with texels at cell centres.
struct StripMap {
  int size, apron;
  __host__ __device__ Vec3<float> direction(int i, int j, int face) const {
    const float a = 2.0F * (static_cast<float>(i - apron) + 0.5F) / size - 1.0F;
    const float b = 2.0F * (static_cast<float>(j - apron) + 0.5F) / size - 1.0F;
    const float lead = (face & 1) != 0 ? -1.0F : 1.0F;
    if (face < 2) return {lead, a, b};
    if (face < 4) return {a, lead, b};
    return {a, b, lead};
  }
};

/// Faces as the hardware addresses them.
struct HardwareCubeMap {
  int size;
  __host__ __device__ Vec3<float> direction(int i, int j, int face) const {
    return pmsp::kernels::texture_direction(face, i, j, size);
  }
};

/// Octahedral map around the y axis.
struct OctahedralMap {
  int size;
  __host__ __device__ Vec3<float> direction(int i, int j, int) const {
    float a = 2.0F * (static_cast<float>(i - 1) + 0.5F) / size - 1.0F;
    float b = 2.0F * (static_cast<float>(j - 1) + 0.5F) / size - 1.0F;
    if (::fabsf(a) > 1.0F) {
      a = ::copysignf(2.0F, a) - a;
      b = -b;
    }
    if (::fabsf(b) > 1.0F) {
      b = ::copysignf(2.0F, b) - b;
      a = -a;
    }
    const float y = 1.0F - ::fabsf(a) - ::fabsf(b);
    if (y >= 0.0F) return {a, y, b};
    return {::copysignf(1.0F - ::fabsf(b), a), y, ::copysignf(1.0F - ::fabsf(a), b)};
  }
};

template <class T>
__device__ T texel_of(float gray);
template <>
__device__ inline std::uint8_t texel_of(float gray) {
  return static_cast<std::uint8_t>(__float2int_rn(fminf(fmaxf(gray, 0.0F), 255.0F)));
}
template <>
__device__ inline std::uint16_t texel_of(float gray) {
  return static_cast<std::uint16_t>(__float2int_rn(fminf(fmaxf(gray, 0.0F), 255.0F) * 257.0F));
}
template <>
__device__ inline __half texel_of(float gray) {
  return __float2half(gray);
}
template <>
__device__ inline float texel_of(float gray) {
  return gray;
}

template <class T, class Map>
__global__ void fill(T* out, Map map, int width, int height, const __grid_constant__ Picture picture) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int j = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  const int face = static_cast<int>(blockIdx.z);
  if (i >= width || j >= height) return;
  out[(static_cast<std::size_t>(face) * height + j) * width + i] =
      texel_of<T>(gray_of(picture, map.direction(i, j, face)));
}

template <class T, class Map>
DeviceArray<T> filled(const Map& map, int width, int height, int faces, const Picture& picture) {
  DeviceArray<T> texels = device_array<T>(static_cast<std::size_t>(width) * height * faces);
  const dim3 block(32, 8);
  const dim3 grid((width + 31) / 32, (height + 7) / 8, faces);
  fill<T><<<grid, block>>>(texels.get(), map, width, height, picture);
  CUDA_CHECK(cudaGetLastError());
  return texels;
}

template <class T>  // a template so that the header may be included anywhere
__global__ void pack_quads(const T* texels, std::uint32_t* quads, int width, int height) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int j = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  if (i >= width || j >= height) return;
  const int right = min(i + 1, width - 1);
  const int below = min(j + 1, height - 1);
  const auto at = [&](int x, int y) {
    return static_cast<std::uint32_t>(texels[static_cast<std::size_t>(y) * width + x]);
  };
  quads[static_cast<std::size_t>(j) * width + i] =
      at(i, j) | at(right, j) << 8 | at(i, below) << 16 | at(right, below) << 24;
}

template <class T>
cudaChannelFormatDesc channels_of() {
  return cudaCreateChannelDesc<T>();
}
template <>
inline cudaChannelFormatDesc channels_of<__half>() {
  return cudaCreateChannelDescHalf();
}

/// A texture and the array behind it.
class Texture {
 public:
  Texture() = default;
  Texture(const Texture&) = delete;
  Texture& operator=(const Texture&) = delete;
  ~Texture() {
    if (object_ != 0) cudaDestroyTextureObject(object_);
    if (array_ != nullptr) cudaFreeArray(array_);
  }

  /// depth 0: plain 2-D; `flags` as for cudaMalloc3DArray. Linear filter; integers are read as 0 to 1.
  template <class T>
  void create(const T* texels, int width, int height, int depth, unsigned flags, bool wrap, bool normalized) {
    const cudaChannelFormatDesc format = channels_of<T>();
    CUDA_CHECK(cudaMalloc3DArray(&array_, &format, make_cudaExtent(width, height, depth), flags));
    cudaMemcpy3DParms copy{};
    copy.srcPtr = make_cudaPitchedPtr(const_cast<T*>(texels), width * sizeof(T), width, height);
    copy.dstArray = array_;
    copy.extent = make_cudaExtent(width, height, depth == 0 ? 1 : depth);
    copy.kind = cudaMemcpyDeviceToDevice;
    CUDA_CHECK(cudaMemcpy3D(&copy));
    cudaResourceDesc resource{};
    resource.resType = cudaResourceTypeArray;
    resource.res.array.array = array_;
    cudaTextureDesc texture{};
    texture.addressMode[0] = wrap ? cudaAddressModeWrap : cudaAddressModeClamp;
    texture.addressMode[1] = cudaAddressModeClamp;
    texture.addressMode[2] = cudaAddressModeClamp;
    texture.filterMode = cudaFilterModeLinear;
    texture.readMode = format.f == cudaChannelFormatKindFloat ? cudaReadModeElementType : cudaReadModeNormalizedFloat;
    texture.normalizedCoords = normalized ? 1 : 0;
    texture.seamlessCubemap = (flags & cudaArrayCubemap) != 0 ? 1 : 0;
    CUDA_CHECK(cudaCreateTextureObject(&object_, &resource, &texture, nullptr));
  }
  cudaTextureObject_t get() const { return object_; }

 private:
  cudaArray_t array_ = nullptr;
  cudaTextureObject_t object_ = 0;
};

inline int face_size_for(int width) { return 2 * static_cast<int>(std::lround(width / (2.0 * kPi))); }
inline int octahedral_size_for(int width) { return 2 * static_cast<int>(std::lround(face_size_for(width) * 1.2247)); }

/// All forms of one panorama, on the device.
class Panorama {
 public:
  Panorama(int width, int height, const Picture& picture) {
    const int size = face_size_for(width);
    const int side = size + 2 * kApron;
    const int octahedral = octahedral_size_for(width);
    const auto equirect = filled<std::uint8_t>(EquirectMap{width, height}, width, height, 1, picture);
    equirect_.create(equirect.get(), width, height, 0, 0, true, true);
    const auto cube8 = filled<std::uint8_t>(HardwareCubeMap{size}, size, size, 6, picture);
    cube8_.create(cube8.get(), size, size, 6, cudaArrayCubemap, false, true);
    const auto cube16 = filled<std::uint16_t>(HardwareCubeMap{size}, size, size, 6, picture);
    cube16_.create(cube16.get(), size, size, 6, cudaArrayCubemap, false, true);
    const auto oct = filled<std::uint8_t>(OctahedralMap{octahedral}, octahedral + 2, octahedral + 2, 1, picture);
    octahedral_.create(oct.get(), octahedral + 2, octahedral + 2, 0, 0, false, false);
    const auto strip = filled<std::uint8_t>(StripMap{size, kApron}, side, side, 6, picture);
    layered_.create(strip.get(), side, side, 6, cudaArrayLayered, false, false);
    strip_.create(strip.get(), side, 6 * side, 0, cudaArrayTextureGather, false, false);
    quads_ = device_array<std::uint32_t>(static_cast<std::size_t>(side) * side * 6);
    pack_quads<<<dim3((side + 31) / 32, (6 * side + 7) / 8), dim3(32, 8)>>>(strip.get(), quads_.get(), side, 6 * side);
    CUDA_CHECK(cudaGetLastError());
    CUDA_CHECK(cudaDeviceSynchronize());
    image_ = {equirect_.get(),
              cube8_.get(),
              cube16_.get(),
              octahedral_.get(),
              layered_.get(),
              strip_.get(),
              quads_.get(),
              0.5F * static_cast<float>(size),
              static_cast<float>(side),
              side,
              0.5F * static_cast<float>(octahedral)};
  }
  const Image& image() const { return image_; }

 private:
  Texture equirect_, cube8_, cube16_, octahedral_, layered_, strip_;
  DeviceArray<std::uint32_t> quads_;
  Image image_{};
};

}  // namespace sampling
