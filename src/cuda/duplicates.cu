// SPDX-License-Identifier: BSD-2-Clause
#include "cuda/device_code.h"
#include "cuda/launch.h"

// Rounds of duplicate removal, one thread per pixel; counterpart of src/cpu/duplicate_row.h.
namespace pmsp::cuda {
namespace {

using kernels::PointStatus;

constexpr int kWarp = 32;
constexpr unsigned int kAll = 0xffffffffU;  ///< all threads of a warp
constexpr float kMany = 8.0F;  ///< half width of the search in a row [px] from which on a warp searches together

/// Search of a thread in another keyframe, in its frame.
struct Search {
  Vec3<float> point, normal;
  kernels::SurfaceDistance<float> off;
  float rank;
  kernels::SearchRegion<float> there;
};

/// Whether the other map has a duplicate of a point, and whether one is kept.
struct Duplicates {
  bool any, kept;
};

__device__ void compare_pixel(const DuplicateArgs& args, const kernels::DuplicateView& other, const Search& search,
                              int pixel, Duplicates& found) {
  const std::uint8_t status = other.map.statuses[pixel];
  if (!kernels::makes_point(status)) return;
  const Vec3<float> bearing =
      kernels::bearing_at<float>(args.round.grid, pixel % other.map.width, pixel / other.map.width);
  if (!kernels::is_duplicate<float>(other.map.surfels[pixel], status, bearing, search.point, search.normal, search.off,
                                    search.rank, other, args.round.limits)) {
    return;
  }
  found.any = true;
  found.kept = found.kept || kernels::status_of(status) == PointStatus::kKept;
}

/// Compares the pixels within the search radius until the answer is known: before the first round none is kept.
__device__ Duplicates search_within(const DuplicateArgs& args, const kernels::DuplicateView& other,
                                    const Search& search, int thread, int threads) {
  Duplicates found{false, false};
  kernels::find_within(
      search.there.at, search.there.spacing, args.round.grid.cos_lat, other.map.width, other.map.height,
      [&](int pixel) {
        compare_pixel(args, other, search, pixel, found);
        return found.kept || (args.first && found.any);
      },
      thread, threads);
  return found;
}

__device__ Vec3<float> of_thread(const Vec3<float>& v, int thread) {
  return {__shfl_sync(kAll, v.x, thread), __shfl_sync(kAll, v.y, thread), __shfl_sync(kAll, v.z, thread)};
}
__device__ Search of_thread(const Search& search, int thread) {
  return {of_thread(search.point, thread),
          of_thread(search.normal, thread),
          {__shfl_sync(kAll, search.off.error, thread), __shfl_sync(kAll, search.off.max, thread)},
          __shfl_sync(kAll, search.rank, thread),
          {{__shfl_sync(kAll, search.there.at.x, thread), __shfl_sync(kAll, search.there.at.y, thread)},
           __shfl_sync(kAll, search.there.spacing, thread)}};
}

/// Searches keyframe `k` for duplicates of each thread's open pixel, if `searches`. Pixels crowd near the poles:
/// instead of waiting for the few threads with points there, all threads search for each of them. Called by all threads
/// of a warp.
__device__ Duplicates search_other(const DuplicateArgs& args, bool searches, int k,
                                   const kernels::OpenPoint<float>& open_point) {
  const int thread = static_cast<int>(threadIdx.x);
  const kernels::DuplicateView& other = args.round.others[k];
  Duplicates found{false, false};
  Search search{{}, open_point.normal, open_point.off, open_point.rank, {}};
  bool many = false;
  search.point = kernels::transform(other.other_from_first, open_point.point);
  if (searches && kernels::may_rank_higher(search.point, open_point.rank, other)) {
    search.there = kernels::search_region(search.point, open_point.reach, other);
    const kernels::PixelsInRadius<float> reached =
        kernels::pixels_in_radius(search.there, args.round.grid, other.map.width, other.map.height);
    if (reached.single) compare_pixel(args, other, search, reached.row * other.map.width + reached.column, found);
    many = reached.multiple && search.there.spacing > kMany * args.round.grid.cos_lat[reached.row];
    if (reached.multiple && !many) found = search_within(args, other, search, 0, 1);
  }
  for (unsigned int left = __ballot_sync(kAll, many); left != 0; left &= left - 1) {
    const int whose = __ffs(static_cast<int>(left)) - 1;
    const kernels::DuplicateView& its_other = args.round.others[__shfl_sync(kAll, k, whose)];
    const Duplicates part = search_within(args, its_other, of_thread(search, whose), thread, kWarp);
    const bool any = __any_sync(kAll, part.any) != 0;
    const bool kept = __any_sync(kAll, part.kept) != 0;
    if (thread == whose) found = {any, kept};
  }
  return found;
}

__device__ std::uint32_t all_views(int count) { return count < 32 ? (1U << static_cast<unsigned>(count)) - 1U : ~0U; }

__global__ void duplicate_kernel(const __grid_constant__ DuplicateArgs args) {
  const kernels::DuplicateRound& round = args.round;
  const int x = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  const bool inside = x < round.width() && y < round.height();
  const int pixel = inside ? y * round.width() + x : 0;
  const std::uint8_t before = inside ? round.map.statuses[pixel] : 0;
  const bool decides = inside && kernels::status_of(before) == PointStatus::kOpen;
  if (inside && !decides) round.statuses[pixel] = before;
  if (__any_sync(kAll, decides) == 0) return;
  kernels::OpenPoint<float> open_point{};
  std::uint32_t pending = 0;
  if (decides) {
    open_point = kernels::open_point_of<float>(round.map.surfels[pixel], before,
                                               kernels::bearing_at<float>(round.grid, x, y), round.map, round.limits);
    pending = args.first ? all_views(round.count) : args.candidates[pixel];
  }
  std::uint32_t open = 0;
  bool dropped = false;
  while (__any_sync(kAll, pending != 0) != 0) {
    const std::uint32_t bit = pending & (0U - pending);  // the next one, or 0
    const Duplicates found = search_other(args, pending != 0, max(__ffs(static_cast<int>(pending)) - 1, 0), open_point);
    if (found.any) open |= bit;
    dropped = dropped || found.kept;
    pending = dropped ? 0 : pending ^ bit;
  }
  if (!decides) return;
  args.candidates[pixel] = open;
  round.statuses[pixel] = kernels::with_status(before, dropped     ? PointStatus::kDropped
                                                       : open != 0 ? PointStatus::kOpen
                                                                   : PointStatus::kKept);
}

}  // namespace

void remove_duplicates(const DuplicateArgs& args, cudaStream_t stream) {
  const dim3 block(kWarp, 2);
  duplicate_kernel<<<image_grid(args.round.width(), args.round.height(), 1, block), block, 0, stream>>>(args);
  PMSP_CUDA_LAUNCHED();
}

}  // namespace pmsp::cuda
