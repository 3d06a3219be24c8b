// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "pmsp/error.h"
#include "pmsp/executor.h"
#include "pmsp/options.h"

using namespace pmsp;

namespace {

using Setter = std::function<void(DensifierOptions&, double)>;

struct Field {
  const char* name;
  Setter set;
  double too_low, lowest, highest, too_high;
  bool whole = false;  ///< takes no NaN
};

int whole(double value) { return static_cast<int>(value); }

const std::vector<Field>& fields() {
  using O = DensifierOptions;
  static const std::vector<Field> kFields = {
      {"width", [](O& o, double v) { o.width = whole(v); }, 30, 32, 16384, 16386, true},
      {"height", [](O& o, double v) { o.height = whole(v); }, 14, 16, 8192, 8194, true},
      {"threads", [](O& o, double v) { o.threads = whole(v); }, -1, 0, 1024, 1025, true},
      {"view_filter.min_parallax_deg", [](O& o, double v) { o.view_filter.min_parallax_deg = v; }, -0.01, 0, 59.9,
       180.1},
      {"view_filter.max_parallax_deg", [](O& o, double v) { o.view_filter.max_parallax_deg = v; }, -0.01, 6.1, 180,
       180.1},
      {"view_filter.min_share", [](O& o, double v) { o.view_filter.min_share = v; }, -0.01, 0, 1, 1.01},
      {"view_filter.min_sharpness", [](O& o, double v) { o.view_filter.min_sharpness = v; }, -0.01, 0, 1, 1.01},
      {"init.sparse_radius_px", [](O& o, double v) { o.init.sparse_radius_px = v; }, -0.01, 0, 100, 100.1},
      {"init.chain_keyframes", [](O& o, double v) { o.init.chain_keyframes = whole(v); }, -1, 0, 100000, 100001, true},
      {"init.range_margin", [](O& o, double v) { o.init.range_margin = v; }, 0.99, 1, 1000, 1000.1},
      {"patchmatch.iterations", [](O& o, double v) { o.patchmatch.iterations = whole(v); }, 0, 1, 100, 101, true},
      {"patchmatch.neighbours", [](O& o, double v) { o.patchmatch.neighbours = whole(v); }, 0, 1, 8, 9, true},
      {"patchmatch.revisits", [](O& o, double v) { o.patchmatch.revisits = whole(v); }, -1, 0, 4, 5, true},
      {"patchmatch.history", [](O& o, double v) { o.patchmatch.history = whole(v); }, 0, 1, 100000, 100001, true},
      {"patchmatch.refinements", [](O& o, double v) { o.patchmatch.refinements = whole(v); }, -1, 0, 32, 33, true},
      {"patchmatch.patch_spacing_px", [](O& o, double v) { o.patchmatch.patch_spacing_px = v; }, 0.49, 0.5, 8, 8.01},
      {"patchmatch.fine_patch", [](O& o, double v) { o.patchmatch.fine_patch = v; }, 0.09, 0.1, 1, 1.01},
      {"patchmatch.fine_patch_contrast", [](O& o, double v) { o.patchmatch.fine_patch_contrast = v; }, -0.01, 0, 255,
       255.1},
      {"patchmatch.prior_weight", [](O& o, double v) { o.patchmatch.prior_weight = v; }, -0.01, 0, 4, 4.01},
      {"patchmatch.sigma_color", [](O& o, double v) { o.patchmatch.sigma_color = v; }, 0.99, 1, 1000, 1000.1},
      {"patchmatch.min_sigma_color", [](O& o, double v) { o.patchmatch.min_sigma_color = v; }, 0.99, 1, 1000, 1000.1},
      {"patchmatch.fine_sigma_space_px", [](O& o, double v) { o.patchmatch.fine_sigma_space_px = v; }, 0.49, 0.5, 100,
       100.1},
      {"patchmatch.sigma_space_px", [](O& o, double v) { o.patchmatch.sigma_space_px = v; }, 0.49, 0.5, 100, 100.1},
      {"patchmatch.max_slant_deg", [](O& o, double v) { o.patchmatch.max_slant_deg = v; }, 9.9, 10, 89, 89.1},
      {"patchmatch.geometric_passes", [](O& o, double v) { o.patchmatch.geometric_passes = whole(v); }, -1, 0, 8, 9,
       true},
      {"patchmatch.geometric_iterations", [](O& o, double v) { o.patchmatch.geometric_iterations = whole(v); }, 0, 1,
       100, 101, true},
      {"patchmatch.geometric_weight", [](O& o, double v) { o.patchmatch.geometric_weight = v; }, -0.01, 0, 4, 4.01},
      {"patchmatch.geometric_tolerance", [](O& o, double v) { o.patchmatch.geometric_tolerance = v; }, 0.0009, 0.001, 1,
       1.01},
      {"median.max_relative_deviation", [](O& o, double v) { o.median.max_relative_deviation = v; }, -0.01, 0, 1, 1.01},
      {"median.min_score", [](O& o, double v) { o.median.min_score = v; }, -1.01, -1, 1, 1.01},
      {"consistency.window", [](O& o, double v) { o.consistency.window = whole(v); }, 2, 3, 15, 16, true},
      {"consistency.min_views", [](O& o, double v) { o.consistency.min_views = whole(v); }, 0, 1, 5, 6, true},
      {"consistency.max_relative_depth", [](O& o, double v) { o.consistency.max_relative_depth = v; }, -0.01, 0, 1,
       1.01},
      {"fusion.window", [](O& o, double v) { o.fusion.window = whole(v); }, 0, 1, 31, 32, true},
      {"fusion.spacing_px", [](O& o, double v) { o.fusion.spacing_px = v; }, -0.01, 0, 4, 4.01},
      {"fusion.max_relative_depth", [](O& o, double v) { o.fusion.max_relative_depth = v; }, -0.01, 0, 1, 1.01},
      {"fusion.max_normal_deg", [](O& o, double v) { o.fusion.max_normal_deg = v; }, -0.01, 0, 180, 180.1},
      {"fusion.min_confidence", [](O& o, double v) { o.fusion.min_confidence = v; }, -0.01, 0, 1, 1.01},
      {"free_space.views", [](O& o, double v) { o.free_space.views = whole(v); }, 0, 1, 32, 33, true},
      {"free_space.max_relative_depth", [](O& o, double v) { o.free_space.max_relative_depth = v; }, -0.01, 0, 1, 1.01},
      {"free_space.min_relative_gap", [](O& o, double v) { o.free_space.min_relative_gap = v; }, -0.01, 0, 1, 1.01},
      {"free_space.max_contradiction", [](O& o, double v) { o.free_space.max_contradiction = v; }, -0.01, 0, 100,
       100.1},
      {"free_space.history", [](O& o, double v) { o.free_space.history = whole(v); }, 0, 1, 100000, 100001, true},
  };
  return kFields;
}

/// What validate() says; empty when it is content.
std::string complaint(const Field& field, double value) {
  DensifierOptions options;
  field.set(options, value);
  try {
    options.validate();
  } catch (const InvalidOption& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("each option's bounds are valid and what lies beyond is refused by name", "[options]") {
  for (const Field& field : fields()) {
    INFO(field.name);
    CHECK(complaint(field, field.lowest) == "");
    CHECK(complaint(field, field.highest) == "");
    CHECK_THAT(complaint(field, field.too_low), Catch::Contains(field.name) && Catch::Contains("expected"));
    CHECK_THAT(complaint(field, field.too_high), Catch::Contains(field.name) && Catch::Contains("expected"));
    if (field.whole) continue;
    CHECK_THAT(complaint(field, std::numeric_limits<double>::quiet_NaN()), Catch::Contains(field.name));
    CHECK_THAT(complaint(field, std::numeric_limits<double>::infinity()), Catch::Contains(field.name));
  }
}

TEST_CASE("sizes are even, or 0 for automatic", "[options]") {
  DensifierOptions options;
  options.width = 641;
  CHECK_THROWS_WITH(options.validate(), Catch::Contains("width") && Catch::Contains("641") && Catch::Contains("even"));
  options.width = 0;
  options.height = 161;
  CHECK_THROWS_WITH(options.validate(), Catch::Contains("height") && Catch::Contains("161"));
  options.height = 0;
  CHECK_NOTHROW(options.validate());
}

TEST_CASE("windows are odd: as many keyframes before as after", "[options]") {
  for (const int window : {4, 14}) {
    DensifierOptions options;
    options.consistency.window = window;
    CHECK_THROWS_WITH(options.validate(), Catch::Contains("consistency.window") && Catch::Contains("odd"));
    options = {};
    options.fusion.window = window;
    CHECK_THROWS_WITH(options.validate(), Catch::Contains("fusion.window") && Catch::Contains("odd"));
  }
}

TEST_CASE("neighbours and revisits share eight places", "[options]") {
  PatchMatchOptions options;
  options.neighbours = 7;
  options.revisits = 1;
  CHECK_NOTHROW(options.validate());
  options.revisits = 2;
  CHECK_THROWS_WITH(options.validate(), Catch::Contains("neighbours is 7") && Catch::Contains("revisits 2"));
}

TEST_CASE("the parallax angles must be in order", "[options]") {
  ViewFilterOptions options;
  options.min_parallax_deg = 60.0;
  CHECK_THROWS_WITH(options.validate(), Catch::Contains("min_parallax_deg") && Catch::Contains("max_parallax_deg"));
}

TEST_CASE("presets are valid and stand for what their names say", "[options]") {
  for (const char* name : {"paper", "online", "normal", "high"}) {
    INFO(name);
    CHECK_NOTHROW(preset(quality_from_name(name)).validate());
  }
  const DensifierOptions paper = preset(Quality::kPaper);
  CHECK(paper.width == 640);
  CHECK(paper.height == 320);
  CHECK(paper.patchmatch.iterations == 4);
  CHECK(paper.patchmatch.neighbours == 2);
  CHECK(paper.init.chain_keyframes == 0);
  CHECK(paper.patchmatch.revisits == 0);
  CHECK(paper.patchmatch.fine_patch == 1.0);
  CHECK(paper.consistency.window == 5);
  CHECK(paper.consistency.min_views == 3);
  CHECK(paper.consistency.max_relative_depth == 0.08);
  const DensifierOptions online = preset(Quality::kOnline);
  CHECK(online.width == 640);
  CHECK(online.height == 320);
  CHECK(online.patchmatch.revisits == 0);
  CHECK(online.patchmatch.neighbours == 2);
  const DensifierOptions normal = preset(Quality::kNormal);
  CHECK(normal.width == 1440);
  CHECK(normal.height == 720);
  CHECK(normal.patchmatch.iterations == 2);
  CHECK(normal.patchmatch.neighbours == 4);
  const DensifierOptions high = preset(Quality::kHigh);
  CHECK(high.width == 0);
  CHECK(high.height == 0);
  CHECK(high.patchmatch.neighbours == 6);
}

TEST_CASE("names are read back and unknown ones refused", "[options]") {
  for (const Simd simd : {Simd::kAuto, Simd::kScalar, Simd::kAvx2, Simd::kAvx512})
    CHECK(simd_from_name(name_of(simd)) == simd);
  CHECK(quality_from_name("high") == Quality::kHigh);
  CHECK_THROWS_WITH(simd_from_name("sse"), Catch::Contains("'sse'") && Catch::Contains("avx512"));
  CHECK_THROWS_AS(simd_from_name(""), InvalidOption);
  CHECK(quality_from_name("paper") == Quality::kPaper);
  CHECK_THROWS_WITH(quality_from_name("fast"),
                    Catch::Contains("'fast'") && Catch::Contains("paper") && Catch::Contains("online"));
  CHECK_THROWS_AS(quality_from_name("Online"), InvalidOption);
}

TEST_CASE("an executor resolves threads and instruction set", "[options]") {
  const Executor automatic;
  CHECK(automatic.threads() >= 1);
  CHECK(automatic.simd() == widest_simd());
  CHECK(automatic.simd() != Simd::kAuto);
  const Executor plain(3, Simd::kScalar);
  CHECK(plain.threads() == 3);
  CHECK(plain.simd() == Simd::kScalar);
  CHECK_THROWS_AS(Executor(-1), InvalidOption);
  CHECK_THROWS_AS(Executor(1025), InvalidOption);
}
