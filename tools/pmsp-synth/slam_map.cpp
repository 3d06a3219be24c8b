// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-synth/slam_map.h"

#include <cstddef>
#include <map>
#include <string>

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "pmsp/camera.h"
#include "synth/rng.h"

namespace pmsp::synth_tool {
namespace {

using nlohmann::json;

constexpr const char* kCamera = "pmsp-synth equirectangular";
constexpr const char* kOrb = "default ORB feature extraction setting";
/// stella_vslam's value for "no parent".
constexpr std::uint32_t kNoParent = 0xFFFFFFFFU;

json array_of(const Eigen::Vector3d& v) { return json::array({v.x(), v.y(), v.z()}); }

json camera(const synth::Mission& mission, double fps) {
  return {{"model_type", "Equirectangular"}, {"setup_type", "Monocular"}, {"color_order", "BGR"},
          {"cols", mission.width},           {"rows", mission.height},    {"fps", fps},
          {"focal_x_baseline", 0.0}};
}

/// Keypoints with the fields of stella_vslam.
class Keypoints {
 public:
  explicit Keypoints(std::uint64_t seed) : seed_(seed) {}

  /// `pixel`: see camera.h; in the file the centre of the first pixel is at 0. A landmark always has the same
  /// descriptor.
  void add(const Eigen::Vector2d& pixel, std::int64_t landmark, std::uint64_t look) {
    points_.push_back({{"pt", {static_cast<float>(pixel.x() - 0.5), static_cast<float>(pixel.y() - 0.5)}},
                       {"ang", static_cast<float>(360.0 * synth::uniform(seed_ + 1, look))},
                       {"oct", look % 8}});
    json descriptor = json::array();
    for (std::uint64_t word = 0; word < 8; ++word) {
      descriptor.push_back(synth::mix(seed_ + 2, 8 * look + word) >> 32);
    }
    descriptors_.push_back(std::move(descriptor));
    landmarks_.push_back(landmark);
  }

  void store(json& keyframe) {
    keyframe["n_keypts"] = points_.size();
    keyframe["undist_keypts"] = std::move(points_);
    keyframe["descs"] = std::move(descriptors_);
    keyframe["lm_ids"] = std::move(landmarks_);
  }

 private:
  std::uint64_t seed_;
  json points_ = json::array();
  json descriptors_ = json::array();
  json landmarks_ = json::array();
};

json keyframe(const synth::Mission& mission, std::size_t index, const SlamMapOptions& options) {
  const synth::Frame& frame = mission.frames[index];
  const RigidTransform pose = cam_from_slam_cam(mission.width).inverse() * frame.cam_from_world;
  const Eigen::Quaterniond rotation = Eigen::Quaterniond(pose.rotation).normalized();
  const bool last = index + 1 == mission.frames.size();
  json result = {{"ts", frame.timestamp},
                 {"cam", kCamera},
                 {"orb_params", kOrb},
                 {"rot_cw", {rotation.x(), rotation.y(), rotation.z(), rotation.w()}},
                 {"trans_cw", array_of(options.scale * pose.translation)},
                 {"x_rights", json::array()},
                 {"depths", json::array()},
                 {"loop_edges", json::array()},
                 {"span_children", last ? json::array() : json::array({mission.frames[index + 1].id})}};
  result["span_parent"] = index == 0 ? json(kNoParent) : json(mission.frames[index - 1].id);

  Keypoints keypoints(options.seed);
  for (const Landmark& landmark : frame.landmarks) {
    // The keypoint is the true projection; only the position in the map may be noisy.
    const Eigen::Vector3d& seen = mission.points[static_cast<std::size_t>(landmark.id)].position_world;
    keypoints.add(pixel_from_bearing(frame.cam_from_world * seen, mission.width, mission.height), landmark.id,
                  static_cast<std::uint64_t>(landmark.id));
  }
  for (int i = 0; i < options.loose_keypoints; ++i) {
    const std::uint64_t look = (std::uint64_t{1} << 32) + 4096 * index + static_cast<std::uint64_t>(i);
    keypoints.add({synth::uniform(options.seed + 3, look) * mission.width,
                   (0.1 + 0.8 * synth::uniform(options.seed + 4, look)) * mission.height},
                  -1, look);
  }
  keypoints.store(result);
  return result;
}

json landmarks(const synth::Mission& mission, double scale) {
  struct Known {
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    std::int64_t first_keyframe = 0;
    int observers = 0;
  };
  std::map<std::int64_t, Known> known;
  for (const synth::Frame& frame : mission.frames) {
    for (const Landmark& landmark : frame.landmarks) {
      Known& entry = known[landmark.id];
      if (entry.observers++ == 0) {
        entry.position = landmark.position_world;
        entry.first_keyframe = frame.id;
      }
    }
  }
  json result = json::object();
  for (const auto& [id, entry] : known) {
    result[std::to_string(id)] = {{"pos_w", array_of(scale * entry.position)},
                                  {"1st_keyfrm", entry.first_keyframe},
                                  {"ref_keyfrm", entry.first_keyframe},
                                  {"n_vis", entry.observers},
                                  {"n_fnd", entry.observers}};
  }
  return result;
}

}  // namespace

std::vector<std::uint8_t> slam_map(const synth::Mission& mission, const SlamMapOptions& options) {
  json root;
  root["cameras"][kCamera] = camera(mission, options.fps);
  root["orb_params"][kOrb] = {
      {"name", kOrb}, {"scale_factor", 1.2F}, {"num_levels", 8}, {"ini_fast_threshold", 20}, {"min_fast_threshold", 7}};
  root["keyframes"] = json::object();
  for (std::size_t i = 0; i < mission.frames.size(); ++i) {
    root["keyframes"][std::to_string(mission.frames[i].id)] = keyframe(mission, i, options);
  }
  root["landmarks"] = landmarks(mission, options.scale);
  root["keyframe_next_id"] = mission.frames.empty() ? 0 : mission.frames.back().id + 1;
  root["landmark_next_id"] = mission.points.size();
  return json::to_msgpack(root);
}

}  // namespace pmsp::synth_tool
