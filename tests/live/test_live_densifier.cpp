// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <memory>
#include <set>
#include <vector>

#include "core/helpers.h"
#include "fake_slam.h"
#include "live/live_missions.h"
#include "pmsp/densifier.h"
#include "pmsp/error.h"
#include "pmsp/live.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

/// A fake SLAM's keyframes, one after the other, each worked on before the next one comes; then the loop is closed.
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

}  // namespace

TEST_CASE("A live flight ends with points as good as those of a Densifier", PMSP_ACCURACY) {
  const LiveOptions options = small_live(kRoomWidth);
  const LiveFigures live = figures(*at_once(live_keyframes(room()), options), room());
  LiveSnapshot offline;
  DensifierCallbacks callbacks;
  callbacks.cloud = [&](const KeyframeCloud& cloud) {
    LiveCloud each;
    each.keyframe_id = cloud.keyframe_id;
    each.pose = cloud.pose();
    each.cloud = std::make_shared<KeyframeCloud>(cloud);
    offline.clouds.push_back(each);
  };
  Densifier densifier(options.densifier, callbacks);
  for (std::size_t i = 0; i < room().frames.size(); ++i) densifier.add(synth::keyframe_of(room(), i));
  densifier.flush();
  const LiveFigures expected = figures(offline, room());
  CAPTURE(live.covered, expected.covered, live.right, expected.right, live.misplaced, expected.misplaced);
  CHECK(live.clouds == expected.clouds);
  CHECK(live.covered * live.right > expected.covered * expected.right - 0.005);
  CHECK(live.right > expected.right - 0.04);  // of more points
}

TEST_CASE("What is done when all is known from the start does not depend on time, threads or pixel formats") {
  LiveOptions options = small_live(kRoomWidth);
  const std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  const auto first = at_once(keyframes, options);
  REQUIRE(first->clouds.size() >= 5);
  options.densifier.threads = 1;
  CHECK(same_points(*first, *at_once(keyframes, options)));
  std::vector<LiveKeyframe> bgr;
  for (const LiveKeyframe& keyframe : keyframes) {
    const LiveImage& image = keyframe.image;
    const std::ptrdiff_t stride = 3 * image.width + 5;
    auto pixels = std::make_shared<std::vector<std::uint8_t>>(static_cast<std::size_t>(stride * image.height));
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < 3 * image.width; ++x) {
        (*pixels)[static_cast<std::size_t>(y * stride + x)] = image.data[y * 3 * image.width + x / 3 * 3 + 2 - x % 3];
      }
    }
    bgr.push_back(keyframe);
    bgr.back().image = {pixels, pixels->data(), image.width, image.height, stride, PixelFormat::kBgr};
  }
  CHECK(same_points(*first, *at_once(bgr, options)));
}

TEST_CASE("Images are let go of when they are no longer needed") {
  std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  std::vector<std::weak_ptr<const void>> images;
  for (LiveKeyframe& keyframe : keyframes) {
    auto owner = std::make_shared<std::vector<std::uint8_t>>(keyframe.image.data,
                                                             keyframe.image.data + 3 * kRoomWidth * (kRoomWidth / 2));
    keyframe.image.data = owner->data();
    keyframe.image.owner = owner;
    images.push_back(owner);
  }
  LiveDensifier live(small_live(kRoomWidth));
  for (LiveKeyframe& keyframe : keyframes) live.add(std::move(keyframe));
  live.finish();
  REQUIRE(live.wait(kLong));
  for (const auto& image : images) CHECK(image.expired());
}

TEST_CASE("Keyframes that converge as a SLAM's do are as good in the end as if they had never moved", PMSP_ACCURACY) {
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

TEST_CASE("A loop closure moves, turns and scales what was seen before it", PMSP_ACCURACY) {
  const LiveOptions options = small_live(kRoomWidth);
  const LiveFigures still = figures(*played(FakeSlam(live_keyframes(room()), 0.0, 0.0), options), room());
  for (const double drift : {0.1, -0.15}) {
    LiveStats stats;
    const auto snapshot = played(FakeSlam(live_keyframes(room()), drift), options, &stats);
    const LiveFigures closed = figures(*snapshot, room());
    CAPTURE(drift, closed.covered, still.covered, closed.right, still.right, closed.misplaced, still.misplaced);
    CHECK(closed.clouds == still.clouds);
    // Places that were seen as two are merged: some of the points go.
    CHECK(closed.right > still.right - 0.012);
    CHECK(closed.covered > still.covered - 0.02);
    CHECK(closed.misplaced < 0.01);
    CHECK(stats.rescaled > 0);
    CHECK(std::any_of(snapshot->clouds.begin(), snapshot->clouds.end(),
                      [](const LiveCloud& cloud) { return std::abs(cloud.pose.scale - 1.0) > 0.02; }));
  }
}

TEST_CASE("Snapshots show what update, erase and reset have said when these return") {
  LiveDensifier live(small_live(kRoomWidth));
  std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  for (const LiveKeyframe& keyframe : keyframes) live.add(keyframe);
  live.finish();
  REQUIRE(live.wait(kLong));
  const auto before = live.snapshot();
  REQUIRE(before->clouds.size() >= 4);
  for (LiveKeyframe& keyframe : keyframes) keyframe.cam_from_world.translation += Eigen::Vector3d(0.0, 1e-4, 0.0);
  live.update(keyframes);
  const auto moved = live.snapshot();
  for (const LiveCloud& cloud : moved->clouds) {
    const auto keyframe = std::find_if(keyframes.begin(), keyframes.end(),
                                       [&](const LiveKeyframe& each) { return each.id == cloud.keyframe_id; });
    CHECK(cloud.pose.cam_from_world.translation == keyframe->cam_from_world.translation);
  }
  const std::int64_t id = before->clouds[2].keyframe_id;
  live.erase({id, 12345});
  const std::vector<std::int64_t> left = ids_of(*live.snapshot());
  CHECK(std::count(left.begin(), left.end(), id) == 0);
  CHECK(left.size() == before->clouds.size() - 1);
  CHECK(live.stats().erased == 1);
  live.reset();
  CHECK(live.snapshot()->clouds.empty());
  CHECK(live.changes_since(before->version).reset);
  CHECK(before->clouds.size() >= 4);  // still there for who holds it
}

TEST_CASE("Of a removed keyframe's points a neighbour takes those that it has seen, too") {
  LiveOptions options = small_live(kRoomWidth);
  LiveDensifier live(options);
  for (const LiveKeyframe& keyframe : live_keyframes(room())) live.add(keyframe);
  live.finish();
  REQUIRE(live.wait(kLong));
  const auto before = live.snapshot();
  const std::size_t middle = before->clouds.size() / 2;
  const std::int64_t id = before->clouds[middle].keyframe_id;
  live.erase({id});
  REQUIRE(live.wait(kLong));
  const auto after = live.snapshot();
  std::size_t back = 0;
  for (const LiveCloud& cloud : after->clouds) {
    const auto then = std::find_if(before->clouds.begin(), before->clouds.end(),
                                   [&](const LiveCloud& each) { return each.keyframe_id == cloud.keyframe_id; });
    const std::set<std::uint32_t> known(then->cloud->pixels.begin(), then->cloud->pixels.end());
    for (const std::uint32_t pixel : cloud.cloud->pixels) back += known.count(pixel) == 0 ? 1 : 0;
  }
  CHECK(back > before->clouds[middle].cloud->points.size() / 20);
  for (const LiveCloud& cloud : after->clouds) {
    const auto& ids = cloud.cloud->window_ids;
    CHECK(std::count(ids.begin(), ids.end(), id) == 0);
  }
}

TEST_CASE("After a reset ids may begin again, and nothing of before comes back") {
  LiveDensifier live(small_live(kRoomWidth));
  const std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  for (int round = 0; round < 3; ++round) {
    for (const LiveKeyframe& keyframe : keyframes) live.add(keyframe);
    if (round < 2) live.reset();  // in the midst of work
  }
  live.finish();
  REQUIRE(live.wait(kLong));
  CHECK(live.stats().resets == 2);
  CHECK(live.stats().added == 3 * static_cast<std::int64_t>(keyframes.size()));
  const auto snapshot = live.snapshot();
  LiveOptions options = small_live(kRoomWidth);
  CHECK(ids_of(*snapshot) == ids_of(*at_once(keyframes, options)));
}

TEST_CASE("sync finds what is new, moved and gone") {
  LiveDensifier live(small_live(kRoomWidth));
  std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  std::vector<LiveKeyframe> some(keyframes.begin(), keyframes.end() - 1);
  live.sync(some);
  LiveKeyframe without_image = keyframes.back();
  without_image.image = {};
  some.push_back(without_image);
  live.sync(some);
  CHECK(live.stats().added == static_cast<std::int64_t>(keyframes.size()) - 1);
  live.sync(keyframes);
  CHECK(live.stats().added == static_cast<std::int64_t>(keyframes.size()));
  live.finish();
  REQUIRE(live.wait(kLong));
  const LiveVersion settled = live.snapshot()->version;
  live.sync(keyframes);
  CHECK(live.snapshot()->version == settled);  // nothing has changed
  keyframes.erase(keyframes.begin() + 3);
  keyframes[4].cam_from_world.translation.x() += 0.001;
  live.sync(keyframes);
  const LiveChanges changes = live.changes_since(settled);
  CHECK(changes.removed.size() <= 1);
  CHECK(live.stats().erased == 1);
  keyframes.push_back(keyframes.back());
  CHECK_THROWS_AS(live.sync(keyframes), InvalidInput);
}

TEST_CASE("Keyframes of two maps do not meet until the maps are merged") {
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

TEST_CASE("Maps with units and places of their own keep the scale of what is in them when they are merged") {
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

TEST_CASE("The end of a map that the SLAM has left is worked on when another has begun") {
  LiveDensifier live(small_live(kRoomWidth));
  std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  for (const LiveKeyframe& keyframe : keyframes) live.add(keyframe);
  for (LiveKeyframe& keyframe : keyframes) {
    keyframe.id += 1000;
    keyframe.map_id = 1;
    live.add(keyframe);
  }
  REQUIRE(live.wait(kLong));  // without finish
  const auto snapshot = live.snapshot();
  LiveOptions options = small_live(kRoomWidth);
  const std::vector<std::int64_t> whole = ids_of(*at_once(live_keyframes(room()), options));
  std::size_t of_first = 0;
  for (const LiveCloud& cloud : snapshot->clouds) of_first += cloud.map_id == 0 ? 1 : 0;
  CHECK(of_first == whole.size());
}

TEST_CASE("Preliminary points come with the keyframes after theirs, and give way to final ones") {
  LiveOptions options = small_live(kSanitized ? 64 : kRoomWidth);
  options.previews = true;
  LiveDensifier live(options);
  const std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  std::set<std::int64_t> previewed;
  for (std::size_t i = 0; i < 6; ++i) {
    live.add(keyframes[i]);
    REQUIRE(live.wait(kLong));
  }
  const auto early = live.snapshot();
  REQUIRE(early->clouds.size() >= 3);
  for (const LiveCloud& cloud : early->clouds) CHECK(cloud.preliminary);
  CHECK(live.stats().previews >= 3);
  for (std::size_t i = 6; i < keyframes.size(); ++i) live.add(keyframes[i]);
  live.finish();
  REQUIRE(live.wait(kLong));
  const LiveStats stats = live.stats();
  CAPTURE(stats.used, stats.not_needed, stats.clouds, stats.passes, stats.last_error, live.backlog().waiting);
  CHECK(stats.errors == 0);
  options.previews = false;
  const std::vector<std::int64_t> final = ids_of(*at_once(keyframes, options));
  const auto last = live.snapshot();
  CHECK(ids_of(*last) == final);  // those that are not used have none any more
  for (const LiveCloud& cloud : last->clouds) CHECK(!cloud.preliminary);
}
