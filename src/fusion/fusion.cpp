// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/stages.h"

#include <string>
#include <utility>

#include "cpu/cpu_processor.h"
#include "densifier_checks.h"
#include "fusion/fusion_setup.h"
#include "fusion/mirrors.h"
#include "pmsp/error.h"
#include "sphere/grid.h"
#include "sphere/plane_views.h"
#include "util/eigen_kernels.h"

namespace pmsp {
namespace {

void check_count(const char* stage, std::size_t count) {
  if (count <= static_cast<std::size_t>(kernels::kMaxViewers)) return;
  throw InvalidInput(std::string(stage) + ": " + std::to_string(count) + " viewers; expected at most " +
                     std::to_string(kernels::kMaxViewers));
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
    check_scale("fuse_pixels: ", input.pose.scale);
    check_pose_error("fuse_pixels: ", input.pose_error);
  }
}

void check_surfels(const char* stage, const PosedSurfels& points) {
  check_scale(std::string(stage) + ": ", points.pose.scale);
  if (points.map == nullptr || points.statuses == nullptr) {
    throw InvalidInput(std::string(stage) + ": a keyframe lacks its points or their statuses");
  }
  if (!same_size(points.map->surfels, *points.statuses)) {
    throw InvalidInput(std::string(stage) + ": points and statuses differ in size");
  }
}

kernels::SurfelView view_of(const PosedSurfels& points) {
  const Image<std::uint32_t>& surfels = points.map->surfels;
  return {surfels.pixels().data(), points.statuses->pixels().data(), surfels.width(), surfels.height(),
          static_cast<float>(points.pose.scale)};
}

}  // namespace

SurfelMap fuse_pixels(const std::vector<FusionMap>& window, std::size_t current, const FusionOptions& options,
                      const Executor& executor, double lens_distance) {
  using kernels::HostViewTypes;
  options.validate();
  check(window, current);
  const PlaneMap& map = *window[current].map;
  const SphereGrid grid(map.width(), map.height());
  std::vector<Array<std::uint32_t>> colors;
  SurfelMap fused;
  fused.keyframe_id = map.keyframe_id;
  fused.surfels = Image<std::uint32_t>(map.width(), map.height());
  fused.details = Image<std::uint32_t>(map.width(), map.height());
  fused.statuses = Image<std::uint8_t>(map.width(), map.height());
  kernels::FusePixels<HostViewTypes> stage{};
  stage.grid = grid.view();
  stage.limits = fusion_limits(options);
  stage.pose_error = static_cast<float>(window[current].pose_error);
  for (std::size_t k = 0; k < window.size(); ++k) {
    const FusionMap& input = window[k];
    const RelativePose to = relative_pose(input.pose, window[current].pose, 0.5 * lens_distance);
    colors.push_back(color_words(*input.color, executor));
    const kernels::FusionView<HostViewTypes> view{view_of(*input.map, *input.confidence), colors.back().get(),
                                                  to.other_from_first, to.scale_ratio};
    if (k == current) {
      stage.first = view;
      continue;
    }
    stage.others[stage.count++] = view;
    fused.window_ids.push_back(input.map->keyframe_id);
  }
  fused.agree.resize(fused.surfels.size() * static_cast<std::size_t>(fused.agree_bytes()));
  stage.to = {fused.surfels.pixels().data(), fused.details.pixels().data(), fused.statuses.pixels().data(),
              fused.agree.data(), fused.agree_bytes()};
  impl_of(executor).run(stage);
  return fused;
}

Image<std::uint8_t> free_space_filter(const SurfelMap& map, const KeyframePose& pose,
                                      const std::vector<PosedRangeMap>& viewers, const FreeSpaceOptions& options,
                                      const Executor& executor, double lens_distance) {
  options.validate();
  check_scale("free_space_filter: ", pose.scale);
  const int width = map.surfels.width();
  const int height = map.surfels.height();
  check_count("free_space_filter", viewers.size());
  CpuProcessor on(executor, width, height);
  Image<std::uint8_t> statuses(width, height);
  std::vector<kernels::Rigid> from_viewers;
  kernels::FreeSpaceTest stage{};
  stage.surfels = map.surfels.pixels().data();
  stage.details = map.details.pixels().data();
  stage.grid = on.grid();
  stage.limits = free_space_limits(options);
  stage.max_contradiction = static_cast<float>(options.max_contradiction);
  stage.statuses = statuses.pixels().data();
  for (const PosedRangeMap& viewer : viewers) {
    if (viewer.ranges == nullptr) throw InvalidInput("free_space_filter: a viewer lacks its range map");
    const Image<float>& nearest = viewer.ranges->nearest;
    if (2 * nearest.width() != width || 2 * nearest.height() != height) {
      throw InvalidInput("free_space_filter: maps differ in size");
    }
    check_scale("free_space_filter: ", viewer.pose.scale);
    const RelativePose to = relative_pose(viewer.pose, pose, 0.5 * lens_distance);
    stage.viewers[stage.count++] = {
        {nearest.pixels().data(), viewer.ranges->farthest.pixels().data(), nearest.width(), nearest.height()},
        to.other_from_first,
        to.scale_ratio};
    from_viewers.push_back(relative_pose(pose, viewer.pose, 0.5 * lens_distance).other_from_first);
  }
  if (!options.enabled) stage.count = 0;
  Mirrors mirrors;
  if (options.enabled && options.mirrors) mirrors = find_mirrors(on, from_viewers, stage);
  on.launch(stage, nullptr);
  return statuses;
}

Image<std::uint8_t> duplicate_round(const PosedSurfels& reference, std::vector<std::uint32_t>& candidates,
                                    const std::vector<PosedSurfels>& others, const FusionOptions& options,
                                    const Executor& executor, double lens_distance) {
  options.validate();
  check_count("duplicate_round", others.size());
  check_surfels("duplicate_round", reference);
  const SurfelMap& map = *reference.map;
  const int width = map.surfels.width();
  const int height = map.surfels.height();
  const SphereGrid grid(width, height);
  Image<std::uint8_t> statuses(width, height);
  kernels::DuplicateRound stage{};
  stage.map = view_of(reference);
  stage.grid = grid.view();
  stage.limits = duplicate_limits(options);
  stage.statuses = statuses.pixels().data();
  for (std::size_t k = 0; k < others.size(); ++k) {
    const PosedSurfels& other = others[k];
    ++stage.count;
    if (other.map == nullptr) continue;
    check_surfels("duplicate_round", other);
    if (!same_size(other.map->surfels, map.surfels)) throw InvalidInput("duplicate_round: maps differ in size");
    const RelativePose to = relative_pose(other.pose, reference.pose, 0.5 * lens_distance);
    stage.others[k] = {view_of(other), to.other_from_first, to.scale_ratio, other.map->keyframe_id < map.keyframe_id};
  }
  const CpuProcessor on(executor, width, height);
  DuplicateCandidates still{on.upload(candidates), candidates.size()};
  on.remove_duplicates(stage, still);
  candidates.assign(still.bits.get(), still.bits.get() + still.count);
  return statuses;
}

KeyframeCloud extract_points(const PosedSurfels& points, double lens_distance) {
  check_surfels("extract_points", points);
  const SurfelMap& map = *points.map;
  const SphereGrid grid(map.surfels.width(), map.surfels.height());
  KeyframeCloud cloud{map.keyframe_id, points.pose.cam_from_world, {}, points.pose.scale, {}, {}, map.window_ids};
  collect_points({map.surfels.pixels().data(), map.details.pixels().data(), points.statuses->pixels().data(),
                  map.agree.data(), map.agree_bytes(), static_cast<float>(0.5 * lens_distance)},
                 grid.view(), cloud);
  return cloud;
}

}  // namespace pmsp
