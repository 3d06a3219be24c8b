// SPDX-License-Identifier: BSD-2-Clause
#include "budget.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <unordered_map>

#include "decoder.h"
#include "map_figures.h"
#include "pmsp/cost.h"
#include "pmsp/executor.h"
#include "pmsp/lens_distance.h"

namespace pmsp::tool {

const char* const kReferenceGpu = "NVIDIA H200 with 16 CPU cores";

namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kMiB = 1024.0 * 1024.0;

// Measured on nine missions (a drone's flight, rooms rendered and furnished, panoramas of one room), where it was 0.88
// to 0.99: pixels of a depth map that make a point before one asks whose place it is. A little less, since missions
// that are harder were not among them.
constexpr double kKept = 0.9;
// Of these, with `fusion.suppression`, give way to one beside them; there 0.05 to 0.35 with maps of this width or more,
// a third of it with maps of a third: errors must be wider than a pixel.
constexpr double kGiveWay = 0.24;
constexpr double kGiveWayWidth = 1440.0;
// Fitted there, to what was left of these points after the free-space filter and ownership: how much of a keyframe's
// places another one of the fusion window, and one farther away, has a point for.
constexpr double kShownNear = 1.5;  // besides, the free-space filter takes some
constexpr double kShownFar = 0.25;

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

/// Of a keyframe's points those that are left when every place has one owner. A landmark of the map stands for what is
/// around it. Where others show the place twice as finely, or more, all of their points rank higher; of those that show
/// it about as finely half do. A point with `m` higher ones around on a pixel's area is left with a probability of
/// 1 / (1 + a m), `a` being the area from which they drive it out: the fewer there is room for, the fewer are there.
class OwnShare {
 public:
  OwnShare(const SlamMap& map, const DensifierOptions& options)
      : map_(map), area_(kPi * options.fusion.spacing_px * options.fusion.spacing_px) {
    for (const MapKeyframe& keyframe : map.keyframes) centers_.emplace(keyframe.id, keyframe.cam_from_world.center());
  }

  double of(const PlanEntry& entry) const {
    constexpr std::size_t kSamples = 64;
    const MapKeyframe* const keyframe = map_.find_keyframe(entry.id);
    if (keyframe == nullptr || area_ == 0.0) return 1.0;
    const Eigen::Vector3d center = centers_.at(entry.id);
    const std::size_t stride = std::max<std::size_t>(1, keyframe->observations.size() / kSamples);
    Mean share;
    for (std::size_t i = 0; i < keyframe->observations.size(); i += stride) {
      const MapLandmark* const landmark = map_.find_landmark(keyframe->observations[i].landmark_id);
      if (landmark == nullptr) continue;
      share.add(of_place(landmark->position_world, center, entry));
    }
    return share.value() > 0.0 ? share.value() : 1.0;
  }

 private:
  double of_place(const Eigen::Vector3d& place, const Eigen::Vector3d& center, const PlanEntry& entry) const {
    const double own = (place - center).norm();
    double higher = 0.0, even = 0.0;
    for (const std::int64_t id : entry.owners) {
      const bool is_near = std::find(entry.fusion.begin(), entry.fusion.end(), id) != entry.fusion.end();
      const auto at = centers_.find(id);
      if (at == centers_.end()) continue;
      const double ratio = own / std::max((place - at->second).norm(), 1e-9);
      const double density = area_ * (is_near ? kShownNear : kShownFar) * std::min(ratio * ratio, 1.0 / area_);
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
  std::unordered_map<std::int64_t, Eigen::Vector3d> centers_;
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
  options.expected_keyframes = used;
  options.scratch_folder.clear();
  const double all = static_cast<double>(device_memory_needed(options, image_width));
  options.scratch_folder = "beside the cloud";
  return {all, std::min(all, static_cast<double>(device_memory_needed(options, image_width)))};
}

MemoryBudget estimate_memory(const SlamMap& map, DensifierOptions options, std::int64_t used, int image_width,
                             int image_height) {
  options.scratch_folder = options.free_space.whole_mission ? "beside the cloud" : "";
  const HostMemory densifier = host_memory_needed(options, used, image_width);
  constexpr double kProcess = 72.0 * kMiB, kGpuProcess = 100.0 * kMiB;  // libraries, a driver's context, threads
  const double image = 3.0 * image_width * image_height;
  const double of_map = map_bytes(map);
  const int ahead = images_ahead(map, threads_of(options));
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

  const OwnShare own_share(question.map, options);
  Mean share, views, owners;
  std::vector<std::int64_t> ids;
  for (const PlanEntry& entry : question.plan.entries) {
    ids.push_back(entry.id);
    b.used += entry.used();
    if (!entry.has_depth_map()) continue;
    ++b.depth_maps;
    views.add(static_cast<double>(entry.near.size()));
    owners.add(static_cast<double>(entry.owners.size()));
    share.add(own_share.of(entry));
  }
  b.keyframes = static_cast<std::int64_t>(ids.size());
  const double all_pixels = pixels * static_cast<double>(b.depth_maps);
  b.views = views.value();
  const double give_way = options.fusion.suppression > 0.0 ? kGiveWay * std::min(1.0, b.width / kGiveWayWidth) : 0.0;
  b.points_per_pixel = kKept * (1.0 - give_way) * share.value();
  b.points = b.points_per_pixel * all_pixels;
  b.cloud_bytes = kPlyBytes * b.points;
  b.workspace_bytes =
      kPlanesBytes * all_pixels + kPointBytes * b.points + kRecordBytes * static_cast<double>(b.keyframes);

  b.memory = estimate_memory(question.map, options, b.used, sized.image_width, sized.image_height);
  b.device = estimate_device(options, b.used, sized.image_width);

  const double image_pixels = one_image * static_cast<double>(b.keyframes);
  const CpuPace& pace = question.pace;
  const double rest = pace.rest * std::pow(static_cast<double>(b.width) / kPaceWidth, -kRestFalls);
  b.cpu_seconds = all_pixels * (pace.matching * b.views + rest + pace.ownership * owners.value()) +
                  kImagePixelSeconds * image_pixels + kPointSeconds * b.points;
  // Fits what whole runs take on that machine, from 5 keyframes to 1,080 and from 640 x 320 to 5760 x 2880, to 20 %;
  // at first the start of the device and the map's, at last what the disk has still to take.
  constexpr double kStartSeconds = 0.42, kLookSeconds = 1.6e-9;  // a pixel's that the lenses are told from
  const double looked_at = static_cast<double>(keyframes_for_lens_distance(ids).size());
  const double matching = planes_tried(options.patchmatch) * (1.15e-10 + 0.37e-10 * b.views);
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
