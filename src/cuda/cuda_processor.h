// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "cuda/launch.h"
#include "cuda/memory.h"
#include "cuda/transfers.h"
#include "engine.h"
#include "processor.h"
#include "sphere/cube_map.h"
#include "util/scratch_file.h"

namespace pmsp::cuda {

/// FIFO of results in flight on all devices of an engine, delivered in submission order.
class ResultQueue {
 public:
  explicit ResultQueue(const EngineContext& context) : context_(context) {}

  /// `emit`: waits for its result and delivers it.
  void push(int device, std::function<void()> emit) { pending_.push_back({device, std::move(emit), round_}); }
  void emit_first();
  std::size_t size() const { return pending_.size(); }
  void deliver(bool all);

 private:
  struct Pending {
    int device;
    std::function<void()> emit;
    std::int64_t round;  ///< call of Densifier::add or flush that submitted it
  };

  const EngineContext& context_;
  std::deque<Pending> pending_;
  std::int64_t round_ = 0;
};

/// CUDA device (see processor.h). All work is queued on one stream in the order of the calls; only copies run beside
/// it, and the stream waits for those that its kernels read. Memory returned to its pool may therefore be used again at
/// once; CopyPool ensures this for copies from other devices. Callbacks for completed work are called in the same
/// order, by `deliver` or earlier.
class CudaProcessor {
 public:
  using ViewTypes = DeviceViewTypes;
  using Keys = DeviceKeys;
  using Planes = Array<float4>;
  using Counts = cuda::Counts;
  using Color = uchar4;  ///< w = 255 for unmasked pixels, else 0
  struct Cubes {
    std::shared_ptr<CubeTexture> gray, matchable;
  };
  struct Prepared {
    Cubes cubes;
    Array<Color> color;
    Array<std::uint8_t> mask;  ///< unused: the mask is in `color`
  };
  static constexpr int kThreadsPerPriorCell = 16;
  static constexpr bool kMaskInColor = true;

  using ReadyEvent = std::shared_ptr<Event>;
  using Queue = ResultQueue;

  static int number_of(const EngineContext& context) { return static_cast<int>(context.options.devices.size()); }
  CudaProcessor(const EngineContext& context, const Executor& executor, int number, Queue& queue);
  ~CudaProcessor();
  CudaProcessor(const CudaProcessor&) = delete;
  CudaProcessor& operator=(const CudaProcessor&) = delete;

  std::size_t number() const { return number_; }
  ReadyEvent mark();  ///< nullptr with a single device
  template <class T>
  Array<T> copy_from(const Array<T>& from, std::size_t count, const CudaProcessor& home, const ReadyEvent& made) {
    const Array<T> copy = copies_.get<T>(count);
    copy_bytes_from_peer(copy.get(), {from, from.get()}, count * sizeof(T), home, made);
    return copy;
  }
  void synchronize();

  DeviceScope enter() const { return DeviceScope(device_number_); }
  void set_size(int width, int height);
  bool limit_results_in_flight();
  const kernels::GridView& grid() const { return grid_->view(); }

  template <class T>
  Array<T> array(std::size_t count) {
    return memory_.get<T>(count);
  }
  Planes planes() { return array<float4>(plane_numbers()); }
  std::size_t plane_numbers() const { return pixels(); }
  Array<std::uint64_t> keys();
  DevicePlanes map(const Planes& planes) const { return {planes.get(), grid().width, grid().height}; }
  DevicePlaneArray to(const Planes& planes) const { return {planes.get()}; }
  template <class T>
  Array<T> upload(const std::vector<T>& values) {
    const Array<T> copy = array<T>(values.size());
    copy_bytes(copy.get(), values.data(), values.size() * sizeof(T), cudaMemcpyHostToDevice);
    return copy;
  }

  Prepared prepare(const Keyframe& keyframe, double& seconds);
  TextureCube gray(const Cubes& cubes) const { return {cubes.gray->texture()}; }
  TextureCube matchable(const Cubes& cubes) const { return {cubes.matchable ? cubes.matchable->texture() : 0}; }
  std::size_t bytes(const Cubes& cubes) const { return cubes.gray ? 2 * packing(cubes).count : 0; }
  CubePacking packing(const Cubes& cubes) const;
  Array<std::uint16_t> pack(const Cubes& cubes);
  Cubes unpack(const Array<std::uint16_t>& packed, const CubePacking& packing);
  const std::uint32_t* color(const Array<Color>& color) const {
    return reinterpret_cast<const std::uint32_t*>(color.get());
  }
  ColorMask mask(const Array<Color>& color, const Array<std::uint8_t>& /*mask*/) const { return {color.get()}; }

  std::pair<Array<kernels::SparsePoint>, int> landmarks(const Keyframe& keyframe, double lens);
  /// No conversion: kernels read planes by their keys.
  template <class Source>
  Source planes_of_keys(const Source& source, Planes& /*planes*/) const {
    return source;
  }

  template <class Stage>
  void launch(const Stage& stage, Counts* counts) const {
    cuda::launch(stage, counts, compute_.get());
  }
  void splat(const kernels::SplatLandmarks<Keys>& splat, int count) const {
    splat_landmarks(splat, count, compute_.get());
  }
  void start(const PatchMatchPass& pass) const { start_pixels(pass, compute_.get()); }
  void iterate(const PatchMatchPass& pass, int colour, int iteration, bool rescore) const {
    iterate_pixels(pass, colour, iteration, rescore, compute_.get());
  }
  void remove_duplicates(const kernels::DuplicateRound& round, DuplicateCandidates& candidates) {
    const bool first = candidates.count == 0;
    if (first) candidates = {array<std::uint32_t>(pixels()), pixels()};
    cuda::remove_duplicates({round, candidates.bits.get(), first}, compute_.get());
  }

  template <class Work>
  void timed(double& seconds, const Work& work) {
    const std::shared_ptr<Record> record = records_.get();
    record->start.record(compute_);
    work();
    record->end.record(compute_);
    enqueue_result([record, &seconds] { seconds += record->waited(); });
  }
  template <class Work>
  void counted(double& seconds, const Work& work, std::function<void(const std::int64_t*)> then) {
    const std::shared_ptr<Record> record = records_.get();
    PMSP_CUDA_CHECK(cudaMemsetAsync(record->device.get(), 0, sizeof(Counts), compute_.get()));
    record->start.record(compute_);
    work(record->device.get());
    PMSP_CUDA_CHECK(cudaMemcpyAsync(record->host.get(), record->device.get(), sizeof(Counts), cudaMemcpyDeviceToHost,
                                    compute_.get()));
    record->end.record(compute_);
    enqueue_result([record, &seconds, then = std::move(then)] {
      seconds += record->waited();
      std::int64_t numbers[Counts::kMost];
      for (int i = 0; i < Counts::kMost; ++i) numbers[i] = record->host[0].of[i];
      then(numbers);
    });
  }

  void emit_depths(std::int64_t id, const KeyframePose& pose, const DevicePlanes& map, const float* confidence,
                   std::function<void(const DepthMap&)> to);
  void emit_points(const kernels::ConstSurfelArrays& map, KeyframeCloud cloud, double& seconds,
                   std::function<void(const KeyframeCloud&)> to);
  void emit_planes(std::int64_t id, const KeyframePose& pose, const Planes& planes,
                   std::function<void(const PlaneMap&)> to);
  Planes planes_of(const PlaneMap& map);

  template <class T>
  void save(const Array<T>& array, std::size_t count, ScratchFile& scratch, std::uint64_t at) {
    host_.resize(count * sizeof(T));
    copy_bytes(host_.data(), array.get(), host_.size(), cudaMemcpyDeviceToHost);
    scratch.write(at, host_.data(), host_.size());
  }
  template <class T>
  Array<T> load(std::size_t count, const ScratchFile& scratch, std::uint64_t at) {
    const Array<T> copy = array<T>(count);
    host_.resize(count * sizeof(T));
    scratch.read(at, host_.data(), host_.size());
    copy_bytes(copy.get(), host_.data(), host_.size(), cudaMemcpyHostToDevice);
    return copy;
  }

 private:
  /// Duration and counts of work, with their transfer to the host.
  struct Record {
    DeviceArray<Counts> device = DeviceArray<Counts>(1);
    PinnedArray<Counts> host = PinnedArray<Counts>(1);
    Event start, end;

    double waited() const {
      end.wait();
      return end.seconds_since(start);
    }
  };
  /// Points and their keys, for transfer to the host.
  struct PointsDownload {
    explicit PointsDownload(std::size_t size) : points(size), pixels(size), agree(size) {}

    DeviceArray<DevicePoint> points;
    DeviceArray<unsigned int> pixels;
    DeviceArray<std::uint32_t> agree;
  };
  template <class Map>
  using Downloads = std::vector<std::unique_ptr<MapDownload<Map>>>;

  void set_image_size(int width, int height);
  std::shared_ptr<CubeTexture> gray_cube(int size);
  void enqueue_result(std::function<void()> emit) { queue_.push(device_number_, std::move(emit)); }
  void copy_bytes_from_peer(void* to, std::shared_ptr<const void> from, std::size_t bytes, const CudaProcessor& home,
                            const ReadyEvent& made);
  template <class Map>
  MapDownload<Map>& free_one(Downloads<Map>& downloads);
  template <class Map>
  void emit(MapDownload<Map>& download, std::int64_t id, const KeyframePose& pose, std::function<void(const Map&)> to);
  /// Copies after all queued work; blocks.
  void copy_bytes(void* to, const void* from, std::size_t bytes, cudaMemcpyKind kind) const;
  bool cancelled() const { return context_.cancel.load(std::memory_order_relaxed); }
  std::size_t pixels() const {
    return static_cast<std::size_t>(grid().width) * static_cast<std::size_t>(grid().height);
  }

  const EngineContext& context_;
  const Executor& executor_;
  Queue& queue_;
  std::size_t number_;
  int device_number_;
  std::optional<DeviceScope> making_;  ///< current during construction of the following members
  LastScope device_;                   ///< declared before all members on the device
  Stream compute_, up_, down_;
  Stream peer_copies_;  ///< from other devices
  DevicePool memory_;
  CopyPool copies_{peer_copies_, compute_, memory_};
  int image_width_ = 0;
  int image_height_ = 0;
  ImageSize matching_{};  ///< size at which images of that size are matched
  Uploader images_, masks_;
  DeviceArray<float> gray_, equalized_;
  DeviceArray<unsigned char> eroded_;
  PinnedArray<kernels::SparsePoint> points_host_;
  Event points_arrived_;
  std::optional<DeviceGrid> grid_;
  std::optional<DeviceSpanTable> columns_, rows_;            ///< from the images' size to that of the depth maps,
  std::optional<DeviceSpanTable> gray_columns_, gray_rows_;  ///< and to that for matching
  std::map<int, Pool<CubeTexture>> grays_;                   ///< by size
  Pool<CubeTexture> matchables_;
  Pool<PointsDownload> clouds_;
  DeviceArray<unsigned char> select_scratch_;
  Pool<Record> records_;
  Downloads<DepthMap> depths_;
  Downloads<PlaneMap> planes_;
  Pool<Event> marks_;
  /// Arrays of other devices, until they are copied.
  std::deque<std::pair<std::shared_ptr<Event>, std::shared_ptr<const void>>> borrowed_;
  std::vector<unsigned char> host_;  ///< buffer for transfers to and from scratch files
  CloudDownload cloud_;              ///< last delivered
  std::size_t clouds_out_ = 0;
};

}  // namespace pmsp::cuda
