// SPDX-License-Identifier: BSD-2-Clause
#include "core/recording.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <thread>

namespace pmsp::test {

DensifierCallbacks Recording::callbacks() {
  DensifierCallbacks result;
  result.raw_depth = [this](const DepthMap& map) {
    raw.push_back(map);
    order.emplace_back('r', map.keyframe_id);
  };
  result.filtered_depth = [this](const DepthMap& map) {
    filtered.push_back(map);
    order.emplace_back('f', map.keyframe_id);
  };
  result.cloud = [this](const KeyframeCloud& cloud) {
    clouds.push_back(cloud);
    order.emplace_back('c', cloud.keyframe_id);
  };
  return result;
}

std::size_t Recording::points() const {
  std::size_t sum = 0;
  for (const KeyframeCloud& cloud : clouds) sum += cloud.points.size();
  return sum;
}

bool same(const KeyframeCloud& a, const KeyframeCloud& b) {
  return a.keyframe_id == b.keyframe_id && a.pose() == b.pose() && a.pixels == b.pixels && a.agree == b.agree &&
         a.window_ids == b.window_ids &&
         std::equal(a.points.begin(), a.points.end(), b.points.begin(), b.points.end(),
                    [](const CloudPoint& p, const CloudPoint& q) {
                      return p.position == q.position && p.normal == q.normal && p.color == q.color &&
                             p.views == q.views && p.confidence == q.confidence;
                    });
}

bool same(const Recording& a, const Recording& b) { return difference(a, b).empty(); }

std::string difference(const Recording& a, const Recording& b) {
  if (a.order != b.order) return "the order of the results";
  for (std::size_t i = 0; i < a.raw.size(); ++i) {
    if (!same(a.raw[i], b.raw[i])) return "raw depth map " + std::to_string(a.raw[i].keyframe_id);
  }
  for (std::size_t i = 0; i < a.filtered.size(); ++i) {
    if (!same(a.filtered[i], b.filtered[i])) return "filtered depth map " + std::to_string(a.filtered[i].keyframe_id);
  }
  for (std::size_t i = 0; i < a.clouds.size(); ++i) {
    if (!same(a.clouds[i], b.clouds[i])) {
      return "cloud " + std::to_string(a.clouds[i].keyframe_id) + ", of " + std::to_string(a.clouds[i].points.size()) +
             " and " + std::to_string(b.clouds[i].points.size()) + " points";
    }
  }
  return {};
}

Recording by_kind(Recording recording) {
  std::stable_sort(recording.order.begin(), recording.order.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  return recording;
}

DensifierOptions fast_options(int width, int threads) {
  DensifierOptions options = preset(Quality::kOnline);
  options.width = width;
  options.height = width / 2;
  options.threads = threads;
  options.simd = kAnySimd;
  options.advanced.patchmatch.iterations = kSanitized ? 1 : 3;
  return options;
}

void fly_through(Densifier& densifier, const synth::Mission& mission) {
  for (std::size_t i = 0; i < mission.frames.size(); ++i) densifier.add(synth::keyframe_of(mission, i));
  densifier.flush();
}

Recording densify(const synth::Mission& mission, const DensifierOptions& options) {
  Recording recording;
  Densifier densifier(options, recording.callbacks());
  fly_through(densifier, mission);
  return recording;
}

const synth::Mission& test_flight() {
  static const synth::Mission kFlight = synth::empty_room(small_recipe(kFlightWidth, 7));
  return kFlight;
}

const Recording& test_result() {
  static const Recording kResult = densify(test_flight(), fast_options());
  return kResult;
}

int callbacks_elsewhere(const DensifierOptions& options) {
  const std::thread::id here = std::this_thread::get_id();
  int elsewhere = 0;
  DensifierCallbacks callbacks;
  callbacks.raw_depth = [&](const DepthMap&) { elsewhere += std::this_thread::get_id() != here ? 1 : 0; };
  callbacks.filtered_depth = callbacks.raw_depth;
  callbacks.cloud = [&](const KeyframeCloud&) { elsewhere += std::this_thread::get_id() != here ? 1 : 0; };
  Densifier densifier(options, callbacks);
  fly_through(densifier, test_flight());
  return elsewhere;
}

void check_cancel(const DensifierOptions& options, std::size_t at, const Recording& whole) {
  Recording recording;
  Densifier* running = nullptr;
  DensifierCallbacks callbacks = recording.callbacks();
  const auto record = callbacks.raw_depth;
  callbacks.raw_depth = [&](const DepthMap& map) {
    record(map);
    if (recording.raw.size() == at) std::thread([&] { running->cancel(); }).join();
  };
  Densifier densifier(options, callbacks);
  running = &densifier;
  CHECK_FALSE(densifier.cancelled());
  fly_through(densifier, test_flight());
  CHECK(densifier.cancelled());
  CHECK(recording.raw.size() == at);
  CHECK(recording.order.back() == std::pair<char, std::int64_t>('r', static_cast<std::int64_t>(at) - 1));
  for (std::size_t i = 0; i < recording.order.size(); ++i) CHECK(recording.order[i] == whole.order[i]);
  Keyframe late = synth::keyframe_of(test_flight(), 0);
  late.id = 500;
  CHECK_FALSE(densifier.add(late));
  densifier.flush();
  CHECK(recording.raw.size() == at);
}

double points_on_surface(const synth::Scene& scene, const std::vector<KeyframeCloud>& clouds, double relative) {
  std::size_t total = 0;
  std::size_t good = 0;
  for (const KeyframeCloud& cloud : clouds) {
    const RigidTransform world_from_cam = cloud.cam_from_world.inverse();
    for (const CloudPoint& point : cloud.points) {
      ++total;
      const auto hit =
          scene.intersect(world_from_cam.translation, world_from_cam.rotation * point.position.cast<double>());
      good += hit && std::abs(static_cast<double>(point.position.norm()) / hit->distance - 1.0) <= relative ? 1 : 0;
    }
  }
  return total > 0 ? static_cast<double>(good) / static_cast<double>(total) : 0.0;
}

double median_surface_error(const synth::Scene& scene, const std::vector<KeyframeCloud>& clouds) {
  std::vector<double> errors;
  for (const KeyframeCloud& cloud : clouds) {
    const RigidTransform world_from_cam = cloud.cam_from_world.inverse();
    for (const CloudPoint& point : cloud.points) {
      const Eigen::Vector3d ray = world_from_cam.rotation * point.position.cast<double>();
      const auto hit = scene.intersect(world_from_cam.translation, ray);
      if (hit) errors.push_back(std::abs(ray.norm() / hit->distance - 1.0));
    }
  }
  REQUIRE(errors.size() > 1000);
  const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
  std::nth_element(errors.begin(), middle, errors.end());
  return *middle;
}

}  // namespace pmsp::test
