// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "pmsp/stages.h"
#include "stage.h"

namespace pmsp {

/// Readable view of a map; empty if the map is empty.
inline kernels::PlaneMapView view_of(const PlaneMap& map) {
  if (map.empty()) return {};
  return {map.x.pixels().data(), map.y.pixels().data(), map.z.pixels().data(),
          map.width(),           map.height(),          map.score.pixels().data()};
}

/// Writable view of a map.
inline kernels::PlaneArrays arrays_of(PlaneMap& map) {
  return {map.x.pixels().data(), map.y.pixels().data(), map.z.pixels().data(), map.score.pixels().data()};
}

inline kernels::FilteredMap<kernels::PlaneMapView> view_of(const PlaneMap& map, const Image<float>& confidence) {
  return {view_of(map), confidence.pixels().data(), map.width(), map.height()};
}

template <class A, class B>
bool same_size(const A& a, const B& b) {
  return a.width() == b.width() && a.height() == b.height();
}

}  // namespace pmsp
