// SPDX-License-Identifier: BSD-2-Clause
#include "planes_pace.h"

namespace pmsp::tool {

bool PlanesPace::is_worth_keeping(const DensifierOptions& options) {
  constexpr double kMostBytesPerSecond = 100e6;
  constexpr double kPlaneBytes = 4 * sizeof(float);
  if (!first_) {
    first_ = Clock::now();
    return false;
  }
  bytes_ += kPlaneBytes * options.width * options.height;
  return bytes_ < kMostBytesPerSecond * std::chrono::duration<double>(Clock::now() - *first_).count();
}

}  // namespace pmsp::tool
