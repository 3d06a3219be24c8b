// SPDX-License-Identifier: BSD-2-Clause
// Dense points of a running stella_vslam: copy this file and pass frames through it. See docs/slam.md.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include <stella_vslam/data/keyframe.h>
#include <stella_vslam/data/landmark.h>
#include <stella_vslam/data/map_database.h>
#include <stella_vslam/publish/map_publisher.h>
#include <stella_vslam/system.h>
#include <opencv2/core/mat.hpp>

#include "pmsp/camera.h"
#include "pmsp/live.h"
#include "pmsp/opencv.h"

class StellaBridge {
 public:
  /// `format`: of the images, as "color_order" in stella's configuration.
  StellaBridge(stella_vslam::system& slam, const pmsp::LiveOptions& options, pmsp::PixelFormat format,
               pmsp::LiveCallbacks callbacks = {})
      : slam_(slam), format_(format), live_(options, std::move(callbacks)) {}

  /// Replaces slam.feed_monocular_frame, on the same thread.
  std::shared_ptr<stella_vslam::Mat44_t> feed(const cv::Mat& image, double timestamp) {
    images_[timestamp] = image.clone();  // the SLAM stores none
    if (images_.size() > kMost) images_.erase(images_.begin());
    const auto pose = slam_.feed_monocular_frame(image, timestamp);
    if (++fed_ % kFrames == 0) sync();
    return pose;
  }

  /// To be called at the end of the video, after slam.shutdown.
  void finish() {
    sync();
    live_.finish();
  }

  pmsp::LiveDensifier& live() { return live_; }

 private:
  static constexpr std::size_t kMost = 200;  ///< maximum number of frames kept until the map has a newer keyframe
  static constexpr int kFrames = 5;          ///< frames between two reads of the map

  void sync() {
    // Never blocks on the map's mutex: the next call reads it.
    const std::unique_lock<std::mutex> lock(stella_vslam::data::map_database::mtx_database_, std::try_to_lock);
    if (!lock) return;
    std::vector<std::shared_ptr<stella_vslam::data::keyframe>> keyframes;
    slam_.get_map_publisher()->get_keyframes(keyframes);  // of the newest map only
    if (keyframes.empty()) return;
    const std::int64_t map_id = keyframes.front()->id_;  // its root
    std::map<std::int64_t, pmsp::LiveKeyframe>& map = maps_[map_id];
    std::map<std::int64_t, pmsp::LiveKeyframe> now;
    double newest = 0.0;
    for (const auto& keyframe : keyframes) {
      newest = std::max(newest, keyframe->timestamp_);
      if (keyframe->will_be_erased()) continue;
      const auto known = timestamps_.emplace(keyframe->id_, keyframe->timestamp_);
      if (known.first->second != keyframe->timestamp_) return begin_again();
      const auto before = map.find(keyframe->id_);
      now[keyframe->id_] = state_of(*keyframe, map_id, before == map.end() ? nullptr : &before->second);
    }
    map = std::move(now);
    std::vector<pmsp::LiveKeyframe> all;
    for (const auto& [root, of_map] : maps_) {
      for (const auto& [id, state] : of_map) all.push_back(state);
    }
    live_.sync(all);
    for (auto& [id, state] : map) state.image = {};               // already passed on
    images_.erase(images_.begin(), images_.upper_bound(newest));  // the mapper creates keyframes in temporal order
  }

  pmsp::LiveKeyframe state_of(stella_vslam::data::keyframe& keyframe, std::int64_t map_id,
                              const pmsp::LiveKeyframe* before) {
    const stella_vslam::Mat44_t pose = keyframe.get_pose_cw();
    const auto image = images_.find(keyframe.timestamp_);
    pmsp::LiveKeyframe state;
    state.id = keyframe.id_;
    state.map_id = map_id;
    state.cam_from_world =
        pmsp::cam_from_slam_cam(static_cast<int>(slam_.get_camera()->cols_)) * pmsp::rigid_transform(pose);
    if (image != images_.end()) state.image = pmsp::live_image(image->second, format_);
    if (before != nullptr && before->cam_from_world.translation == state.cam_from_world.translation) return state;
    for (const auto& landmark : keyframe.get_landmarks()) {
      if (!landmark || landmark->will_be_erased()) continue;
      state.landmarks.push_back({landmark->id_, landmark->get_pos_in_world()});
    }
    return state;
  }

  /// stella_vslam was reset: ids start again.
  void begin_again() {
    live_.reset();
    maps_.clear();
    timestamps_.clear();
  }

  stella_vslam::system& slam_;
  const pmsp::PixelFormat format_;
  std::map<double, cv::Mat> images_;                                         ///< newer than all known keyframes
  std::map<std::int64_t, std::map<std::int64_t, pmsp::LiveKeyframe>> maps_;  ///< newest states, by root and id
  std::map<std::int64_t, double> timestamps_;                                ///< of keyframes, by id
  int fed_ = 0;
  pmsp::LiveDensifier live_;
};
