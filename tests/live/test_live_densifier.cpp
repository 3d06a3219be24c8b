// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "core/helpers.h"
#include "elementary.h"
#include "live/live_missions.h"
#include "pmsp/densifier.h"
#include "pmsp/error.h"
#include "pmsp/live.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

/// Passes a mission, from its first keyframe to its map.
void fly_all(LiveDensifier& live, const std::vector<LiveKeyframe>& keyframes) {
  for (const LiveKeyframe& keyframe : keyframes) live.add(keyframe);
  live.finish();
  REQUIRE(live.wait(kLong));
}

}  // namespace

TEST_CASE("LiveDensifier and Densifier reach the same accuracy and completeness on the same mission", PMSP_ACCURACY) {
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

TEST_CASE("A mission known from the start gives the same points for any timing and threads and pixel formats") {
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

TEST_CASE("Landmarks passed after their keyframe are used like those passed with it") {
  const LiveOptions options = small_live(kRoomWidth);
  const std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  LiveDensifier live(options);
  live.pause();
  for (LiveKeyframe keyframe : keyframes) {
    keyframe.landmarks.clear();
    live.add(keyframe);
  }
  live.update(keyframes);
  live.finish();
  live.resume();
  REQUIRE(live.wait(kLong));
  CHECK(same_points(*live.snapshot(), *at_once(keyframes, options)));
}

TEST_CASE("Keyframes without landmarks get points once their landmarks are passed") {
  LiveOptions options = small_live(kRoomWidth);
  options.densifier.advanced.view_filter.enabled = false;
  const std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  LiveDensifier live(options);
  for (LiveKeyframe keyframe : keyframes) {
    keyframe.landmarks.clear();
    live.add(keyframe);
  }
  live.finish();
  REQUIRE(live.wait(kLong));
  REQUIRE(live.stats().used == static_cast<std::int64_t>(keyframes.size()));
  CHECK(live.snapshot()->clouds.empty());  // no depth range
  live.update(keyframes);
  REQUIRE(live.wait(kLong));
  CHECK(ids_of(*live.snapshot()) == ids_of(*at_once(keyframes, options)));
}

TEST_CASE("Images are released when no longer needed") {
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

TEST_CASE("Snapshots show the effect of update and erase and reset once these return") {
  LiveDensifier live(small_live(kRoomWidth));
  std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  fly_all(live, keyframes);
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
  CHECK(before->clouds.size() >= 4);  // still valid for its holder
}

TEST_CASE("Points of a removed keyframe are replaced by those of a neighbour that saw the same surface") {
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

TEST_CASE("Points tested against a removed keyframe are tested again at any distance") {
  LiveDensifier live(small_live(kRoomWidth));
  for (const LiveKeyframe& keyframe : live_keyframes(room())) live.add(keyframe);
  live.finish();
  REQUIRE(live.wait(kLong));
  const auto before = live.snapshot();
  live.erase({before->clouds.front().keyframe_id});
  REQUIRE(live.wait(kLong));
  const auto after = live.snapshot();
  REQUIRE(after->clouds.size() + 1 == before->clouds.size());
  CHECK(after->clouds.back().cloud_since > before->version);  // no depth map of its points is removed
}

TEST_CASE("Points are tested again when a distant keyframe that saw them moves") {
  LiveDensifier live(small_live(kRoomWidth));
  std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  fly_all(live, keyframes);
  const auto before = live.snapshot();
  LiveKeyframe& first = keyframes.front();
  REQUIRE(before->clouds.front().keyframe_id == first.id);
  double range = 0.0;
  for (const Landmark& landmark : first.landmarks) {
    range += (first.cam_from_world * landmark.position_world).norm() / static_cast<double>(first.landmarks.size());
  }
  const double pixel = 2.0 * kernels::kPi / kRoomWidth;
  first.cam_from_world.translation.y() += 0.17 * pixel * range;  // far from a loop closure
  live.update({first});
  REQUIRE(live.wait(kLong));
  CHECK(live.snapshot()->clouds.back().cloud_since > before->version);
}

TEST_CASE("A keyframe that leaves its map affects the points of that map like a removed one") {
  LiveDensifier live(small_live(kRoomWidth));
  std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  fly_all(live, keyframes);
  const auto before = live.snapshot();
  LiveKeyframe& first = keyframes.front();
  REQUIRE(before->clouds.front().keyframe_id == first.id);
  first.map_id = 7;
  SECTION("at the same pose") {}
  SECTION("at a pose of the other map") { first.cam_from_world.translation.y() += 100.0; }
  live.update({first});
  REQUIRE(live.wait(kLong));
  CHECK(live.snapshot()->clouds.back().cloud_since > before->version);  // tested again without it
  CHECK(live.stats().matched_again == 0);
}

TEST_CASE("Without duplicate removal no keyframe waits for it") {
  LiveOptions options = small_live(kRoomWidth);
  options.densifier.advanced.fusion.spacing_px = 0.0;
  options.densifier.advanced.free_space.whole_mission = GENERATE(false, true);
  LiveDensifier live(options);
  std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  fly_all(live, keyframes);
  for (LiveKeyframe& keyframe : keyframes) {
    keyframe.cam_from_world.translation -= keyframe.cam_from_world.rotation * Eigen::Vector3d(3.0, 0.0, 0.0);
    keyframe.landmarks.clear();
  }
  live.update(keyframes);
  REQUIRE(live.wait(kLong));
  CHECK(live.backlog().refining == 0);
}

TEST_CASE("With a single PatchMatch pass the depth map still gets the weighted median") {
  LiveOptions options = small_live(kRoomWidth);
  options.densifier.advanced.patchmatch.geometric_passes = 0;
  const auto weighted = at_once(live_keyframes(room()), options);
  options.densifier.advanced.median.weighted = false;
  CHECK_FALSE(same_points(*weighted, *at_once(live_keyframes(room()), options)));
}

TEST_CASE("A map that moves as a whole is tested again once") {
  LiveDensifier live(small_live(kRoomWidth));
  std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  fly_all(live, keyframes);
  const auto shift = [&](double by) {
    for (LiveKeyframe& keyframe : keyframes) {
      keyframe.cam_from_world.translation -= keyframe.cam_from_world.rotation * Eigen::Vector3d(by, 0.0, 0.0);
      for (Landmark& landmark : keyframe.landmarks) landmark.position_world.x() += by;
    }
    live.update(keyframes);
    REQUIRE(live.wait(kLong));
    return live.stats().clouds;
  };
  const std::int64_t before = live.stats().clouds;
  const std::int64_t after = shift(3.0);
  CHECK(after > before);
  CHECK(shift(1e-9) == after);
}

TEST_CASE("Removing a keyframe restores the duplicates dropped in keyframes of another pass of the same place",
          PMSP_ACCURACY) {
  LiveOptions options = small_live(kRoomWidth);
  options.densifier.advanced.free_space.whole_mission = true;
  options.densifier.advanced.patchmatch.geometric_passes = 1;
  LiveDensifier live(options);
  live.pause();
  const std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  const auto count = static_cast<std::int64_t>(keyframes.size());
  for (std::int64_t id = 0; id < 2 * count; ++id) {  // there and back
    LiveKeyframe keyframe = keyframes[static_cast<std::size_t>(id < count ? id : 2 * count - 1 - id)];
    keyframe.id = id;
    live.add(keyframe);
  }
  live.finish();
  live.resume();
  REQUIRE(live.wait(kLong));
  constexpr std::int64_t kFirst = kRoomKeyframes / 2;  // farther from those at the end than any window reaches
  const auto points_at_first = [&] {
    std::size_t points = 0;
    for (const LiveCloud& cloud : live.snapshot()->clouds) {
      if (cloud.keyframe_id < kFirst) points += cloud.cloud->points.size();
    }
    return points;
  };
  const std::size_t shared = points_at_first();
  std::vector<std::int64_t> back;
  for (std::int64_t id = 2 * count - kFirst; id < 2 * count; ++id) back.push_back(id);
  live.erase(back);
  REQUIRE(live.wait(kLong));
  CAPTURE(shared, points_at_first());
  CHECK(points_at_first() > shared + shared / 10);
}

TEST_CASE("After a reset ids may be reused and no previous results appear") {
  LiveDensifier live(small_live(kRoomWidth));
  const std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  for (int round = 0; round < 3; ++round) {
    for (const LiveKeyframe& keyframe : keyframes) live.add(keyframe);
    if (round < 2) live.reset();  // during work
  }
  live.finish();
  REQUIRE(live.wait(kLong));
  CHECK(live.stats().resets == 2);
  CHECK(live.stats().added == 3 * static_cast<std::int64_t>(keyframes.size()));
  const auto snapshot = live.snapshot();
  LiveOptions options = small_live(kRoomWidth);
  CHECK(ids_of(*snapshot) == ids_of(*at_once(keyframes, options)));
}

TEST_CASE("Points finished after their keyframe id was reused are discarded") {
  LiveOptions options = small_live(kRoomWidth);
  options.densifier.advanced.patchmatch.geometric_passes = 1;
  std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  keyframes.resize(5);  // few, so that points of all are made together
  LiveKeyframe other = keyframes[4];
  const std::vector<std::int64_t> ids = ids_of(*at_once(keyframes, options));
  REQUIRE(std::count(ids.begin(), ids.end(), other.id) == 1);
  other.map_id = 7;  // without others, it never gets points
  LiveDensifier* told = nullptr;
  bool replaced = false;
  bool in_the_midst = false;
  LiveCallbacks callbacks;
  callbacks.changed = [&](LiveVersion) {
    if (std::exchange(replaced, true)) {
      in_the_midst = in_the_midst || told->stats().clouds == 0;  // not counted until all exist
      return;
    }
    told->erase({other.id});
    told->add(other);
    told->finish();
  };
  LiveDensifier live(options, callbacks);
  told = &live;
  live.pause();
  for (const LiveKeyframe& keyframe : keyframes) live.add(keyframe);
  live.finish();
  live.resume();
  REQUIRE(live.wait(kLong));
  REQUIRE(in_the_midst);
  const std::vector<std::int64_t> left = ids_of(*live.snapshot());
  CHECK(left.size() == ids.size() - 1);
  CHECK(std::count(left.begin(), left.end(), other.id) == 0);
}

TEST_CASE("sync detects added and moved and removed keyframes") {
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

TEST_CASE("The last keyframes of a map are densified once another map begins") {
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

TEST_CASE("Preliminary points appear after the following keyframes and are replaced by final ones") {
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
  CHECK(ids_of(*last) == final);  // unused ones have none any more
  for (const LiveCloud& cloud : last->clouds) CHECK(!cloud.preliminary);
}

namespace {

/// The room with textureless walls, with the true depth of each image.
std::vector<LiveKeyframe> keyframes_with_depth(const synth::Mission& mission) {
  std::vector<LiveKeyframe> keyframes = live_keyframes(mission);
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    const Image<float>& depth = mission.frames[i].depth;
    keyframes[i].prior_depth = std::shared_ptr<const Image<float>>(&depth, [](const Image<float>*) {});
  }
  return keyframes;
}

}  // namespace

TEST_CASE("Preliminary points use the current poses", PMSP_ACCURACY) {
  LiveOptions options = small_live(kRoomWidth);
  options.previews = true;
  const std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  const RigidTransform elsewhere{Eigen::AngleAxisd(1.5, Eigen::Vector3d::UnitY()).toRotationMatrix(), {5.0, 0.0, 1.0}};
  const auto points_of_third = [&](bool moves) {  // the SLAM turns and shifts its map before the fourth one comes
    LiveDensifier live(options);
    std::vector<LiveKeyframe> known;
    for (std::size_t i = 0; i < 4; ++i) {
      LiveKeyframe keyframe = keyframes[i];
      if (moves && i == 3) {
        known.push_back(keyframe);
        for (LiveKeyframe& each : known) {
          each.cam_from_world = each.cam_from_world * elsewhere.inverse();
          for (Landmark& landmark : each.landmarks) landmark.position_world = elsewhere * landmark.position_world;
        }
        keyframe = known.back();
        known.pop_back();
        live.update(known);
      }
      known.push_back(keyframe);
      live.add(keyframe);
      REQUIRE(live.wait(kLong));
    }
    for (const LiveCloud& cloud : live.snapshot()->clouds) {
      if (cloud.keyframe_id == keyframes[2].id && cloud.preliminary) return cloud.cloud->points.size();
    }
    return std::size_t{0};
  };
  const std::size_t still = points_of_third(false);
  CHECK(still > 200);
  CHECK(points_of_third(true) > still * 9 / 10);
}

TEST_CASE("Prior depth fills textureless surfaces in the map units it was passed in", "[live]" PMSP_ACCURACY) {
  const synth::Mission mission = synth::painted_room(small_recipe(kRoomWidth, kRoomKeyframes));
  LiveOptions options = small_live(kRoomWidth);
  options.densifier.advanced.median.weighted =
      false;  // in a map this small its window is as wide as a picture on the wall
  const LiveFigures without = figures(*at_once(live_keyframes(mission), options), mission);
  const std::vector<LiveKeyframe> keyframes = keyframes_with_depth(mission);
  const LiveFigures with = figures(*at_once(keyframes, options), mission);
  CAPTURE(without.covered, without.right, with.covered, with.right);
  CHECK(with.right > without.right);
  CHECK(with.covered > without.covered);

  // The SLAM halves the map's scale before the first one is prepared.
  LiveDensifier live(options);
  live.pause();
  for (const LiveKeyframe& keyframe : keyframes) live.add(keyframe);
  std::vector<LiveKeyframe> smaller = live_keyframes(mission);
  synth::Mission small = mission;
  for (std::size_t i = 0; i < smaller.size(); ++i) {
    smaller[i].cam_from_world.translation *= 0.5;
    for (Landmark& landmark : smaller[i].landmarks) landmark.position_world *= 0.5;
    small.frames[i].cam_from_world = smaller[i].cam_from_world;
    for (float& depth : small.frames[i].depth.pixels()) depth *= 0.5F;
  }
  live.update(smaller);
  live.finish();
  live.resume();
  REQUIRE(live.wait(kLong));
  const LiveFigures rescaled = figures(*live.snapshot(), small);
  CAPTURE(rescaled.covered, rescaled.right);
  CHECK(rescaled.right > with.right - 0.02);
  CHECK(rescaled.covered > with.covered - 0.02);
}

TEST_CASE("Prior depth of too low resolution is refused", "[live]") {
  LiveDensifier live(small_live(kRoomWidth));
  LiveKeyframe keyframe = live_keyframe(room(), 0);
  keyframe.prior_depth = std::make_shared<const Image<float>>(8, 4, 1.0F);
  CHECK_THROWS_AS(live.add(keyframe), InvalidInput);
  CHECK(live.stats().added == 0);
  keyframe.prior_depth = std::make_shared<const Image<float>>();  // none
  live.add(keyframe);
  CHECK(live.stats().added == 1);
}
