// SPDX-License-Identifier: BSD-2-Clause
#include "budget.h"
#include "machine.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <unordered_map>

#include "cost.h"
#include "io/image_reader.h"
#include "map_figures.h"
#include "pmsp/calibration.h"
#include "pmsp/camera.h"
#include "pmsp/stages.h"

namespace pmsp::tool {

const char* const kReferenceGpu = "NVIDIA H200 with 16 CPU cores";

namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kMiB = 1024.0 * 1024.0;

// Fitted to nine missions (flights through rooms, a hall and a yard, photo sets of flats and of a garden), with
// `online` and `normal`: pixels of a depth map that make a point before duplicates are removed, where all landmarks are
// near.
constexpr double kKept = 0.93;
// Landmarks much farther than the others mean an open scene: little parallax, and sky, which has no landmarks.
constexpr double kFar = 2.0;         // from so many times the median range on
constexpr double kLostBehind = 4.0;  // pixels without a point for each landmark that is infinitely far

// Points that give way to one beside them with `fusion.suppression`; there 0.05 to 0.35 with maps of this width or
// more, a third of it with maps of a third: errors must be wider than a pixel.
constexpr double kGiveWay = 0.24;
constexpr double kGiveWayWidth = 1440.0;
// Fitted there, to what duplicate removal leaves: points of another keyframe for each pixel of it that shows a place.
constexpr double kShown = 1.5;

constexpr double kPlanesBytes = 16.0;  // of a pixel
constexpr double kPointBytes = 40.0;   // of a point in a workspace
constexpr double kPlyBytes = 32.0;     // of one in the cloud
constexpr double kRecordBytes = 12e3;  // of a keyframe in a workspace's record and looks

// Measured on one core: an image's pixel decoded, its sharpness looked at, its landmarks compared [s].
constexpr double kImagePixelSeconds = 14e-9;
// What is not matching takes less a pixel the larger a map is. Measured on a drone's flight, a bare and a glossy room.
constexpr double kRestFalls = 0.42;      // exponent of the width
constexpr double kPointSeconds = 20e-9;  // encoded and written

/// Mean of what decides over places.
class Mean {
 public:
  void add(double value) {
    sum_ += value;
    ++count_;
  }
  double value() const { return count_ > 0 ? sum_ / count_ : 0.0; }

 private:
  double sum_ = 0.0;
  int count_ = 0;
};

/// Of a depth map's pixels those that make a point. A landmark of the map stands for what is around it: one for each
/// cell of the panorama, since landmarks lie densely where there is texture.
///
/// Duplicates: where other keyframes see a place twice as finely, or more, all of their points rank higher; of those
/// that see it about as finely half do. A point with `m` higher ones around on a pixel's area is left with a
/// probability of 1 / (1 + a m), `a` being the area from which they drive it out: the fewer there is room for, the
/// fewer are there.
class PointShare {
 public:
  PointShare(const SlamMap& map, const DensifierOptions& options)
      : map_(map), area_(kPi * options.advanced.fusion.spacing_px * options.advanced.fusion.spacing_px) {
    for (const MapKeyframe& keyframe : map.keyframes) {
      View& view = views_[keyframe.id];
      view.center = keyframe.cam_from_world.center();
      for (const MapObservation& observation : keyframe.observations) view.landmarks.push_back(observation.landmark_id);
      std::sort(view.landmarks.begin(), view.landmarks.end());
    }
  }

  double of(const PlanEntry& entry) const {
    constexpr int kColumns = 20, kRows = 10;
    const MapKeyframe* const keyframe = map_.find_keyframe(entry.id);
    if (keyframe == nullptr) return kKept;
    const Eigen::Vector3d& center = views_.at(entry.id).center;
    std::array<bool, static_cast<std::size_t>(kColumns) * kRows> known{};
    std::vector<const MapLandmark*> places;
    for (const MapObservation& observation : keyframe->observations) {
      const MapLandmark* const landmark = map_.find_landmark(observation.landmark_id);
      if (landmark == nullptr) continue;
      const Eigen::Vector2d at =
          pixel_from_bearing(keyframe->cam_from_world * landmark->position_world, kColumns, kRows);
      if (!(at.array() >= 0.0).all() || !(at.x() < kColumns) || !(at.y() < kRows)) continue;
      bool& is_known = known[static_cast<std::size_t>(static_cast<int>(at.y()) * kColumns + static_cast<int>(at.x()))];
      if (is_known) continue;
      is_known = true;
      places.push_back(landmark);
    }
    if (places.empty()) return kKept;
    const std::vector<Viewer> viewers = viewers_of(entry, places);
    Mean share;
    std::vector<double> ranges;
    for (const MapLandmark* const place : places) {
      share.add(of_place(place->position_world, center, viewers));
      ranges.push_back((place->position_world - center).norm());
    }
    const auto middle = ranges.begin() + static_cast<std::ptrdiff_t>(ranges.size() / 2);
    std::nth_element(ranges.begin(), middle, ranges.end());
    Mean lost;
    for (const double range : ranges) lost.add(kLostBehind * std::max(0.0, 1.0 - kFar * *middle / range));
    return kKept * std::max(0.0, 1.0 - lost.value()) * share.value();
  }

 private:
  struct View {
    Eigen::Vector3d center;
    std::vector<std::int64_t> landmarks;  ///< ascending
  };
  /// Another keyframe that may have duplicates, and how much of this one's surface it sees.
  struct Viewer {
    const View* view;
    double overlap;
  };

  /// By the landmarks that both observe, of which a SLAM finds only some again: the most that any has in common count
  /// as all.
  std::vector<Viewer> viewers_of(const PlanEntry& entry, const std::vector<const MapLandmark*>& places) const {
    std::vector<Viewer> viewers;
    double most = 1.0;
    for (const std::int64_t id : entry.duplicate_views) {
      const auto view = views_.find(id);
      if (view == views_.end()) continue;
      const std::vector<std::int64_t>& seen = view->second.landmarks;
      const auto shared = std::count_if(places.begin(), places.end(), [&](const MapLandmark* place) {
        return std::binary_search(seen.begin(), seen.end(), place->id);
      });
      viewers.push_back({&view->second, static_cast<double>(shared)});
      most = std::max(most, viewers.back().overlap);
    }
    for (Viewer& viewer : viewers) viewer.overlap /= most;
    return viewers;
  }

  double of_place(const Eigen::Vector3d& place, const Eigen::Vector3d& center,
                  const std::vector<Viewer>& viewers) const {
    const double own = (place - center).norm();
    double higher = 0.0, even = 0.0;
    for (const Viewer& other : viewers) {
      const double ratio = own / std::max((place - other.view->center).norm(), 1e-9);
      const double density = area_ * kShown * other.overlap * std::min(ratio * ratio, 1.0 / area_);
      // octaves of the distance: within a factor of two there is a border with the probability of its logarithm
      const double octaves = std::clamp(std::log2(ratio), -1.0, 1.0);
      if (octaves > 0.0) higher += octaves * density;
      even += (1.0 - std::abs(octaves)) * density;
    }
    if (even <= 1e-6) return 1.0 / (1.0 + higher);
    return std::log((1.0 + higher + even) / (1.0 + higher)) / even;
  }

  const SlamMap& map_;
  double area_;
  std::unordered_map<std::int64_t, View> views_;
};

double map_bytes(const SlamMap& map) {
  double bytes = static_cast<double>(map.landmarks.size() * sizeof(MapLandmark));
  for (const MapKeyframe& keyframe : map.keyframes) {
    bytes += static_cast<double>(sizeof(MapKeyframe) + keyframe.observations.size() * sizeof(MapObservation));
  }
  return bytes;
}

int threads_of(const DensifierOptions& options) { return options.threads > 0 ? options.threads : usable_cpus(); }

}  // namespace

DeviceBudget estimate_device(DensifierOptions options, std::int64_t used, int image_width) {
  options.advanced.expected_keyframes = used;
  options.scratch_folder.clear();
  const double all = static_cast<double>(device_memory_needed(options, image_width));
  options.scratch_folder = "beside the cloud";
  return {all, std::min(all, static_cast<double>(device_memory_needed(options, image_width)))};
}

MemoryBudget estimate_memory(const SlamMap& map, DensifierOptions options, std::int64_t used, int image_width,
                             int image_height) {
  options.scratch_folder = options.advanced.free_space.whole_mission ? "beside the cloud" : "";
  const HostMemory densifier = host_memory_needed(options, used, image_width);
  constexpr double kProcess = 72.0 * kMiB, kGpuProcess = 100.0 * kMiB;  // libraries, a driver's context, threads
  const double image = 3.0 * image_width * image_height;
  const double of_map = map_bytes(map);
  const int ahead = io::images_ahead(map, threads_of(options));
  MemoryBudget memory;
  memory.scratch = densifier.scratch;
  memory.host = kProcess + of_map + image * (ahead + 3) + densifier.memory;
  memory.gpu_host = kGpuProcess + of_map + 3.0 * image * ahead;  // twice while it is decoded, and in heaps
  return memory;
}

Budget estimate_budget(const BudgetQuestion& question) {
  BudgetQuestion sized = question;
  DensifierOptions& options = sized.options;
  if (sized.image_width == 0 && !question.map.cameras.empty()) {
    sized.image_width = question.map.cameras[0].width;
    sized.image_height = question.map.cameras[0].height;
  }
  fill_in_size(options, sized.image_width, sized.image_height);
  const double one_image = static_cast<double>(sized.image_width) * sized.image_height;
  Budget b;
  b.width = options.width;
  b.height = options.height;
  b.threads = threads_of(options);
  const double pixels = static_cast<double>(b.width) * b.height;

  const PointShare point_share(question.map, options);
  Mean share, views, duplicate_views;
  std::vector<std::int64_t> ids;
  for (const PlanEntry& entry : question.plan.entries) {
    ids.push_back(entry.id);
    b.used += entry.used();
    if (!entry.has_depth_map()) continue;
    ++b.depth_maps;
    views.add(static_cast<double>(entry.near.size()));
    duplicate_views.add(static_cast<double>(entry.duplicate_views.size()));
    share.add(point_share.of(entry));
  }
  b.keyframes = static_cast<std::int64_t>(ids.size());
  const double all_pixels = pixels * static_cast<double>(b.depth_maps);
  b.views = views.value();
  const double give_way =
      options.advanced.fusion.suppression > 0.0 ? kGiveWay * std::min(1.0, b.width / kGiveWayWidth) : 0.0;
  b.points_per_pixel = (1.0 - give_way) * share.value();
  b.points = b.points_per_pixel * all_pixels;
  b.cloud_bytes = kPlyBytes * b.points;
  b.workspace_bytes =
      kPlanesBytes * all_pixels + kPointBytes * b.points + kRecordBytes * static_cast<double>(b.keyframes);

  b.memory = estimate_memory(question.map, options, b.used, sized.image_width, sized.image_height);
  b.device = estimate_device(options, b.used, sized.image_width);

  const double image_pixels = one_image * static_cast<double>(b.keyframes);
  const CpuPace& pace = question.pace;
  const double rest = pace.rest * std::pow(static_cast<double>(b.width) / kPaceWidth, -kRestFalls);
  b.cpu_seconds = all_pixels * (pace.matching * b.views + rest + pace.ownership * duplicate_views.value()) +
                  kImagePixelSeconds * image_pixels + kPointSeconds * b.points;
  // Fits what whole runs take on that machine, from 5 keyframes to 1,080 and from 640 x 320 to 5760 x 2880, to 20 %;
  // at first the start of the device and the map's, at last what the disk has still to take.
  constexpr double kStartSeconds = 0.42, kLookSeconds = 1.6e-9;  // a pixel's that the lenses are told from
  const double looked_at = static_cast<double>(keyframes_for_lens_distance(ids).size());
  const double matching = planes_tried(options.advanced.patchmatch) * (1.15e-10 + 0.37e-10 * b.views);
  b.reference_seconds = kStartSeconds + all_pixels * (matching + 1.8e-9) + 0.8e-9 * image_pixels +
                        kLookSeconds * one_image * looked_at + 4.5e-9 * b.points;
  return b;
}

std::vector<PlanKeyframe> keyframes_without_image(const SlamMap& map, const ImageSource* source,
                                                  const DensifierOptions& options) {
  std::set<std::int64_t> with_image;
  if (source != nullptr) with_image.insert(source->keyframe_ids().begin(), source->keyframe_ids().end());
  std::vector<PlanKeyframe> keyframes;
  for (const MapKeyframe* keyframe : in_order_of_flight(map)) {
    if (source != nullptr && with_image.count(keyframe->id) == 0) continue;
    keyframes.push_back(plan_keyframe(keyframe_of(map, *keyframe), options));
  }
  return keyframes;
}

}  // namespace pmsp::tool
