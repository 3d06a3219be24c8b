// SPDX-License-Identifier: BSD-2-Clause
#include "cuda/transfers.h"

#include <algorithm>
#include <cstring>
#include <utility>
#include <vector>

#include "pmsp/error.h"
#include "sphere/area_resize.h"
#include "sphere/grid.h"

namespace pmsp::cuda {
namespace {

/// Queues a copy on the stream of the kernels that read it: cudaMemcpy may return before the data have arrived, and
/// other streams would not wait. The source must stay valid until the stream has completed the copy.
template <class T>
void copy_up(T* to, const T* from, std::size_t count, const Stream& stream) {
  PMSP_CUDA_CHECK(cudaMemcpyAsync(to, from, count * sizeof(T), cudaMemcpyHostToDevice, stream.get()));
}

/// `pinned`: memory of `to`. Grows to twice `count`, since the host waits for all devices to replace page-locked
/// memory. If page-locking fails, the copy is slower.
template <class T, class From>
void copy_down(std::vector<T>& to, const From* from, std::size_t count, std::optional<PinnedRange>& pinned,
               const Stream& stream) {
  static_assert(sizeof(T) == sizeof(From), "copied as it is");
  if (to.capacity() < count) {
    pinned.reset();
    to = std::vector<T>();
    to.reserve(2 * count);
    try {
      pinned.emplace(to.data(), to.capacity() * sizeof(T));
    } catch (const DeviceError&) {
      cudaGetLastError();  // clears the error
    }
  }
  to.resize(count);
  if (count == 0) return;
  PMSP_CUDA_CHECK(cudaMemcpyAsync(to.data(), from, count * sizeof(T), cudaMemcpyDeviceToHost, stream.get()));
}

/// Map without depths.
template <class Map>
Map blank(int width, int height);

template <>
DepthMap blank(int width, int height) {
  DepthMap map;
  map.depth = Image<float>(width, height, 0.0F);
  map.normal = Image<Eigen::Vector3f>(width, height, Eigen::Vector3f::Zero());
  map.confidence = Image<float>(width, height, 0.0F);
  return map;
}

template <>
PlaneMap blank(int width, int height) {
  return {width, height};
}

using Numbers = std::pair<float*, std::size_t>;

std::vector<Numbers> images_of(DepthMap& map) {
  return {{map.depth.pixels().data(), map.depth.size()},
          {map.normal.pixels().data()->data(), 3 * map.normal.size()},
          {map.confidence.pixels().data(), map.confidence.size()}};
}

std::vector<Numbers> images_of(PlaneMap& map) {
  std::vector<Numbers> images;
  for (Image<float>* const image : {&map.x, &map.y, &map.z, &map.score}) {
    images.emplace_back(image->pixels().data(), image->size());
  }
  return images;
}

}  // namespace

DeviceGrid::DeviceGrid(int width, int height, const Stream& stream) {
  const SphereGrid grid(width, height);
  const kernels::GridView host = grid.view();
  const std::size_t columns = static_cast<std::size_t>(width);
  const std::size_t rows = static_cast<std::size_t>(height);
  tables_ = DeviceArray<float>(2 * (columns + rows));
  float* const sin_lon = tables_.get();
  float* const cos_lon = sin_lon + columns;
  float* const sin_lat = cos_lon + columns;
  float* const cos_lat = sin_lat + rows;
  copy_up(sin_lon, host.sin_lon, columns, stream);
  copy_up(cos_lon, host.cos_lon, columns, stream);
  copy_up(sin_lat, host.sin_lat, rows, stream);
  copy_up(cos_lat, host.cos_lat, rows, stream);
  PMSP_CUDA_CHECK(cudaStreamSynchronize(stream.get()));
  view_ = {width, height, sin_lon, cos_lon, sin_lat, cos_lat};
}

DeviceSpanTable::DeviceSpanTable(int source, int target, const Stream& stream) {
  const std::vector<ResampleSpan> spans = resample_spans(source, target);
  std::size_t count = 0;
  for (const ResampleSpan& span : spans) count = std::max(count, span.weights.size());
  std::vector<int> first;
  std::vector<float> weights(spans.size() * count, 0.0F);
  for (std::size_t i = 0; i < spans.size(); ++i) {
    first.push_back(spans[i].first);
    std::copy(spans[i].weights.begin(), spans[i].weights.end(), &weights[i * count]);
  }
  first_ = DeviceArray<int>(first.size());
  weights_ = DeviceArray<float>(weights.size());
  copy_up(first_.get(), first.data(), first.size(), stream);
  copy_up(weights_.get(), weights.data(), weights.size(), stream);
  PMSP_CUDA_CHECK(cudaStreamSynchronize(stream.get()));
  view_ = {first_.get(), weights_.get(), static_cast<int>(count)};
}

const unsigned char* Uploader::upload(const void* data, std::size_t row_bytes, std::size_t row_pitch, int rows,
                                      const Stream& copies, const Stream& compute, ThreadPool& pool) {
  current_ = 1 - current_;
  Slot& slot = slots_[current_];
  const std::size_t bytes = row_bytes * static_cast<std::size_t>(rows);
  slot.arrived.wait();
  if (slot.host.size() < bytes) {
    slot.consumed.wait();
    slot.host = PinnedArray<unsigned char>(bytes);
    slot.device = DeviceArray<unsigned char>(bytes);
  }
  constexpr int kRowsPerTask = 64;
  pool.for_each((rows + kRowsPerTask - 1) / kRowsPerTask, [&](int task) {
    for (int y = task * kRowsPerTask; y < std::min(rows, (task + 1) * kRowsPerTask); ++y) {
      const std::size_t row = static_cast<std::size_t>(y);
      std::memcpy(slot.host.get() + row * row_bytes, static_cast<const unsigned char*>(data) + row * row_pitch,
                  row_bytes);
    }
  });
  slot.consumed.wait_on(copies);
  PMSP_CUDA_CHECK(cudaMemcpyAsync(slot.device.get(), slot.host.get(), bytes, cudaMemcpyHostToDevice, copies.get()));
  slot.arrived.record(copies);
  slot.arrived.wait_on(compute);
  return slot.device.get();
}

const KeyframeCloud& CloudDownload::fetch(KeyframeCloud head, const DevicePoint* points, const unsigned int* pixels,
                                          const std::uint32_t* agree, std::size_t count, const Stream& copies) {
  head.points.swap(cloud_.points);
  head.pixels.swap(cloud_.pixels);
  head.agree.swap(cloud_.agree);
  cloud_ = std::move(head);
  copy_down(cloud_.points, points, count, pinned_[0], copies);
  copy_down(cloud_.pixels, pixels, count, pinned_[1], copies);
  copy_down(cloud_.agree, agree, count, pinned_[2], copies);
  arrived_.record(copies);
  arrived_.wait();
  return cloud_;
}

template <class Map>
MapDownload<Map>::MapDownload(int width, int height) : map_(blank<Map>(width, height)) {
  for (const auto& [data, count] : images_of(map_)) parts_.emplace_back(data, count);
}

template <class Map>
void MapDownload<Map>::start(const Stream& compute, const Stream& copies) {
  written_.record(compute);
  written_.wait_on(copies);
  for (const Part& part : parts_) {
    PMSP_CUDA_CHECK(cudaMemcpyAsync(part.host, part.device.get(), part.device.size() * sizeof(float),
                                    cudaMemcpyDeviceToHost, copies.get()));
  }
  arrived_.record(copies);
}

template <class Map>
const Map& MapDownload<Map>::finish(std::int64_t id, const KeyframePose& pose) {
  arrived_.wait();
  map_.keyframe_id = id;
  map_.cam_from_world = pose.cam_from_world;
  map_.scale = pose.scale;
  return map_;
}

template class MapDownload<DepthMap>;
template class MapDownload<PlaneMap>;

}  // namespace pmsp::cuda
