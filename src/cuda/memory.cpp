// SPDX-License-Identifier: BSD-2-Clause
#include "cuda/memory.h"

#include <cstring>
#include <string>

#include "pmsp/error.h"

namespace pmsp::cuda {

void check(cudaError_t result, const char* call, const char* file, int line) {
  if (result == cudaSuccess) return;
  const char* name = std::strrchr(file, '/');
  std::string text = std::string("CUDA: ") + cudaGetErrorString(result) + " (" + call + ", " +
                     (name != nullptr ? name + 1 : file) + ":" + std::to_string(line) + ")";
  if (result == cudaErrorMemoryAllocation) {
    text += "; reduce width or fusion.window, end other programs on the GPU, or use backend cpu";
    cudaGetLastError();  // a failed allocation does not break the device
  }
  throw DeviceError(text);
}

DeviceScope::DeviceScope(int device) {
  PMSP_CUDA_CHECK(cudaGetDevice(&before_));
  PMSP_CUDA_CHECK(cudaSetDevice(device));
  cudaGetLastError();  // ignores errors of earlier, unrelated calls
}
DeviceScope::~DeviceScope() { cudaSetDevice(before_); }

void LastScope::enter() noexcept {
  if (cudaGetDevice(&before_) == cudaSuccess) cudaSetDevice(device_);
}
LastScope::~LastScope() {
  if (before_ >= 0) cudaSetDevice(before_);
}

Stream::Stream() { PMSP_CUDA_CHECK(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking)); }
Stream::~Stream() { cudaStreamDestroy(stream_); }

Event::Event() { PMSP_CUDA_CHECK(cudaEventCreate(&event_)); }
Event::~Event() { cudaEventDestroy(event_); }
void Event::record(const Stream& stream) { PMSP_CUDA_CHECK(cudaEventRecord(event_, stream.get())); }
bool Event::is_complete() const {
  const bool come = cudaEventQuery(event_) == cudaSuccess;
  if (!come) cudaGetLastError();  // clears "not ready", which counts as an error
  return come;
}

void Event::wait() const { PMSP_CUDA_CHECK(cudaEventSynchronize(event_)); }
void Event::wait_on(const Stream& stream) const { PMSP_CUDA_CHECK(cudaStreamWaitEvent(stream.get(), event_, 0)); }
double Event::seconds_since(const Event& start) const {
  float milliseconds = 0.0F;
  PMSP_CUDA_CHECK(cudaEventElapsedTime(&milliseconds, start.event_, event_));
  return 1e-3 * static_cast<double>(milliseconds);
}

void* DeviceMemory::allocate(std::size_t bytes) {
  void* data = nullptr;
  PMSP_CUDA_CHECK(cudaMalloc(&data, bytes));
  return data;
}

void* DevicePool::take(std::size_t bytes) {
  std::vector<void*>& free = free_[bytes];
  if (free.empty()) return allocate(bytes);
  void* const data = free.back();
  free.pop_back();
  return data;
}

void* DevicePool::allocate(std::size_t bytes) {
  void* data = nullptr;
  if (cudaMalloc(&data, bytes) == cudaSuccess) return data;
  cudaGetLastError();  // clears the error
  release();           // idle memory of other sizes may suffice
  if (copies_ != nullptr) copies_->release();
  return DeviceMemory::allocate(bytes);
}

void DevicePool::release() {
  for (auto& [bytes, free] : free_) {
    for (void* data : free) DeviceMemory::free(data);
    free.clear();
  }
}

CopyPool::CopyPool(const Stream& copies, const Stream& compute, DevicePool& other)
    : copies_(copies), compute_(compute), other_(other) {
  other_.copies_ = this;
}

CopyPool::~CopyPool() {
  other_.copies_ = nullptr;
  release();
}

CopyPool::Block CopyPool::take(std::size_t bytes) {
  std::deque<Block>& free = free_[bytes];
  if (free.empty()) {
    auto read = std::make_shared<Event>();
    return {other_.allocate(bytes), std::move(read)};
  }
  Block block = std::move(free.front());
  free.pop_front();
  block.read->wait_on(copies_);
  return block;
}

void CopyPool::give_back(std::size_t bytes, Block block) {
  cudaEventRecord(block.read->get(), compute_.get());
  free_[bytes].push_back(std::move(block));
}

void CopyPool::release() {
  for (auto& [bytes, free] : free_) {
    for (const Block& block : free) DeviceMemory::free(block.data);
    free.clear();
  }
}

void* PinnedMemory::allocate(std::size_t bytes) {
  void* data = nullptr;
  PMSP_CUDA_CHECK(cudaHostAlloc(&data, bytes, cudaHostAllocDefault));
  return data;
}

PinnedRange::PinnedRange(void* data, std::size_t bytes) {
  PMSP_CUDA_CHECK(cudaHostRegister(data, bytes, cudaHostRegisterDefault));
  data_ = data;
}
void PinnedRange::reset() {
  if (data_ != nullptr) cudaHostUnregister(data_);
  data_ = nullptr;
}

CubeTexture::CubeTexture(int size, int bits)
    : side_(static_cast<std::size_t>(size)), texel_bytes_(static_cast<std::size_t>(bits) / 8) {
  const cudaChannelFormatDesc format{bits, 0, 0, 0, cudaChannelFormatKindUnsigned};
  PMSP_CUDA_CHECK(
      cudaMalloc3DArray(&array_, &format, cudaExtent{side_, side_, 6}, cudaArrayCubemap | cudaArraySurfaceLoadStore));
  cudaResourceDesc resource{};
  resource.resType = cudaResourceTypeArray;
  resource.res.array.array = array_;
  cudaTextureDesc texture{};
  for (auto& mode : texture.addressMode) mode = cudaAddressModeClamp;
  texture.filterMode = cudaFilterModeLinear;
  texture.readMode = cudaReadModeNormalizedFloat;
  texture.normalizedCoords = 1;
  texture.seamlessCubemap = 1;
  try {
    PMSP_CUDA_CHECK(cudaCreateTextureObject(&texture_, &resource, &texture, nullptr));
    PMSP_CUDA_CHECK(cudaCreateSurfaceObject(&surface_, &resource));
  } catch (...) {
    if (texture_ != 0) cudaDestroyTextureObject(texture_);
    cudaFreeArray(array_);
    throw;
  }
}

CubeTexture::~CubeTexture() {
  cudaDestroySurfaceObject(surface_);
  cudaDestroyTextureObject(texture_);
  cudaFreeArray(array_);
}

void CubeTexture::copy_to(void* data, const Stream& stream) const {
  cudaMemcpy3DParms copy{};
  copy.srcArray = array_;
  copy.dstPtr = {data, side_ * texel_bytes_, side_, side_};
  copy.extent = {side_, side_, 6};
  copy.kind = cudaMemcpyDeviceToDevice;
  PMSP_CUDA_CHECK(cudaMemcpy3DAsync(&copy, stream.get()));
}

void CubeTexture::copy_from(const void* data, const Stream& stream) {
  cudaMemcpy3DParms copy{};
  copy.srcPtr = {const_cast<void*>(data), side_ * texel_bytes_, side_, side_};
  copy.dstArray = array_;
  copy.extent = {side_, side_, 6};
  copy.kind = cudaMemcpyDeviceToDevice;
  PMSP_CUDA_CHECK(cudaMemcpy3DAsync(&copy, stream.get()));
}

}  // namespace pmsp::cuda
