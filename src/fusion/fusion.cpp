// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/fusion.h"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <string>
#include <utility>

#include "cpu/executor_impl.h"
#include "filters/depth_map_tools.h"
#include "fusion/fusion_setup.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

void check_scale(const char* stage, const KeyframePose& pose) {
  if (!(pose.scale > 0.0) || !std::isfinite(pose.scale)) {
    throw InvalidInput(std::string(stage) + ": a keyframe's scale is " + std::to_string(pose.scale) +
                       "; expected more than 0");
  }
}

void check_count(const char* stage, std::size_t count) {
  if (count <= static_cast<std::size_t>(kernels::kMaxViewers)) return;
  throw InvalidInput(std::string(stage) + ": " + std::to_string(count) + " keyframes are asked; expected at most " +
                     std::to_string(kernels::kMaxViewers));
}

kernels::GridView view_of(const SphereGrid& grid) {
  return {grid.sin_lon(), grid.cos_lon(), grid.sin_lat(), grid.cos_lat()};
}

template <class A, class B>
bool same_image_size(const Image<A>& a, const Image<B>& b) {
  return a.width() == b.width() && a.height() == b.height();
}

/// Colours as the kernels gather them.
std::vector<std::uint32_t> words(const Image<Rgb>& color, ThreadPool& pool) {
  std::vector<std::uint32_t> packed(color.size());
  const std::size_t width = static_cast<std::size_t>(color.width());
  pool.for_each(color.height(), [&](int y) {
    const Rgb* const from = color.row(y);
    std::uint32_t* const to = packed.data() + static_cast<std::size_t>(y) * width;
    for (std::size_t x = 0; x < width; ++x) {
      to[x] = from[x].r | static_cast<std::uint32_t>(from[x].g) << 8U | static_cast<std::uint32_t>(from[x].b) << 16U;
    }
  });
  return packed;
}

void check(const std::vector<FusionMap>& window, std::size_t current) {
  if (current >= window.size()) throw InvalidInput("fuse_pixels: the current keyframe is not in the window");
  check_count("fuse_pixels", window.size() - 1);
  for (const FusionMap& input : window) {
    if (input.map == nullptr || input.color == nullptr) {
      throw InvalidInput("fuse_pixels: a keyframe of the window lacks its depth map or colours");
    }
    if (!same_size(*input.map, *window.front().map) || !same_image_size(*input.color, input.map->depth) ||
        (input.confidence != nullptr && !same_image_size(*input.confidence, input.map->depth))) {
      throw InvalidInput("fuse_pixels: depth maps, colours and confidences differ in size");
    }
    check_scale("fuse_pixels", input.pose);
  }
}

void check_surfels(const char* stage, const SurfelsFrom& points) {
  check_scale(stage, points.pose);
  if (points.map == nullptr || points.standings == nullptr) {
    throw InvalidInput(std::string(stage) + ": a keyframe lacks its points or their standings");
  }
  if (!same_image_size(points.map->surfels, *points.standings)) {
    throw InvalidInput(std::string(stage) + ": points and standings differ in size");
  }
}

kernels::SurfelView view_of(const SurfelsFrom& points) {
  const Image<std::uint32_t>& surfels = points.map->surfels;
  return {surfels.pixels().data(), points.standings->pixels().data(), surfels.width(), surfels.height(),
          static_cast<float>(points.pose.scale)};
}

std::size_t open_pixels(const std::uint8_t* standings, std::size_t count) {
  return static_cast<std::size_t>(std::count_if(standings, standings + count, [](std::uint8_t packed) {
    return kernels::standing_of(packed) == kernels::Standing::kOpen;
  }));
}

}  // namespace

SurfelMap fuse_pixels(const std::vector<FusionMap>& window, std::size_t current, const FusionOptions& options,
                      const Executor& executor) {
  options.validate();
  check(window, current);
  const DepthMap& map = *window[current].map;
  const int width = map.depth.width();
  const int height = map.depth.height();
  const SphereGrid grid(width, height);
  Executor::Impl& machine = executor.impl();
  std::vector<PlaneRows> planes;
  std::vector<std::vector<std::uint32_t>> colors;
  planes.reserve(window.size());  // views point into them
  colors.reserve(window.size());
  SurfelMap fused;
  using View = kernels::FusionView<kernels::PlaneMapView>;
  std::vector<View> others;
  View first{};
  for (std::size_t k = 0; k < window.size(); ++k) {
    const FusionMap& input = window[k];
    const Relation to = relation(input.pose, window[current].pose);
    planes.emplace_back(*input.map, grid, machine.pool, input.confidence);
    colors.push_back(words(*input.color, machine.pool));
    const Image<float>& confidence = input.confidence != nullptr ? *input.confidence : input.map->confidence;
    const View view{planes.back().view(), confidence.pixels().data(), colors.back().data(), to.other_from_first,
                    to.zoom};
    if (k == current) {
      first = view;
    } else {
      others.push_back(view);
      fused.window_ids.push_back(input.map->keyframe_id);
    }
  }
  fused.keyframe_id = map.keyframe_id;
  fused.surfels = Image<std::uint32_t>(width, height);
  fused.details = Image<std::uint32_t>(width, height);
  fused.standings = Image<std::uint8_t>(width, height);
  fused.agree.resize(fused.surfels.size() * static_cast<std::size_t>(fused.agree_bytes()));
  const cpu::FusedArrays to{fused.surfels.pixels().data(), fused.details.pixels().data(),
                            fused.standings.pixels().data(), fused.agree.data(), fused.agree_bytes()};
  const kernels::FusePixels<kernels::PlaneMapView> stage{first, view_of(grid), others.data(),
                                                         static_cast<int>(others.size()), fusion_limits(options)};
  machine.pool.for_each(height, [&](int y) { machine.rows.fuse_row(stage, y, to); });
  return fused;
}

Image<std::uint8_t> judge(const SurfelMap& map, const KeyframePose& pose, const std::vector<SightFrom>& viewers,
                          const FreeSpaceOptions& options, const Executor& executor) {
  options.validate();
  check_scale("judge", pose);
  const int width = map.surfels.width();
  const int height = map.surfels.height();
  const SphereGrid grid(width, height);
  std::vector<kernels::Viewer> asked;
  for (const SightFrom& viewer : viewers) {
    if (viewer.sight == nullptr) throw InvalidInput("judge: a viewer lacks its sight map");
    const Image<float>& nearest = viewer.sight->nearest;
    if (2 * nearest.width() != width || 2 * nearest.height() != height) {
      throw InvalidInput("judge: maps differ in size");
    }
    check_scale("judge", viewer.pose);
    const Relation to = relation(viewer.pose, pose);
    asked.push_back(
        {{nearest.pixels().data(), viewer.sight->farthest.pixels().data(), nearest.width(), nearest.height()},
         to.other_from_first,
         to.zoom});
  }
  const kernels::Eligibility stage{map.surfels.pixels().data(),
                                   map.details.pixels().data(),
                                   view_of(grid),
                                   width,
                                   asked.data(),
                                   options.enabled ? static_cast<int>(asked.size()) : 0,
                                   sight_limits(options),
                                   static_cast<float>(options.max_contradiction)};
  Image<std::uint8_t> standings(width, height);
  executor.impl().pool.for_each(height, [&](int y) { executor.impl().rows.judge_row(stage, y, standings.row(y)); });
  return standings;
}

Image<std::uint8_t> ownership_round(const SurfelsFrom& reference, std::vector<std::uint32_t>& asked,
                                    const std::vector<SurfelsFrom>& viewers, const FusionOptions& options,
                                    const Executor& executor) {
  options.validate();
  check_count("ownership_round", viewers.size());
  check_surfels("ownership_round", reference);
  const SurfelMap& map = *reference.map;
  const Image<std::uint8_t>& before = *reference.standings;
  const int width = map.surfels.width();
  const int height = map.surfels.height();
  const SphereGrid grid(width, height);
  std::uint32_t there = 0;
  std::vector<kernels::OwnershipView> others;
  for (std::size_t k = 0; k < viewers.size(); ++k) {
    const SurfelsFrom& viewer = viewers[k];
    others.emplace_back();
    if (viewer.map == nullptr) continue;
    check_surfels("ownership_round", viewer);
    if (!same_image_size(viewer.map->surfels, map.surfels)) throw InvalidInput("ownership_round: maps differ in size");
    const Relation to = relation(viewer.pose, reference.pose);
    others.back() = {view_of(viewer), to.other_from_first, to.zoom, viewer.map->keyframe_id < map.keyframe_id};
    there |= 1U << k;
  }
  const std::size_t rows = static_cast<std::size_t>(height);
  std::vector<std::size_t> first(rows + 1);  // open pixels before each row
  for (int y = 0; y < height; ++y) {
    const std::size_t row = static_cast<std::size_t>(y);
    first[row + 1] = first[row] + open_pixels(before.row(y), static_cast<std::size_t>(width));
  }
  if (!asked.empty() && asked.size() != first[rows]) {
    throw InvalidInput("ownership_round: standings are not those of the round before");
  }
  const kernels::OwnershipRound stage{view_of(reference), view_of(grid),
                                      others.data(),      static_cast<int>(others.size()),
                                      asked.empty(),      ownership_limits(options)};
  Image<std::uint8_t> standings(width, height);
  std::vector<std::vector<std::uint32_t>> still(rows);
  executor.impl().pool.for_each(height, [&](int y) {
    const std::size_t row = static_cast<std::size_t>(y);
    const std::uint32_t* const ask = asked.empty() ? nullptr : asked.data() + first[row];
    std::vector<std::uint32_t> left(first[row + 1] - first[row]);
    const int count = executor.impl().rows.own_row(stage, y, ask, there, standings.row(y), left.data());
    still[row].assign(left.begin(), left.begin() + count);
  });
  std::size_t count = 0;
  for (const std::vector<std::uint32_t>& row : still) count += row.size();
  asked.clear();
  asked.shrink_to_fit();
  asked.reserve(count);
  for (const std::vector<std::uint32_t>& row : still) asked.insert(asked.end(), row.begin(), row.end());
  return standings;
}

KeyframeCloud owned_points(const SurfelsFrom& made) {
  check_surfels("owned_points", made);
  const SurfelMap& map = *made.map;
  const int width = map.surfels.width();
  const SphereGrid grid(width, map.surfels.height());
  const kernels::GridView view = view_of(grid);
  KeyframeCloud cloud{map.keyframe_id, made.pose.cam_from_world, {}, made.pose.scale, {}, {}, map.window_ids};
  const std::vector<std::uint8_t>& standings = made.standings->pixels();
  const std::size_t count =
      static_cast<std::size_t>(std::count_if(standings.begin(), standings.end(), kernels::makes_point));
  cloud.points.reserve(count);
  cloud.pixels.reserve(count);
  cloud.agree.reserve(count);
  const std::size_t bytes = static_cast<std::size_t>(map.agree_bytes());
  for (std::size_t pixel = 0; pixel < standings.size(); ++pixel) {
    if (!kernels::makes_point(standings[pixel])) continue;
    const kernels::PackedPoint<std::uint32_t> packed{map.surfels.pixels()[pixel], map.details.pixels()[pixel]};
    const int x = static_cast<int>(pixel) % width;
    const int y = static_cast<int>(pixel) / width;
    std::uint32_t agree = 0;
    for (std::size_t i = 0; i < bytes; ++i) {
      agree |= static_cast<std::uint32_t>(map.agree[bytes * pixel + i]) << (8 * i);
    }
    CloudPoint point;
    point.position = kernels::depth_of_surfel<float>(packed.surfel) * to_eigen(kernels::bearing_at<float>(view, x, y));
    point.normal = to_eigen(kernels::normal_of(packed));
    point.color = {static_cast<std::uint8_t>(packed.detail), static_cast<std::uint8_t>(packed.detail >> 8U),
                   static_cast<std::uint8_t>(packed.detail >> 16U)};
    point.views = static_cast<std::uint8_t>(1 + std::bitset<32>(agree).count());
    point.confidence = kernels::confidence_of_level<float>(static_cast<std::uint32_t>(standings[pixel]) >> 2U);
    cloud.points.push_back(point);
    cloud.pixels.push_back(static_cast<std::uint32_t>(pixel));
    cloud.agree.push_back(agree);
  }
  return cloud;
}

}  // namespace pmsp
