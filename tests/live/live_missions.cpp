// SPDX-License-Identifier: BSD-2-Clause
#include "live/live_missions.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>

#include "core/recording.h"

namespace pmsp::test {

LiveKeyframe live_keyframe(const synth::Mission& mission, std::size_t index) {
  const synth::Frame& frame = mission.frames[index];
  LiveKeyframe keyframe;
  keyframe.id = frame.id;
  keyframe.cam_from_world = frame.cam_from_world;
  keyframe.landmarks = frame.landmarks;
  const std::uint8_t* const data = &frame.image.pixels().data()->r;
  keyframe.image = {std::shared_ptr<const void>(data, [](const void*) {}),
                    data,
                    frame.image.width(),
                    frame.image.height(),
                    0,
                    PixelFormat::kRgb};
  return keyframe;
}

std::vector<LiveKeyframe> live_keyframes(const synth::Mission& mission) {
  std::vector<LiveKeyframe> result;
  for (std::size_t i = 0; i < mission.frames.size(); ++i) result.push_back(live_keyframe(mission, i));
  return result;
}

LiveOptions small_live(int width) {
  LiveOptions options;
  options.densifier.width = width;
  options.densifier.height = width / 2;
  options.densifier.threads = 2;
  options.densifier.simd = kAnySimd;
  options.densifier.advanced.patchmatch.refinements = 2;
  options.densifier.backend = Backend::kCpu;
  options.nice = 0;
  options.max_move_px *= width / 640.0;  // of small images, too, as far as depths go
  options.previews = false;
  return options;
}

const synth::Mission& room() {
  static const synth::Mission kRoom = synth::textured_room(small_recipe(kRoomWidth, kRoomKeyframes));
  return kRoom;
}

std::shared_ptr<const LiveSnapshot> at_once(const std::vector<LiveKeyframe>& keyframes, const LiveOptions& options) {
  LiveDensifier live(options);
  live.pause();
  for (const LiveKeyframe& keyframe : keyframes) live.add(keyframe);
  live.finish();
  live.resume();
  if (!live.wait(kLong)) throw std::runtime_error("the work does not end");
  const LiveStats stats = live.stats();
  if (stats.errors != 0) throw std::runtime_error(stats.last_error);
  return live.snapshot();
}

std::vector<std::int64_t> ids_of(const LiveSnapshot& snapshot) {
  std::vector<std::int64_t> ids;
  for (const LiveCloud& cloud : snapshot.clouds) ids.push_back(cloud.keyframe_id);
  return ids;
}

LiveFigures figures(const LiveSnapshot& snapshot, const synth::Mission& mission) {
  LiveFigures result;
  std::size_t right = 0;
  std::size_t pixels = 0;
  std::vector<double> off;
  for (const LiveCloud& live : snapshot.clouds) {
    if (live.preliminary) continue;
    ++result.clouds;
    result.points += live.cloud->points.size();
    const auto frame = std::find_if(mission.frames.begin(), mission.frames.end(),
                                    [&](const synth::Frame& each) { return each.id == live.keyframe_id; });
    if (frame == mission.frames.end()) continue;
    pixels += frame->depth.size();
    const Eigen::Vector3d center = frame->cam_from_world.center();
    const std::vector<CloudPoint> points = transform_points(*live.cloud, live.pose);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double truth = frame->depth.pixels()[live.cloud->pixels[i]];
      const double error = std::abs((points[i].position.cast<double>() - center).norm() / truth - 1.0);
      right += error <= 0.02 ? 1 : 0;
      off.push_back(error);
    }
  }
  if (result.points == 0 || pixels == 0) return result;
  result.covered = static_cast<double>(result.points) / static_cast<double>(pixels);
  result.right = static_cast<double>(right) / static_cast<double>(result.points);
  std::nth_element(off.begin(), off.begin() + static_cast<std::ptrdiff_t>(off.size() / 2), off.end());
  result.misplaced = off[off.size() / 2];
  return result;
}

bool same_points(const LiveSnapshot& a, const LiveSnapshot& b) {
  return a.clouds.size() == b.clouds.size() &&
         std::equal(a.clouds.begin(), a.clouds.end(), b.clouds.begin(), [](const LiveCloud& x, const LiveCloud& y) {
           return x.keyframe_id == y.keyframe_id && x.preliminary == y.preliminary && same(*x.cloud, *y.cloud);
         });
}

}  // namespace pmsp::test
