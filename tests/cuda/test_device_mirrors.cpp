// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <memory>
#include <vector>

#include "core/helpers.h"
#include "core/on_depth_maps.h"
#include "cuda/launch.h"
#include "cuda/on_device.h"
#include "cuda/transfers.h"
#include "fusion/fusion_setup.h"
#include "fusion/mirrors.h"
#include "pmsp/stages.h"
#include "util/eigen_kernels.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

/// The part of a processor that mirror removal uses.
struct Plain {
  kernels::GridView view;

  kernels::GridView grid() const { return view; }
  template <class T>
  Array<T> array(std::size_t count) const {
    auto held = std::make_shared<cuda::DeviceArray<T>>(count);
    return Array<T>(held, held->get());
  }
  template <class Stage>
  void launch(const Stage& stage, cuda::Counts* counts) const {
    cuda::launch(stage, counts, nullptr);
  }
};

}  // namespace

TEST_CASE("mirror images on the device equal those of the host", "[cuda][mirrors]") {
  const synth::Mission room = synth::empty_room(small_recipe(160, 5));
  std::vector<DepthMap> maps = truth_maps(room);
  const std::vector<std::size_t> ghosts = look_through_floor(maps[2], room.scene, 0.3, 2.5);
  const Executor executor;
  for (float& confidence : maps[2].confidence.pixels()) confidence = 0.8F;
  const KeyframePose pose{maps[2].cam_from_world};
  const Image<Rgb> color(room.width, room.height);
  const SurfelMap points = fuse_pixels({{&maps[2], &color, pose}}, 0, {}, executor);
  std::vector<RangeMap> range_maps;
  for (const DepthMap& map : maps) range_maps.push_back(range_map(map, executor));

  const cuda::Stream stream;
  const cuda::DeviceGrid grid(room.width, room.height, stream);
  PMSP_CUDA_CHECK(cudaDeviceSynchronize());
  const auto surfels = uploaded(points.surfels.pixels());
  const auto details = uploaded(points.details.pixels());
  const cuda::DeviceArray<std::uint8_t> statuses(points.surfels.size());
  const cuda::DeviceArray<cuda::Counts> counts(1);
  PMSP_CUDA_CHECK(cudaMemset(counts.get(), 0, sizeof(cuda::Counts)));
  std::vector<PosedRangeMap> viewers;
  std::vector<cuda::DeviceArray<float>> depths;
  std::vector<kernels::Rigid> from_viewers;
  kernels::FreeSpaceTest stage{};
  stage.surfels = surfels.get();
  stage.details = details.get();
  stage.grid = grid.view();
  stage.limits = free_space_limits({});
  stage.max_contradiction = static_cast<float>(FreeSpaceOptions{}.max_contradiction);
  stage.statuses = statuses.get();
  for (const std::size_t k : {0U, 1U, 3U, 4U}) {
    const RangeMap& ranges = range_maps[k];
    viewers.push_back({&ranges, {ranges.cam_from_world}});
    depths.push_back(uploaded(ranges.nearest.pixels()));
    depths.push_back(uploaded(ranges.farthest.pixels()));
    const RelativePose to = relative_pose(viewers.back().pose, pose);
    stage.viewers[stage.count++] = {
        {depths[depths.size() - 2].get(), depths.back().get(), room.width / 2, room.height / 2},
        to.other_from_first,
        to.scale_ratio};
    from_viewers.push_back(relative_pose(pose, viewers.back().pose).other_from_first);
  }
  const Plain on{grid.view()};
  const Mirrors mirrors = find_mirrors(on, from_viewers, stage);
  cuda::launch(stage, counts.get(), nullptr);
  PMSP_CUDA_CHECK(cudaDeviceSynchronize());

  const Image<std::uint8_t> host = free_space_filter(points, pose, viewers, {}, executor);
  const std::vector<std::uint8_t> device = downloaded(statuses);
  std::size_t same = 0;
  for (std::size_t i = 0; i < device.size(); ++i) same += (device[i] != 0) == (host.pixels()[i] != 0) ? 1 : 0;
  std::size_t left = 0;
  for (const std::size_t pixel : ghosts) left += device[pixel] != 0 ? 1 : 0;
  CHECK(static_cast<double>(same) >= 0.995 * static_cast<double>(device.size()));
  CHECK(static_cast<double>(left) < 0.05 * static_cast<double>(ghosts.size()));
}
