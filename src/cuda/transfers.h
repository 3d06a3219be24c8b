// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

#include "cuda/launch.h"
#include "cuda/memory.h"
#include "pmsp/stages.h"
#include "pmsp/types.h"
#include "util/thread_pool.h"

// Data in device memory for a whole sequence, and transfers between host and device. `stream`: of the kernels that read
// them.
namespace pmsp::cuda {

/// Tables of a SphereGrid.
class DeviceGrid {
 public:
  DeviceGrid(int width, int height, const Stream& stream);
  const kernels::GridView& view() const { return view_; }

 private:
  DeviceArray<float> tables_;
  kernels::GridView view_{};
};

/// Resampling weights along one axis.
class DeviceSpanTable {
 public:
  DeviceSpanTable(int source, int target, const Stream& stream);
  const DeviceSpans& view() const { return view_; }

 private:
  DeviceArray<int> first_;
  DeviceArray<float> weights_;
  DeviceSpans view_{};
};

/// Uploads of images through page-locked memory. While the device works on one, the next can arrive.
class Uploader {
 public:
  /// Copies rows into page-locked memory and starts their transfer to the device; `compute` waits for their arrival.
  /// The result is valid until the call after the next; `consumed` must be called when the kernels that read it are
  /// queued.
  const unsigned char* upload(const void* data, std::size_t row_bytes, std::size_t row_pitch, int rows,
                              const Stream& copies, const Stream& compute, ThreadPool& pool);
  void consumed(const Stream& compute) { slots_[current_].consumed.record(compute); }

 private:
  struct Slot {
    PinnedArray<unsigned char> host;
    DeviceArray<unsigned char> device;
    Event arrived;
    Event consumed;
  };
  Slot slots_[2];
  std::size_t current_ = 0;
};

/// Downloads of clouds, one at a time, directly into page-locked memory, which is used again for the next one.
class CloudDownload {
 public:
  /// `head`: all but the points. Copies the points on `copies`; blocks. The result is valid until the next call.
  const KeyframeCloud& fetch(KeyframeCloud head, const DevicePoint* points, const unsigned int* pixels,
                             const std::uint32_t* agree, std::size_t count, const Stream& copies);

 private:
  KeyframeCloud cloud_;
  std::optional<PinnedRange> pinned_[3];
  Event arrived_;
};

/// Download of a DepthMap or a PlaneMap, directly into page-locked images.
template <class Map>
class MapDownload {
 public:
  MapDownload(int width, int height);
  float* part(std::size_t k) const {
    return parts_[k].device.get();
  }                                                              ///< k-th image of the map, to be written by kernels
  void start(const Stream& compute, const Stream& copies);       ///< after the kernels queued so far
  const Map& finish(std::int64_t id, const KeyframePose& pose);  ///< blocks

  bool busy = false;

 private:
  struct Part {
    Part(float* data, std::size_t count) : host(data), device(count), pinned(data, count * sizeof(float)) {}

    float* host;
    DeviceArray<float> device;
    PinnedRange pinned;
  };

  Map map_;
  std::deque<Part> parts_;
  Event written_, arrived_;
};

}  // namespace pmsp::cuda
