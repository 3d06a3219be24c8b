// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cmath>
#include <cstddef>

#include "core/small_missions.h"
#include "pmsp/error.h"

using namespace pmsp;
using namespace pmsp::test;

TEST_CASE("keyframes of different scales give the same surfaces", "[densifier][scale]") {
  for (SmallMission& mission : small_missions()) {
    const ResultsById plain = by_id(whole_run(mission));
    REQUIRE(plain.points() > 0);
    give_scales(mission);
    const ResultsById scaled = by_id(whole_run(mission));
    std::size_t own_unit = 0;
    for (const auto& [id, cloud] : scaled.clouds) own_unit += cloud.scale == 1.0 ? 0 : cloud.points.size();
    INFO(mission.name);
    CHECK(own_unit > plain.points() / 2);
    CHECK(difference(in_scene_units(scaled), plain) == "");
  }
}

TEST_CASE("keyframes must have a scale representable in single precision", "[densifier][scale]") {
  SmallMission mission{"one", small_preset(Quality::kOnline), small_flight(1)};
  for (const double scale : {0.0, -1.0, 1e-4, 1e4, std::nan("")}) {
    Densifier densifier(mission.options, {});
    mission.keyframes[0].scale = scale;
    CHECK_THROWS_AS(densifier.add(mission.keyframes[0]), InvalidInput);
  }
}
