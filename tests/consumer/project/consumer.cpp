// SPDX-License-Identifier: BSD-2-Clause
// What a SLAM does with libpmsp, and the README's example: keyframes in, points out.
#include <cstdint>
#include <cstdio>
#include <vector>

#include <pmsp/densifier.h>
#include <pmsp/version.h>

int main() {
  pmsp::DensifierOptions options = pmsp::preset(pmsp::Quality::kOnline);
  options.width = 64;
  options.height = 32;

  std::int64_t points = 0;
  pmsp::DensifierCallbacks callbacks;
  callbacks.cloud = [&points](const pmsp::KeyframeCloud& cloud) {
    points += static_cast<std::int64_t>(cloud.points.size());
  };
  pmsp::Densifier densifier(options, callbacks);

  // In a SLAM, image, pose and landmarks are those of its keyframe; here they are two gray pictures, one step apart.
  const std::vector<pmsp::Rgb> pixels(64 * 32, pmsp::Rgb{128, 128, 128});
  for (int i = 0; i < 2; ++i) {
    pmsp::Keyframe keyframe;
    keyframe.id = i;
    keyframe.timestamp = 0.1 * i;
    keyframe.cam_from_world.translation = Eigen::Vector3d(-0.5 * i, 0.0, 0.0);
    keyframe.landmarks = {{1, {0.0, 0.0, 2.0}}, {2, {0.5, 0.5, 2.0}}, {3, {0.0, -0.5, -2.0}}};
    keyframe.image = {pixels.data(), 64, 32};
    densifier.add(keyframe);
  }
  densifier.flush();

  const pmsp::DensifierStats& stats = densifier.stats();
  std::printf("libpmsp %s: %lld keyframes, %lld points\n", PMSP_VERSION_STRING,
              static_cast<long long>(stats.keyframes_added), static_cast<long long>(points));
  return stats.keyframes_added == 2 && stats.points == points ? 0 : 1;
}
