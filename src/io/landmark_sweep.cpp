// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/io/landmark_sweep.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "elementary.h"
#include "pmsp/camera.h"
#include "pmsp/error.h"
#include "pose_convention.h"
#include "util/patch_correlation.h"
#include "util/thread_pool.h"

namespace pmsp {
namespace {

constexpr int kWidth = 512;           ///< of the gray images, or less where the images are smaller
constexpr int kCell = 12;             ///< side of the squares that give a patch each [px]
constexpr double kMaxLatitude = 1.2;  ///< [rad]
constexpr int kRadius = 2;            ///< of a patch [samples]
constexpr int kSide = 2 * kRadius + 1;
constexpr double kSpacing = 1.5;  ///< of its samples [px]
constexpr std::size_t kNeighbours = 6;
constexpr double kNearest = 0.4;  ///< depths, in distances to the farthest neighbour
constexpr double kFarthest = 60.0;
constexpr int kDepths = 160;           ///< evenly spaced in 1 / depth, so evenly in the images
constexpr int kPeakReach = 8;          ///< depths on either side that belong to one peak
constexpr float kMinDeviation = 5.0F;  ///< of a patch [gray levels]
constexpr float kMinScore = 0.8F;      ///< NCC
constexpr float kMinLead = 0.08F;      ///< over the best depth that is not of the same peak
constexpr float kSeen = 0.7F;          ///< NCC from which a neighbour observes the landmark
constexpr std::size_t kTrialKeyframes = 8;
constexpr std::size_t kTrialStride = 4;
constexpr double kClearlyMore = 1.8;  ///< times what the given poses find
constexpr double kEnough = 0.15;      ///< of the patches, for another convention to mean something

using Patch = std::array<float, kSide * kSide>;
using map_detail::PoseConvention;

/// A keyframe with its small image.
struct View {
  const MapKeyframe* keyframe = nullptr;
  RigidTransform pose;
  cv::Mat gray;  ///< 8 bits
  cv::Mat mask;  ///< empty = use all

  float at(double x, double y) const {
    const double fx = x - 0.5;
    const double fy = std::clamp(y - 0.5, 0.0, gray.rows - 1.0);
    const double left = std::floor(fx);
    const int top = std::min(static_cast<int>(fy), gray.rows - 2);
    int column = static_cast<int>(left) % gray.cols;
    if (column < 0) column += gray.cols;
    const int next = column + 1 < gray.cols ? column + 1 : 0;
    const auto across = static_cast<float>(fx - left);
    const auto down = static_cast<float>(fy - top);
    const auto* const upper = gray.ptr<std::uint8_t>(top);
    const auto* const lower = gray.ptr<std::uint8_t>(top + 1);
    const float a = static_cast<float>(upper[column]) * (1.0F - across) + static_cast<float>(upper[next]) * across;
    const float b = static_cast<float>(lower[column]) * (1.0F - across) + static_cast<float>(lower[next]) * across;
    return a + down * (b - a);
  }

  Eigen::Vector2d project(const Eigen::Vector3d& point) const {
    return pixel_from_bearing(point, gray.cols, gray.rows);
  }
};

/// What lies around a direction, on the plane through `depth` that faces the keyframe.
struct Surface {
  Eigen::Vector3d bearing;
  Eigen::Vector3d right, down;  ///< from sample to sample, as tangents of the unit sphere
};

Surface surface_at(const View& view, const Eigen::Vector2d& pixel) {
  Surface surface;
  surface.bearing = bearing_from_pixel(pixel, view.gray.cols, view.gray.rows);
  const double step = kSpacing * 2.0 * kernels::kPi / view.gray.cols;
  surface.right = step * Eigen::Vector3d::UnitY().cross(surface.bearing).normalized();
  surface.down = step * surface.bearing.cross(surface.right).normalized();
  return surface;
}

/// The patch as another view (or the same one) shows it; `view_from_ref` takes points of the reference.
Patch sample(const View& view, const RigidTransform& view_from_ref, const Surface& surface, double depth) {
  const auto place = [&](const Eigen::Vector3d& direction) {
    return view.project(view_from_ref.rotation * (depth * direction) + view_from_ref.translation);
  };
  const Eigen::Vector2d centre = place(surface.bearing);
  const auto step = [&](const Eigen::Vector3d& tangent) {
    Eigen::Vector2d d = place(surface.bearing + kRadius * tangent) - centre;
    d.x() -= view.gray.cols * std::round(d.x() / view.gray.cols);
    return Eigen::Vector2d(d / kRadius);
  };
  const Eigen::Vector2d right = step(surface.right);
  const Eigen::Vector2d down = step(surface.down);
  Patch patch;
  std::size_t i = 0;
  for (int row = -kRadius; row <= kRadius; ++row) {
    for (int column = -kRadius; column <= kRadius; ++column) {
      const Eigen::Vector2d at = centre + column * right + row * down;
      patch[i++] = view.at(at.x(), at.y());
    }
  }
  return patch;
}

/// A landmark that was found, and the views that show it, the reference first.
struct Found {
  Eigen::Vector3d position_world;
  std::vector<std::size_t> views;
};

class Sweep {
 public:
  explicit Sweep(std::vector<View> views) : views_(std::move(views)) {}

  std::size_t size() const { return views_.size(); }
  const View& view(std::size_t i) const { return views_[i]; }

  /// Looks for the patches of view i, or each `stride`th; returns how many there are.
  std::size_t look(std::size_t i, std::size_t stride, std::vector<Found>& found) const {
    const std::vector<std::size_t> neighbours = neighbours_of(i);
    if (neighbours.empty()) return 0;
    const View& reference = views_[i];
    const double reach = distance(i, neighbours.back());
    std::vector<RigidTransform> from_reference;
    for (const std::size_t k : neighbours) from_reference.push_back(views_[k].pose * reference.pose.inverse());
    std::size_t patches = 0;
    const std::vector<Eigen::Vector2d> places = corners(reference);
    for (std::size_t at = 0; at < places.size(); at += stride) {
      const Surface surface = surface_at(reference, places[at]);
      Patch patch = sample(reference, {}, surface, 1.0);
      if (!normalise(patch, kMinDeviation)) continue;
      ++patches;
      const double depth = depth_of(patch, surface, reach, neighbours, from_reference);
      if (!(depth > 0.0)) continue;
      Found one{reference.pose.inverse() * (depth * surface.bearing), {i}};
      for (std::size_t k = 0; k < neighbours.size(); ++k) {
        Patch other = sample(views_[neighbours[k]], from_reference[k], surface, depth);
        if (normalise(other, kMinDeviation) && correlation(patch, other) >= kSeen) one.views.push_back(neighbours[k]);
      }
      if (one.views.size() > 1) found.push_back(std::move(one));
    }
    return patches;
  }

 private:
  double distance(std::size_t i, std::size_t k) const {
    return (views_[i].pose.center() - views_[k].pose.center()).norm();
  }

  /// The nearest other places, the nearest first.
  std::vector<std::size_t> neighbours_of(std::size_t i) const {
    std::vector<std::pair<double, std::size_t>> others;
    for (std::size_t k = 0; k < views_.size(); ++k) {
      if (k != i && distance(i, k) > 0.0) others.emplace_back(distance(i, k), k);
    }
    const auto last = others.begin() + static_cast<std::ptrdiff_t>(std::min(kNeighbours, others.size()));
    std::partial_sort(others.begin(), last, others.end());
    std::vector<std::size_t> result;
    for (auto it = others.begin(); it != last; ++it) result.push_back(it->second);
    return result;
  }

  /// The most textured place of each square, away from the poles.
  static std::vector<Eigen::Vector2d> corners(const View& view) {
    cv::Mat strength;
    cv::cornerMinEigenVal(view.gray, strength, 5);
    std::vector<Eigen::Vector2d> result;
    const int border = static_cast<int>(std::ceil(view.gray.rows * (0.5 - kMaxLatitude / kernels::kPi)));
    for (int top = border; top + kCell <= view.gray.rows - border; top += kCell) {
      for (int left = 0; left + kCell <= view.gray.cols; left += kCell) {
        float best = 0.0F;
        Eigen::Vector2i at(-1, -1);
        for (int y = top; y < top + kCell; ++y) {
          for (int x = left; x < left + kCell; ++x) {
            if (strength.at<float>(y, x) <= best || (!view.mask.empty() && view.mask.at<std::uint8_t>(y, x) == 0)) {
              continue;
            }
            best = strength.at<float>(y, x);
            at = {x, y};
          }
        }
        if (at.x() >= 0) result.emplace_back(at.x() + 0.5, at.y() + 0.5);
      }
    }
    return result;
  }

  /// Where one depth fits clearly better than all others; else 0.
  double depth_of(const Patch& patch, const Surface& surface, double reach, const std::vector<std::size_t>& neighbours,
                  const std::vector<RigidTransform>& from_reference) const {
    const double nearest = 1.0 / (kNearest * reach);
    const double farthest = 1.0 / (kFarthest * reach);
    const auto inverse_depth = [&](double step) { return farthest + (nearest - farthest) * step / (kDepths - 1); };
    std::array<float, kDepths> scores{};
    std::vector<float> of_views(neighbours.size());
    for (int step = 0; step < kDepths; ++step) {
      for (std::size_t k = 0; k < neighbours.size(); ++k) {
        Patch other = sample(views_[neighbours[k]], from_reference[k], surface, 1.0 / inverse_depth(step));
        of_views[k] = normalise(other, kMinDeviation) ? correlation(patch, other) : 0.0F;
      }
      scores[static_cast<std::size_t>(step)] = score(of_views);
    }
    const auto top = static_cast<int>(std::max_element(scores.begin(), scores.end()) - scores.begin());
    const auto at = [&](int step) { return scores[static_cast<std::size_t>(step)]; };
    if (at(top) < kMinScore || top == 0 || top == kDepths - 1) return 0.0;
    for (int step = 0; step < kDepths; ++step) {
      if (std::abs(step - top) > kPeakReach && at(step) > at(top) - kMinLead) return 0.0;
    }
    const float curvature = at(top - 1) - 2.0F * at(top) + at(top + 1);
    const float shift = curvature < 0.0F ? 0.5F * (at(top - 1) - at(top + 1)) / curvature : 0.0F;
    return 1.0 / inverse_depth(top + static_cast<double>(std::clamp(shift, -0.5F, 0.5F)));
  }

  /// The mean of the better two thirds: something may hide the patch from the others.
  static float score(std::vector<float>& of_views) {
    std::sort(of_views.begin(), of_views.end(), std::greater<float>());
    const std::size_t count = (2 * of_views.size() + 2) / 3;
    float sum = 0.0F;
    for (std::size_t k = 0; k < count; ++k) sum += of_views[k];
    return sum / static_cast<float>(count);
  }

  std::vector<View> views_;
};

/// Some keyframes, evenly spread, as another convention has the poses: the share of patches that are found.
double share_of(std::vector<View> views, const PoseConvention* convention, ThreadPool& pool) {
  if (convention != nullptr) {
    for (View& view : views) view.pose = convention->of(view.pose);
  }
  const Sweep sweep(std::move(views));
  const std::size_t count = std::min(kTrialKeyframes, sweep.size());
  std::vector<std::size_t> patches(count, 0);
  std::vector<std::vector<Found>> found(count);
  pool.for_each(static_cast<int>(count), [&](int trial) {
    const auto i = static_cast<std::size_t>(trial);
    patches[i] = sweep.look((2 * i + 1) * sweep.size() / (2 * count), kTrialStride, found[i]);
  });
  std::size_t all = 0;
  std::size_t hits = 0;
  for (std::size_t i = 0; i < count; ++i) {
    all += patches[i];
    hits += found[i].size();
  }
  return all > 0 ? static_cast<double>(hits) / static_cast<double>(all) : 0.0;
}

}  // namespace

struct LandmarkSweep::Impl {
  const SlamMap* map = nullptr;
  std::map<std::int64_t, View> views;  ///< by keyframe
};

LandmarkSweep::LandmarkSweep(const SlamMap& map) : impl_(std::make_unique<Impl>()) { impl_->map = &map; }

LandmarkSweep::~LandmarkSweep() = default;

void LandmarkSweep::add(std::int64_t keyframe_id, ImageView<const Rgb> image, ImageView<const std::uint8_t> mask) {
  const MapKeyframe* const keyframe = impl_->map->find_keyframe(keyframe_id);
  if (keyframe == nullptr) {
    throw InvalidInput("LandmarkSweep::add: the map has no keyframe " + std::to_string(keyframe_id));
  }
  if (image.empty()) {
    throw InvalidInput("LandmarkSweep::add: the image of keyframe " + std::to_string(keyframe_id) + " is empty");
  }
  View view;
  view.keyframe = keyframe;
  view.pose = keyframe->cam_from_world;
  cv::Mat gray(image.height, image.width, CV_8UC1);
  for (int y = 0; y < image.height; ++y) {
    auto* const row = gray.ptr<std::uint8_t>(y);
    for (int x = 0; x < image.width; ++x) {
      const Rgb c = image(x, y);
      row[x] = static_cast<std::uint8_t>((77 * c.r + 150 * c.g + 29 * c.b) >> 8);
    }
  }
  const int width = std::min(kWidth, image.width);
  const cv::Size size(width, std::max(2, width / 2));
  cv::resize(gray, view.gray, size, 0.0, 0.0, cv::INTER_AREA);
  if (!mask.empty()) {
    cv::Mat used(mask.height, mask.width, CV_8UC1);
    for (int y = 0; y < mask.height; ++y) {
      auto* const row = used.ptr<std::uint8_t>(y);
      for (int x = 0; x < mask.width; ++x) row[x] = mask(x, y) != 0 ? 255 : 0;
    }
    cv::resize(used, view.mask, size, 0.0, 0.0, cv::INTER_NEAREST);
    cv::erode(view.mask, view.mask, cv::Mat::ones(2 * kSide, 2 * kSide, CV_8UC1));
  }
  impl_->views[keyframe_id] = std::move(view);
}

LandmarkSweep::Result LandmarkSweep::make_landmarks(SlamMap& map, int threads, bool try_conventions) const {
  std::vector<View> views;
  for (const auto& [id, view] : impl_->views) views.push_back(view);
  ThreadPool pool(threads);
  Result result;
  const double given = try_conventions ? share_of(views, nullptr, pool) : 1.0;
  double best = std::max(kClearlyMore * given, kEnough);
  const bool may_be_another = best < 1.0;
  for (const PoseConvention& convention :
       may_be_another ? map_detail::other_conventions() : std::vector<PoseConvention>()) {
    const double share = share_of(views, &convention, pool);
    if (share < best) continue;
    best = result.better_share = share;
    result.fits_better = convention.what;
  }
  result.share = given;
  if (!result.fits_better.empty()) return result;

  const Sweep sweep(std::move(views));
  std::vector<std::size_t> patches(sweep.size(), 0);
  std::vector<std::vector<Found>> found(sweep.size());
  pool.for_each(static_cast<int>(sweep.size()), [&](int i) {
    patches[static_cast<std::size_t>(i)] =
        sweep.look(static_cast<std::size_t>(i), 1, found[static_cast<std::size_t>(i)]);
  });
  map.landmarks.clear();
  for (MapKeyframe& keyframe : map.keyframes) keyframe.observations.clear();
  std::map<std::int64_t, MapKeyframe*> keyframes;
  for (MapKeyframe& keyframe : map.keyframes) keyframes[keyframe.id] = &keyframe;
  for (std::size_t i = 0; i < sweep.size(); ++i) {
    result.patches += patches[i];
    for (const Found& one : found[i]) {
      const auto id = static_cast<std::int64_t>(map.landmarks.size());
      map.landmarks.push_back({id, one.position_world});
      for (const std::size_t k : one.views) {
        MapKeyframe& keyframe = *keyframes.at(sweep.view(k).keyframe->id);
        const MapCamera& camera = map.cameras[static_cast<std::size_t>(keyframe.camera)];
        const Eigen::Vector2d pixel =
            pixel_from_bearing(keyframe.cam_from_world * one.position_world, camera.width, camera.height);
        keyframe.observations.push_back({id, pixel.cast<float>()});
      }
    }
  }
  map.observations_are_tested = false;
  result.landmarks = map.landmarks.size();
  result.share = result.patches > 0 ? static_cast<double>(result.landmarks) / static_cast<double>(result.patches) : 0.0;
  return result;
}

}  // namespace pmsp
