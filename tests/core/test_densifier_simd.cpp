// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <vector>

#include "core/recording.h"

using namespace pmsp;
using namespace pmsp::test;

TEST_CASE("AVX2 and AVX-512 give the same bytes: depth maps and clouds of a flight, all presets",
          "[densifier][simd]" PMSP_ACCURACY) {
  const std::vector<Simd> sets = available_simd();
  for (const Simd simd : {Simd::kAvx2, Simd::kAvx512}) {
    if (std::find(sets.begin(), sets.end(), simd) != sets.end()) continue;
    WARN("not compared, since this machine lacks it: " << name_of(simd));
    return;
  }
  for (const Quality quality : {Quality::kPaper, Quality::kOnline, Quality::kNormal, Quality::kHigh}) {
    DensifierOptions options = preset(quality);
    options.width = kTinyWidth + 12;  // rows that fill no whole number of lanes
    options.height = options.width / 2;
    options.advanced.patchmatch.iterations = 2;
    options.simd = Simd::kAvx2;
    const Recording narrow = densify(test_flight(), options);
    options.simd = Simd::kAvx512;
    INFO("preset " << static_cast<int>(quality));
    CHECK(difference(narrow, densify(test_flight(), options)).empty());
    CHECK(narrow.points() > 1000);
  }
}
