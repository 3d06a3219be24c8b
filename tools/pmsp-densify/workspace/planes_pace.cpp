// SPDX-License-Identifier: BSD-2-Clause
#include "planes_pace.h"

#include <cstddef>

namespace pmsp::tool {

bool PlanesPace::is_worth_keeping(const PlaneMap& planes) {
  constexpr double kMostBytesPerSecond = 100e6;
  constexpr std::size_t kPlaneBytes = 4 * sizeof(float);
  if (!first_) {
    first_ = Clock::now();
    return false;
  }
  bytes_ += static_cast<double>(kPlaneBytes * planes.x.size());
  return bytes_ < kMostBytesPerSecond * std::chrono::duration<double>(Clock::now() - *first_).count();
}

}  // namespace pmsp::tool
