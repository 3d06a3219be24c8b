// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "init.h"
#include "pmsp/plane_map.h"
#include "sphere/plane_views.h"

namespace pmsp {

/// Keys of the pixels in host memory; threads may offer to one at the same time.
struct HostKeys {
  std::uint64_t* keys;
};
inline void offer(const HostKeys& keys, int pixel, std::uint64_t key) {
  std::uint64_t* const at = keys.keys + pixel;
  std::uint64_t known = __atomic_load_n(at, __ATOMIC_RELAXED);
  while (key < known && !__atomic_compare_exchange_n(at, &known, key, true, __ATOMIC_RELAXED, __ATOMIC_RELAXED)) {
  }
}

/// The planes that keys stand for (kernels::LandmarkPlanes, kernels::WarpedPlanes).
template <class Planes>
PlaneMap planes_of_keys(const Planes& planes, int width, int height) {
  PlaneMap map(width, height);
  const kernels::PlaneArrays to = arrays_of(map);
  for (int pixel = 0; pixel < width * height; ++pixel) {
    if (planes.keys[pixel] == kernels::kNoKey) continue;
    put(to, static_cast<std::size_t>(pixel), 1,
        kernels::Hypothesis<float>{kernels::plane_at<float>(planes, pixel), 0.0F});
  }
  return map;
}

}  // namespace pmsp
