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
#include "live/live_missions.h"
#include "pmsp/densifier.h"
#include "pmsp/error.h"
#include "pmsp/live.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

/// Tells a flight, from its first keyframe to its map.
void fly_all(LiveDensifier& live, const std::vector<LiveKeyframe>& keyframes) {
  for (const LiveKeyframe& keyframe : keyframes) live.add(keyframe);
  live.finish();
  REQUIRE(live.wait(kLong));
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

TEST_CASE("Landmarks that are told of after their keyframe are as good as those that came with it") {
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

TEST_CASE("Snapshots show what update, erase and reset have said when these return") {
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

TEST_CASE("Points that a removed keyframe was asked about are asked about again, however far away") {
  LiveDensifier live(small_live(kRoomWidth));
  for (const LiveKeyframe& keyframe : live_keyframes(room())) live.add(keyframe);
  live.finish();
  REQUIRE(live.wait(kLong));
  const auto before = live.snapshot();
  live.erase({before->clouds.front().keyframe_id});
  REQUIRE(live.wait(kLong));
  const auto after = live.snapshot();
  REQUIRE(after->clouds.size() + 1 == before->clouds.size());
  CHECK(after->clouds.back().cloud_since > before->version);  // no depth map that its points are made of is gone
}

TEST_CASE("Points are asked about again when a keyframe moves that has looked at them from afar") {
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
  const double pixel = 2.0 * M_PI / kRoomWidth;
  first.cam_from_world.translation.y() += 0.17 * pixel * range;  // far from a loop closure
  live.update({first});
  REQUIRE(live.wait(kLong));
  CHECK(live.snapshot()->clouds.back().cloud_since > before->version);
}

TEST_CASE("Where one pass of PatchMatch is all, its map goes through the median by colours, too") {
  LiveOptions options = small_live(kRoomWidth);
  options.densifier.advanced.patchmatch.geometric_passes = 0;
  const auto weighted = at_once(live_keyframes(room()), options);
  options.densifier.advanced.median.weighted = false;
  CHECK_FALSE(same_points(*weighted, *at_once(live_keyframes(room()), options)));
}

TEST_CASE("A map that has moved as a whole is asked about once") {
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

TEST_CASE("Of a removed keyframe's points those take theirs back that have seen the place at another time",
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

TEST_CASE("Points that are ready when another keyframe has the id already are not shown as that one's") {
  LiveOptions options = small_live(kRoomWidth);
  options.densifier.advanced.patchmatch.geometric_passes = 1;
  std::vector<LiveKeyframe> keyframes = live_keyframes(room());
  keyframes.resize(5);  // few, so that points of all are made together
  LiveKeyframe other = keyframes[4];
  const std::vector<std::int64_t> ids = ids_of(*at_once(keyframes, options));
  REQUIRE(std::count(ids.begin(), ids.end(), other.id) == 1);
  other.map_id = 7;  // alone there, it never gets points
  LiveDensifier* told = nullptr;
  bool replaced = false;
  bool in_the_midst = false;
  LiveCallbacks callbacks;
  callbacks.changed = [&](LiveVersion) {
    if (std::exchange(replaced, true)) {
      in_the_midst = in_the_midst || told->stats().clouds == 0;  // not counted until all of them are there
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

namespace {

/// The room, whose walls have no texture, with the true depth beside each image.
std::vector<LiveKeyframe> keyframes_with_depth(const synth::Mission& mission) {
  std::vector<LiveKeyframe> keyframes = live_keyframes(mission);
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    const Image<float>& depth = mission.frames[i].depth;
    keyframes[i].prior_depth = std::shared_ptr<const Image<float>>(&depth, [](const Image<float>*) {});
  }
  return keyframes;
}

}  // namespace

TEST_CASE("Preliminary points are made with poses as they are then", PMSP_ACCURACY) {
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

TEST_CASE("Depth from elsewhere helps where there is no texture, in the unit that the SLAM had",
          "[live]" PMSP_ACCURACY) {
  const synth::Mission mission = synth::painted_room(small_recipe(kRoomWidth, kRoomKeyframes));
  LiveOptions options = small_live(kRoomWidth);
  options.densifier.advanced.median.weighted =
      false;  // in so small a map its window is as wide as a picture on the wall
  const LiveFigures without = figures(*at_once(live_keyframes(mission), options), mission);
  const std::vector<LiveKeyframe> keyframes = keyframes_with_depth(mission);
  const LiveFigures with = figures(*at_once(keyframes, options), mission);
  CAPTURE(without.covered, without.right, with.covered, with.right);
  CHECK(with.right > without.right);
  CHECK(with.covered > without.covered);

  // The SLAM finds that the world is half as large before the first one is prepared.
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

TEST_CASE("Depth from elsewhere that is too small is refused", "[live]") {
  LiveDensifier live(small_live(kRoomWidth));
  LiveKeyframe keyframe = live_keyframe(room(), 0);
  keyframe.prior_depth = std::make_shared<const Image<float>>(8, 4, 1.0F);
  CHECK_THROWS_AS(live.add(keyframe), InvalidInput);
  CHECK(live.stats().added == 0);
  keyframe.prior_depth = std::make_shared<const Image<float>>();  // none
  live.add(keyframe);
  CHECK(live.stats().added == 1);
}
