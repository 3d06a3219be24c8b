// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/small_missions.h"
#include "plan/halo.h"
#include "planned_densifier.h"
#include "pmsp/error.h"
#include "support/temp_dir.h"

using namespace pmsp;
using namespace pmsp::test;
using Catch::Contains;

namespace {

using Ids = std::vector<std::int64_t>;

/// Returns the keyframes of a mission by id. All share one buffer, so that an image is overwritten by the next one.
class Source {
 public:
  explicit Source(const SmallMission& mission) : mission_(mission) {}

  Keyframe operator()(std::int64_t id) {
    ++asked[id];
    Keyframe keyframe = keyframe_of(mission_, id);
    keyframe.image = copy(keyframe.image, image_);
    if (!keyframe.mask.empty()) keyframe.mask = copy(keyframe.mask, mask_);
    return keyframe;
  }

  std::map<std::int64_t, int> asked;  ///< number of requests by keyframe id

 private:
  template <class T>
  static ImageView<const T> copy(const ImageView<const T>& from, Image<T>& to) {
    if (to.empty()) to = Image<T>(from.width, from.height);
    for (int y = 0; y < from.height; ++y) std::copy_n(from.data + y * from.stride, from.width, to.row(y));
    return to.view();
  }

  const SmallMission& mission_;
  Image<Rgb> image_;
  Image<std::uint8_t> mask_;
};

/// Results with requested keyframes. Checks which ones were requested.
ResultsById run_by_asking(const SmallMission& mission, const Plan& plan, const Ids& ids, int& again) {
  Source source(mission);
  Recording recording;
  PlannedDensifier densifier(mission.options, plan, ids, recording.callbacks());
  densifier.run([&](std::int64_t id) { return source(id); });
  Ids came;
  for (const auto& [id, times] : source.asked) {
    came.push_back(id);
    again += times - 1;
  }
  Ids expected = find_halo(plan, ids, mission.options, Wanted::kPoints).images;
  std::sort(expected.begin(), expected.end());
  CHECK(came == expected);
  return by_id(recording);
}

SmallMission mission_of(Quality quality) { return {"", small_preset(quality), small_flight(kSanitized ? 6 : 16)}; }

}  // namespace

TEST_CASE("requested keyframes give the same results as added ones", "[densifier][source]") {
  for (const SmallMission& mission : small_missions()) {
    if (kSanitized && !mission.options.unordered) continue;
    const Plan plan = plan_of(mission);
    const Ids ids = ids_of(mission.keyframes);
    INFO(mission.name);
    int again = 0;
    CHECK(difference(run_by_asking(mission, plan, ids, again), by_id(whole_run(mission))) == "");
    CHECK((again > 0) == mission.options.unordered);
    const Ids part(ids.begin() + 2, ids.begin() + 5);
    CHECK(difference(run_by_asking(mission, plan, part, again), by_id(run_part(mission, plan, part))) == "");
  }
}

TEST_CASE("results spilled to a scratch directory are restored unchanged", "[densifier][source]") {
  const pmsp_test::TempDir dir;
  for (SmallMission& mission : small_missions()) {
    if (kSanitized && !mission.options.unordered) continue;
    const ResultsById expected = by_id(whole_run(mission));
    mission.options.scratch_folder = dir.path().string();
    INFO(mission.name);
    CHECK(difference(by_id(whole_run(mission)), expected) == "");
    const Plan plan = plan_of(mission);
    int again = 0;
    CHECK(difference(run_by_asking(mission, plan, ids_of(mission.keyframes), again), expected) == "");
    CHECK(again == 0);
  }
}

TEST_CASE("a given plan continues with requested keyframes after added ones", "[densifier][source]") {
  const SmallMission mission = mission_of(Quality::kOnline);
  Source source(mission);
  Recording recording;
  PlannedDensifier densifier(mission.options, plan_of(mission), ids_of(mission.keyframes), recording.callbacks());
  for (std::size_t i = 0; i < 3; ++i) densifier.add(mission.keyframes[i]);
  densifier.run([&](std::int64_t id) { return source(id); });
  CHECK(difference(by_id(recording), by_id(whole_run(mission))) == "");
}

TEST_CASE("unavailable keyframes end the run by name", "[densifier][source]") {
  const SmallMission mission = mission_of(Quality::kNormal);
  const Plan plan = plan_of(mission);
  Source source(mission);
  const auto run = [&](const KeyframeSource& keyframes) {
    PlannedDensifier densifier(mission.options, plan, ids_of(mission.keyframes), {});
    try {
      densifier.run(keyframes);
    } catch (...) {
      CHECK(densifier.cancelled());
      throw;
    }
  };
  const std::int64_t second = mission.keyframes[1].id;
  CHECK_THROWS_WITH(run([&](std::int64_t id) { return source(id == second ? id + 1 : id); }),
                    Contains("expected keyframe " + std::to_string(second)));
  CHECK_THROWS_WITH(run([&](std::int64_t id) {
                      if (id == second) throw std::runtime_error("the disk is gone");
                      return source(id);
                    }),
                    "the disk is gone");
  PlannedDensifier densifier(mission.options, {});
  CHECK_THROWS_WITH(densifier.run([&](std::int64_t id) { return source(id); }), Contains("given plan"));
  CHECK_FALSE(densifier.cancelled());
  PlannedDensifier given(mission.options, plan, ids_of(mission.keyframes), {});
  CHECK_THROWS_WITH(given.run(nullptr), Contains("source is empty"));
  CHECK_FALSE(given.cancelled());
}

TEST_CASE("an image unavailable at the second request ends the run and cancel ends it silently",
          "[densifier][source]") {
  for (const SmallMission& mission : small_missions()) {
    if (!mission.options.unordered) continue;
    for (const bool cancel : {false, true}) {
      Source source(mission);
      Recording recording;
      PlannedDensifier densifier(mission.options, plan_of(mission), ids_of(mission.keyframes), recording.callbacks());
      int again = 0;
      const auto run = [&] {
        densifier.run([&](std::int64_t id) {
          Keyframe keyframe = source(id);
          if (source.asked[id] == 1 || ++again < 9) return keyframe;
          if (cancel) densifier.cancel();
          return Keyframe();
        });
      };
      if (cancel) {
        CHECK_NOTHROW(run());
      } else {
        CHECK_THROWS_AS(run(), InvalidInput);
      }
      CHECK(again == 9);  // no further requests
      CHECK(densifier.cancelled());
      CHECK(recording.clouds.empty());
      CHECK_NOTHROW(densifier.run([&](std::int64_t id) { return source(id); }));
    }
  }
}

TEST_CASE("a run has the statistics of added keyframes and a second one has no work", "[densifier][source]") {
  SmallMission mission = mission_of(kSanitized ? Quality::kOnline : Quality::kHigh);
  mission.options.width = 0;  // that of the images
  mission.options.height = 0;
  Recording pushed;
  PlannedDensifier pushes(mission.options, plan_of(mission), ids_of(mission.keyframes), pushed.callbacks());
  fly_through(pushes, mission);
  Source source(mission);
  Recording pulled;
  PlannedDensifier pulls(mission.options, plan_of(mission), ids_of(mission.keyframes), pulled.callbacks());
  for (int i = 0; i < 2; ++i) pulls.run([&](std::int64_t id) { return source(id); });
  CHECK(difference(by_id(pulled), by_id(pushed)) == "");
  CHECK(pulls.stats().keyframes_accepted == pushes.stats().keyframes_accepted);
  CHECK(pulls.stats().points_repeated == pushes.stats().points_repeated);
  CHECK(pulls.stats().points == pushes.stats().points);
}
