// SPDX-License-Identifier: BSD-2-Clause
#include "cuda/cuda_processor.h"

#include <algorithm>
#include <cstddef>

#include "init/init_setup.h"
#include "pmsp/types.h"
#include "sphere/cube_map.h"
#include "sphere/panorama_data.h"
#include "util/inside.h"

namespace pmsp::cuda {
namespace {

constexpr int kGrayBits = 16;  ///< of texels, as on the CPU: finer than the camera's, since resampling averages
constexpr int kMatchableBits = 8;
constexpr std::size_t kDownloads = 2;     ///< maximum depth maps, plane maps and clouds in transfer, each
constexpr std::size_t kMostPending = 64;  ///< maximum results in flight per device; bounds the delay of cancellation
/// Initial capacity for a keyframe; for more, the host waits for all devices to replace page-locked memory.
constexpr std::size_t kUsualLandmarks = 8192;

static_assert(sizeof(DevicePoint) == sizeof(CloudPoint) &&
                  offsetof(DevicePoint, normal) == offsetof(CloudPoint, normal) &&
                  offsetof(DevicePoint, color) == offsetof(CloudPoint, color) &&
                  offsetof(DevicePoint, views) == offsetof(CloudPoint, views) &&
                  offsetof(DevicePoint, confidence) == offsetof(CloudPoint, confidence),
              "points are copied as they are");

}  // namespace

CudaProcessor::CudaProcessor(const EngineContext& context, const Executor& executor, int number, Queue& queue)
    : context_(context),
      executor_(executor),
      queue_(queue),
      number_(static_cast<std::size_t>(number)),
      device_number_(context.options.devices[number_]),
      making_(device_number_),
      device_(device_number_) {
  making_.reset();
}

CudaProcessor::~CudaProcessor() {
  device_.enter();
  for (const Stream* stream : {&compute_, &up_, &down_, &peer_copies_}) cudaStreamSynchronize(stream->get());
}

CudaProcessor::ReadyEvent CudaProcessor::mark() {
  if (context_.options.devices.size() < 2) return nullptr;
  const ReadyEvent mark = marks_.get();
  mark->record(compute_);
  return mark;
}

void CudaProcessor::copy_bytes_from_peer(void* to, std::shared_ptr<const void> from, std::size_t bytes,
                                         const CudaProcessor& home, const ReadyEvent& made) {
  while (!borrowed_.empty() && borrowed_.front().first->is_complete()) borrowed_.pop_front();
  made->wait_on(peer_copies_);
  PMSP_CUDA_CHECK(cudaMemcpyPeerAsync(to, device_number_, from.get(), home.device_number_, bytes, peer_copies_.get()));
  const ReadyEvent here = marks_.get();
  here->record(peer_copies_);
  here->wait_on(compute_);
  borrowed_.emplace_back(here, std::move(from));
}

void CudaProcessor::synchronize() {
  const DeviceScope scope = enter();
  cudaStreamSynchronize(peer_copies_.get());
  borrowed_.clear();
}

void CudaProcessor::set_size(int width, int height) {
  if (grid_) return;
  grid_.emplace(width, height, compute_);
}

void CudaProcessor::set_image_size(int width, int height) {
  if (width == image_width_ && height == image_height_) return;
  PMSP_CUDA_CHECK(cudaStreamSynchronize(compute_.get()));  // kernels may still read the old tables
  columns_.emplace(width, grid().width, compute_);
  rows_.emplace(height, grid().height, compute_);
  matching_ = matching_size(width, grid().width, grid().height, context_.options.advanced.patchmatch.image_scale);
  gray_columns_.emplace(width, matching_.width, compute_);
  gray_rows_.emplace(height, matching_.height, compute_);
  const std::size_t matched = static_cast<std::size_t>(matching_.width) * static_cast<std::size_t>(matching_.height);
  if (gray_.size() < matched) {
    gray_ = DeviceArray<float>(matched);
    equalized_ = DeviceArray<float>(matched);
  }
  image_width_ = width;
  image_height_ = height;
}

/// Called before each pass; limits the number of results in flight.
bool CudaProcessor::limit_results_in_flight() {
  while (!cancelled() && queue_.size() > kMostPending * context_.options.devices.size()) queue_.emit_first();
  return !cancelled();
}

Array<std::uint64_t> CudaProcessor::keys() {
  Array<std::uint64_t> keys = array<std::uint64_t>(pixels());
  static_assert(kernels::kNoKey == ~std::uint64_t{0}, "bytes of 255");
  PMSP_CUDA_CHECK(cudaMemsetAsync(keys.get(), 0xff, pixels() * sizeof(std::uint64_t), compute_.get()));
  return keys;
}

std::shared_ptr<CubeTexture> CudaProcessor::gray_cube(int size) { return grays_[size].get(size, kGrayBits); }

CudaProcessor::Prepared CudaProcessor::prepare(const Keyframe& keyframe, double& seconds) {
  const auto& image = keyframe.image;
  const auto& mask = keyframe.mask;
  set_image_size(image.width, image.height);
  ThreadPool& pool = pool_of(executor_);
  const int size = cube_size_for(matching_.width);
  const int matchable_size = cube_size_for(grid().width);
  Prepared prepared{{gray_cube(size), nullptr}, array<Color>(pixels()), nullptr};
  ResizeArgs args{};
  args.image = images_.upload(image.data, 3 * static_cast<std::size_t>(image.width),
                              3 * static_cast<std::size_t>(image.stride), image.height, up_, compute_, pool);
  if (!mask.empty()) {
    args.mask = masks_.upload(mask.data, static_cast<std::size_t>(mask.width), static_cast<std::size_t>(mask.stride),
                              mask.height, up_, compute_, pool);
    prepared.cubes.matchable = matchables_.get(matchable_size, kMatchableBits);
    if (eroded_.empty()) eroded_ = DeviceArray<unsigned char>(pixels());
  }
  args.source_width = image.width;
  args.source_height = image.height;
  args.width = grid().width;
  args.height = grid().height;
  args.columns = columns_->view();
  args.rows = rows_->view();
  args.color = prepared.color.get();
  const bool at_once = matching_.width == args.width;
  if (at_once) args.gray = gray_.get();
  timed(seconds, [&] {
    const cudaStream_t stream = compute_.get();
    resize(args, stream);
    if (!at_once) {
      ResizeArgs finer = args;
      finer.width = matching_.width;
      finer.height = matching_.height;
      finer.columns = gray_columns_->view();
      finer.rows = gray_rows_->view();
      finer.color = nullptr;
      finer.gray = gray_.get();
      resize(finer, stream);
    }
    equalize_rows(gray_.get(), equalized_.get(), matching_.width, matching_.height, stream);
    fill_cube(equalized_.get(), matching_.width, matching_.height, {size, prepared.cubes.gray->surface()}, stream);
    if (mask.empty()) return;
    fill_matchable_cube(args.color, args.width, args.height, kPatchReachPx, eroded_.get(),
                        {matchable_size, prepared.cubes.matchable->surface()}, stream);
  });
  images_.consumed(compute_);
  if (!mask.empty()) masks_.consumed(compute_);
  return prepared;
}

/// Two bytes per texel of the image, one of the mask.
CubePacking CudaProcessor::packing(const Cubes& cubes) const {
  const std::size_t texels = cubes.gray->texels();
  if (!cubes.matchable) return {texels, cubes.gray->side(), 0};
  return {texels + cubes.matchable->texels() / 2, cubes.gray->side(), cubes.matchable->side()};
}

Array<std::uint16_t> CudaProcessor::pack(const Cubes& cubes) {
  const Array<std::uint16_t> packed = array<std::uint16_t>(packing(cubes).count);
  cubes.gray->copy_to(packed.get(), compute_);
  if (cubes.matchable) cubes.matchable->copy_to(packed.get() + cubes.gray->texels(), compute_);
  return packed;
}

CudaProcessor::Cubes CudaProcessor::unpack(const Array<std::uint16_t>& packed, const CubePacking& packing) {
  Cubes cubes{gray_cube(packing.side), nullptr};
  cubes.gray->copy_from(packed.get(), compute_);
  if (packing.matchable_side == 0) return cubes;
  cubes.matchable = matchables_.get(packing.matchable_side, kMatchableBits);
  cubes.matchable->copy_from(packed.get() + cubes.gray->texels(), compute_);
  return cubes;
}

std::pair<Array<kernels::SparsePoint>, int> CudaProcessor::landmarks(const Keyframe& keyframe, double lens) {
  const std::size_t most = keyframe.landmarks.size();
  points_arrived_.wait();  // those of the previous keyframe
  if (points_host_.size() < most) points_host_ = PinnedArray<kernels::SparsePoint>(std::max(2 * most, kUsualLandmarks));
  const std::size_t count = sparse_points(keyframe, lens, grid().width, grid().height, points_host_.get());
  const auto points = array<kernels::SparsePoint>(points_host_.size());
  PMSP_CUDA_CHECK(cudaMemcpyAsync(points.get(), points_host_.get(), count * sizeof(kernels::SparsePoint),
                                  cudaMemcpyHostToDevice, compute_.get()));
  points_arrived_.record(compute_);
  return {points, static_cast<int>(count)};
}

void CudaProcessor::emit_depths(std::int64_t id, const KeyframePose& pose, const DevicePlanes& map,
                                const float* confidence, std::function<void(const DepthMap&)> to) {
  MapDownload<DepthMap>& download = free_one(depths_);
  launch(kernels::DepthImage<DeviceViewTypes>{map, confidence, grid(), download.part(0), download.part(1),
                                              download.part(2)},
         nullptr);
  emit(download, id, pose, std::move(to));
}

void CudaProcessor::emit_planes(std::int64_t id, const KeyframePose& pose, const Planes& planes,
                                std::function<void(const PlaneMap&)> to) {
  MapDownload<PlaneMap>& download = free_one(planes_);
  launch(kernels::PlaneImage<DeviceViewTypes>{map(planes), grid(), download.part(0), download.part(1), download.part(2),
                                              download.part(3)},
         nullptr);
  emit(download, id, pose, std::move(to));
}

/// Queues the download of a map that kernels have been queued to write.
template <class Map>
void CudaProcessor::emit(MapDownload<Map>& download, std::int64_t id, const KeyframePose& pose,
                         std::function<void(const Map&)> to) {
  download.busy = true;
  download.start(compute_, down_);
  enqueue_result([this, &download, id, pose, to = std::move(to)] {
    const Map& arrived = download.finish(id, pose);
    download.busy = false;  // not used again before `to` returns or throws
    if (!cancelled()) to(arrived);
  });
}

CudaProcessor::Planes CudaProcessor::planes_of(const PlaneMap& map) {
  std::vector<float4> planes(pixels());
  for (std::size_t i = 0; i < planes.size(); ++i) {
    planes[i] = {map.x.pixels()[i], map.y.pixels()[i], map.z.pixels()[i], map.score.pixels()[i]};
  }
  return upload(planes);
}

void CudaProcessor::emit_points(const kernels::ConstSurfelArrays& map, KeyframeCloud cloud, double& seconds,
                                std::function<void(const KeyframeCloud&)> to) {
  while (clouds_out_ >= kDownloads) queue_.emit_first();
  if (select_scratch_.empty()) {
    select_scratch_ = DeviceArray<unsigned char>(emit_scratch_bytes(static_cast<int>(pixels())));
  }
  const std::shared_ptr<PointsDownload> lent = clouds_.get(pixels());
  ++clouds_out_;
  const auto select = [&](Counts* counts) {
    extract_points({grid(), map, lent->points.get(), lent->pixels.get(), lent->agree.get(), counts->of},
                   select_scratch_.get(), select_scratch_.size(), compute_.get());
  };
  counted(seconds, select,
          [this, lent, cloud = std::move(cloud), to = std::move(to)](const std::int64_t* numbers) mutable {
            --clouds_out_;
            if (cancelled()) return;
            const std::size_t count = static_cast<std::size_t>(numbers[0]);
            to(cloud_.fetch(std::move(cloud), lent->points.get(), lent->pixels.get(), lent->agree.get(), count, down_));
          });
}

void CudaProcessor::copy_bytes(void* to, const void* from, std::size_t bytes, cudaMemcpyKind kind) const {
  PMSP_CUDA_CHECK(cudaMemcpyAsync(to, from, bytes, kind, compute_.get()));
  PMSP_CUDA_CHECK(cudaStreamSynchronize(compute_.get()));
}

/// Results of the latest rounds, one per device, stay in flight.
void ResultQueue::deliver(bool all) {
  const std::int64_t behind = static_cast<std::int64_t>(context_.options.devices.size());
  const std::int64_t until = all || !context_.options.advanced.pipelined ? round_ : round_ - behind;
  while (!pending_.empty() && pending_.front().round <= until) emit_first();
  ++round_;
}

template <class Map>
MapDownload<Map>& CudaProcessor::free_one(Downloads<Map>& downloads) {
  for (;;) {
    for (const auto& download : downloads) {
      if (!download->busy) return *download;
    }
    if (downloads.size() < kDownloads) {
      downloads.push_back(std::make_unique<MapDownload<Map>>(grid().width, grid().height));
    } else {
      queue_.emit_first();
    }
  }
}

void ResultQueue::emit_first() {
  Pending first = std::move(pending_.front());
  pending_.pop_front();
  const DeviceScope scope(first.device);
  first.emit();
}

}  // namespace pmsp::cuda
