// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "core/helpers.h"
#include "core/on_depth_maps.h"
#include "cuda/launch.h"
#include "cuda/on_device.h"
#include "cuda/transfers.h"
#include "fusion/fusion_setup.h"
#include "pmsp/stages.h"
#include "util/eigen_kernels.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

constexpr int kRounds = 4;
constexpr std::size_t kAgreeBytes = 1;

/// Depth maps of a mission and their points on host and device; each keyframe is compared with all others.
struct Flight {
  explicit Flight(int width, int keyframes) : mission(synth::sphere_inside(small_recipe(width, keyframes))) {
    maps = truth_maps(mission);
    for (std::size_t k = 0; k < maps.size(); ++k) {
      DepthMap& map = maps[k];
      for (std::size_t i = 0; i < map.depth.size(); ++i) {  // wavy, with floaters, holes, and low confidences
        float& depth = map.depth.pixels()[i];
        if (!(depth > 0.0F)) continue;
        depth *= 1.0F + 0.002F * std::sin(0.37F * static_cast<float>(i) + static_cast<float>(k));
        if (i % 97 < 4) depth *= 0.6F;
        map.confidence.pixels()[i] = 0.6F + 0.35F * std::sin(0.11F * static_cast<float>(i + 31 * k));
        if (i % 53 == k) depth = 0.0F;
      }
      clear_where_no_depth(map);
      colors.emplace_back(mission.width, mission.height);
      for (std::size_t i = 0; i < map.depth.size(); ++i) {
        colors[k].pixels()[i] = mission.frames[k].image.pixels()[i];
      }
      poses.push_back({map.cam_from_world, 1.0});
    }
    // A keyframe in units of another length.
    for (float& depth : maps[1].depth.pixels()) depth *= 0.5F;
    poses[1].scale = 2.0;
  }

  std::size_t size() const { return maps.size(); }

  synth::Mission mission;
  std::vector<DepthMap> maps;
  std::vector<Image<Rgb>> colors;
  std::vector<KeyframePose> poses;
  FusionOptions fusion;
  FreeSpaceOptions free_space;
};

std::vector<SurfelMap> on_host(const Flight& flight, std::vector<KeyframeCloud>& clouds) {
  const Executor executor;
  std::vector<FusedDepth> window;
  for (std::size_t k = 0; k < flight.size(); ++k) {
    window.push_back({&flight.maps[k], &flight.colors[k], flight.poses[k]});
  }
  std::vector<SurfelMap> surfels;
  std::vector<RangeMap> range_maps;
  for (std::size_t i = 0; i < flight.size(); ++i) {
    surfels.push_back(fuse_pixels(window, i, flight.fusion, executor));
    range_maps.push_back(range_map(flight.maps[i], executor));
  }
  for (std::size_t i = 0; i < flight.size(); ++i) {
    std::vector<PosedRangeMap> asked;
    for (std::size_t k = 0; k < flight.size(); ++k) {
      if (k != i) asked.push_back({&range_maps[k], flight.poses[k]});
    }
    surfels[i].statuses = free_space_filter(surfels[i], flight.poses[i], asked, flight.free_space, executor);
  }
  std::vector<std::vector<std::uint32_t>> still(flight.size());
  for (int round = 0; round < kRounds; ++round) {
    std::vector<Image<std::uint8_t>> next;
    for (std::size_t i = 0; i < flight.size(); ++i) {
      std::vector<PosedSurfels> asked;
      for (std::size_t k = 0; k < flight.size(); ++k) {
        if (k != i) asked.push_back({&surfels[k], &surfels[k].statuses, flight.poses[k]});
      }
      next.push_back(duplicate_round({&surfels[i], &surfels[i].statuses, flight.poses[i]}, still[i], asked,
                                     flight.fusion, executor));
    }
    for (std::size_t i = 0; i < flight.size(); ++i) surfels[i].statuses = next[i];
  }
  for (std::size_t i = 0; i < flight.size(); ++i)
    clouds.push_back(extract_points({&surfels[i], &surfels[i].statuses, flight.poses[i]}));
  return surfels;
}

/// One keyframe's arrays on the device.
struct OnDevice {
  cuda::DeviceArray<float4> planes;
  cuda::DeviceArray<float> confidence;
  cuda::DeviceArray<std::uint32_t> color;
  cuda::DeviceArray<std::uint32_t> surfels, details, asked;
  cuda::DeviceArray<std::uint8_t> agree, statuses, next;
  cuda::DeviceArray<float> nearest, farthest;
};

struct DeviceResult {
  std::vector<std::uint32_t> surfels, details;
  std::vector<std::uint8_t> agree, statuses;
  std::vector<cuda::DevicePoint> points;
  std::vector<unsigned int> pixels;
  std::vector<std::uint32_t> agree_of_points;
};

OnDevice uploaded_map(const Flight& flight, std::size_t k) {
  const DepthMap& map = flight.maps[k];
  const PlaneMap made = plane_map_of(map, Executor(1));
  std::vector<float4> planes(map.depth.size(), float4{0.0F, 0.0F, 0.0F, 0.0F});
  std::vector<std::uint32_t> color(map.depth.size());
  for (int y = 0; y < map.depth.height(); ++y) {
    for (int x = 0; x < map.depth.width(); ++x) {
      const std::size_t at = static_cast<std::size_t>(y * map.depth.width() + x);
      const Rgb& rgb = flight.colors[k](x, y);
      color[at] = rgb.r | static_cast<std::uint32_t>(rgb.g) << 8U | static_cast<std::uint32_t>(rgb.b) << 16U;
      if (!(map.depth(x, y) > 0.0F)) continue;
      planes[at] = float4{made.x(x, y), made.y(x, y), made.z(x, y), 1.0F};
    }
  }
  const std::size_t pixels = map.depth.size();
  OnDevice arrays;
  arrays.planes = uploaded(planes);
  arrays.confidence = uploaded(map.confidence.pixels());
  arrays.color = uploaded(color);
  arrays.surfels = cuda::DeviceArray<std::uint32_t>(pixels);
  arrays.details = cuda::DeviceArray<std::uint32_t>(pixels);
  arrays.asked = cuda::DeviceArray<std::uint32_t>(pixels);
  arrays.agree = cuda::DeviceArray<std::uint8_t>(pixels * kAgreeBytes);
  arrays.statuses = cuda::DeviceArray<std::uint8_t>(pixels);
  arrays.next = cuda::DeviceArray<std::uint8_t>(pixels);
  arrays.nearest = cuda::DeviceArray<float>(pixels / 4);
  arrays.farthest = cuda::DeviceArray<float>(pixels / 4);
  return arrays;
}

std::vector<DeviceResult> on_device(const Flight& flight) {
  const int width = flight.mission.width;
  const int height = flight.mission.height;
  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  const cuda::Stream stream;
  const cuda::DeviceGrid grid(width, height, stream);
  PMSP_CUDA_CHECK(cudaDeviceSynchronize());
  std::vector<OnDevice> frames;
  const cuda::DeviceArray<cuda::Counts> counts(1);
  PMSP_CUDA_CHECK(cudaMemset(counts.get(), 0, sizeof(cuda::Counts)));
  for (std::size_t k = 0; k < flight.size(); ++k) frames.push_back(uploaded_map(flight, k));
  using ViewTypes = cuda::DeviceViewTypes;
  const auto filtered = [&](std::size_t k) {
    return kernels::FilteredMap<cuda::DevicePlanes>{
        {frames[k].planes.get(), width, height}, frames[k].confidence.get(), width, height};
  };
  const auto from = [&](std::size_t k, std::size_t i) { return relative_pose(flight.poses[k], flight.poses[i]); };
  for (std::size_t i = 0; i < flight.size(); ++i) {
    const auto view = [&](std::size_t k) {
      return kernels::FusionView<ViewTypes>{filtered(k), frames[k].color.get(), from(k, i).other_from_first,
                                            from(k, i).scale_ratio};
    };
    kernels::FusePixels<ViewTypes> fuse{};
    fuse.grid = grid.view();
    fuse.first = view(i);
    for (std::size_t k = 0; k < flight.size(); ++k) {
      if (k != i) fuse.others[fuse.count++] = view(k);
    }
    fuse.limits = fusion_limits(flight.fusion);
    fuse.to = {frames[i].surfels.get(), frames[i].details.get(), frames[i].statuses.get(), frames[i].agree.get(),
               static_cast<int>(kAgreeBytes)};
    cuda::launch(fuse, counts.get(), nullptr);
    cuda::launch(
        kernels::FindRanges<ViewTypes>{filtered(i), grid.view(), frames[i].nearest.get(), frames[i].farthest.get()},
        nullptr, nullptr);
  }
  for (std::size_t i = 0; i < flight.size(); ++i) {
    kernels::FreeSpaceTest judge{};
    judge.surfels = frames[i].surfels.get();
    judge.details = frames[i].details.get();
    judge.grid = grid.view();
    for (std::size_t k = 0; k < flight.size(); ++k) {
      if (k == i) continue;
      judge.viewers[judge.count++] = {{frames[k].nearest.get(), frames[k].farthest.get(), width / 2, height / 2},
                                      from(k, i).other_from_first,
                                      from(k, i).scale_ratio};
    }
    judge.limits = free_space_limits(flight.free_space);
    judge.max_contradiction = static_cast<float>(flight.free_space.max_contradiction);
    judge.statuses = frames[i].statuses.get();
    cuda::launch(judge, counts.get(), nullptr);
  }
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t i = 0; i < flight.size(); ++i) {
      const auto view = [&](std::size_t k) {
        return kernels::SurfelView{frames[k].surfels.get(), frames[k].statuses.get(), width, height,
                                   static_cast<float>(flight.poses[k].scale)};
      };
      kernels::DuplicateRound stage{};
      stage.map = view(i);
      stage.grid = grid.view();
      for (std::size_t k = 0; k < flight.size(); ++k) {
        if (k == i) continue;
        stage.others[stage.count++] = {view(k), from(k, i).other_from_first, from(k, i).scale_ratio,
                                       flight.maps[k].keyframe_id < flight.maps[i].keyframe_id};
      }
      stage.limits = duplicate_limits(flight.fusion);
      stage.statuses = frames[i].next.get();
      cuda::remove_duplicates({stage, frames[i].asked.get(), round == 0}, nullptr);
    }
    for (OnDevice& frame : frames) std::swap(frame.statuses, frame.next);
  }
  const cuda::DeviceArray<cuda::DevicePoint> points(pixels);
  const cuda::DeviceArray<unsigned int> indices(pixels);
  const cuda::DeviceArray<std::uint32_t> agree(pixels);
  const cuda::DeviceArray<unsigned int> count(1);
  const cuda::DeviceArray<unsigned char> scratch(cuda::emit_scratch_bytes(static_cast<int>(pixels)));
  std::vector<DeviceResult> results;
  for (OnDevice& frame : frames) {
    cuda::extract_points({grid.view(),
                          {frame.surfels.get(), frame.details.get(), frame.statuses.get(), frame.agree.get(),
                           static_cast<int>(kAgreeBytes), 0.0F},
                          points.get(),
                          indices.get(),
                          agree.get(),
                          count.get()},
                         scratch.get(), scratch.size(), nullptr);
    PMSP_CUDA_CHECK(cudaDeviceSynchronize());
    DeviceResult result{downloaded(frame.surfels),  downloaded(frame.details), downloaded(frame.agree),
                        downloaded(frame.statuses), downloaded(points),        downloaded(indices),
                        downloaded(agree)};
    const std::size_t made = downloaded(count).front();
    REQUIRE(made <= pixels);
    result.points.resize(made);
    result.pixels.resize(made);
    result.agree_of_points.resize(made);
    results.push_back(std::move(result));
  }
  return results;
}

void check_same(const Flight& flight) {
  std::vector<KeyframeCloud> clouds;
  const std::vector<SurfelMap> host = on_host(flight, clouds);
  const std::vector<DeviceResult> device = on_device(flight);
  for (std::size_t k = 0; k < flight.size(); ++k) {
    const std::size_t pixels = flight.maps[k].depth.size();
    std::size_t same_standing = 0;
    std::size_t same_depth = 0;
    std::size_t same_agree = 0;
    std::size_t dropped = 0;
    std::size_t rejected = 0;
    for (std::size_t i = 0; i < pixels; ++i) {
      const std::uint8_t status = host[k].statuses.pixels()[i];
      same_standing += (status & 3) == (device[k].statuses[i] & 3) ? 1 : 0;
      dropped += (status & 3) == 3 ? 1 : 0;
      const float depth = kernels::depth_of_surfel<float>(host[k].surfels.pixels()[i]);
      rejected += depth > 0.0F && status == 0 ? 1 : 0;
      same_depth += std::abs(kernels::depth_of_surfel<float>(device[k].surfels[i]) - depth) <= 1e-3F * depth ? 1 : 0;
      same_agree += host[k].agree[i] == device[k].agree[i] ? 1 : 0;
    }
    CAPTURE(k, pixels, same_standing, same_depth, same_agree, dropped, rejected);
    CHECK(static_cast<double>(same_standing) >= 0.995 * static_cast<double>(pixels));
    CHECK(static_cast<double>(same_depth) >= 0.995 * static_cast<double>(pixels));
    CHECK(static_cast<double>(same_agree) >= 0.995 * static_cast<double>(pixels));
    CHECK(rejected > 0);
    const std::vector<CloudPoint>& points = clouds[k].points;
    CAPTURE(points.size(), device[k].points.size());
    CHECK(std::abs(static_cast<double>(device[k].points.size()) - static_cast<double>(points.size())) <=
          0.01 * static_cast<double>(points.size()) + 2.0);
    CHECK(std::is_sorted(device[k].pixels.begin(), device[k].pixels.end()));
    std::size_t common = 0;
    std::size_t equal = 0;
    for (std::size_t i = 0, j = 0; i < points.size() && j < device[k].points.size();) {
      if (clouds[k].pixels[i] != device[k].pixels[j]) {
        clouds[k].pixels[i] < device[k].pixels[j] ? ++i : ++j;
        continue;
      }
      const cuda::DevicePoint& there = device[k].points[j];
      const Eigen::Vector3f position(there.position[0], there.position[1], there.position[2]);
      const Eigen::Vector3f normal(there.normal[0], there.normal[1], there.normal[2]);
      ++common;
      equal += (position - points[i].position).norm() <= 1e-2F * position.norm() &&
                       normal.dot(points[i].normal) > 0.99F && std::abs(there.color[1] - points[i].color.g) <= 2 &&
                       there.views == points[i].views && device[k].agree_of_points[j] == clouds[k].agree[i] &&
                       std::abs(there.confidence - points[i].confidence) < 0.02F
                   ? 1
                   : 0;
      ++i;
      ++j;
    }
    CAPTURE(common, equal);
    CHECK(static_cast<double>(common) >= 0.99 * static_cast<double>(points.size()));
    CHECK(static_cast<double>(equal) >= 0.99 * static_cast<double>(common));
  }
}

}  // namespace

TEST_CASE("duplicate removal on the device equals that of the host", "[cuda][duplicates]") {
  const Flight flight(320, 5);
  check_same(flight);
}

TEST_CASE("duplicate removal of a small mission on the device equals that of the host", "[cuda][duplicates][small]") {
  const Flight flight(64, 3);
  check_same(flight);
}
