// SPDX-License-Identifier: BSD-2-Clause
#include "estimates.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <exception>
#include <iostream>
#include <limits>
#include <numeric>
#include <set>
#include <unordered_map>
#include <vector>

#include <nlohmann/json.hpp>

#include "cloud_arguments.h"
#include "cost.h"
#include "devices.h"
#include "elementary.h"
#include "export/robot_map.h"
#include "io/convention.h"
#include "io/image_reader.h"
#include "machine.h"
#include "mission_input.h"
#include "numbers.h"
#include "options.h"
#include "pmsp/calibration.h"
#include "pmsp/camera.h"
#include "pmsp/stages.h"
#include "progress.h"
#include "verbs.h"

namespace pmsp::tool {

const char* const kReferenceGpu = "NVIDIA H200 with 16 CPU cores";

namespace {

constexpr double kMiB = 1024.0 * 1024.0;

// Points. Fitted to `online` and `normal` runs.
constexpr double kKept = 0.93;  // share of pixels with one before duplicate removal if all landmarks are near
// Distant landmarks indicate an open scene: little parallax, and sky, which has no landmarks.
constexpr double kFar = 2.0;         // threshold [median range]
constexpr double kLostBehind = 4.0;  // pixels without a point per landmark at infinity
// Share suppressed by adjacent ones (`fusion.suppression`), for maps of at least this width, proportionally less for
// smaller ones, since errors must exceed a pixel.
constexpr double kGiveWay = 0.24;
constexpr double kGiveWayWidth = 1440.0;
constexpr double kShown =
    1.5;  // of another keyframe per pixel of it that shows the same surface, after duplicate removal

// Memory and disk [bytes].
constexpr double kProcess = 72.0 * kMiB, kGpuProcess = 100.0 * kMiB;  // libraries, driver context, threads
constexpr double kRecordBytes = 12e3;  // per keyframe, in a workspace's record and sharpness files
// Additional memory of a run with a workspace.
constexpr double kWorkspaceKeyframe = 60e3;                     // per keyframe
constexpr double kWorkspacePixel = kPlanesBytes + kPointBytes;  // per pixel of depth maps, in flight to their files
constexpr double kWorkspaceGpu = 128.0 * kMiB;                  // data in flight, if produced faster than written

// Time on one core of this CPU besides its pace [s].
constexpr double kImagePixelSeconds = 14e-9;  // per image pixel: decoding, sharpness, pairing check
constexpr double kPointSeconds = 20e-9;       // per point: encoding and writing
constexpr double kRestFalls = 0.42;           // exponent with which the pace of the other stages falls with the width

// Time with kReferenceGpu [s]. Fitted to whole runs.
constexpr double kGpuStart = 0.42;                             // start of device and map
constexpr double kGpuPlane = 1.15e-10, kGpuView = 0.37e-10;    // per pixel and plane tried; more per source view
constexpr double kGpuPixel = 1.8e-9, kGpuImagePixel = 0.8e-9;  // other stages; per image pixel
constexpr double kGpuLensPixel = 1.6e-9;                       // per pixel of the images for the lens estimate
constexpr double kGpuPoint = 4.5e-9;                           // per point, with pending writes to disk

/// Arithmetic mean.
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

/// Share of a depth map's pixels that become points, estimated from landmarks: at most one per cell of the panorama,
/// since their density follows texture.
///
/// Duplicates: all points of keyframes with at least twice the resolution rank higher, half of those with similar
/// resolution. A point with `m` expected higher-ranked points per pixel area remains with a probability of 1 / (1 + a
/// m), `a` being the area within which they suppress it: the fewer points there is room for, the fewer there are.
class PointShare {
 public:
  PointShare(const SlamMap& map, const DensifierOptions& options)
      : map_(map), area_(kernels::kPi * options.advanced.fusion.spacing_px * options.advanced.fusion.spacing_px) {
    for (const MapKeyframe& keyframe : map.keyframes) {
      View& view = views_[keyframe.id];
      view.center = keyframe.cam_from_world.center();
      for (const MapObservation& observation : keyframe.observations) view.landmarks.push_back(observation.landmark_id);
      std::sort(view.landmarks.begin(), view.landmarks.end());
    }
  }

  double of(const PlanEntry& entry) const {
    constexpr int kBoxColumns = 20, kBoxRows = 10;
    const MapKeyframe* const keyframe = map_.find_keyframe(entry.id);
    if (keyframe == nullptr) return kKept;
    const Eigen::Vector3d& center = views_.at(entry.id).center;
    std::array<bool, static_cast<std::size_t>(kBoxColumns) * kBoxRows> known{};
    std::vector<const MapLandmark*> places;
    for (const MapObservation& observation : keyframe->observations) {
      const MapLandmark* const landmark = map_.find_landmark(observation.landmark_id);
      if (landmark == nullptr) continue;
      const Eigen::Vector2d at =
          pixel_from_bearing(keyframe->cam_from_world * landmark->position_world, kBoxColumns, kBoxRows);
      if (!(at.array() >= 0.0).all() || !(at.x() < kBoxColumns) || !(at.y() < kBoxRows)) continue;
      bool& is_known =
          known[static_cast<std::size_t>(static_cast<int>(at.y()) * kBoxColumns + static_cast<int>(at.x()))];
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
  /// Other keyframe with possible duplicates, and its share of common surface.
  struct Viewer {
    const View* view;
    double overlap;
  };

  /// Estimates overlap from common landmarks, normalised to the maximum, since a SLAM rediscovers only some.
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
      // octaves of distance: within a factor of two, the probability of an octave boundary is the logarithm
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
  const double image = 3.0 * image_width * image_height;
  const double of_map = map_bytes(map);
  const int ahead = io::images_ahead(map, threads_of(options));
  MemoryBudget memory;
  memory.scratch = densifier.scratch;
  memory.host = kProcess + of_map + image * (ahead + 3) + densifier.memory;
  memory.gpu_host = kGpuProcess + of_map + 3.0 * image * ahead;  // two copies during decoding, and heap overhead
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
  b.cpu_seconds = all_pixels * (pace.matching * b.views + rest + pace.duplicate_removal * duplicate_views.value()) +
                  kImagePixelSeconds * image_pixels + kPointSeconds * b.points;
  const double looked_at = static_cast<double>(keyframes_for_lens_distance(ids).size());
  const double matching = planes_tried(options.advanced.patchmatch) * (kGpuPlane + kGpuView * b.views);
  b.reference_seconds = kGpuStart + all_pixels * (matching + kGpuPixel) + kGpuImagePixel * image_pixels +
                        kGpuLensPixel * one_image * looked_at + kGpuPoint * b.points;
  return b;
}

std::vector<PlanKeyframe> keyframes_without_image(const SlamMap& map, const ImageSource* source,
                                                  const DensifierOptions& options) {
  std::set<std::int64_t> with_image;
  if (source != nullptr) with_image.insert(source->keyframe_ids().begin(), source->keyframe_ids().end());
  std::vector<PlanKeyframe> keyframes;
  for (const MapKeyframe* keyframe : in_time_order(map)) {
    if (source != nullptr && with_image.count(keyframe->id) == 0) continue;
    keyframes.push_back(plan_keyframe(keyframe_of(map, *keyframe), options));
  }
  return keyframes;
}

namespace {

std::string time_text(double seconds) {
  if (seconds < 100.0) return number_text(std::ceil(seconds), "%.0f s");
  return seconds < 6000.0 ? number_text(seconds / 60.0, "%.0f min") : number_text(seconds / 3600.0, "%.1f h");
}

constexpr double kMinAnnouncedSeconds = 30.0;  ///< minimum time for an announcement [s]
constexpr double kFastestPace = 1.5e-6;        ///< CPU time per pixel and source view, below that of any CPU [s]

/// Expected CPU time [s]; 0 = clearly below kMinAnnouncedSeconds.
double expected_seconds(const SlamMap& map, const ImageSource& source, const DensifierOptions& options) {
  const Plan plan = make_plan(keyframes_without_image(map, &source, options), options);
  Budget budget = estimate_budget({map, plan, options, 0, 0, {kFastestPace, 0.0, 0.0}});
  if (budget.cpu_seconds < kMinAnnouncedSeconds * budget.threads) return 0.0;
  budget = estimate_budget({map, plan, options, 0, 0, measure_cpu_pace(options)});
  return budget.cpu_seconds / budget.threads;
}

std::int64_t whole(double number) { return static_cast<std::int64_t>(std::llround(number)); }

}  // namespace

std::string bytes_text(double bytes) {
  const char* unit = "MiB";
  double number = bytes / (1024.0 * 1024.0);
  for (const char* larger : {"GiB", "TiB"}) {
    if (number < 1000.0) break;
    number /= 1024.0;
    unit = larger;
  }
  return number_text(number, number < 10.0 ? "%.1f " : "%.0f ") + unit;
}

nlohmann::ordered_json to_json(const Budget& b) {
  return {{"width", b.width},
          {"height", b.height},
          {"keyframes", b.keyframes},
          {"used", b.used},
          {"depth_maps", b.depth_maps},
          {"views", b.views},
          {"points_per_pixel", b.points_per_pixel},
          {"points", whole(b.points)},
          {"cloud_bytes", whole(b.cloud_bytes)},
          {"workspace_bytes", whole(b.workspace_bytes)},
          {"scratch_bytes", whole(b.memory.scratch)},
          {"cpu",
           {{"memory_bytes", whole(b.memory.host)},
            {"threads", b.threads},
            {"cpu_seconds", b.cpu_seconds},
            {"seconds", b.cpu_seconds / b.threads}}},
          {"gpu",
           {{"memory_bytes", whole(b.memory.gpu_host)},
            {"device_bytes", whole(b.device.all)},
            {"least_device_bytes", whole(b.device.least)},
            {"reference", kReferenceGpu},
            {"reference_seconds", b.reference_seconds}}}};
}

std::string budget_text(const Budget& b) {
  const std::string size = std::to_string(b.width) + " x " + std::to_string(b.height);
  std::string text = "a run:      " + std::to_string(b.depth_maps) + " depth maps of " + size + " px; about " +
                     count_text(whole(b.points)) + number_text(b.points_per_pixel, " points (%.2f a pixel)") +
                     ", usually within 30 %\n";
  text += "  disk:     cloud " + bytes_text(b.cloud_bytes);
  if (b.memory.scratch > 0.0) text += ", temporary data " + bytes_text(b.memory.scratch);
  text += ", workspace (if used) " + bytes_text(b.workspace_bytes) + "\n";
  text += "  CPU:      " + time_text(b.cpu_seconds / b.threads) + " on " + std::to_string(b.threads) +
          (b.threads == 1 ? " thread" : " threads") + " (" + time_text(b.cpu_seconds) +
          " of CPU time, by a benchmark on this machine), " + bytes_text(b.memory.host) + " of memory\n";
  text += "  GPU:      " + bytes_text(b.device.all) + " of GPU memory";
  if (b.device.least < 0.9 * b.device.all)
    text += " (at least " + bytes_text(b.device.least) + ", with temporary data)";
  text += ", " + bytes_text(b.memory.gpu_host) + " of host memory; " + time_text(b.reference_seconds) + " with an " +
          kReferenceGpu + "\n";
  return text;
}

std::string cpu_time_text(const SlamMap& map, const ImageSource& source, const DensifierOptions& options,
                          const DensifierOptions& online) {
  const double seconds = expected_seconds(map, source, options);
  if (seconds < kMinAnnouncedSeconds) return "";
  const double faster = expected_seconds(map, source, online);
  const std::string text = "time: about " + time_text(seconds) + " on this CPU";
  if (faster > 0.7 * seconds) return text;
  return text + "; with --quality online " + (faster > 0.0 ? "about " : "below ") +
         time_text(std::max(faster, kMinAnnouncedSeconds));
}

namespace {

struct ImageSize {
  int width = 0;
  int height = 0;
};

/// Decodes the first remaining image; {} if unreadable.
ImageSize first_size(ImageSource& source) {
  try {
    if (const auto item = source.next()) return {item->image.width(), item->image.height()};
  } catch (const std::exception&) {  // reported by the run
  }
  return {};
}

/// CUDA devices of the run.
std::vector<int> devices_of(const DensifierOptions& options) {
  if (options.backend == Backend::kCpu) return {};
  if (!options.devices.empty()) return options.devices;
  std::vector<int> all(static_cast<std::size_t>(std::max(1, device_count())));
  std::iota(all.begin(), all.end(), 0);
  return all;
}

/// Minimum over the devices; 0 = one is unusable, or there is none.
std::size_t free_on(const std::vector<int>& devices) {
  std::size_t least = devices.empty() ? 0 : std::numeric_limits<std::size_t>::max();
  for (const int device : devices) least = std::min(least, free_device_memory(device));
  return least;
}

}  // namespace

double memory_of_outputs(const Arguments& arguments, const DensifierOptions& options, const SlamMap& map,
                         const ImageSource& images) {
  constexpr double kNodes = 1.0;             // of an OctoMap, relative to the cells
  constexpr double kRays = 32.0 * kMiB;      // of a keyframe
  constexpr double kDepthPixelBytes = 60.0;  // of a depth map and its files
  const double depth = arguments.cloud.wants_depth() ? kDepthPixelBytes * options.width * options.height : 0.0;
  if (!arguments.cloud.has_map()) return depth;
  const CloudHeader header = cloud_header(arguments, options, map, find_frame(arguments, map, images));
  if (!(header.cell_size > 0.0)) return depth;  // reported by the run
  const double cells = std::min<double>(expected_map_bytes(map, header, arguments.cloud.amount.crop), kMostMapBytes);
  return depth + kRays + (1.0 + kNodes) * cells;
}

void print_memory(const Arguments& arguments) {
  DensifierOptions options = effective_options(arguments);
  const SlamMap map = read_map(arguments);
  if (!arguments.no_verify) require_convention(map);
  const std::unique_ptr<ImageSource> source = open_images(arguments, map);
  const std::int64_t keyframes = static_cast<std::int64_t>(source->keyframe_ids().size());
  ImageSize size = first_size(*source);
  if (size.width == 0 && !map.cameras.empty()) size = {map.cameras[0].width, map.cameras[0].height};
  fill_in_size(options, size.width, size.height);
  const MemoryBudget memory = estimate_memory(map, options, keyframes, size.width, size.height);
  const DeviceBudget device = estimate_device(options, keyframes, kAnyImageWidth);
  const double pixels = static_cast<double>(options.width) * static_cast<double>(options.height);
  const double workspace = arguments.workspace.empty()
                               ? 0.0
                               : kWorkspaceKeyframe * static_cast<double>(keyframes) + kWorkspacePixel * pixels;
  const double more = workspace + memory_of_outputs(arguments, options, map, *source);
  const double gpu_workspace = arguments.workspace.empty() ? 0.0 : kWorkspaceGpu;
  const std::vector<int> devices = devices_of(options);
  const nlohmann::ordered_json json{{"cpu", {{"memory_bytes", whole(memory.host + more)}}},
                                    {"gpu",
                                     {{"memory_bytes", whole(memory.gpu_host + more + gpu_workspace)},
                                      {"device_bytes", whole(device.all)},
                                      {"least_device_bytes", whole(device.least)},
                                      {"devices", devices},
                                      {"free_device_bytes", free_on(devices)}}}};
  std::cout << json.dump(2) << "\n";
}

}  // namespace pmsp::tool
