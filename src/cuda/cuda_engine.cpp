// SPDX-License-Identifier: BSD-2-Clause
#include "cuda/cuda_engine.h"

#include <cstddef>
#include <deque>
#include <functional>
#include <optional>
#include <utility>

#include "cpu/executor_impl.h"
#include "cuda/transfers.h"
#include "filters/filter_setup.h"
#include "fusion/fusion_setup.h"
#include "init/init_setup.h"
#include "patchmatch/match_setup.h"
#include "pmsp/camera.h"
#include "pmsp/error.h"
#include "pmsp/point_cloud.h"
#include "priors/prior_setup.h"
#include "sphere/cube_map.h"
#include "sphere/panorama_data.h"
#include "util/eigen_kernels.h"

namespace pmsp::cuda {
namespace {

constexpr int kGrayBits =
    16;  ///< of the cube maps' texels, as the CPU's: finer than the camera's, since resampling averages
constexpr int kUsableBits = 8;
constexpr std::size_t kDownloads = 2;     ///< depth maps on their way down at once, and clouds
constexpr std::size_t kMostPending = 64;  ///< how far the host may run ahead, so that it can stop when told to

using Colors = DeviceArray<uchar4>;
using Planes = DeviceArray<float4>;
using Floats = DeviceArray<float>;
using Bytes = DeviceArray<unsigned char>;
using Words = DeviceArray<std::uint32_t>;

static_assert(sizeof(DevicePoint) == sizeof(CloudPoint) &&
                  offsetof(DevicePoint, normal) == offsetof(CloudPoint, normal) &&
                  offsetof(DevicePoint, color) == offsetof(CloudPoint, color) &&
                  offsetof(DevicePoint, views) == offsetof(CloudPoint, views) &&
                  offsetof(DevicePoint, confidence) == offsetof(CloudPoint, confidence),
              "points are copied as they are");

/// What a frame keeps on the device, lent from the engine's pools.
struct CudaFrame : Engine::Frame {
  using Frame::Frame;

  std::shared_ptr<Colors> color;
  std::shared_ptr<CubeTexture> gray;
  std::shared_ptr<CubeTexture> usable;  ///< none without a mask
  std::shared_ptr<Planes> raws[2];      ///< after the last even and the last odd pass of PatchMatch
  std::shared_ptr<Planes> planes;       ///< after the last pass and the median filter
  std::shared_ptr<Floats> confidence;   ///< after the consistency filter; 0 = no depth
  std::shared_ptr<Floats> nearest;      ///< sight map, half as wide and high
  std::shared_ptr<Floats> farthest;
  std::shared_ptr<Words> surfels, details;  ///< see SurfelMap
  std::shared_ptr<Bytes> agree;
  std::shared_ptr<Bytes> standings;      ///< after `rounds`
  std::shared_ptr<Bytes> before;         ///< after the round before the last
  int rounds = 0;                        ///< of ownership that the frame is through
  std::vector<std::int64_t> window_ids;  ///< of the bits of `agree`
};

CudaFrame& own(Engine::Frame& frame) { return static_cast<CudaFrame&>(frame); }
const CudaFrame& own(const Engine::Frame& frame) { return static_cast<const CudaFrame&>(frame); }

/// How long stages took and what became of the pixels, on its way to the statistics.
struct Record {
  DeviceArray<Counts> device = DeviceArray<Counts>(1);
  PinnedArray<Counts> host = PinnedArray<Counts>(1);
  Event marks[3];  ///< before, between and after the stages

  void start(const Stream& stream) {
    PMSP_CUDA_CHECK(cudaMemsetAsync(device.get(), 0, sizeof(Counts), stream.get()));
    marks[0].record(stream);
  }
  std::int64_t counted(int i) const { return host[0].of[i]; }
  void stop(const Stream& stream, int mark) {
    PMSP_CUDA_CHECK(cudaMemcpyAsync(host.get(), device.get(), sizeof(Counts), cudaMemcpyDeviceToHost, stream.get()));
    marks[mark].record(stream);
  }
};

/// Points and their keys, on their way down.
struct PointsDownload {
  explicit PointsDownload(std::size_t size) : points(size), pixels(size), agree(size) {}

  DeviceArray<DevicePoint> points;
  DeviceArray<unsigned int> pixels;
  Words agree;
};

/// All work on one frame is queued on one stream, in the order of the calls; only copies run beside it. So whatever a
/// kernel reads was written by an earlier one, and memory that goes back to its pool may be used again at once.
class CudaEngine : public Engine {
 public:
  CudaEngine(const EngineContext& context, Executor executor)
      : Engine(context, std::move(executor)), device_(context.options.device) {}
  ~CudaEngine() override;

  std::unique_ptr<Frame> prepare(const Keyframe& keyframe) override;
  void match(const MatchTask& task) override;
  void filter(Frame& reference, const std::vector<const Frame*>& others) override;
  void fuse(Frame& reference, const std::vector<const Frame*>& window, std::size_t current) override;
  void judge(Frame& reference, const std::vector<const Frame*>& viewers) override;
  void round(Frame& reference, const std::vector<const Frame*>& others, int round) override;
  void hand_out(Frame& reference) override;
  void release(Frame& frame, Artefact artefact) override;
  void deliver(bool all) override;

 private:
  void allocate();
  void set_image_size(int width, int height);
  void prepare_image(CudaFrame& frame, ResizeArgs args);
  kernels::LandmarkPlanes find_sparse(const MatchTask& task);
  kernels::WarpedPlanes<DevicePlanes> warp_previous(const MatchTask& task);
  PatchMatchPass pass_of(const MatchTask& task) const;
  void run_pass(const MatchTask& task, float4* result);
  DevicePlanes plane_priors(const DevicePlanes& planes, const PatchMatchPass& pass);
  void filter_median(const CudaFrame& frame, const float4* raw, float4* planes, Counts* counts);
  void send_depths(const CudaFrame& frame, const float4* planes, const float* confidence,
                   const std::function<void(const DepthMap&)>& to);
  MapDownload& free_download();
  void expect(std::function<void()> hand_out) { pending_.push_back({std::move(hand_out), round_}); }
  /// The first elements of an array.
  template <class To, class From>
  void download(const DeviceArray<From>& from, std::size_t count, std::vector<To>& to) {
    static_assert(sizeof(To) == sizeof(From), "elements are copied as they are");
    to.resize(count);
    downloader_.download(from.get(), count * sizeof(To), to.data(), down_, executor_.impl().pool);
  }
  void expect_time(const std::shared_ptr<Record>& record, double DensifierStats::*seconds);
  void hand_out_first();
  bool may_go_on();
  void finish_match(CudaFrame& reference, int pass);
  void find_sight_of(CudaFrame& frame);
  DevicePlanes planes_of(const float4* planes) const {
    return {planes, context_.options.width, context_.options.height};
  }
  kernels::FilteredMap<DevicePlanes> filtered(const CudaFrame& frame) const {
    return {planes_of(frame.planes->get()), frame.confidence->get(), context_.options.width, context_.options.height};
  }
  bool cancelled() const { return context_.cancel.load(std::memory_order_relaxed); }
  std::size_t pixels() const {
    return static_cast<std::size_t>(context_.options.width) * static_cast<std::size_t>(context_.options.height);
  }

  /// Something that was asked of the device.
  struct Pending {
    std::function<void()> hand_out;  ///< waits for what it needs
    std::int64_t round;              ///< Densifier::add or flush during which it was asked for
  };

  LastScope device_;  ///< before all that lies on the device
  Stream compute_, up_, down_;
  int image_width_ = 0;
  int image_height_ = 0;
  Uploader images_, masks_;
  Downloader downloader_;
  Floats gray_, equalized_;
  Bytes eroded_;
  Planes state_, warp_source_;
  DeviceArray<std::uint64_t> sparse_keys_, warp_keys_;
  PinnedArray<kernels::SparsePoint> points_host_;
  DeviceArray<kernels::SparsePoint> points_;
  Event points_arrived_;
  std::optional<DevicePriors> priors_;
  std::optional<DeviceGrid> grid_;
  std::optional<DeviceSpanTable> columns_, rows_;  ///< from the images' size
  Pool<Colors> colors_;
  Pool<CubeTexture> grays_, usables_;
  Pool<Planes> raws_, planes_;
  Pool<Floats> confidences_, sights_;
  Pool<Words> words_;
  Pool<Bytes> standings_, agree_;
  Pool<PointsDownload> clouds_;
  Bytes select_scratch_;
  Pool<Record> records_;
  std::vector<std::unique_ptr<MapDownload>> downloads_;
  std::deque<Pending> pending_;
  KeyframeCloud cloud_;  ///< handed out last; its memory is used again
  std::size_t clouds_out_ = 0;
  std::int64_t round_ = 0;
};

CudaEngine::~CudaEngine() {
  device_.enter();
  for (const Stream* stream : {&compute_, &up_, &down_}) cudaStreamSynchronize(stream->get());
}

void CudaEngine::allocate() {
  const DensifierOptions& options = context_.options;
  if (grid_) return;
  grid_.emplace(options.width, options.height, compute_);
  gray_ = Floats(pixels());
  equalized_ = Floats(pixels());
  state_ = Planes(pixels());
  if (options.init.sparse_points) sparse_keys_ = DeviceArray<std::uint64_t>(pixels());
  if (options.init.warp_previous) warp_keys_ = DeviceArray<std::uint64_t>(pixels());
  if (options.patchmatch.plane_priors && options.patchmatch.geometric_passes > 0) {
    priors_.emplace(options.width, options.height, compute_);
  }
}

void CudaEngine::set_image_size(int width, int height) {
  if (width == image_width_ && height == image_height_) return;
  PMSP_CUDA_CHECK(cudaStreamSynchronize(compute_.get()));  // kernels may still read the old tables
  columns_.emplace(width, context_.options.width, compute_);
  rows_.emplace(height, context_.options.height, compute_);
  image_width_ = width;
  image_height_ = height;
}

std::unique_ptr<Engine::Frame> CudaEngine::prepare(const Keyframe& keyframe) {
  const DeviceScope scope(context_.options.device);
  const auto& image = keyframe.image;
  const auto& mask = keyframe.mask;
  allocate();
  set_image_size(image.width, image.height);
  ThreadPool& pool = executor_.impl().pool;
  ResizeArgs args{};
  args.image = images_.upload(image.data, 3 * static_cast<std::size_t>(image.width),
                              3 * static_cast<std::size_t>(image.stride), image.height, up_, compute_, pool);
  if (!mask.empty()) {
    args.mask = masks_.upload(mask.data, static_cast<std::size_t>(mask.width), static_cast<std::size_t>(mask.stride),
                              mask.height, up_, compute_, pool);
  }
  args.source_width = image.width;
  args.source_height = image.height;
  const std::shared_ptr<Record> record = records_.get();
  record->marks[0].record(compute_);
  auto frame = std::make_unique<CudaFrame>(keyframe);
  prepare_image(*frame, args);
  images_.consumed(compute_);
  if (!mask.empty()) masks_.consumed(compute_);
  record->marks[1].record(compute_);
  expect_time(record, &DensifierStats::seconds_prepare);
  return frame;
}

void CudaEngine::prepare_image(CudaFrame& frame, ResizeArgs args) {
  const int size = cube_size_for(context_.options.width);
  frame.color = colors_.get(pixels());
  frame.gray = grays_.get(size, kGrayBits);
  args.width = context_.options.width;
  args.height = context_.options.height;
  args.columns = columns_->view();
  args.rows = rows_->view();
  args.color = frame.color->get();
  args.gray = gray_.get();
  resize(args, compute_.get());
  equalize_rows(gray_.get(), equalized_.get(), args.width, args.height, compute_.get());
  fill_cube(equalized_.get(), args.width, args.height, {size, frame.gray->surface()}, compute_.get());
  if (args.mask == nullptr) return;
  if (eroded_.empty()) eroded_ = Bytes(pixels());
  frame.usable = usables_.get(size, kUsableBits);
  fill_usable_cube(args.color, args.width, args.height, kPatchReachPx, eroded_.get(), {size, frame.usable->surface()},
                   compute_.get());
}

kernels::LandmarkPlanes CudaEngine::find_sparse(const MatchTask& task) {
  const std::size_t most = task.keyframe->landmarks.size();
  points_arrived_.wait();  // the previous keyframe's
  if (points_host_.size() < most) {
    PMSP_CUDA_CHECK(cudaStreamSynchronize(compute_.get()));  // kernels may still read the old ones
    points_host_ = PinnedArray<kernels::SparsePoint>(2 * most);
    points_ = DeviceArray<kernels::SparsePoint>(2 * most);
  }
  const std::size_t count =
      sparse_points(*task.keyframe, context_.options.width, context_.options.height, points_host_.get());
  PMSP_CUDA_CHECK(cudaMemcpyAsync(points_.get(), points_host_.get(), count * sizeof(kernels::SparsePoint),
                                  cudaMemcpyHostToDevice, compute_.get()));
  points_arrived_.record(compute_);
  PMSP_CUDA_CHECK(cudaMemsetAsync(sparse_keys_.get(), 0xff, pixels() * sizeof(std::uint64_t), compute_.get()));
  splat_landmarks(
      {points_.get(), grid_->view(), static_cast<float>(context_.options.init.sparse_radius_px), {sparse_keys_.get()}},
      static_cast<int>(count), compute_.get());
  return {sparse_keys_.get(), points_.get()};
}

/// The previous keyframe's planes, median filtered, those of the first pass while later ones are to come.
kernels::WarpedPlanes<DevicePlanes> CudaEngine::warp_previous(const MatchTask& task) {
  const CudaFrame& previous = own(*task.previous);
  if (!previous.planes) {
    if (warp_source_.empty()) warp_source_ = Planes(pixels());
    filter_median(previous, previous.raws[0]->get(), warp_source_.get(), nullptr);
  }
  const DevicePlanes planes = planes_of(previous.planes ? previous.planes->get() : warp_source_.get());
  const RigidTransform moved = task.reference->cam_from_world * previous.cam_from_world.inverse();
  PMSP_CUDA_CHECK(cudaMemsetAsync(warp_keys_.get(), 0xff, pixels() * sizeof(std::uint64_t), compute_.get()));
  launch(
      kernels::WarpPixels<DeviceMachine, DeviceKeys>{
          planes, grid_->view(), to_rigid(moved), planes.width, planes.height, {warp_keys_.get()}},
      nullptr, compute_.get());
  return {warp_keys_.get(), planes, to_rigid(moved.inverse())};
}

/// Those of the pass that starts from the reference's map with these planes.
DevicePlanes CudaEngine::plane_priors(const DevicePlanes& planes, const PatchMatchPass& pass) {
  kernels::PriorCells<DevicePlanes> cells = priors_->cells();
  cells.map = planes;
  cells.grid = pass.grid;
  cells.min_variance = texture_variance(context_.options.patchmatch);
  cells.limits = pass.matching.limits;
  launch(kernels::TextureVariance<DeviceMachine>{pass.matching.reference, pass.grid, texture_spacing(planes.width),
                                                 priors_->variance()},
         nullptr, compute_.get());
  find_cell_planes(cells, compute_.get());
  launch(kernels::PixelPriors<DeviceMachine>{cells, {priors_->priors()}}, nullptr, compute_.get());
  return planes_of(priors_->priors());
}

void CudaEngine::filter_median(const CudaFrame& frame, const float4* raw, float4* planes, Counts* counts) {
  launch(median_stage<DeviceMachine>(planes_of(raw), grid_->view(), {frame.color->get()}, context_.options.median,
                                     {planes}),
         counts, compute_.get());
}

void CudaEngine::match(const MatchTask& task) {
  const DeviceScope scope(context_.options.device);
  if (!may_go_on()) return;
  CudaFrame& reference = own(*task.reference);
  std::shared_ptr<Planes>& raw = reference.raws[task.pass % 2];
  if (!raw) raw = raws_.get(pixels());
  run_pass(task, raw->get());
  reference.matched = true;
  if (task.last) finish_match(reference, task.pass);
}

/// Without priors and first planes.
PatchMatchPass CudaEngine::pass_of(const MatchTask& task) const {
  const DensifierOptions& options = context_.options;
  const CudaFrame& reference = own(*task.reference);
  PatchMatchPass pass{};
  pass.matching = make_matching<TextureCube>({reference.gray->texture()}, options.patchmatch, options.width, task.range,
                                             options.seed, reference.id);
  const RigidTransform world_from_ref = reference.cam_from_world.inverse();
  for (const Frame* frame : task.neighbours) {
    const CudaFrame& neighbour = own(*frame);
    const bool near = static_cast<std::size_t>(pass.matching.num_views) < task.near;
    const Planes* const before = task.pass > 0 && near ? neighbour.raws[(task.pass - 1) % 2].get() : nullptr;
    pass.matching.views[pass.matching.num_views++] = {{neighbour.gray->texture()},
                                                      {neighbour.usable ? neighbour.usable->texture() : 0},
                                                      to_rigid(neighbour.cam_from_world * world_from_ref),
                                                      planes_of(before == nullptr ? nullptr : before->get())};
  }
  pass.grid = grid_->view();
  pass.state = {state_.get()};
  pass.mask = {reference.color->get()};
  return pass;
}

void CudaEngine::run_pass(const MatchTask& task, float4* result) {
  const DensifierOptions& options = context_.options;
  const CudaFrame& reference = own(*task.reference);
  const Iterations iterations = iterations_of(options.patchmatch, task.pass);
  PatchMatchPass pass = pass_of(task);
  const DevicePlanes before = planes_of(task.pass > 0 ? reference.raws[(task.pass - 1) % 2]->get() : nullptr);
  const std::shared_ptr<Record> record = records_.get();
  record->marks[0].record(compute_);
  if (task.pass == 0 && options.init.sparse_points) pass.landmarks = find_sparse(task);
  if (task.previous != nullptr) pass.warped = warp_previous(task);
  if (task.pass > 0 && options.patchmatch.plane_priors) pass.priors = plane_priors(before, pass);
  record->marks[1].record(compute_);
  if (task.pass == 0) {
    start_pixels(pass, compute_.get());
  } else {
    from_rows(before, state_.get(), compute_.get());
  }
  for (int i = 0; i < iterations.count; ++i) {
    const bool rescore = task.pass > 0 && i == 0;
    for (int colour = 0; colour < 2; ++colour) {
      iterate_pixels(pass, colour, iterations.first + i, rescore, compute_.get());
    }
  }
  to_rows(planes_of(state_.get()), result, compute_.get());
  record->marks[2].record(compute_);
  expect([this, record] {
    record->marks[2].wait();
    context_.stats.seconds_init += record->marks[1].seconds_since(record->marks[0]);
    context_.stats.seconds_patchmatch += record->marks[2].seconds_since(record->marks[1]);
  });
}

void CudaEngine::finish_match(CudaFrame& reference, int pass) {
  std::shared_ptr<Planes>& raw = reference.raws[pass % 2];
  if (context_.results.raw_depth) send_depths(reference, raw->get(), nullptr, context_.results.raw_depth);
  reference.planes = planes_.get(pixels());
  const std::shared_ptr<Record> record = records_.get();
  record->start(compute_);
  filter_median(reference, raw->get(), reference.planes->get(), record->device.get());
  record->stop(compute_, 1);
  // Nobody else will ask for it, and whoever gets the memory next works on the same stream.
  if (context_.options.patchmatch.geometric_passes == 0) raw.reset();
  expect([this, record] {
    record->marks[1].wait();
    DensifierStats& stats = context_.stats;
    stats.seconds_median += record->marks[1].seconds_since(record->marks[0]);
    ++stats.depth_maps;
    stats.pixels += record->counted(0);
    stats.pixels_matched += record->counted(1);
    stats.pixels_after_median += record->counted(2);
  });
}

void CudaEngine::filter(Frame& frame, const std::vector<const Frame*>& others) {
  const DeviceScope scope(context_.options.device);
  CudaFrame& reference = own(frame);
  reference.confidence = confidences_.get(pixels());
  auto stage = consistency_stage<DeviceMachine>(planes_of(reference.planes->get()), grid_->view(), others.size(),
                                                context_.options.consistency, reference.confidence->get());
  for (std::size_t k = 0; k < others.size(); ++k) {
    stage.others[k] = {planes_of(own(*others[k]).planes->get()),
                       to_rigid(others[k]->cam_from_world * reference.cam_from_world.inverse())};
  }
  const std::shared_ptr<Record> record = records_.get();
  record->start(compute_);
  launch(stage, record->device.get(), compute_.get());
  record->stop(compute_, 1);
  if (context_.results.filtered_depth) {
    send_depths(reference, reference.planes->get(), reference.confidence->get(), context_.results.filtered_depth);
  }
  if (context_.results.cloud && context_.options.free_space.enabled) find_sight_of(reference);
  expect([this, record] {
    record->marks[1].wait();
    context_.stats.seconds_consistency += record->marks[1].seconds_since(record->marks[0]);
    context_.stats.pixels_after_consistency += record->counted(1);
  });
}

void CudaEngine::find_sight_of(CudaFrame& frame) {
  const std::shared_ptr<Record> record = records_.get();
  record->marks[0].record(compute_);
  frame.nearest = sights_.get(pixels() / 4);
  frame.farthest = sights_.get(pixels() / 4);
  launch(kernels::FindSight<DeviceMachine>{filtered(frame), grid_->view(), frame.nearest->get(), frame.farthest->get()},
         nullptr, compute_.get());
  record->marks[1].record(compute_);
  expect_time(record, &DensifierStats::seconds_free_space);
}

void CudaEngine::fuse(Frame& frame, const std::vector<const Frame*>& window, std::size_t current) {
  const DeviceScope scope(context_.options.device);
  CudaFrame& reference = own(frame);
  reference.surfels = words_.get(pixels());
  reference.details = words_.get(pixels());
  reference.agree = agree_.get(pixels() * static_cast<std::size_t>(agree_bytes(context_.options.fusion)));
  reference.standings = standings_.get(pixels());
  const auto view = [&](const CudaFrame& member) {
    const Relation to = relation(member.pose(), reference.pose());
    return kernels::FusionView<DeviceMachine>{
        filtered(member), reinterpret_cast<const std::uint32_t*>(member.color->get()), to.other_from_first, to.zoom};
  };
  kernels::FusePixels<DeviceMachine> stage{};
  stage.grid = grid_->view();
  stage.first = view(reference);
  for (std::size_t i = 0; i < window.size(); ++i) {
    if (i == current) continue;
    stage.others[stage.count++] = view(own(*window[i]));
    reference.window_ids.push_back(window[i]->id);
  }
  stage.limits = fusion_limits(context_.options.fusion);
  stage.to = {reference.surfels->get(), reference.details->get(), reference.standings->get(), reference.agree->get(),
              agree_bytes(context_.options.fusion)};
  const std::shared_ptr<Record> record = records_.get();
  record->start(compute_);
  launch(stage, record->device.get(), compute_.get());
  record->stop(compute_, 1);
  const bool judged = context_.options.free_space.enabled;
  expect([this, record, judged] {
    record->marks[1].wait();
    context_.stats.seconds_fusion += record->marks[1].seconds_since(record->marks[0]);
    context_.stats.points_fused += record->counted(0);
    if (!judged) context_.stats.points_repeated += record->counted(0);
  });
}

void CudaEngine::judge(Frame& frame, const std::vector<const Frame*>& viewers) {
  const DeviceScope scope(context_.options.device);
  CudaFrame& reference = own(frame);
  kernels::Eligibility stage{};
  stage.surfels = reference.surfels->get();
  stage.details = reference.details->get();
  stage.grid = grid_->view();
  for (const Frame* asked : viewers) {
    const CudaFrame& viewer = own(*asked);
    const Relation to = relation(viewer.pose(), reference.pose());
    stage.viewers[stage.count++] = {
        {viewer.nearest->get(), viewer.farthest->get(), context_.options.width / 2, context_.options.height / 2},
        to.other_from_first,
        to.zoom};
  }
  stage.limits = sight_limits(context_.options.free_space);
  stage.max_contradiction = static_cast<float>(context_.options.free_space.max_contradiction);
  stage.standings = reference.standings->get();
  const std::shared_ptr<Record> record = records_.get();
  record->start(compute_);
  launch(stage, record->device.get(), compute_.get());
  record->stop(compute_, 1);
  expect([this, record] {
    record->marks[1].wait();
    context_.stats.seconds_free_space += record->marks[1].seconds_since(record->marks[0]);
    context_.stats.points_repeated += record->counted(0);  // less those that are handed out
  });
}

void CudaEngine::round(Frame& frame, const std::vector<const Frame*>& others, int round) {
  const DeviceScope scope(context_.options.device);
  CudaFrame& reference = own(frame);
  const auto view = [&](const CudaFrame& viewed, const Bytes& standings) {
    return kernels::SurfelView{viewed.surfels->get(), standings.get(), context_.options.width, context_.options.height,
                               static_cast<float>(viewed.pose().scale)};
  };
  const std::shared_ptr<Bytes> after = standings_.get(pixels());
  kernels::OwnershipRound stage{};
  stage.map = view(reference, *reference.standings);
  stage.grid = grid_->view();
  for (const Frame* asked : others) {
    const CudaFrame& viewer = own(*asked);
    const Relation to = relation(viewer.pose(), reference.pose());
    stage.others[stage.count++] = {view(viewer, viewer.rounds < round ? *viewer.standings : *viewer.before),
                                   to.other_from_first, to.zoom, viewer.id < reference.id};
  }
  stage.first = round == 1;
  stage.limits = ownership_limits(context_.options.fusion);
  stage.standings = after->get();
  const std::shared_ptr<Record> record = records_.get();
  record->marks[0].record(compute_);
  launch(stage, nullptr, compute_.get());
  record->marks[1].record(compute_);
  reference.before = reference.standings;
  reference.standings = after;
  reference.rounds = round;
  expect_time(record, &DensifierStats::seconds_ownership);
}

void CudaEngine::hand_out(Frame& frame) {
  const DeviceScope scope(context_.options.device);
  const CudaFrame& reference = own(frame);
  while (clouds_out_ >= kDownloads) hand_out_first();
  if (select_scratch_.empty()) select_scratch_ = Bytes(owned_scratch_bytes(static_cast<int>(pixels())));
  const std::shared_ptr<PointsDownload> lent = clouds_.get(pixels());
  const std::shared_ptr<Record> record = records_.get();
  record->start(compute_);
  owned_points({grid_->view(),
                {reference.surfels->get(), reference.details->get(), reference.standings->get(), reference.agree->get(),
                 agree_bytes(context_.options.fusion)},
                lent->points.get(),
                lent->pixels.get(),
                lent->agree.get(),
                record->device.get()->of},
               select_scratch_.get(), select_scratch_.size(), compute_.get());
  record->stop(compute_, 1);
  ++clouds_out_;
  expect([this, record, lent, id = reference.id, pose = reference.pose(), window_ids = reference.window_ids] {
    --clouds_out_;
    record->marks[1].wait();
    if (cancelled()) return;
    context_.stats.seconds_ownership += record->marks[1].seconds_since(record->marks[0]);
    const std::size_t count = static_cast<std::size_t>(record->counted(0));
    context_.stats.points_repeated -= static_cast<std::int64_t>(count);
    cloud_.keyframe_id = id;
    cloud_.cam_from_world = pose.cam_from_world;
    cloud_.scale = pose.scale;
    cloud_.window_ids = window_ids;
    download(lent->points, count, cloud_.points);
    download(lent->pixels, count, cloud_.pixels);
    download(lent->agree, count, cloud_.agree);
    context_.results.cloud(cloud_);
  });
}

/// Memory that goes back to the pools may be used again at once: whoever gets it works on the same stream.
void CudaEngine::release(Frame& frame, Artefact artefact) {
  CudaFrame& done = own(frame);
  switch (artefact) {
    case Artefact::kImage:
      break;
    case Artefact::kFarImage:
      done.gray.reset();
      done.usable.reset();
      break;
    case Artefact::kColor:
      done.color.reset();
      break;
    case Artefact::kLandmarks:
      break;
    case Artefact::kPlanes:
      for (auto& raw : done.raws) raw.reset();
      break;
    case Artefact::kMedian:
      done.planes.reset();
      break;
    case Artefact::kFiltered:
      done.confidence.reset();
      break;
    case Artefact::kSight:
      done.nearest.reset();
      done.farthest.reset();
      break;
    case Artefact::kSurfels:
      done.surfels.reset();
      done.details.reset();
      done.agree.reset();
      done.standings.reset();
      done.before.reset();
      break;
  }
}

void CudaEngine::deliver(bool all) {
  const DeviceScope scope(context_.options.device);
  const std::int64_t until = all || !context_.options.pipelined ? round_ : round_ - 1;
  while (!pending_.empty() && pending_.front().round <= until) hand_out_first();
  ++round_;
}

MapDownload& CudaEngine::free_download() {
  for (;;) {
    for (const auto& download : downloads_) {
      if (!download->busy) return *download;
    }
    if (downloads_.size() < kDownloads) {
      downloads_.push_back(std::make_unique<MapDownload>(context_.options.width, context_.options.height));
    } else {
      hand_out_first();
    }
  }
}

/// Depths, normals and confidences of the planes.
void CudaEngine::send_depths(const CudaFrame& frame, const float4* planes, const float* confidence,
                             const std::function<void(const DepthMap&)>& to) {
  MapDownload& download = free_download();
  launch(kernels::DepthImage<DeviceMachine>{planes_of(planes), confidence, grid_->view(), download.depth(),
                                            download.normal(), download.confidence()},
         nullptr, compute_.get());
  download.busy = true;
  download.start(compute_, down_);
  expect([this, &download, id = frame.id, pose = frame.cam_from_world, to] {
    const DepthMap& map = download.finish(id, pose);
    download.busy = false;  // nobody else can ask for it before `to` returns or throws
    if (!cancelled()) to(map);
  });
}

/// Adds what a stage has taken, from the record's first mark to its second, to the statistics.
void CudaEngine::expect_time(const std::shared_ptr<Record>& record, double DensifierStats::*seconds) {
  expect([this, record, seconds] {
    record->marks[1].wait();
    context_.stats.*seconds += record->marks[1].seconds_since(record->marks[0]);
  });
}

/// Whether nobody has cancelled; asked before each pass, while not too much is queued.
bool CudaEngine::may_go_on() {
  while (!cancelled() && pending_.size() > kMostPending) hand_out_first();
  return !cancelled();
}

void CudaEngine::hand_out_first() {
  const Pending first = std::move(pending_.front());
  pending_.pop_front();
  first.hand_out();
}

}  // namespace

std::unique_ptr<Engine> make_engine(const EngineContext& context, Executor executor) {
  const DeviceScope scope(context.options.device);
  return std::make_unique<CudaEngine>(context, std::move(executor));
}

}  // namespace pmsp::cuda
