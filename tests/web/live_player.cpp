// SPDX-License-Identifier: BSD-2-Clause
// A simulated SLAM for the browser test: a LiveDensifier with a mission, served by LiveServer. It prints the address,
// then executes the lines on stdin: "fly" (all keyframes come), "move" (each by 10 along x), "erase" (the last one),
// "end".
#include <atomic>
#include <chrono>
#include <iostream>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "pmsp/io/images.h"
#include "pmsp/io/map.h"
#include "pmsp/live.h"
#include "pmsp/web.h"

namespace {

std::vector<pmsp::LiveKeyframe> read_keyframes(const char* map_file, const char* folder) {
  const pmsp::SlamMap map = pmsp::read_map(map_file);
  const std::unique_ptr<pmsp::ImageSource> images = pmsp::open_image_folder(map, folder);
  std::vector<pmsp::LiveKeyframe> keyframes;
  while (std::optional<pmsp::ImageSource::Item> item = images->next()) {
    const pmsp::MapKeyframe& in_map = *map.find_keyframe(item->keyframe_id);
    auto image = std::make_shared<pmsp::Image<pmsp::Rgb>>(std::move(item->image));
    pmsp::LiveKeyframe keyframe;
    keyframe.id = in_map.id;
    keyframe.cam_from_world = in_map.cam_from_world;
    for (const pmsp::MapObservation& it : in_map.observations) {
      keyframe.landmarks.push_back({it.landmark_id, map.find_landmark(it.landmark_id)->position_world});
    }
    keyframe.image.data = &image->pixels().data()->r;
    keyframe.image.width = image->width();
    keyframe.image.height = image->height();
    keyframe.image.owner = std::move(image);
    keyframes.push_back(std::move(keyframe));
  }
  return keyframes;
}

void shift(std::vector<pmsp::LiveKeyframe>& keyframes, const Eigen::Vector3d& by) {
  for (pmsp::LiveKeyframe& keyframe : keyframes) {
    keyframe.image = {};
    keyframe.cam_from_world.translation -= keyframe.cam_from_world.rotation * by;
    keyframe.landmarks.clear();  // the last ones stay
  }
}

void play(const char* map, const char* images) {
  std::vector<pmsp::LiveKeyframe> keyframes = read_keyframes(map, images);
  pmsp::LiveOptions options;
  options.densifier.backend = pmsp::Backend::kCpu;
  options.densifier.width = 256;
  options.densifier.height = 128;
  options.nice = 0;
  std::atomic<bool> has_points{false};
  pmsp::LiveCallbacks callbacks;
  callbacks.changed = [&](pmsp::LiveVersion) {
    if (has_points.exchange(true)) return;
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    std::cout << "first points at " << std::chrono::duration_cast<std::chrono::milliseconds>(now).count() << std::endl;
  };
  pmsp::LiveDensifier live(options, callbacks);
  pmsp::LiveServer server(
      {}, {[&](pmsp::LiveVersion since) { return live.changes_since(since); }, [&] { return live.snapshot(); }});
  std::cout << server.url() << std::endl;
  for (std::string line; std::getline(std::cin, line) && line != "end";) {
    if (line == "fly") {
      for (const pmsp::LiveKeyframe& keyframe : keyframes) {
        live.add(keyframe);
        server.set_camera(keyframe.cam_from_world);
      }
      live.finish();
      live.wait(std::chrono::minutes(10));
      std::cout << "flown" << std::endl;
    } else if (line == "move") {
      live.pause();  // places are followed all the same, and nothing is matched again
      shift(keyframes, {10.0, 0.0, 0.0});
      live.update(keyframes);
    } else if (line == "erase") {
      live.erase({live.snapshot()->clouds.back().keyframe_id});
    }
  }
  server.finish(std::chrono::seconds(10));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  try {
    play(argv[1], argv[2]);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << error.what() << "\n";
    return 1;
  }
}
