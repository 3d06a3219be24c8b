// SPDX-License-Identifier: BSD-2-Clause
// A keyframe through the functions of the README's snippet.
#include "snippet.h"

#include <cstdlib>

int main() {
  const cv::Mat image(64, 128, CV_8UC3, cv::Scalar(10, 20, 30));
  on_keyframe(7, image, Eigen::Matrix4d::Identity(), {{1, {0.0, 0.0, 2.0}}});
  on_optimised({});
  if (live.stats().added != 1) return EXIT_FAILURE;
  return on_draw(0).removed.empty() ? EXIT_SUCCESS : EXIT_FAILURE;
}
