// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "cpu/executor_impl.h"
#include "engine.h"
#include "fused_point.h"
#include "init.h"
#include "processor.h"
#include "sphere/cube_map.h"
#include "sphere/grid.h"
#include "util/scratch_file.h"
#include "util/stopwatch.h"

namespace pmsp {

/// Keys of pixels in host memory; threads may offer keys for one pixel concurrently.
struct HostKeys {
  std::uint64_t* keys;
};
inline void atomic_min_key(const HostKeys& keys, int pixel, std::uint64_t key) {
  std::uint64_t* const at = keys.keys + pixel;
  std::uint64_t known = __atomic_load_n(at, __ATOMIC_RELAXED);
  while (key < known && !__atomic_compare_exchange_n(at, &known, key, true, __ATOMIC_RELAXED, __ATOMIC_RELAXED)) {
  }
}

/// Colours in the format of the kernels.
Array<std::uint32_t> color_words(const Image<Rgb>& color, const Executor& executor);

/// Appends the points of a keyframe to `cloud`; other members stay unchanged.
void collect_points(const kernels::ConstSurfelArrays& map, const kernels::GridView& grid, KeyframeCloud& cloud);

/// CPU processor: calls return when their work is done (see processor.h).
class CpuProcessor {
 public:
  using ViewTypes = kernels::HostViewTypes;
  using Keys = HostKeys;
  using Planes = Array<float>;  ///< x, y, z and score of all pixels, consecutively
  using Color = std::uint32_t;
  using Counts = std::int64_t;
  using Pass = kernels::PatchMatchPass<ViewTypes>;
  static constexpr int kMostCounts = 3;
  struct Cubes {
    std::shared_ptr<const CubeMap> gray, matchable;
  };
  struct Prepared {
    Cubes cubes;
    Array<Color> color;
    Array<std::uint8_t> mask;
  };
  static constexpr int kThreadsPerPriorCell = 1;
  static constexpr bool kMaskInColor = false;

  using ReadyEvent = std::nullptr_t;
  struct Queue {
    explicit Queue(const EngineContext& /*context*/) {}
    void deliver(bool /*all*/) const {}
  };

  static int number_of(const EngineContext& /*context*/) { return 1; }
  CpuProcessor(const EngineContext& context, const Executor& executor, int /*number*/, Queue& /*queue*/)
      : cancel_(&context.cancel), image_scale_(context.options.advanced.patchmatch.image_scale), executor_(executor) {}
  /// For single stages, without an engine.
  CpuProcessor(const Executor& executor, int width, int height) : executor_(executor) { set_size(width, height); }

  std::size_t number() const { return 0; }
  ReadyEvent mark() const { return nullptr; }
  template <class T>
  Array<T> copy_from(const Array<T>& from, std::size_t /*count*/, const CpuProcessor& /*home*/,
                     ReadyEvent /*made*/) const {
    return from;
  }
  void synchronize() const {}

  int enter() const { return 0; }
  void set_size(int width, int height) {
    if (!grid_) grid_.emplace(width, height);
  }
  bool limit_results_in_flight() const { return !is_cancelled(); }
  bool is_cancelled() const { return cancel_ != nullptr && cancel_->load(std::memory_order_relaxed); }
  kernels::GridView grid() const { return grid_->view(); }

  template <class T>
  Array<T> array(std::size_t count) const {
    return Array<T>(new T[count]);
  }
  Planes planes() const { return array<float>(plane_numbers()); }
  std::size_t plane_numbers() const { return 4 * grid_->size(); }
  Array<std::uint64_t> keys() const;
  kernels::PlaneMapView map(const Planes& planes) const;
  kernels::PlaneArrays to(const Planes& planes) const;
  template <class T>
  Array<T> upload(const std::vector<T>& values) const {
    Array<T> copy = array<T>(values.size());
    std::copy(values.begin(), values.end(), copy.get());
    return copy;
  }

  Prepared prepare(const Keyframe& keyframe, double& seconds);
  kernels::CubeView gray(const Cubes& cubes) const { return cubes.gray->view(); }
  kernels::CubeView matchable(const Cubes& cubes) const {
    return cubes.matchable ? cubes.matchable->view() : kernels::CubeView{};
  }
  std::size_t bytes(const Cubes& cubes) const;
  CubePacking packing(const Cubes& cubes) const;
  Array<std::uint16_t> pack(const Cubes& cubes) const;
  Cubes unpack(const Array<std::uint16_t>& packed, const CubePacking& packing) const;
  const std::uint32_t* color(const Array<Color>& color) const { return color.get(); }
  kernels::ByteMask mask(const Array<Color>& /*color*/, const Array<std::uint8_t>& mask) const { return {mask.get()}; }

  std::pair<Array<kernels::SparsePoint>, int> landmarks(const Keyframe& keyframe, double lens) const;
  template <class Source>
  kernels::PlaneMapView planes_of_keys(const Source& source, Planes& planes) const {
    planes = this->planes();
    launch(kernels::PlanesOfKeys<ViewTypes, Source>{source, grid(), to(planes)}, nullptr);
    return map(planes);
  }

  template <class Stage>
  void launch(const Stage& stage, Counts* counts) const {
    static_assert(Stage::kCounts <= kMostCounts, "room for what is counted");
    const auto sums = impl_of(executor_).run(stage);
    if (counts != nullptr) std::copy(sums.begin(), sums.end(), counts);
  }
  void splat(const kernels::SplatLandmarks<Keys>& splat, int count) const {
    for (int i = 0; i < count; ++i) splat(i, 0, 1);
  }
  void start(const Pass& pass) const;
  void iterate(const Pass& pass, int colour, int iteration, bool rescore) const;
  /// Searches only the candidates of each open pixel, and updates these.
  void remove_duplicates(const kernels::DuplicateRound& stage, DuplicateCandidates& candidates) const;

  template <class Work>
  void timed(double& seconds, const Work& work) const {
    const Stopwatch watch(seconds);
    work();
  }
  template <class Work, class Then>
  void counted(double& seconds, const Work& work, const Then& then) const {
    std::array<Counts, kMostCounts> counts{};
    timed(seconds, [&] { work(counts.data()); });
    then(counts.data());
  }

  DepthMap depth_map(std::int64_t id, const KeyframePose& pose, const kernels::PlaneMapView& map,
                     const float* confidence) const;
  void emit_depths(std::int64_t id, const KeyframePose& pose, const kernels::PlaneMapView& map, const float* confidence,
                   const std::function<void(const DepthMap&)>& to) const {
    to(depth_map(id, pose, map, confidence));
  }
  void emit_points(const kernels::ConstSurfelArrays& map, KeyframeCloud cloud, double& seconds,
                   const std::function<void(const KeyframeCloud&)>& to) const;
  void emit_planes(std::int64_t id, const KeyframePose& pose, const Planes& planes,
                   const std::function<void(const PlaneMap&)>& to) const;
  Planes planes_of(const PlaneMap& map) const;

  template <class T>
  void save(const Array<T>& array, std::size_t count, ScratchFile& scratch, std::uint64_t at) const {
    scratch.write(at, array.get(), count * sizeof(T));
  }
  template <class T>
  Array<T> load(std::size_t count, const ScratchFile& scratch, std::uint64_t at) const {
    Array<T> copy = array<T>(count);
    scratch.read(at, copy.get(), count * sizeof(T));
    return copy;
  }

 private:
  const std::atomic<bool>* cancel_ = nullptr;
  double image_scale_ = PatchMatchOptions().image_scale;
  std::optional<CubeNodes> nodes_;  ///< of the last image's cube map
  const Executor& executor_;
  std::optional<SphereGrid> grid_;
};

}  // namespace pmsp
