// SPDX-License-Identifier: BSD-2-Clause
#include "cpu/cpu_processor.h"

#include <algorithm>
#include <bitset>

#include "depth_image.h"
#include "init/init_setup.h"
#include "pmsp/error.h"
#include "sphere/panorama_data.h"
#include "util/eigen_kernels.h"

namespace pmsp {

Array<std::uint32_t> color_words(const Image<Rgb>& color, const Executor& executor) {
  Array<std::uint32_t> packed(new std::uint32_t[color.size()]);
  const std::size_t width = static_cast<std::size_t>(color.width());
  pool_of(executor).for_each(color.height(), [&](int y) {
    const Rgb* const from = color.row(y);
    std::uint32_t* const to = packed.get() + static_cast<std::size_t>(y) * width;
    for (std::size_t x = 0; x < width; ++x) {
      to[x] = from[x].r | static_cast<std::uint32_t>(from[x].g) << 8U | static_cast<std::uint32_t>(from[x].b) << 16U;
    }
  });
  return packed;
}

void collect_points(const kernels::ConstSurfelArrays& map, const kernels::GridView& grid, KeyframeCloud& cloud) {
  const std::uint8_t* const statuses = map.statuses;
  const int pixels = grid.width * grid.height;
  const std::size_t count = static_cast<std::size_t>(std::count_if(statuses, statuses + pixels, kernels::makes_point));
  cloud.points.reserve(count);
  cloud.pixels.reserve(count);
  cloud.agree.reserve(count);
  for (int pixel = 0; pixel < pixels; ++pixel) {
    if (!kernels::makes_point(statuses[pixel])) continue;
    const kernels::EmittedPoint emitted = kernels::emitted_point(map, grid, pixel);
    CloudPoint point;
    point.position = to_eigen(emitted.position);
    point.normal = to_eigen(emitted.normal);
    point.color = {emitted.color[0], emitted.color[1], emitted.color[2]};
    point.views = static_cast<std::uint8_t>(1 + std::bitset<32>(emitted.agree).count());
    point.confidence = emitted.confidence;
    cloud.points.push_back(point);
    cloud.pixels.push_back(static_cast<std::uint32_t>(pixel));
    cloud.agree.push_back(emitted.agree);
  }
}

Array<std::uint64_t> CpuProcessor::keys() const {
  Array<std::uint64_t> keys = array<std::uint64_t>(grid_->size());
  std::fill_n(keys.get(), grid_->size(), kernels::kNoKey);
  return keys;
}

kernels::PlaneMapView CpuProcessor::map(const Planes& planes) const {
  if (!planes) return {};
  const kernels::PlaneArrays from = to(planes);
  return {from.x, from.y, from.z, grid_->width(), grid_->height(), from.score};
}

kernels::PlaneArrays CpuProcessor::to(const Planes& planes) const {
  float* const x = planes.get();
  const std::size_t size = grid_->size();
  return {x, x + size, x + 2 * size, x + 3 * size};
}

CpuProcessor::Prepared CpuProcessor::prepare(const Keyframe& keyframe, double& seconds) {
  const Stopwatch watch(seconds);
  PanoramaData data =
      prepare_panorama(keyframe.image, keyframe.mask, grid_->width(), grid_->height(), image_scale_, executor_, nodes_);
  Prepared image;
  image.cubes.gray = std::make_shared<CubeMap>(std::move(data.gray));
  image.color = color_words(data.color, executor_);
  if (data.mask.empty()) return image;
  image.cubes.matchable = std::make_shared<CubeMap>(std::move(data.matchable));
  image.mask = upload(data.mask.pixels());
  return image;
}

std::size_t CpuProcessor::bytes(const Cubes& cubes) const {
  const auto size = [](const auto& cube) { return cube ? cube->quads.size() * sizeof(std::uint64_t) : 0; };
  return size(cubes.gray) + size(cubes.matchable);
}

CubePacking CpuProcessor::packing(const Cubes& cubes) const {
  const std::size_t nodes = node_count(cubes.gray->size);
  if (!cubes.matchable) return {nodes, cubes.gray->size, 0};
  return {nodes + node_count(cubes.matchable->size), cubes.gray->size, cubes.matchable->size};
}

Array<std::uint16_t> CpuProcessor::pack(const Cubes& cubes) const {
  Array<std::uint16_t> packed = array<std::uint16_t>(packing(cubes).count);
  write_nodes(*cubes.gray, packed.get());
  if (cubes.matchable) write_nodes(*cubes.matchable, packed.get() + node_count(cubes.gray->size));
  return packed;
}

CpuProcessor::Cubes CpuProcessor::unpack(const Array<std::uint16_t>& packed, const CubePacking& packing) const {
  const auto unpacked = [&](const std::uint16_t* nodes, int side) {
    return std::make_shared<CubeMap>(cube_of_nodes(nodes, side, pool_of(executor_)));
  };
  Cubes cubes{unpacked(packed.get(), packing.side), nullptr};
  if (packing.matchable_side > 0)
    cubes.matchable = unpacked(packed.get() + node_count(packing.side), packing.matchable_side);
  return cubes;
}

std::pair<Array<kernels::SparsePoint>, int> CpuProcessor::landmarks(const Keyframe& keyframe, double lens) const {
  const auto points = array<kernels::SparsePoint>(keyframe.landmarks.size());
  const std::size_t count = sparse_points(keyframe, lens, grid_->width(), grid_->height(), points.get());
  return {points, static_cast<int>(count)};
}

void CpuProcessor::start(const Pass& pass) const {
  auto& impl = impl_of(executor_);
  impl.pool.for_each(pass.grid.height, [&](int y) { impl.rows.start_row(pass, y); });
}

void CpuProcessor::iterate(const Pass& pass, int colour, int iteration, bool rescore) const {
  auto& impl = impl_of(executor_);
  impl.pool.for_each(pass.grid.height, [&](int y) {
    if (is_cancelled()) return;  // of each row, since rows are slow at low priority
    impl.rows.iterate_row(pass, y, colour, iteration, rescore);
  });
}

void CpuProcessor::remove_duplicates(const kernels::DuplicateRound& stage, DuplicateCandidates& candidates) const {
  auto& impl = impl_of(executor_);
  const std::size_t rows = static_cast<std::size_t>(stage.height());
  const std::ptrdiff_t width = stage.width();
  std::vector<std::size_t> first(rows + 1);  // number of open pixels before each row
  for (std::size_t y = 0; y < rows; ++y) {
    const std::uint8_t* const row = stage.map.statuses + static_cast<std::ptrdiff_t>(y) * width;
    first[y + 1] = first[y] + static_cast<std::size_t>(std::count_if(row, row + width, [](std::uint8_t packed) {
                     return kernels::status_of(packed) == kernels::PointStatus::kOpen;
                   }));
  }
  if (candidates.count > 0 && candidates.count != first[rows]) {
    throw InvalidInput("duplicate_round: the statuses are not those of the previous round");
  }
  std::uint32_t available = 0;
  for (int k = 0; k < stage.count; ++k) available |= stage.others[k].map.surfels == nullptr ? 0U : 1U << k;
  std::vector<std::vector<std::uint32_t>> remaining(rows);
  impl.pool.for_each(stage.height(), [&](int y) {
    const std::size_t row = static_cast<std::size_t>(y);
    const std::uint32_t* const row_candidates = candidates.count == 0 ? nullptr : candidates.bits.get() + first[row];
    std::vector<std::uint32_t> left(first[row + 1] - first[row]);
    const int count = impl.rows.duplicate_row(stage, y, row_candidates, available, left.data());
    remaining[row].assign(left.begin(), left.begin() + count);
  });
  candidates = {};
  for (const std::vector<std::uint32_t>& row : remaining) candidates.count += row.size();
  candidates.bits = array<std::uint32_t>(candidates.count);
  std::uint32_t* to = candidates.bits.get();
  for (const std::vector<std::uint32_t>& row : remaining) to = std::copy(row.begin(), row.end(), to);
}

DepthMap CpuProcessor::depth_map(std::int64_t id, const KeyframePose& pose, const kernels::PlaneMapView& map,
                                 const float* confidence) const {
  static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float), "normals are written as numbers");
  DepthMap depths{id,
                  pose.cam_from_world,
                  Image<float>(map.width, map.height),
                  Image<Eigen::Vector3f>(map.width, map.height, Eigen::Vector3f::Zero()),
                  Image<float>(map.width, map.height),
                  pose.scale};
  launch(kernels::DepthImage<ViewTypes>{map, confidence, grid(), depths.depth.pixels().data(),
                                        depths.normal.pixels().data()->data(), depths.confidence.pixels().data()},
         nullptr);
  return depths;
}

void CpuProcessor::emit_points(const kernels::ConstSurfelArrays& map, KeyframeCloud cloud, double& seconds,
                               const std::function<void(const KeyframeCloud&)>& to) const {
  timed(seconds, [&] { collect_points(map, grid(), cloud); });
  to(cloud);
}

void CpuProcessor::emit_planes(std::int64_t id, const KeyframePose& pose, const Planes& planes,
                               const std::function<void(const PlaneMap&)>& to) const {
  PlaneMap map(grid_->width(), grid_->height());
  map.keyframe_id = id;
  map.cam_from_world = pose.cam_from_world;
  map.scale = pose.scale;
  const float* from = planes.get();
  for (Image<float>* const part : {&map.x, &map.y, &map.z, &map.score}) {
    std::copy_n(from, grid_->size(), part->pixels().data());
    from += grid_->size();
  }
  to(map);
}

CpuProcessor::Planes CpuProcessor::planes_of(const PlaneMap& map) const {
  Planes planes = this->planes();
  float* to = planes.get();
  for (const Image<float>* const part : {&map.x, &map.y, &map.z, &map.score}) {
    to = std::copy_n(part->pixels().data(), grid_->size(), to);
  }
  return planes;
}

}  // namespace pmsp
