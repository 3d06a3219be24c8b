// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "core/helpers.h"
#include "live/live_missions.h"
#include "pmsp/error.h"
#include "pmsp/live.h"

using namespace pmsp;
using namespace pmsp::test;
using std::chrono::milliseconds;

// LiveDensifier under load: waiting keyframes, overload, memory limits, invalid input and concurrent calls.

TEST_CASE("A keyframe waits for newer ones until its pose is stable") {
  LiveOptions options = small_live(32);
  options.stable_after = 2;
  options.stable_at_latest = 12;
  const bool is_moving = GENERATE(false, true);
  LiveDensifier live(options);
  std::vector<LiveKeyframe> there;
  for (const LiveKeyframe& keyframe : live_keyframes(room())) {
    if (is_moving) {  // to and fro, by more than stable_move of the room's size
      const double by = there.size() % 2 == 0 ? 0.05 : -0.05;
      for (LiveKeyframe& each : there) each.cam_from_world.translation.y() += by;
      live.update(there);
    }
    there.push_back(keyframe);
    live.add(keyframe);
    REQUIRE(live.wait(kLong));
    const auto added = static_cast<std::int64_t>(there.size());
    const std::int64_t waits_for =
        is_moving ? options.stable_at_latest / 3 : options.stable_after;  // the worker is idle
    CAPTURE(is_moving, added);
    CHECK(live.backlog().unstable == std::min(added, waits_for));
  }
  live.finish();  // no more keyframes
  REQUIRE(live.wait(kLong));
  CHECK(live.backlog().unstable == 0);
}

TEST_CASE("When more than max_waiting keyframes wait those between near neighbours are skipped") {
  LiveOptions options = small_live(32);
  options.max_waiting = 4;
  LiveDensifier live(options);
  live.pause();
  for (const LiveKeyframe& keyframe : live_keyframes(room())) live.add(keyframe);
  live.finish();
  live.resume();
  REQUIRE(live.wait(kLong));
  const LiveStats stats = live.stats();
  CHECK(stats.dropped_late >= stats.used - 5);
  CHECK(stats.dropped_late > 0);
  CHECK(live.snapshot()->clouds.size() >= 2);
}

TEST_CASE("A crowded place takes no more memory", PMSP_ACCURACY) {
  LiveOptions options = small_live(32);
  options.densifier.advanced.view_filter.enabled = false;
  options.densifier.advanced.patchmatch.geometric_passes = 1;
  LiveDensifier live(options);
  const std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  std::int64_t used[2] = {0, 0};
  std::int64_t id = 0;
  constexpr int kRounds = 60;
  for (int round = 0; round < kRounds; ++round) {  // to and fro
    for (std::size_t i = 0; i < keyframes.size(); ++i) {
      LiveKeyframe keyframe = keyframes[round % 2 == 0 ? i : keyframes.size() - 1 - i];
      keyframe.id = id++;
      live.add(keyframe);
    }
    REQUIRE(live.wait(kLong));
    used[2 * (round + 1) > kRounds ? 1 : 0] = live.stats().used;
  }
  CHECK(used[1] == used[0]);
  CHECK(live.stats().errors == 0);
}

TEST_CASE("A crowded place stays crowded when the map units change") {
  LiveOptions options = small_live(32);
  options.densifier.advanced.view_filter.enabled = false;
  options.densifier.advanced.patchmatch.geometric_passes = 1;
  options.stable_after = options.stable_at_latest = 20;
  LiveDensifier live(options);
  std::vector<LiveKeyframe> keyframes;
  for (std::int64_t id = 0; id < 40; ++id) {  // hovers
    LiveKeyframe keyframe = live_keyframe(room(), 0);
    keyframe.id = id;
    keyframe.cam_from_world.translation +=
        0.02 * Eigen::Vector3d(std::sin(2.0 * static_cast<double>(id)), std::cos(3.0 * static_cast<double>(id)), 0.0);
    keyframes.push_back(keyframe);
    live.add(keyframe);
  }
  REQUIRE(live.wait(kLong));
  const std::int64_t used = live.stats().used;
  CHECK(used < 20);
  for (LiveKeyframe& keyframe : keyframes) {
    keyframe.cam_from_world.translation *= 50.0;
    for (Landmark& landmark : keyframe.landmarks) landmark.position_world *= 50.0;
  }
  live.update(keyframes);
  live.finish();
  REQUIRE(live.wait(kLong));
  CHECK(live.stats().rescaled > 0);
  CHECK(live.stats().used == used);
}

TEST_CASE("Cached results stay within memory_mib", PMSP_ACCURACY) {
  LiveOptions options = small_live(width_of_any(128));
  options.densifier.advanced.view_filter.enabled = false;
  options.densifier.advanced.patchmatch.geometric_passes = 1;
  options.memory_mib = 9;
  LiveDensifier live(options);
  const std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  constexpr std::int64_t kCount = 3 * kRoomKeyframes;
  for (std::int64_t id = 0; id < kCount; ++id) {
    LiveKeyframe keyframe = keyframes[static_cast<std::size_t>(id) % keyframes.size()];
    keyframe.id = id;
    live.add(keyframe);
    REQUIRE(live.wait(kLong));
    CHECK(live.stats().memory_mib <= options.memory_mib);
  }
  live.finish();
  REQUIRE(live.wait(kLong));
  const LiveStats stats = live.stats();
  CHECK(stats.images_dropped > 0);
  CHECK(stats.keyframes_frozen > 0);
  CHECK(stats.dropped_late == 0);
  CHECK(live.snapshot()->clouds.size() > 20);
  options.memory_mib = 1;
  options.densifier.width = 256;
  options.densifier.height = 128;
  CHECK_THROWS_AS(LiveDensifier(options), InvalidOption);  // too little memory for any points
}

TEST_CASE("Pending images while paused stay within memory_mib") {
  LiveOptions options = small_live(width_of_any(128));
  options.memory_mib = kSanitized ? 2 : 9;
  LiveDensifier live(options);
  live.pause();
  const std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  constexpr std::int64_t kCount = kSanitized ? 2200 : 500;
  constexpr std::int64_t kMost = kSanitized ? 1500 : 400;  // more than fit into memory
  for (std::int64_t id = 0; id < kCount; ++id) {
    LiveKeyframe keyframe = keyframes[static_cast<std::size_t>(id) % keyframes.size()];
    keyframe.id = id;
    live.add(keyframe);
  }
  const auto left = [&] { return live.stats().dropped_late; };
  for (int i = 0; i < 60000 && left() < kCount - kMost; ++i) std::this_thread::sleep_for(milliseconds(1));
  CHECK(left() >= kCount - kMost);
  CHECK(live.backlog().unstable <= kMost);
}

TEST_CASE("Keyframes pending at a reset do not affect later results") {
  const LiveOptions options = small_live(kRoomWidth);
  const std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  LiveDensifier live(options);
  live.pause();
  for (LiveKeyframe keyframe : keyframes) {
    keyframe.id += 1000;
    live.add(keyframe);
  }
  live.reset();
  for (const LiveKeyframe& keyframe : keyframes) live.add(keyframe);
  live.finish();
  live.resume();
  REQUIRE(live.wait(kLong));
  CHECK(same_points(*live.snapshot(), *at_once(keyframes, options)));
}

TEST_CASE("Exceptions of callbacks are counted and change no result") {
  const std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  std::atomic<int> calls{0};
  LiveCallbacks callbacks;
  callbacks.changed = [&](LiveVersion) {
    ++calls;
    if (calls % 2 == 0) throw std::runtime_error("no room on the screen");
    throw 5;
  };
  callbacks.on_error = [](const std::string&) { throw std::runtime_error("nor for errors"); };
  LiveDensifier live(small_live(kRoomWidth), callbacks);
  for (const LiveKeyframe& keyframe : keyframes) live.add(keyframe);
  live.finish();
  REQUIRE(live.wait(kLong));
  CHECK(calls > 1);
  const LiveStats stats = live.stats();
  CHECK(stats.errors == calls);
  CHECK(stats.last_error.find("callback") != std::string::npos);
  CHECK(ids_of(*live.snapshot()) == ids_of(*at_once(keyframes, small_live(kRoomWidth))));
}

TEST_CASE("An unusable keyframe is reported and the others are densified") {
  std::vector<std::string> errors;
  LiveCallbacks callbacks;
  callbacks.on_error = [&](const std::string& text) { errors.push_back(text); };
  LiveOptions options = small_live(kRoomWidth);
  options.densifier.width = 0;
  options.densifier.height = 0;
  LiveDensifier live(options, callbacks);
  const std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  LiveKeyframe small = keyframes[0];
  small.id = -5;
  small.image.height = 8;  // gives no depth map size
  small.image.width = 16;
  live.add(small);
  REQUIRE_NOTHROW(live.add(keyframes[0]));
  for (std::size_t i = 1; i < keyframes.size(); ++i) live.add(keyframes[i]);
  live.finish();
  REQUIRE(live.wait(kLong));
  REQUIRE(errors.size() == 1);
  CHECK(errors[0].find("16 x 8") != std::string::npos);
  CHECK(live.stats().errors == 1);
  const auto snapshot = live.snapshot();
  REQUIRE(snapshot->clouds.size() >= 4);
  for (const LiveCloud& cloud : snapshot->clouds)
    CHECK(cloud.cloud->pixels.back() > 16 * 8);  // same size as the others
}

TEST_CASE("Invalid input and options are refused without side effects") {
  LiveOptions options = small_live(kRoomWidth);
  LiveDensifier live(options);
  const LiveKeyframe good = live_keyframe(room(), 0);
  const auto refused = [&](const char* what, auto&& spoil) {
    LiveKeyframe bad = good;
    spoil(bad);
    CAPTURE(what);
    CHECK_THROWS_AS(live.add(bad), InvalidInput);
  };
  refused("no image", [](LiveKeyframe& k) { k.image = {}; });
  refused("no owner", [](LiveKeyframe& k) { k.image.owner.reset(); });
  refused("odd width", [](LiveKeyframe& k) { k.image.width = 31; });
  refused("rows overlap", [](LiveKeyframe& k) { k.image.stride = 5; });
  refused("rows overlap by a third", [](LiveKeyframe& k) { k.image.stride = 2 * k.image.width; });
  refused("no rotation", [](LiveKeyframe& k) { k.cam_from_world.rotation *= 2.0; });
  refused("not finite", [](LiveKeyframe& k) { k.cam_from_world.translation.x() = std::nan(""); });
  refused("landmark", [](LiveKeyframe& k) { k.landmarks.push_back({1, {0.0, 0.0, INFINITY}}); });
  CHECK(live.stats().added == 0);
  LiveKeyframe bad = good;
  bad.cam_from_world.rotation *= 2.0;
  CHECK_THROWS_AS(live.update({good, bad}), InvalidInput);
  CHECK_THROWS_AS(live.sync({good, bad}), InvalidInput);
  CHECK(live.stats().added == 0);
  options.stable_at_latest = 2;
  CHECK_THROWS_AS(LiveDensifier(options), InvalidOption);
  options = small_live(kRoomWidth);
  options.densifier.advanced.patchmatch.neighbours = 0;
  CHECK_THROWS_AS(LiveDensifier(options), InvalidOption);
  options = small_live(kRoomWidth);
  options.mask = std::make_shared<Image<std::uint8_t>>(16, 8, 255);
  LiveDensifier masked(options);
  CHECK_THROWS_AS(masked.add(good), InvalidInput);
  CHECK_THROWS_AS(masked.sync({good}), InvalidInput);
  CHECK(masked.stats().added == 0);
}

TEST_CASE("All functions are thread-safe and a LiveDensifier may be destroyed while working") {
  const std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  LiveOptions options = small_live(32);
  options.previews = true;
  options.densifier.advanced.patchmatch.geometric_passes = 1;
  const auto stress = [&](std::uint32_t seed) {
    LiveDensifier live(options);
    std::atomic<std::int64_t> next{0};
    const auto caller = [&](std::uint32_t number) {
      std::mt19937 random(seed * 100 + number);
      LiveVersion seen = 0;
      for (int i = 0; i < 150; ++i) {
        const std::int64_t id = next;
        switch (random() % 10) {
          case 0:
          case 1:
          case 2: {
            LiveKeyframe keyframe = keyframes[static_cast<std::size_t>(id) % keyframes.size()];
            keyframe.id = next++;
            keyframe.map_id = static_cast<std::int64_t>(random() % 8 == 0);
            live.add(keyframe);
            break;
          }
          case 3:
          case 4: {
            std::vector<LiveKeyframe> moved;
            for (std::int64_t k = std::max<std::int64_t>(0, id - 20); k < id; ++k) {
              moved.push_back(keyframes[static_cast<std::size_t>(k) % keyframes.size()]);
              moved.back().id = k;
              moved.back().image = {};
              moved.back().cam_from_world.translation.x() += 1e-3 * static_cast<double>(random() % 10);
            }
            live.update(moved);
            break;
          }
          case 5:
            live.erase({static_cast<std::int64_t>(random() % static_cast<std::uint32_t>(id + 1))});
            break;
          case 6:
            if (random() % 20 == 0) live.reset();
            if (random() % 4 == 0) live.finish();
            break;
          case 7:
            live.pause();
            live.resume();
            break;
          case 8: {
            const auto snapshot = live.snapshot();
            for (const LiveCloud& cloud : snapshot->clouds) {
              if (cloud.cloud->keyframe_id != cloud.keyframe_id) throw std::runtime_error("another keyframe's points");
            }
            break;
          }
          default: {
            const LiveChanges changes = live.changes_since(seen);
            seen = changes.to;
            (void)live.stats();
            (void)live.backlog();
            break;
          }
        }
        if (random() % 8 == 0) std::this_thread::sleep_for(std::chrono::microseconds(random() % 3000));
      }
    };
    std::vector<std::thread> callers;
    for (std::uint32_t number = 0; number < 4; ++number) callers.emplace_back(caller, number);
    for (std::thread& thread : callers) thread.join();
    CHECK(live.stats().errors == 0);
    if (seed % 2 == 0) {
      live.finish();
      CHECK(live.wait(kLong));
    }
  };
  std::thread other([&] { stress(2); });  // two at once
  stress(1);
  stress(3);
  other.join();
}
