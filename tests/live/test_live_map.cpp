// SPDX-License-Identifier: BSD-2-Clause
#include <atomic>
#include <catch2/catch.hpp>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <random>
#include <thread>
#include <vector>

#include "live/live_map.h"

using namespace pmsp;

namespace {

LivePose at(std::int64_t id, double x, double scale = 1.0, std::int64_t map_id = 0) {
  return {id, {{Eigen::Matrix3d::Identity(), {x, 0.0, 0.0}}, scale}, map_id};
}

std::shared_ptr<const KeyframeCloud> cloud_of(std::int64_t id, std::size_t points = 1) {
  auto cloud = std::make_shared<KeyframeCloud>();
  cloud->keyframe_id = id;
  cloud->points.resize(points);
  return cloud;
}

std::vector<std::int64_t> ids_of(const std::vector<LiveCloud>& clouds) {
  std::vector<std::int64_t> ids;
  for (const LiveCloud& cloud : clouds) ids.push_back(cloud.keyframe_id);
  return ids;
}

/// The clouds of a viewer that applies changes only.
class Viewer {
 public:
  void follow(const LiveMap& map) {
    const LiveChanges changes = map.changes_since(version_);
    CHECK(changes.from == version_);
    if (changes.reset) clouds_.clear();
    for (const LiveCloud& cloud : changes.added) CHECK(clouds_.emplace(cloud.keyframe_id, cloud).second);
    for (const LiveCloud& cloud : changes.replaced) {
      REQUIRE(clouds_.count(cloud.keyframe_id) == 1);
      CHECK(clouds_[cloud.keyframe_id].cloud != cloud.cloud);
      clouds_[cloud.keyframe_id] = cloud;
    }
    for (const LiveCloud& cloud : changes.moved) {
      REQUIRE(clouds_.count(cloud.keyframe_id) == 1);
      CHECK(clouds_[cloud.keyframe_id].cloud == cloud.cloud);
      clouds_[cloud.keyframe_id] = cloud;
    }
    for (const std::int64_t id : changes.removed) CHECK(clouds_.erase(id) == 1);
    version_ = changes.to;
  }

  bool has(const LiveSnapshot& snapshot) const {
    if (snapshot.version != version_ || snapshot.clouds.size() != clouds_.size()) return false;
    for (const LiveCloud& cloud : snapshot.clouds) {
      const auto mine = clouds_.find(cloud.keyframe_id);
      if (mine == clouds_.end() || mine->second.cloud != cloud.cloud || mine->second.map_id != cloud.map_id ||
          mine->second.pose.scale != cloud.pose.scale || mine->second.preliminary != cloud.preliminary ||
          mine->second.pose.cam_from_world.translation != cloud.pose.cam_from_world.translation) {
        return false;
      }
    }
    return true;
  }

 private:
  LiveVersion version_ = 0;
  std::map<std::int64_t, LiveCloud> clouds_;
};

/// A random change of the map.
void disturb(LiveMap& map, std::mt19937& random) {
  const auto draw = [&](int below) { return static_cast<std::int64_t>(random() % static_cast<unsigned>(below)); };
  const std::int64_t id = draw(12);
  switch (draw(10)) {
    case 0:
      return draw(5) == 0 ? map.reset() : map.remove({id, draw(12)});
    case 1:
    case 2:
      return map.remove({id});
    case 3:
    case 4:
    case 5:
      return map.move({at(id, static_cast<double>(draw(3))), at(draw(12), 1.0, 2.0, draw(2))});
    default:
      return map.publish(at(id, static_cast<double>(draw(3))), cloud_of(id), draw(2) == 0);
  }
}

}  // namespace

TEST_CASE("changes list added and replaced and moved and removed clouds", "[live][map]") {
  LiveMap map;
  CHECK(map.snapshot()->version == 0);
  CHECK(map.changes_since(0).empty());
  map.publish(at(3, 0.0), cloud_of(3), true);
  map.publish(at(1, 0.0), cloud_of(1), true);
  map.publish(at(2, 0.0), cloud_of(2), true);
  const LiveVersion first = map.snapshot()->version;
  CHECK(ids_of(map.snapshot()->clouds) == std::vector<std::int64_t>{1, 2, 3});
  CHECK(ids_of(map.changes_since(0).added) == std::vector<std::int64_t>{1, 2, 3});
  CHECK(map.changes_since(first).empty());

  map.publish(at(1, 0.0), cloud_of(1, 5), false);
  map.move({at(2, 4.0, 1.2), at(1, 5.0), at(99, 1.0)});
  map.remove({3, 77});
  const LiveChanges changes = map.changes_since(first);
  CHECK(changes.added.empty());
  REQUIRE(ids_of(changes.replaced) == std::vector<std::int64_t>{1});
  CHECK_FALSE(changes.replaced[0].preliminary);
  CHECK(changes.replaced[0].pose.cam_from_world.translation.x() == 5.0);
  REQUIRE(ids_of(changes.moved) == std::vector<std::int64_t>{2});
  CHECK(changes.moved[0].pose.scale == 1.2);
  CHECK(changes.removed == std::vector<std::int64_t>{3});
  CHECK(changes.to == first + 3);
  CHECK(ids_of(map.changes_since(0).added) == std::vector<std::int64_t>{1, 2});
  CHECK(map.changes_since(0).removed.empty());  // not listed for viewers without it
}

TEST_CASE("a call without effect makes no version", "[live][map]") {
  LiveMap map;
  map.publish(at(1, 2.0), cloud_of(1), false);
  const auto before = map.snapshot();
  map.move({at(1, 2.0)});
  map.move({});
  map.remove({5});
  CHECK(map.snapshot() == before);
  map.move({at(1, 2.0, 1.0, 4)});  // into another map
  CHECK(map.snapshot() != before);
  CHECK(ids_of(map.changes_since(before->version).moved) == std::vector<std::int64_t>{1});
}

TEST_CASE("after a reset all clouds are new and ids may be reused", "[live][map]") {
  LiveMap map;
  map.publish(at(0, 0.0), cloud_of(0), false);
  map.publish(at(1, 0.0), cloud_of(1), false);
  const LiveVersion before = map.snapshot()->version;
  map.reset();
  map.publish(at(0, 7.0), cloud_of(0), false);
  const LiveChanges changes = map.changes_since(before);
  CHECK(changes.reset);
  CHECK(ids_of(changes.added) == std::vector<std::int64_t>{0});
  CHECK((changes.removed.empty() && changes.moved.empty() && changes.replaced.empty()));
  CHECK_FALSE(map.changes_since(changes.to).reset);
  CHECK(map.changes_since(changes.to + 5).empty());
  CHECK(map.changes_since(changes.to + 5).from == changes.to);
}

TEST_CASE("a snapshot is immutable", "[live][map]") {
  LiveMap map;
  map.publish(at(1, 0.0), cloud_of(1, 3), true);
  const auto snapshot = map.snapshot();
  map.move({at(1, 9.0)});
  map.reset();
  REQUIRE(snapshot->clouds.size() == 1);
  CHECK(snapshot->clouds[0].pose.cam_from_world.translation.x() == 0.0);
  CHECK(snapshot->clouds[0].cloud->points.size() == 3);
}

TEST_CASE("applying the changes since any version gives the snapshot", "[live][map]") {
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    LiveMap map;
    std::vector<Viewer> viewers(3);
    for (int step = 0; step < 200; ++step) {
      disturb(map, random);
      Viewer& viewer = viewers[random() % viewers.size()];  // the others follow later, over many versions
      if (random() % 3 != 0) continue;
      viewer.follow(map);
      REQUIRE(viewer.has(*map.snapshot()));
    }
  }
}

TEST_CASE("concurrent writers and readers leave a consistent map", "[live][map]") {
  LiveMap map;
  std::atomic<bool> stop{false};
  std::atomic<int> torn{0};
  std::vector<std::thread> threads;
  for (unsigned seed = 1; seed <= 3; ++seed) {
    threads.emplace_back([&, seed] {
      std::mt19937 random(seed);
      for (int i = 0; i < 3000; ++i) disturb(map, random);
    });
  }
  std::thread reader([&] {
    LiveVersion last = 0;
    while (!stop) {
      const auto snapshot = map.snapshot();
      if (snapshot->version < last) ++torn;
      last = snapshot->version;
      for (const LiveCloud& cloud : snapshot->clouds) {
        if (!cloud.cloud || cloud.cloud->keyframe_id != cloud.keyframe_id || cloud.cloud_since > last) ++torn;
      }
      if (map.changes_since(last).to < last) ++torn;
    }
  });
  for (std::thread& thread : threads) thread.join();
  stop = true;
  reader.join();
  CHECK(torn == 0);
  Viewer viewer;
  viewer.follow(map);
  CHECK(viewer.has(*map.snapshot()));
}
