// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/ownership.h"

#include <cmath>
#include <string>

#include "cpu/executor_impl.h"
#include "filters/depth_map_tools.h"
#include "fused_point.h"
#include "ownership.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

/// A keyframe's place as another one's kernels take it.
struct Relation {
  kernels::Rigid other_from_first;
  float zoom;
};

Relation relation(const KeyframePose& other, const KeyframePose& first) {
  const double zoom = first.scale / other.scale;
  RigidTransform transform = other.cam_from_world * first.cam_from_world.inverse();
  transform.rotation *= zoom;
  transform.translation /= other.scale;
  return {to_rigid(transform), static_cast<float>(zoom)};
}

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

/// Runs a stage over all pixels.
template <class Stage>
void for_each_pixel(const Stage& stage, int width, int height, ThreadPool& pool) {
  pool.for_each(height, [&](int row) {
    for (int column = 0; column < width; ++column) stage(column, row);
  });
}

float min_cos_normals(const FusionOptions& options) {
  return static_cast<float>(std::cos(options.max_normal_deg * kernels::kPi / 180.0));
}

void check(const std::vector<FusionMap>& window, std::size_t current) {
  if (current >= window.size()) throw InvalidInput("fuse_pixels: the current keyframe is not in the window");
  check_count("fuse_pixels", window.size() - 1);
  for (const FusionMap& input : window) {
    if (input.map == nullptr || input.color == nullptr) {
      throw InvalidInput("fuse_pixels: a keyframe of the window lacks its depth map or colours");
    }
    if (!same_size(*input.map, *window.front().map) || !same_image_size(*input.color, input.map->depth)) {
      throw InvalidInput("fuse_pixels: depth maps and colours differ in size");
    }
    check_scale("fuse_pixels", input.pose);
  }
}

kernels::SurfelView view_of(const SurfelMap& map, const KeyframePose& pose) {
  return {map.surfels.pixels().data(), map.standings.pixels().data(), map.surfels.width(), map.surfels.height(),
          static_cast<float>(pose.scale)};
}

}  // namespace

FusedMap fuse_pixels(const std::vector<FusionMap>& window, std::size_t current, const FusionOptions& options,
                     const Executor& executor) {
  options.validate();
  check(window, current);
  const DepthMap& map = *window[current].map;
  const int width = map.depth.width();
  const int height = map.depth.height();
  const SphereGrid grid(width, height);
  ThreadPool& pool = executor.impl().pool;
  std::vector<PlaneRows> planes;
  planes.reserve(window.size());  // views point into it
  FusedMap fused;
  std::vector<kernels::FusionView> others;
  kernels::FusionView first{};
  for (std::size_t k = 0; k < window.size(); ++k) {
    const FusionMap& input = window[k];
    const Relation to = relation(input.pose, window[current].pose);
    planes.emplace_back(*input.map, grid, pool);
    const kernels::FusionView view{planes.back().view(), input.map->confidence.pixels().data(),
                                   &input.color->pixels().data()->r, to.other_from_first, to.zoom};
    if (k == current) {
      first = view;
    } else {
      others.push_back(view);
      fused.window_ids.push_back(input.map->keyframe_id);
    }
  }
  fused.keyframe_id = map.keyframe_id;
  fused.depth = Image<float>(width, height);
  fused.normal = Image<Eigen::Vector3f>(width, height, Eigen::Vector3f::Zero());
  fused.confidence = Image<float>(width, height);
  fused.color = Image<Rgb>(width, height);
  fused.views = Image<std::uint8_t>(width, height);
  fused.agree = Image<std::uint32_t>(width, height);
  const kernels::FusedArrays to{fused.depth.pixels().data(),      fused.normal.pixels().data()->data(),
                                fused.confidence.pixels().data(), &fused.color.pixels().data()->r,
                                fused.views.pixels().data(),      fused.agree.pixels().data()};
  const kernels::FusionLimits limits{static_cast<float>(options.max_relative_depth), min_cos_normals(options)};
  for_each_pixel(kernels::FusePixel{first, view_of(grid), others.data(), static_cast<int>(others.size()), limits,
                                    static_cast<float>(options.min_confidence), to},
                 width, height, pool);
  return fused;
}

SurfelMap judge(FusedMap& fused, const KeyframePose& pose, const std::vector<SightFrom>& viewers,
                const FreeSpaceOptions& options, const FusionOptions& fusion, const Executor& executor) {
  options.validate();
  fusion.validate();
  check_scale("judge", pose);
  check_count("judge", viewers.size());
  const int width = fused.depth.width();
  const int height = fused.depth.height();
  const SphereGrid grid(width, height);
  std::vector<kernels::Viewer> asked;
  for (const SightFrom& viewer : viewers) {
    if (viewer.sight == nullptr) throw InvalidInput("judge: a viewer lacks its sight map");
    if (kernels::kSightCell * viewer.sight->nearest.width() != width ||
        kernels::kSightCell * viewer.sight->nearest.height() != height) {
      throw InvalidInput("judge: maps differ in size");
    }
    check_scale("judge", viewer.pose);
    const Relation to = relation(viewer.pose, pose);
    asked.push_back({{viewer.sight->nearest.pixels().data(), viewer.sight->farthest.pixels().data(),
                      viewer.sight->nearest.width(), viewer.sight->nearest.height()},
                     to.other_from_first,
                     to.zoom,
                     viewer.may_own});
  }
  const float tolerance = static_cast<float>(options.max_relative_depth);
  const kernels::SightLimits limits{1.0F - static_cast<float>(options.min_relative_gap), 1.0F - tolerance,
                                    1.0F + tolerance};
  const float most = options.enabled ? static_cast<float>(options.max_contradiction) : HUGE_VALF;
  SurfelMap map{fused.keyframe_id, Image<std::uint32_t>(width, height), Image<std::uint8_t>(width, height),
                Image<std::uint32_t>(width, height)};
  Image<float> scaled(width, height);
  const kernels::Eligibility stage{fused.depth.pixels().data(),
                                   fused.confidence.pixels().data(),
                                   view_of(grid),
                                   width,
                                   asked.data(),
                                   static_cast<int>(asked.size()),
                                   limits,
                                   static_cast<float>(fusion.spacing_px),
                                   most,
                                   map.standings.pixels().data(),
                                   scaled.pixels().data(),
                                   map.asked.pixels().data()};
  for_each_pixel(
      [&](int x, int y) {
        stage(x, y);
        if (kernels::standing_of(map.standings(x, y)) == kernels::Standing::kNone) {
          fused.depth(x, y) = fused.confidence(x, y) = 0.0F;
          return;
        }
        if (options.enabled) fused.confidence(x, y) = scaled(x, y);
        map.surfels(x, y) = kernels::pack_surfel(fused.depth(x, y), to_vec3(fused.normal(x, y)));
      },
      width, height, executor.impl().pool);
  return map;
}

Image<std::uint8_t> ownership_round(SurfelMap& map, const KeyframePose& pose, const std::vector<SurfelsFrom>& viewers,
                                    const FusionOptions& options, const Executor& executor) {
  options.validate();
  check_scale("ownership_round", pose);
  check_count("ownership_round", viewers.size());
  const int width = map.surfels.width();
  const int height = map.surfels.height();
  const SphereGrid grid(width, height);
  std::uint32_t there = 0;
  std::vector<kernels::OwnershipView> others;
  for (std::size_t k = 0; k < viewers.size(); ++k) {
    const SurfelsFrom& viewer = viewers[k];
    others.emplace_back();
    if (viewer.map == nullptr) continue;
    check_scale("ownership_round", viewer.pose);
    if (!same_image_size(viewer.map->surfels, map.surfels)) throw InvalidInput("ownership_round: maps differ in size");
    const Relation to = relation(viewer.pose, pose);
    others.back() = {view_of(*viewer.map, viewer.pose), to.other_from_first, to.zoom,
                     viewer.map->keyframe_id < map.keyframe_id};
    there |= 1U << k;
  }
  for (std::uint32_t& bits : map.asked.pixels()) bits &= there;
  Image<std::uint8_t> standings(width, height);
  const kernels::OwnershipLimits limits{static_cast<float>(options.spacing_px),
                                        static_cast<float>(options.max_relative_depth), min_cos_normals(options)};
  for_each_pixel(
      kernels::OwnershipRound{view_of(map, pose), view_of(grid), others.data(), static_cast<int>(others.size()), limits,
                              map.asked.pixels().data(), standings.pixels().data()},
      width, height, executor.impl().pool);
  return standings;
}

KeyedCloud owned_points(const FusedMap& fused, const SurfelMap& map, const KeyframePose& pose) {
  if (!same_image_size(fused.depth, map.standings)) throw InvalidInput("owned_points: maps differ in size");
  const SphereGrid grid(fused.depth.width(), fused.depth.height());
  KeyedCloud keyed{{fused.keyframe_id, pose.cam_from_world, {}}, {}, {}, fused.window_ids};
  for (int y = 0; y < fused.depth.height(); ++y) {
    for (int x = 0; x < fused.depth.width(); ++x) {
      if (!kernels::makes_point(map.standings(x, y))) continue;
      CloudPoint point;
      point.position = fused.depth(x, y) * to_eigen(kernels::bearing_at(view_of(grid), x, y));
      point.normal = fused.normal(x, y);
      point.color = fused.color(x, y);
      point.views = fused.views(x, y);
      point.confidence = fused.confidence(x, y);
      keyed.cloud.points.push_back(point);
      keyed.pixels.push_back(static_cast<std::uint32_t>(y * fused.depth.width() + x));
      keyed.agree.push_back(fused.agree(x, y));
    }
  }
  return keyed;
}

}  // namespace pmsp
