// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cmath>
#include <cstddef>

#include "core/small_missions.h"
#include "pmsp/error.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

/// Powers of two, by which nothing is rounded.
double scale_of(std::size_t i) { return std::ldexp(1.0, static_cast<int>(i % 5) - 2); }

void to_world(DepthMap& map) {
  for (float& depth : map.depth.pixels()) depth *= static_cast<float>(map.scale);
  map.scale = 1.0;
}

void to_world(KeyframeCloud& cloud) {
  for (CloudPoint& point : cloud.points) point.position *= static_cast<float>(cloud.scale);
  cloud.scale = 1.0;
}

ResultsById in_scene_units(ResultsById results) {
  for (auto& [id, map] : results.raw) to_world(map);
  for (auto& [id, map] : results.filtered) to_world(map);
  for (auto& [id, cloud] : results.clouds) to_world(cloud);
  return results;
}

}  // namespace

TEST_CASE("keyframes with units of their own give the same surfaces", "[densifier][scale]") {
  for (SmallMission& mission : small_missions()) {
    const ResultsById plain = by_id(whole_run(mission));
    REQUIRE(plain.points() > 0);
    for (std::size_t i = 0; i < mission.keyframes.size(); ++i) mission.keyframes[i].scale = scale_of(i);
    const ResultsById scaled = by_id(whole_run(mission));
    std::size_t own_unit = 0;
    for (const auto& [id, cloud] : scaled.clouds) own_unit += cloud.scale == 1.0 ? 0 : cloud.points.size();
    INFO(mission.name);
    CHECK(own_unit > plain.points() / 2);
    CHECK(difference(in_scene_units(scaled), plain) == "");
  }
}

TEST_CASE("keyframes must have a scale that single precision bears", "[densifier][scale]") {
  SmallMission mission{"one", small_preset(Quality::kOnline), small_flight(1)};
  for (const double scale : {0.0, -1.0, 1e-4, 1e4, std::nan("")}) {
    Densifier densifier(mission.options, {});
    mission.keyframes[0].scale = scale;
    CHECK_THROWS_AS(densifier.add(mission.keyframes[0]), InvalidInput);
  }
}
