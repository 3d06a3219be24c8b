// SPDX-License-Identifier: BSD-2-Clause
// Use of libpmsp by a SLAM: keyframes in, points out. The keyframes show the inside of a sphere, so that the true
// points are known.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <vector>

#include <pmsp/camera.h>
#include <pmsp/densifier.h>
#include <pmsp/version.h>

namespace {

constexpr double kRadius = 3.0;  // of the hall, around the origin
constexpr int kWidth = 192;
constexpr int kHeight = kWidth / 2;
constexpr int kKeyframes = 6;

Eigen::Vector3d position(int keyframe) { return {0.3 * keyframe - 0.75, 0.0, 0.0}; }

/// Where a ray from inside meets the wall.
Eigen::Vector3d wall(const Eigen::Vector3d& from, const Eigen::Vector3d& ray) {
  const double along = from.dot(ray);
  return from + (-along + std::sqrt(along * along + kRadius * kRadius - from.squaredNorm())) * ray;
}

std::uint8_t gray(double wave) { return static_cast<std::uint8_t>(127.5 + 127.0 * std::sin(wave)); }

/// A texture without repetition.
pmsp::Rgb paint(const Eigen::Vector3d& p) {
  const double bend = 3.0 * std::sin(1.7 * p.x() + 0.9 * p.y()) + 2.0 * std::sin(2.3 * p.z() - 1.1 * p.x());
  return {gray(7.0 * p.x() + bend), gray(8.0 * p.y() - 2.0 * p.x() - bend), gray(9.0 * p.z() + 3.0 * p.y() + bend)};
}

std::vector<pmsp::Rgb> panorama(const Eigen::Vector3d& from) {
  std::vector<pmsp::Rgb> pixels;
  pixels.reserve(kWidth * kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      pixels.push_back(paint(wall(from, pmsp::bearing_from_pixel({x + 0.5, y + 0.5}, kWidth, kHeight))));
    }
  }
  return pixels;
}

}  // namespace

int main() {
  pmsp::DensifierOptions options = pmsp::preset(pmsp::Quality::kOnline);
  options.width = kWidth;
  options.height = kHeight;

  std::int64_t points = 0;
  std::int64_t on_wall = 0;
  pmsp::DensifierCallbacks callbacks;
  callbacks.cloud = [&](const pmsp::KeyframeCloud& cloud) {
    for (const pmsp::CloudPoint& point : pmsp::transform_points(cloud, cloud.pose())) {
      ++points;
      on_wall += std::abs(point.position.norm() - kRadius) < 0.05 * kRadius ? 1 : 0;
    }
  };
  pmsp::Densifier densifier(options, callbacks);

  std::vector<pmsp::Landmark> landmarks;
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d ray = pmsp::bearing_from_pixel({3.7 * i, 17.0 + (11 * i) % 60}, kWidth, kHeight);
    landmarks.push_back({i, kRadius * ray});
  }
  for (int i = 0; i < kKeyframes; ++i) {
    const std::vector<pmsp::Rgb> pixels = panorama(position(i));
    pmsp::Keyframe keyframe;
    keyframe.id = i;
    keyframe.timestamp = 0.1 * i;
    keyframe.cam_from_world.translation = -position(i);
    keyframe.landmarks = landmarks;
    keyframe.image = {pixels.data(), kWidth, kHeight};
    densifier.add(keyframe);
  }
  densifier.flush();

  const pmsp::DensifierStats& stats = densifier.stats();
  std::printf("libpmsp %s: %lld keyframes, %lld points, %lld of them on the wall\n", PMSP_VERSION_STRING,
              static_cast<long long>(stats.keyframes_added), static_cast<long long>(points),
              static_cast<long long>(on_wall));
  // No part of the wall is occluded: the cloud contains each visible place once.
  const bool enough = points > kWidth * kHeight;
  const bool right = on_wall > points * 9 / 10;
  return stats.keyframes_added == kKeyframes && stats.points == points && enough && right ? 0 : 1;
}
