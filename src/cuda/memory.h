// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <utility>
#include <vector>

// Owners of CUDA resources. They throw DeviceError, with the call and its line, if a call fails; destructors ignore
// errors, since the original failure has been thrown.
namespace pmsp::cuda {

/// Throws DeviceError unless `result` is cudaSuccess.
void check(cudaError_t result, const char* call, const char* file, int line);
#define PMSP_CUDA_CHECK(call) ::pmsp::cuda::check((call), #call, __FILE__, __LINE__)

/// Makes a device the thread's current one during its lifetime.
class DeviceScope {
 public:
  explicit DeviceScope(int device);
  ~DeviceScope();
  DeviceScope(const DeviceScope&) = delete;
  DeviceScope& operator=(const DeviceScope&) = delete;

 private:
  int before_ = 0;
};

/// To be declared first: from `enter` on, its device is current during destruction of the members declared after it.
class LastScope {
 public:
  explicit LastScope(int device) : device_(device) {}
  ~LastScope();
  LastScope(const LastScope&) = delete;
  LastScope& operator=(const LastScope&) = delete;
  void enter() noexcept;

 private:
  int device_;
  int before_ = -1;  ///< not entered
};

class Stream {
 public:
  Stream();
  ~Stream();
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;
  cudaStream_t get() const { return stream_; }

 private:
  cudaStream_t stream_ = nullptr;
};

class Event {
 public:
  Event();
  ~Event();
  Event(const Event&) = delete;
  Event& operator=(const Event&) = delete;
  cudaEvent_t get() const { return event_; }
  void record(const Stream& stream);
  bool is_complete() const;                  ///< also true if nothing was recorded
  void wait() const;                         ///< on the host; returns at once if nothing was recorded
  void wait_on(const Stream& stream) const;  ///< makes the stream wait
  double seconds_since(const Event& start) const;

 private:
  cudaEvent_t event_ = nullptr;
};

/// Uninitialised memory of one kind.
template <class T, class Memory>
class Owned {
 public:
  Owned() = default;
  explicit Owned(std::size_t size) : data_(static_cast<T*>(Memory::allocate(size * sizeof(T)))), size_(size) {}
  ~Owned() { Memory::free(data_); }
  Owned(Owned&& other) noexcept : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)) {}
  Owned& operator=(Owned&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    return *this;
  }
  T* get() const { return data_; }
  T& operator[](std::size_t i) const { return data_[i]; }  ///< if the host can read it
  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }

 private:
  T* data_ = nullptr;
  std::size_t size_ = 0;
};

struct DeviceMemory {
  static void* allocate(std::size_t bytes);
  static void free(void* data) { cudaFree(data); }
};

/// Page-locked host memory, for copies without the CPU.
struct PinnedMemory {
  static void* allocate(std::size_t bytes);
  static void free(void* data) { cudaFreeHost(data); }
};

template <class T>
using DeviceArray = Owned<T, DeviceMemory>;
template <class T>
using PinnedArray = Owned<T, PinnedMemory>;

/// Page-locks memory of another owner during its lifetime.
class PinnedRange {
 public:
  PinnedRange(void* data, std::size_t bytes);
  ~PinnedRange() { reset(); }
  PinnedRange(const PinnedRange&) = delete;
  PinnedRange& operator=(const PinnedRange&) = delete;

 private:
  void reset();
  void* data_ = nullptr;
};

/// Cube map in texture memory with seamless filtering, and the surface for writing.
class CubeTexture {
 public:
  /// Faces of `size` x `size` texels of `bits` bits (8 or 16), read as numbers from 0 to 1.
  CubeTexture(int size, int bits);
  ~CubeTexture();
  CubeTexture(const CubeTexture&) = delete;
  CubeTexture& operator=(const CubeTexture&) = delete;
  cudaTextureObject_t texture() const { return texture_; }
  cudaSurfaceObject_t surface() const { return surface_; }
  int side() const { return static_cast<int>(side_); }
  std::size_t texels() const { return 6 * side_ * side_; }

  /// Copies all texels, row by row and face by face, to or from other device memory.
  void copy_to(void* data, const Stream& stream) const;
  void copy_from(const void* data, const Stream& stream);

 private:
  std::size_t side_;
  std::size_t texel_bytes_;
  cudaArray_t array_ = nullptr;
  cudaTextureObject_t texture_ = 0;
  cudaSurfaceObject_t surface_ = 0;
};

class CopyPool;

/// Pool of device memory. A new user may overwrite it at once, since all users work on one stream. The pool must
/// outlive its blocks.
class DevicePool {
 public:
  DevicePool() = default;
  ~DevicePool() { release(); }
  DevicePool(const DevicePool&) = delete;
  DevicePool& operator=(const DevicePool&) = delete;

  /// Uninitialised.
  template <class T>
  std::shared_ptr<T[]> get(std::size_t count) {
    const std::size_t bytes = count * sizeof(T);
    return {static_cast<T*>(take(bytes)), [this, bytes](T* returned) { free_[bytes].push_back(returned); }};
  }

 private:
  friend class CopyPool;
  void* take(std::size_t bytes);
  void* allocate(std::size_t bytes);
  void release();  ///< frees idle blocks

  std::map<std::size_t, std::vector<void*>> free_;  ///< by size
  CopyPool* copies_ = nullptr;                      ///< whose idle blocks may be freed, too
};

/// Pool of device memory for copies on a separate stream, beside kernels: a copy waits for the kernels that read the
/// memory which it overwrites. The pool must outlive its blocks, and the streams and the other pool must outlive it.
class CopyPool {
 public:
  CopyPool(const Stream& copies, const Stream& compute, DevicePool& other);
  ~CopyPool();
  CopyPool(const CopyPool&) = delete;
  CopyPool& operator=(const CopyPool&) = delete;

  /// Uninitialised, to be filled on the stream of the copies.
  template <class T>
  std::shared_ptr<T[]> get(std::size_t count) {
    const std::size_t bytes = count * sizeof(T);
    const Block block = take(bytes);
    return {static_cast<T*>(block.data), [this, bytes, block](T* /*data*/) { give_back(bytes, block); }};
  }

 private:
  friend class DevicePool;
  struct Block {
    void* data;
    std::shared_ptr<Event> read;  ///< recorded after all kernels that were queued when the block was returned
  };

  Block take(std::size_t bytes);
  void give_back(std::size_t bytes, Block block);
  void release();  ///< frees idle blocks

  const Stream& copies_;
  const Stream& compute_;
  DevicePool& other_;
  std::map<std::size_t, std::deque<Block>> free_;  ///< by size, longest idle first
};

/// Pool of reusable objects. A new user may overwrite an object at once, since all users work on one stream; events,
/// too, since waits that are queued already refer to the previous record. The pool must outlive its objects.
template <class T>
class Pool {
 public:
  template <class... Args>
  std::shared_ptr<T> get(Args&&... args) {
    if (free_.empty()) free_.push_back(std::make_unique<T>(std::forward<Args>(args)...));
    std::unique_ptr<T> object = std::move(free_.back());
    free_.pop_back();
    return {object.release(), [this](T* returned) { free_.emplace_back(returned); }};
  }

 private:
  std::vector<std::unique_ptr<T>> free_;
};

}  // namespace pmsp::cuda
