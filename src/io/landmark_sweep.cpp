// SPDX-License-Identifier: BSD-2-Clause
#include "io/landmark_sweep.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numeric>
#include <random>
#include <utility>
#include <vector>

#include "patch_sweep.h"
#include "pmsp/camera.h"
#include "pmsp/error.h"
#include "pose_convention.h"
#include "util/median_of.h"
#include "util/percent.h"
#include "util/thread_pool.h"

namespace pmsp {
namespace {

using io::PatchSweep;
using io::SweepPoint;
using io::SweepView;
using map_detail::PoseConvention;
using Views = std::vector<SweepView>;

constexpr std::size_t kTrialKeyframes = 8;
constexpr std::size_t kTrialPatches = 512;  ///< total of these keyframes
constexpr std::size_t kFewPatches = 64;     ///< first stage of a trial, which rejects poses that match hardly anything
constexpr double kHardlyAny = 0.5;          ///< fraction of the required share for the second stage
constexpr std::size_t kChances = 3;
constexpr std::size_t kFewestViews = 4;  ///< with fewer, correct poses and chance are too close
constexpr std::size_t kFewestPatches = 100;

/// Shares of matched patches, between those of correct poses and those of other keyframes or wrong rotations. Constant
/// rotations of all cameras by a small angle reach the highest share of wrong poses.
constexpr double kCertain = 0.5;
constexpr double kExpected = 0.25;
constexpr double kLeast = 0.05;
constexpr double kExpectedOverChance = 4.0;
constexpr double kLeastOverChance = 2.0;
constexpr double kClearlyMore = 1.8;  ///< ratio to the share with the map's poses for another convention to be named

/// Numbers of patches searched and matched at one depth.
struct Tally {
  std::size_t patches = 0;
  std::size_t found = 0;
  double share() const { return patches > 0 ? static_cast<double>(found) / static_cast<double>(patches) : 0.0; }
};

/// Alternative poses for the same images.
struct Hypothesis {
  std::string what;
  std::string remedy;
  std::function<Views(const Views&)> of;
};

Views with_poses_of(const Views& views, const std::function<std::ptrdiff_t(std::size_t)>& other) {
  Views result;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const std::ptrdiff_t k = other(i);
    if (k < 0 || k >= static_cast<std::ptrdiff_t>(views.size())) continue;
    result.push_back({views[static_cast<std::size_t>(k)].cam_from_world, views[i].image});
  }
  return result;
}

std::vector<Hypothesis> other_poses() {
  std::vector<Hypothesis> all;
  for (const PoseConvention& convention : map_detail::other_conventions()) {
    all.push_back({convention.what, remedy_of(convention), [convention](const Views& given) {
                     Views views = given;
                     for (SweepView& view : views) view.cam_from_world = convention.of(view.cam_from_world);
                     return views;
                   }});
  }
  for (const std::ptrdiff_t shift : {-1, 1}) {
    all.push_back({std::string("poses one keyframe ") + (shift < 0 ? "late" : "early") + ", each of the " +
                       (shift < 0 ? "previous" : "next") + " image",
                   "correct the times or the order of poses or images (--frame-offset)", [shift](const Views& given) {
                     return with_poses_of(given,
                                          [shift](std::size_t i) { return static_cast<std::ptrdiff_t>(i) - shift; });
                   }});
  }
  return all;
}

/// Images with randomly permuted poses.
Views shuffled(const Views& views, std::size_t seed) {
  std::vector<std::size_t> order(views.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::mt19937_64 random(seed);
  for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[random() % i]);
  return with_poses_of(views, [&](std::size_t i) { return static_cast<std::ptrdiff_t>(order[i]); });
}

/// Tallies of evenly spread patches of evenly spread keyframes, per set of poses.
std::vector<Tally> trials(const std::vector<Views>& poses, std::size_t patches, ThreadPool& pool) {
  std::vector<PatchSweep> sweeps;
  for (const Views& views : poses) sweeps.emplace_back(views);
  std::vector<Tally> of_keyframe(poses.size() * kTrialKeyframes);
  pool.for_each(static_cast<int>(of_keyframe.size()), [&](int task) {
    const auto number = static_cast<std::size_t>(task);
    const PatchSweep& sweep = sweeps[number / kTrialKeyframes];
    const std::size_t count = std::min(kTrialKeyframes, sweep.size());
    const std::size_t trial = number % kTrialKeyframes;
    if (trial >= count) return;
    const std::size_t i = (2 * trial + 1) * sweep.size() / (2 * count);
    const std::size_t stride = std::max<std::size_t>(1, sweep.patches(i) * count / patches);
    std::vector<SweepPoint> found;
    of_keyframe[number].patches = sweep.look(i, stride / 2, stride, found);
    of_keyframe[number].found = found.size();
  });
  std::vector<Tally> result(poses.size());
  for (std::size_t number = 0; number < of_keyframe.size(); ++number) {
    Tally& tally = result[number / kTrialKeyframes];
    tally.patches += of_keyframe[number].patches;
    tally.found += of_keyframe[number].found;
  }
  return result;
}

std::string figures(const LandmarkSweep::Result& result, std::size_t patches) {
  return percent(result.share) + " of " + std::to_string(patches) +
         " patches of the images are found at one depth in other images (by chance " + percent(result.by_chance) +
         ", with fitting poses at least " + percent(kExpected) + ")";
}

constexpr char kAdvice[] =
    "check that trajectory and images are of the same mission and paired rightly (--images, --fps, --frame-offset), "
    "and that the poses are the camera's: those of an IMU or a base need --camera-from-body";

/// Adds alternative poses with clearly more matches to `result`.
void try_other_poses(const Views& views, ThreadPool& pool, LandmarkSweep::Result& result) {
  const std::vector<Hypothesis> all = other_poses();
  std::vector<Views> poses;
  for (const Hypothesis& hypothesis : all) poses.push_back(hypothesis.of(views));
  double best = std::max(kClearlyMore * result.share, kExpected);
  const std::vector<Tally> few = trials(poses, kFewPatches, pool);
  std::vector<std::size_t> left;
  std::vector<Views> poses_left;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (few[i].share() < kHardlyAny * best) continue;
    left.push_back(i);
    poses_left.push_back(std::move(poses[i]));
  }
  const std::vector<Tally> many = trials(poses_left, kTrialPatches, pool);
  for (std::size_t i = 0; i < left.size(); ++i) {
    if (many[i].share() < best) continue;
    best = result.better_share = many[i].share();
    result.fits_better = all[left[i]].what;
    result.message = "the images fit other poses clearly better: " + result.fits_better + ", " +
                     percent(result.better_share) + " of the patches are found instead of " + percent(result.share) +
                     "; " + all[left[i]].remedy;
  }
}

LandmarkSweep::Result check(const Views& views, ThreadPool& pool) {
  LandmarkSweep::Result result;
  const Tally given = trials({views}, kTrialPatches, pool).front();
  result.share = given.share();
  result.conclusive = views.size() >= kFewestViews && given.patches >= kFewestPatches;
  if (!result.conclusive) {
    result.message = "unknown whether the poses fit the images: " + std::to_string(views.size()) + " images with " +
                     std::to_string(given.patches) + " textured patches, expected at least " +
                     std::to_string(kFewestViews) + " with " + std::to_string(kFewestPatches);
    return result;
  }
  if (result.share >= kCertain) return result;
  std::vector<Views> wrong;
  for (std::size_t seed = 0; seed < kChances; ++seed) wrong.push_back(shuffled(views, seed));
  std::vector<double> chances;
  for (const Tally& tally : trials(wrong, kTrialPatches, pool)) chances.push_back(tally.share());
  result.by_chance = median(chances);
  try_other_poses(views, pool, result);
  if (!result.fits_better.empty()) {
    result.fits = false;
  } else if (result.share < std::max(kLeast, kLeastOverChance * result.by_chance)) {
    result.fits = false;
    result.message = "the poses do not fit the images: only " + figures(result, given.patches) + "; " + kAdvice +
                     ", or use --no-verify";
  } else if (result.share < std::max(kExpected, kExpectedOverChance * result.by_chance)) {
    result.doubtful = true;
    result.message = "the poses may not fit the images: only " + figures(result, given.patches) + "; " + kAdvice;
  }
  return result;
}

}  // namespace

struct LandmarkSweep::Impl {
  struct Image {
    const MapKeyframe* keyframe;
    std::shared_ptr<const io::SweepImage> image;
  };

  /// By time.
  std::vector<const Image*> in_order() const {
    std::vector<const Image*> order;
    for (const auto& [id, image] : images) order.push_back(&image);
    std::stable_sort(order.begin(), order.end(),
                     [](const Image* a, const Image* b) { return a->keyframe->timestamp < b->keyframe->timestamp; });
    return order;
  }

  const SlamMap* map = nullptr;
  std::map<std::int64_t, Image> images;  ///< by keyframe id
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
  impl_->images[keyframe_id] = {keyframe, std::make_shared<const io::SweepImage>(image, mask)};
}

LandmarkSweep::Result LandmarkSweep::check_poses(int threads) const {
  Views views;
  for (const Impl::Image* it : impl_->in_order()) views.push_back({it->keyframe->cam_from_world, it->image});
  ThreadPool pool(threads);
  return check(views, pool);
}

LandmarkSweep::Result LandmarkSweep::make_landmarks(SlamMap& map, int threads, bool with_check) const {
  const std::vector<const Impl::Image*> images = impl_->in_order();
  Views views;
  for (const Impl::Image* it : images) views.push_back({it->keyframe->cam_from_world, it->image});
  ThreadPool pool(threads);
  Result result;
  if (with_check) result = check(views, pool);
  if (!result.fits) return result;

  const PatchSweep sweep(std::move(views));
  std::vector<std::size_t> patches(sweep.size(), 0);
  std::vector<std::vector<SweepPoint>> found(sweep.size());
  pool.for_each(static_cast<int>(sweep.size()), [&](int number) {
    const auto i = static_cast<std::size_t>(number);
    patches[i] = sweep.look(i, 0, 1, found[i]);
  });
  map.landmarks.clear();
  for (MapKeyframe& keyframe : map.keyframes) keyframe.observations.clear();
  std::map<std::int64_t, MapKeyframe*> keyframes;
  for (MapKeyframe& keyframe : map.keyframes) keyframes[keyframe.id] = &keyframe;
  for (std::size_t i = 0; i < sweep.size(); ++i) {
    result.patches += patches[i];
    for (const SweepPoint& point : found[i]) {
      const auto id = static_cast<std::int64_t>(map.landmarks.size());
      map.landmarks.push_back({id, point.position_world});
      for (const std::size_t k : point.views) {
        MapKeyframe& keyframe = *keyframes.at(images[k]->keyframe->id);
        const MapCamera& camera = map.cameras[static_cast<std::size_t>(keyframe.camera)];
        const Eigen::Vector2d pixel =
            pixel_from_bearing(keyframe.cam_from_world * point.position_world, camera.width, camera.height);
        keyframe.observations.push_back({id, pixel.cast<float>()});
      }
    }
  }
  map.observations_are_measured = false;
  result.landmarks = map.landmarks.size();
  result.share = result.patches > 0 ? static_cast<double>(result.landmarks) / static_cast<double>(result.patches) : 0.0;
  return result;
}

}  // namespace pmsp
