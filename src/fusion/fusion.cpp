// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/fusion.h"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <string>
#include <utility>

#include "cpu/executor_impl.h"
#include "fusion/fusion_setup.h"
#include "pmsp/error.h"
#include "sphere/grid.h"
#include "sphere/plane_views.h"
#include "util/eigen_kernels.h"

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
    if (input.map == nullptr || input.confidence == nullptr || input.color == nullptr) {
      throw InvalidInput("fuse_pixels: a keyframe of the window lacks its planes, confidences or colours");
    }
    const PlaneMap& first = *window.front().map;
    if (!same_size(*input.map, first) || !same_size(*input.color, first) || !same_size(*input.confidence, first)) {
      throw InvalidInput("fuse_pixels: planes, confidences and colours differ in size");
    }
    check_scale("fuse_pixels", input.pose);
  }
}

void check_surfels(const char* stage, const SurfelsFrom& points) {
  check_scale(stage, points.pose);
  if (points.map == nullptr || points.standings == nullptr) {
    throw InvalidInput(std::string(stage) + ": a keyframe lacks its points or their standings");
  }
  if (!same_size(points.map->surfels, *points.standings)) {
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
  using kernels::HostMachine;
  options.validate();
  check(window, current);
  const PlaneMap& map = *window[current].map;
  const SphereGrid grid(map.width(), map.height());
  std::vector<std::vector<std::uint32_t>> colors;
  SurfelMap fused;
  fused.keyframe_id = map.keyframe_id;
  fused.surfels = Image<std::uint32_t>(map.width(), map.height());
  fused.details = Image<std::uint32_t>(map.width(), map.height());
  fused.standings = Image<std::uint8_t>(map.width(), map.height());
  kernels::FusePixels<HostMachine> stage{};
  stage.grid = grid.view();
  stage.limits = fusion_limits(options);
  for (std::size_t k = 0; k < window.size(); ++k) {
    const FusionMap& input = window[k];
    const Relation to = relation(input.pose, window[current].pose);
    colors.push_back(words(*input.color, executor.impl().pool));
    const kernels::FusionView<HostMachine> view{view_of(*input.map, *input.confidence), colors.back().data(),
                                                to.other_from_first, to.zoom};
    if (k == current) {
      stage.first = view;
      continue;
    }
    stage.others[stage.count++] = view;
    fused.window_ids.push_back(input.map->keyframe_id);
  }
  fused.agree.resize(fused.surfels.size() * static_cast<std::size_t>(fused.agree_bytes()));
  stage.to = {fused.surfels.pixels().data(), fused.details.pixels().data(), fused.standings.pixels().data(),
              fused.agree.data(), fused.agree_bytes()};
  executor.impl().run(stage);
  return fused;
}

Image<std::uint8_t> judge(const SurfelMap& map, const KeyframePose& pose, const std::vector<SightFrom>& viewers,
                          const FreeSpaceOptions& options, const Executor& executor) {
  options.validate();
  check_scale("judge", pose);
  const int width = map.surfels.width();
  const int height = map.surfels.height();
  check_count("judge", viewers.size());
  const SphereGrid grid(width, height);
  Image<std::uint8_t> standings(width, height);
  kernels::Eligibility stage{};
  stage.surfels = map.surfels.pixels().data();
  stage.details = map.details.pixels().data();
  stage.grid = grid.view();
  stage.limits = sight_limits(options);
  stage.max_contradiction = static_cast<float>(options.max_contradiction);
  stage.standings = standings.pixels().data();
  for (const SightFrom& viewer : viewers) {
    if (viewer.sight == nullptr) throw InvalidInput("judge: a viewer lacks its sight map");
    const Image<float>& nearest = viewer.sight->nearest;
    if (2 * nearest.width() != width || 2 * nearest.height() != height) {
      throw InvalidInput("judge: maps differ in size");
    }
    check_scale("judge", viewer.pose);
    const Relation to = relation(viewer.pose, pose);
    stage.viewers[stage.count++] = {
        {nearest.pixels().data(), viewer.sight->farthest.pixels().data(), nearest.width(), nearest.height()},
        to.other_from_first,
        to.zoom};
  }
  if (!options.enabled) stage.count = 0;
  executor.impl().run(stage);
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
  Image<std::uint8_t> standings(width, height);
  kernels::OwnershipRound stage{};
  stage.map = view_of(reference);
  stage.grid = grid.view();
  stage.first = asked.empty();
  stage.limits = ownership_limits(options);
  stage.standings = standings.pixels().data();
  std::uint32_t there = 0;
  for (std::size_t k = 0; k < viewers.size(); ++k) {
    const SurfelsFrom& viewer = viewers[k];
    ++stage.count;
    if (viewer.map == nullptr) continue;
    check_surfels("ownership_round", viewer);
    if (!same_size(viewer.map->surfels, map.surfels)) throw InvalidInput("ownership_round: maps differ in size");
    const Relation to = relation(viewer.pose, reference.pose);
    stage.others[k] = {view_of(viewer), to.other_from_first, to.zoom, viewer.map->keyframe_id < map.keyframe_id};
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
  std::vector<std::vector<std::uint32_t>> still(rows);
  executor.impl().pool.for_each(height, [&](int y) {
    const std::size_t row = static_cast<std::size_t>(y);
    const std::uint32_t* const ask = asked.empty() ? nullptr : asked.data() + first[row];
    std::vector<std::uint32_t> left(first[row + 1] - first[row]);
    const int count = executor.impl().rows.own_row(stage, y, ask, there, left.data());
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
  const SphereGrid grid(map.surfels.width(), map.surfels.height());
  KeyframeCloud cloud{map.keyframe_id, made.pose.cam_from_world, {}, made.pose.scale, {}, {}, map.window_ids};
  const std::vector<std::uint8_t>& standings = made.standings->pixels();
  const std::size_t count =
      static_cast<std::size_t>(std::count_if(standings.begin(), standings.end(), kernels::makes_point));
  cloud.points.reserve(count);
  cloud.pixels.reserve(count);
  cloud.agree.reserve(count);
  const kernels::ConstSurfelArrays arrays{map.surfels.pixels().data(), map.details.pixels().data(), standings.data(),
                                          map.agree.data(), map.agree_bytes()};
  for (std::size_t pixel = 0; pixel < standings.size(); ++pixel) {
    if (!kernels::makes_point(standings[pixel])) continue;
    const kernels::OwnedPoint owned = kernels::owned_point(arrays, grid.view(), static_cast<int>(pixel));
    CloudPoint point;
    point.position = to_eigen(owned.position);
    point.normal = to_eigen(owned.normal);
    point.color = {owned.color[0], owned.color[1], owned.color[2]};
    point.views = static_cast<std::uint8_t>(1 + std::bitset<32>(owned.agree).count());
    point.confidence = owned.confidence;
    cloud.points.push_back(point);
    cloud.pixels.push_back(static_cast<std::uint32_t>(pixel));
    cloud.agree.push_back(owned.agree);
  }
  return cloud;
}

}  // namespace pmsp
