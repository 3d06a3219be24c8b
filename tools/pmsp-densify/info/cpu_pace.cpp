// SPDX-License-Identifier: BSD-2-Clause
#include "cpu_pace.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <deque>
#include <vector>

#include "plan/plan.h"
#include "pmsp/camera.h"
#include "pmsp/densifier.h"

namespace pmsp::tool {
namespace {

constexpr int kPaceHeight = kPaceWidth / 2;
constexpr int kKeyframes = 8;
constexpr double kStep = 0.4;                   // between keyframes, all of which see the whole box
const Eigen::Vector3d kHalf = {4.0, 1.6, 3.0};  // half sides of the box, around the middle of the path
constexpr int kRepetitions = 3;                 // the fastest one counts, since other processes may be running
constexpr double kLongEnough = 1.0;             // total limit for repetitions [s]
constexpr int kLandmarkColumns = 20, kLandmarkRows = 10;

/// Intersection of a ray from inside with the box.
Eigen::Vector3d hit(const Eigen::Vector3d& from, const Eigen::Vector3d& bearing) {
  double nearest = 1e9;
  for (int axis = 0; axis < 3; ++axis) {
    const double speed = bearing[axis];
    if (std::abs(speed) < 1e-9) continue;
    nearest = std::min(nearest, ((speed > 0.0 ? kHalf[axis] : -kHalf[axis]) - from[axis]) / speed);
  }
  return from + nearest * bearing;
}

/// View-independent texture of several scales.
std::uint8_t gray_at(const Eigen::Vector3d& p) {
  double sum = 0.0;
  for (const double size : {0.15, 0.4, 1.1}) {
    sum += std::sin(p.x() / size + 1.7 * std::sin(p.y() / size)) * std::sin(p.z() / size + 1.3 * p.y() / size);
  }
  return static_cast<std::uint8_t>(std::clamp(128.0 + 40.0 * sum, 0.0, 255.0));
}

double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

DensifierOptions small(DensifierOptions options) {
  options.width = kPaceWidth;
  options.height = kPaceHeight;
  options.backend = Backend::kCpu;
  options.threads = 1;
  options.scratch_folder.clear();
  options.unordered = false;
  options.advanced.view_filter.enabled = false;
#ifdef PMSP_SANITIZED  // too slow to be representative
  options.simd = Simd::kScalar;
  options.advanced.patchmatch.iterations = 1;
  options.advanced.patchmatch.refinements = 1;
  options.advanced.patchmatch.geometric_passes = 0;
#endif
  return options;
}

std::vector<Landmark> landmarks() {
  std::vector<Landmark> points;
  for (int row = 0; row < kLandmarkRows; ++row) {
    for (int column = 0; column < kLandmarkColumns; ++column) {
      const Eigen::Vector3d bearing = bearing_from_pixel({column + 0.5, row + 0.5}, kLandmarkColumns, kLandmarkRows);
      points.push_back({static_cast<std::int64_t>(points.size()), hit(Eigen::Vector3d::Zero(), bearing)});
    }
  }
  return points;
}

Image<Rgb> picture_from(const Eigen::Vector3d& center) {
  Image<Rgb> image(kPaceWidth, kPaceHeight);
  for (int y = 0; y < kPaceHeight; ++y) {
    for (int x = 0; x < kPaceWidth; ++x) {
      const std::uint8_t gray = gray_at(hit(center, bearing_from_pixel({x + 0.5, y + 0.5}, kPaceWidth, kPaceHeight)));
      image(x, y) = {gray, gray, gray};
    }
  }
  return image;
}

/// CPU time of a run [s].
double seconds_of(const DensifierOptions& options, const std::vector<Keyframe>& keyframes, DensifierStats& stats) {
  DensifierCallbacks callbacks;
  callbacks.cloud = [](const KeyframeCloud&) {};
  Densifier densifier(options, callbacks);
  const double start = cpu_seconds();
  for (const Keyframe& keyframe : keyframes) densifier.add(keyframe);
  densifier.flush();
  stats = densifier.stats();
  return cpu_seconds() - start;
}

}  // namespace

CpuPace measure_cpu_pace(const DensifierOptions& given) {
  const DensifierOptions options = small(given);
  std::vector<Keyframe> keyframes;
  std::deque<Image<Rgb>> images;
  std::vector<PlanKeyframe> planned;
  for (int i = 0; i < kKeyframes; ++i) {
    Keyframe keyframe;
    keyframe.id = i;
    const Eigen::Vector3d center = {kStep * (i - 0.5 * (kKeyframes - 1)), 0.0, 0.0};
    keyframe.cam_from_world.translation = -center;
    keyframe.landmarks = landmarks();
    images.push_back(picture_from(center));
    keyframe.image = images.back().view();
    keyframes.push_back(keyframe);
    planned.push_back({keyframe.id, keyframe.cam_from_world, keyframe.landmarks, {}});
  }
  double views = 0.0, duplicate_views = 0.0, maps = 0.0;
  for (const PlanEntry& entry : make_plan(planned, options).entries) {
    if (!entry.has_depth_map()) continue;
    views += static_cast<double>(entry.near.size());
    duplicate_views += static_cast<double>(entry.duplicate_views.size());
    maps += 1.0;
  }
  const double pixels = static_cast<double>(kPaceWidth) * kPaceHeight;
  CpuPace pace;
  double fastest = 0.0, spent = 0.0;
  for (int i = 0; i < kRepetitions && spent < kLongEnough; ++i) {
    DensifierStats s;
    const double took = seconds_of(options, keyframes, s);
    spent += took;
    if (fastest > 0.0 && took >= fastest) continue;
    fastest = took;
    const double others = s.seconds_prepare + s.seconds_init + s.seconds_median + s.seconds_consistency +
                          s.seconds_fusion + s.seconds_free_space;
    // Stage times include waiting for a CPU: they give shares, the thread's CPU time the total.
    const double scale = took / std::max(s.seconds_patchmatch + others + s.seconds_duplicates, 1e-9);
    pace.matching = scale * s.seconds_patchmatch / (pixels * std::max(views, 1.0));
    pace.rest = scale * others / (pixels * std::max(maps, 1.0));
    pace.duplicate_removal = scale * s.seconds_duplicates / (pixels * std::max(duplicate_views, 1.0));
  }
  return pace;
}

}  // namespace pmsp::tool
