// SPDX-License-Identifier: BSD-2-Clause
// Use of LiveDensifier by a SLAM: a fake one, which plays a recorded mission. The part of a real SLAM is between the
// lines "a SLAM's part".
//
//   live_slam MAP IMAGES [--speed X] [--drift SHARE] [--wait SECONDS] [-o CLOUD.ply]
//
//   MAP, IMAGES     a mission as pmsp-densify takes it, such as data/map.msg data/images
//   --speed X       playback speed relative to the recording [default 1]
//   --drift SHARE   scale error at the end, before the loop closure [default 0.1]
//   --wait SECONDS  maximum time for the points after the last keyframe [default 600]
//   -o CLOUD.ply    final points
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "fake_slam.h"
#include "pmsp/io/cloud.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"
#include "pmsp/live.h"

namespace {

using Clock = std::chrono::steady_clock;

struct Arguments {
  std::string map, images, cloud;
  double speed = 1.0;
  double drift = 0.1;
  double wait = 600.0;
};

Arguments parse(int argc, char** argv) {
  Arguments arguments;
  std::vector<std::string> plain;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word.rfind('-', 0) != 0) {
      plain.push_back(word);
      continue;
    }
    if (i + 1 == argc) throw std::invalid_argument(word + ": a value is missing");
    const std::string value = argv[++i];
    if (word == "--speed") {
      arguments.speed = std::stod(value);
    } else if (word == "--drift") {
      arguments.drift = std::stod(value);
    } else if (word == "--wait") {
      arguments.wait = std::stod(value);
    } else if (word == "-o") {
      arguments.cloud = value;
    } else {
      throw std::invalid_argument(word + " is no option; expected --speed, --drift, --wait or -o");
    }
  }
  if (plain.size() != 2) throw std::invalid_argument("expected MAP and IMAGES");
  arguments.map = plain[0];
  arguments.images = plain[1];
  return arguments;
}

struct Mission {
  std::vector<pmsp::LiveKeyframe> keyframes;
  std::vector<double> seconds;  ///< from the first one
};

Mission read_mission(const Arguments& arguments) {
  const pmsp::SlamMap map = pmsp::read_map(arguments.map);
  const std::unique_ptr<pmsp::ImageSource> images = pmsp::open_image_folder(map, arguments.images);
  Mission mission;
  std::optional<double> start;
  while (std::optional<pmsp::ImageSource::Item> item = images->next()) {
    const pmsp::MapKeyframe& in_map = *map.find_keyframe(item->keyframe_id);
    auto image = std::make_shared<pmsp::Image<pmsp::Rgb>>(std::move(item->image));
    const pmsp::Keyframe known = keyframe_of(map, in_map);
    pmsp::LiveKeyframe keyframe;
    keyframe.id = known.id;
    keyframe.cam_from_world = known.cam_from_world;
    keyframe.landmarks = known.landmarks;
    keyframe.pose_error = known.pose_error;
    keyframe.image.data = &image->pixels().data()->r;
    keyframe.image.width = image->width();
    keyframe.image.height = image->height();
    keyframe.image.owner = std::move(image);
    mission.keyframes.push_back(std::move(keyframe));
    if (!start) start = in_map.timestamp;
    mission.seconds.push_back(in_map.timestamp - *start);
  }
  return mission;
}

/// Stand-in for a viewer.
class Viewer {
 public:
  void draw(const pmsp::LiveDensifier& live, double seconds) {
    const pmsp::LiveChanges changes = live.changes_since(version_);
    version_ = changes.to;
    for (const std::vector<pmsp::LiveCloud>* clouds : {&changes.added, &changes.replaced}) {
      for (const pmsp::LiveCloud& cloud : *clouds) {
        (cloud.preliminary ? preliminary_ : final_) += 1;
        points_ += cloud.cloud->points.size();
      }
    }
    moved_ += changes.moved.size();
    const pmsp::LiveBacklog backlog = live.backlog();
    std::printf(
        "%6.1f s  keyframes: %2lld unstable, %2lld waiting, %2lld refining;  clouds drawn: %3zu preliminary, %3zu "
        "final, "
        "%4zu moved;  %6.2f million points uploaded\n",
        seconds, static_cast<long long>(backlog.unstable), static_cast<long long>(backlog.waiting),
        static_cast<long long>(backlog.refining), preliminary_, final_, moved_, 1e-6 * static_cast<double>(points_));
    std::fflush(stdout);
  }

 private:
  pmsp::LiveVersion version_ = 0;
  std::size_t preliminary_ = 0;
  std::size_t final_ = 0;
  std::size_t moved_ = 0;
  std::size_t points_ = 0;
};

void write_cloud(const pmsp::LiveSnapshot& snapshot, const std::string& path) {
  pmsp::CloudOutput output(path);
  for (const pmsp::LiveCloud& cloud : snapshot.clouds) {
    if (!cloud.preliminary) output.add(*cloud.cloud, cloud.pose);
  }
  output.commit();
  std::printf("%s: %lld points\n", path.c_str(), static_cast<long long>(output.points()));
}

int run(const Arguments& arguments) {
  const Mission mission = read_mission(arguments);
  FakeSlam slam(mission.keyframes, arguments.drift);
  Viewer viewer;
  const Clock::time_point start = Clock::now();
  const auto now = [&] { return std::chrono::duration<double>(Clock::now() - start).count(); };

  // ---- a SLAM's part ----

  pmsp::LiveOptions options;  // the online preset, at low priority
  pmsp::LiveCallbacks callbacks;
  callbacks.on_error = [](const std::string& what) { std::fprintf(stderr, "live_slam: %s\n", what.c_str()); };
  pmsp::LiveDensifier live(options, callbacks);

  std::thread mapping([&] {  // the SLAM's own thread
    for (std::size_t k = 0; k < slam.size(); ++k) {
      while (now() * arguments.speed < mission.seconds[k]) std::this_thread::sleep_for(std::chrono::milliseconds(2));
      live.add(slam.next());      // the mapper has finished a keyframe
      live.update(slam.moved());  // its local bundle adjustment has moved others
    }
    live.update(slam.closed());  // the loop is closed; scales are not reported
    live.finish();               // tracking has ended
  });

  const double end = mission.seconds.back() / arguments.speed;
  for (; now() < end; std::this_thread::sleep_for(std::chrono::seconds(1))) viewer.draw(live, now());
  mapping.join();
  bool done = false;
  while (!(done = live.wait(std::chrono::seconds(1))) && now() < end + arguments.wait) viewer.draw(live, now());
  viewer.draw(live, now());

  // ---- that is all ----

  const pmsp::LiveStats stats = live.stats();
  std::printf(
      "%lld keyframes, %lld used; %lld preliminary and %lld final clouds; %lld scales found again, %lld matched "
      "again\n",
      static_cast<long long>(stats.added), static_cast<long long>(stats.used), static_cast<long long>(stats.previews),
      static_cast<long long>(stats.clouds), static_cast<long long>(stats.rescaled),
      static_cast<long long>(stats.matched_again));
  if (!arguments.cloud.empty()) write_cloud(*live.snapshot(), arguments.cloud);
  if (!done) std::fprintf(stderr, "live_slam: not done in time\n");
  return done && stats.errors == 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(parse(argc, argv));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "live_slam: %s\n", error.what());
    return 2;
  }
}
