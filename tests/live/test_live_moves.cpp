// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/helpers.h"
#include "fake_slam.h"
#include "live/live_missions.h"
#include "pmsp/live.h"

using namespace pmsp;
using namespace pmsp::test;

// Moving keyframes: effect of bundle adjustments, loop closures and merged maps on points.

namespace {

/// Keyframes of a simulated SLAM, each densified before the next one; then the loop is closed.
std::shared_ptr<const LiveSnapshot> played(FakeSlam slam, const LiveOptions& options, LiveStats* stats = nullptr) {
  LiveDensifier live(options);
  for (std::size_t k = 0; k < slam.size(); ++k) {
    live.add(slam.next());
    live.update(slam.moved());
    REQUIRE(live.wait(kLong));
  }
  live.update(slam.closed());
  live.finish();
  REQUIRE(live.wait(kLong));
  if (stats != nullptr) *stats = live.stats();
  return live.snapshot();
}

/// Results of a loop closed during work: when the first points exist and most keyframes are in flight.
struct Midst {
  std::int64_t passes_before = 0;                        ///< of PatchMatch
  std::shared_ptr<const LiveSnapshot> before_any_again;  ///< the last one before a keyframe was matched again
  std::shared_ptr<const LiveSnapshot> last;
  LiveStats stats;
};

LiveOptions three_passes() {
  LiveOptions options = small_live(kRoomWidth);
  options.densifier.advanced.patchmatch.geometric_passes = 2;
  return options;
}

Midst closed_in_the_midst(double drift) {
  Midst midst;
  FakeSlam slam(live_keyframes(room()), drift, 0.0);
  LiveDensifier* told = nullptr;
  LiveCallbacks callbacks;
  callbacks.changed = [&](LiveVersion) {  // on the worker: updates from here do not depend on timing
    const LiveStats stats = told->stats();
    if (midst.passes_before == 0 && told->snapshot()->clouds.size() >= 8) {
      midst.passes_before = stats.passes;
      told->update(slam.closed());
    }
    if (stats.matched_again == 0) midst.before_any_again = told->snapshot();
  };
  LiveDensifier live(three_passes(), callbacks);
  told = &live;
  live.pause();
  for (std::size_t k = 0; k < slam.size(); ++k) live.add(slam.next());
  live.finish();
  live.resume();
  REQUIRE(live.wait(kLong));
  midst.last = live.snapshot();
  midst.stats = live.stats();
  REQUIRE(midst.passes_before > 0);
  REQUIRE(midst.stats.errors == 0);
  return midst;
}

}  // namespace

TEST_CASE("Keyframes with converging poses reach the accuracy of fixed poses", PMSP_ACCURACY) {
  const LiveOptions options = small_live(kRoomWidth);
  const LiveFigures still = figures(*played(FakeSlam(live_keyframes(room()), 0.0, 0.0), options), room());
  LiveStats stats;
  const LiveFigures moved = figures(*played(FakeSlam(live_keyframes(room()), 0.0), options, &stats), room());
  CAPTURE(moved.covered, still.covered, moved.right, still.right, moved.misplaced, still.misplaced,
          stats.matched_again);
  CHECK(moved.clouds == still.clouds);
  CHECK(moved.right > still.right - 0.01);
  CHECK(moved.covered > still.covered - 0.02);
}

TEST_CASE("A loop closure moves and rotates and scales earlier points", PMSP_ACCURACY) {
  const LiveOptions options = small_live(kRoomWidth);
  const LiveFigures still = figures(*played(FakeSlam(live_keyframes(room()), 0.0, 0.0), options), room());
  for (const double drift : {0.1, -0.15}) {
    LiveStats stats;
    const auto snapshot = played(FakeSlam(live_keyframes(room()), drift), options, &stats);
    const LiveFigures closed = figures(*snapshot, room());
    CAPTURE(drift, closed.covered, still.covered, closed.right, still.right, closed.misplaced, still.misplaced);
    CHECK(closed.clouds == still.clouds);
    // Places seen twice are merged: duplicates are removed.
    CHECK(closed.right > still.right - 0.012);
    CHECK(closed.covered > still.covered - 0.02);
    CHECK(closed.misplaced < 0.01);
    CHECK(stats.rescaled > 0);
    CHECK(std::any_of(snapshot->clouds.begin(), snapshot->clouds.end(),
                      [](const LiveCloud& cloud) { return std::abs(cloud.pose.scale - 1.0) > 0.02; }));
  }
}

TEST_CASE("Keyframes moved far by a loop closure restart without finishing stale work") {
  const Midst midst = closed_in_the_midst(0.2);
  CHECK(midst.stats.matched_again > 0);
  CHECK(midst.stats.passes - midst.passes_before == 3 * midst.stats.used);
}

TEST_CASE("A loop closure during work leaves points as accurate as with final poses", PMSP_ACCURACY) {
  const LiveFigures known = figures(*at_once(live_keyframes(room()), three_passes()), room());
  // Small enough that existing places are not taken for two and merged.
  const LiveFigures closed = figures(*closed_in_the_midst(0.1).last, room());
  CAPTURE(closed.covered, known.covered, closed.right, known.right);
  CHECK(closed.clouds == known.clouds);
  CHECK(closed.covered * closed.right > known.covered * known.right - 0.025);
  CHECK(closed.misplaced < 1.15 * known.misplaced);
}

TEST_CASE("Keyframes in flight during small pose changes finish before any is matched again", PMSP_ACCURACY) {
  const LiveFigures known = figures(*at_once(live_keyframes(room()), three_passes()), room());
  const Midst midst = closed_in_the_midst(0.02);
  CHECK(midst.stats.matched_again > 0);
  const LiveFigures first = figures(*midst.before_any_again, room());
  CAPTURE(first.covered, known.covered, first.right, known.right);
  CHECK(first.clouds == known.clouds);
  CHECK(first.covered * first.right > known.covered * known.right - 0.025);
}

TEST_CASE("Keyframes of two maps are not matched until the maps are merged") {
  LiveOptions options = small_live(kRoomWidth);
  LiveDensifier live(options);
  std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  const std::size_t half = keyframes.size() / 2;
  for (std::size_t i = half; i < keyframes.size(); ++i) keyframes[i].map_id = 7;
  for (const LiveKeyframe& keyframe : keyframes) live.add(keyframe);
  live.finish();
  REQUIRE(live.wait(kLong));
  const std::int64_t border = keyframes[half].id;
  for (const LiveCloud& cloud : live.snapshot()->clouds) {
    for (const std::int64_t id : cloud.cloud->window_ids) CHECK((id < border) == (cloud.keyframe_id < border));
    CHECK(cloud.map_id == (cloud.keyframe_id < border ? 0 : 7));
  }
  for (LiveKeyframe& keyframe : keyframes) keyframe.map_id = 0;
  live.update(keyframes);
  for (const LiveCloud& cloud : live.snapshot()->clouds) CHECK(cloud.map_id == 0);
  REQUIRE(live.wait(kLong));
  bool met = false;
  for (const LiveCloud& cloud : live.snapshot()->clouds) {
    for (const std::int64_t id : cloud.cloud->window_ids) met = met || (id < border) != (cloud.keyframe_id < border);
  }
  CHECK(met);
}

TEST_CASE("Merging maps of different units and origins keeps the scale of their points") {
  LiveDensifier live(small_live(kRoomWidth));
  std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  const std::vector<LiveKeyframe> merged = keyframes;
  const std::size_t half = keyframes.size() / 2;
  constexpr double kUnit = 1.25;
  const Eigen::Vector3d away(50.0, -3.0, 7.0);
  for (std::size_t i = half; i < keyframes.size(); ++i) {
    LiveKeyframe& keyframe = keyframes[i];
    keyframe.map_id = 7;
    const Eigen::Vector3d center = kUnit * keyframe.cam_from_world.center() + away;
    keyframe.cam_from_world.translation = -(keyframe.cam_from_world.rotation * center);
    for (Landmark& landmark : keyframe.landmarks) landmark.position_world = kUnit * landmark.position_world + away;
  }
  for (const LiveKeyframe& keyframe : keyframes) live.add(keyframe);
  live.finish();
  REQUIRE(live.wait(kLong));
  const bool with_landmarks = GENERATE(true, false);
  std::vector<LiveKeyframe> moved = merged;
  if (!with_landmarks) {
    for (LiveKeyframe& keyframe : moved) keyframe.landmarks.clear();
  }
  live.update(moved);
  for (const LiveCloud& cloud : live.snapshot()->clouds) {
    const double expected = cloud.keyframe_id < merged[half].id ? 1.0 : 1.0 / kUnit;
    CAPTURE(with_landmarks, cloud.keyframe_id);
    CHECK(cloud.pose.scale == Approx(expected).epsilon(0.01));
  }
}
