// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-synth/layouts.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "export/files.h"
#include "export/little_endian.h"
#include "io/image_decode.h"
#include "pmsp-synth/slam_map.h"
#include "pmsp/camera.h"
#include "pmsp/io/depth.h"
#include "util/numbered_name.h"

namespace pmsp::synth_tool {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

json rows_of(const Eigen::Matrix3d& m) {
  json rows = json::array();
  for (int i = 0; i < 3; ++i) rows.push_back({m(i, 0), m(i, 1), m(i, 2)});
  return rows;
}

std::string ply_of(const std::vector<Eigen::Vector3d>& points) {
  std::string text = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(points.size()) +
                     "\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
  for (const Eigen::Vector3d& point : points) {
    for (const double value : point) append_little(text, static_cast<float>(value));
  }
  return text;
}

// --- OB3D: cameras/, images/, depths/ (channel V), normals/ (X, Y, Z, of the world), sparse/

void write_ob3d(const synth::Mission& mission, const fs::path& folder) {
  constexpr float kNoSurface = 1e10F;  // Blender's distance of the sky
  for (const char* name : {"cameras", "images", "depths", "normals", "sparse"}) make_folder(folder / name);
  for (std::size_t i = 0; i < mission.frames.size(); ++i) {
    const synth::Frame& frame = mission.frames[i];
    const std::string number = format("%05zu", i);
    const Eigen::Vector3d& t = frame.cam_from_world.translation;
    const json camera = {
        {{"id", i},
         {"width", mission.width},
         {"height", mission.height},
         {"intrinsics", {{"focal", mission.height}, {"cx", mission.width / 2.0}, {"cy", mission.height / 2.0}}},
         {"extrinsics",
          {{"rotation", rows_of(frame.cam_from_world.rotation)}, {"translation", {t.x(), t.y(), t.z()}}}}}};
    write_file(folder / "cameras" / (number + "_cam.json"), camera.dump(4));
    write_image(folder / "images" / (number + "_rgb.png"), frame.image);
    Image<float> depth = frame.depth;
    for (float& value : depth.pixels()) value = value > 0.0F ? value : kNoSurface;
    write_exr(folder / "depths" / (number + "_depth.exr"), {{"V", std::move(depth)}});
    std::vector<ImageChannel> normals;
    const Eigen::Matrix3f world_from_cam = frame.cam_from_world.rotation.transpose().cast<float>();
    for (int axis = 0; axis < 3; ++axis) {
      normals.push_back({std::string(1, "XYZ"[axis]), Image<float>(mission.width, mission.height)});
      for (std::size_t k = 0; k < frame.normal.size(); ++k) {
        normals.back().values.pixels()[k] = world_from_cam.row(axis).dot(frame.normal.pixels()[k]);
      }
    }
    write_exr(folder / "normals" / (number + "_normal.exr"), std::move(normals));
  }
  std::vector<Eigen::Vector3d> points;
  for (const synth::SurfacePoint& point : mission.points) points.push_back(point.position_world);
  write_file(folder / "sparse" / "sparse.ply", ply_of(points));
}

// --- TartanAir V2 as packaged for COLMAP: images/, depth/ (1/8 m, min-pooled by 4, the sky saturated), poses.txt,
// scene.json

Image<float> min_pooled(const Image<float>& depth, int factor) {
  Image<float> pooled(depth.width() / factor, depth.height() / factor);
  for (int y = 0; y < pooled.height() * factor; ++y) {
    for (int x = 0; x < pooled.width() * factor; ++x) {
      float& least = pooled(x / factor, y / factor);
      if (depth(x, y) > 0.0F && (least == 0.0F || depth(x, y) < least)) least = depth(x, y);
    }
  }
  return pooled;
}

void write_tartanair(const synth::Mission& mission, const fs::path& folder) {
  constexpr int kFirstFrame = 120;
  constexpr int kPooled = 4;
  constexpr double kDepthScale = 8.0;
  constexpr int kJpegQuality = 97;
  Eigen::Matrix3d cam_from_body;  // the body's x is forward, y right, z down; the middle of its panoramas is its left
  cam_from_body << 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0;
  for (const char* name : {"images", "depth"}) make_folder(folder / name);
  std::string poses;
  json frames = json::array();
  for (std::size_t i = 0; i < mission.frames.size(); ++i) {
    const synth::Frame& frame = mission.frames[i];
    const std::int64_t number = kFirstFrame + static_cast<std::int64_t>(i);
    const std::string image = numbered_name("", number, ".jpg"), depth = numbered_name("", number, ".png");
    write_image(folder / "images" / image, frame.image, kJpegQuality);
    Image<float> pooled = min_pooled(frame.depth, kPooled);
    std::replace(pooled.pixels().begin(), pooled.pixels().end(), 0.0F, static_cast<float>(65535.0 / kDepthScale));
    write_png16(folder / "depth" / depth, pooled, kDepthScale);
    const Eigen::Vector3d p = frame.cam_from_world.center();
    const Eigen::Quaterniond q(frame.cam_from_world.rotation.transpose() * cam_from_body);
    poses += format("%lld %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n", static_cast<long long>(number), p.x(), p.y(), p.z(),
                    q.x(), q.y(), q.z(), q.w());
    frames.push_back({{"source_frame", number}, {"image_name", image}, {"depth_name", depth}});
  }
  write_file(folder / "poses.txt", poses);
  const json scene = {{"manifest_version", 1},
                      {"environment", "Synthetic"},
                      {"difficulty", "easy"},
                      {"trajectory", "P000"},
                      {"image_size", {mission.width, mission.height}},
                      {"depth_size", {mission.width / kPooled, mission.height / kPooled}},
                      {"depth_scale", kDepthScale},
                      {"depth_invalid_value", 0},
                      {"depth_downsampling", "min_pool"},
                      {"frames", frames}};
  write_file(folder / "scene.json", scene.dump(2));
}

// --- FIORD: images/, a model of COLMAP in sparse/, a scan in its frame, lidar.ply

std::string quaternion_first(const RigidTransform& pose) {
  const Eigen::Quaterniond q(pose.rotation);
  const Eigen::Vector3d& t = pose.translation;
  return format("%.12g %.12g %.12g %.12g %.12g %.12g %.12g", q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z());
}

void write_colmap(const synth::Mission& mission, const fs::path& folder, const std::vector<std::string>& images) {
  make_folder(folder);
  write_file(folder / "cameras.txt",
             format("1 EQUIRECTANGULAR %d %d %d %d\n", mission.width, mission.height, mission.width, mission.height));
  std::string text;
  std::map<std::int64_t, std::pair<Eigen::Vector3d, std::string>> points;  // position, track
  for (std::size_t i = 0; i < mission.frames.size(); ++i) {
    const synth::Frame& frame = mission.frames[i];
    text += format("%zu ", i + 1) + quaternion_first(frame.cam_from_world) + " 1 " + images[i] + "\n";
    for (std::size_t k = 0; k < frame.landmarks.size(); ++k) {
      const Landmark& landmark = frame.landmarks[k];
      const Eigen::Vector3d& seen = mission.points[static_cast<std::size_t>(landmark.id)].position_world;
      const Eigen::Vector2d pixel = pixel_from_bearing(frame.cam_from_world * seen, mission.width, mission.height);
      text += format("%s%.4f %.4f %lld", k > 0 ? " " : "", pixel.x(), pixel.y(), static_cast<long long>(landmark.id));
      auto& [position, track] = points[landmark.id];
      position = landmark.position_world;
      track += format(" %zu %zu", i + 1, k);
    }
    text += "\n";
  }
  write_file(folder / "images.txt", text);
  text.clear();
  for (const auto& [id, point] : points) {
    const auto& [p, track] = point;
    text +=
        format("%lld %.9g %.9g %.9g 128 128 128 0.5", static_cast<long long>(id), p.x(), p.y(), p.z()) + track + "\n";
  }
  write_file(folder / "points3D.txt", text);
}

void write_fiord(const synth::Mission& mission, const fs::path& folder) {
  constexpr int kJpegQuality = 95;
  make_folder(folder / "images");
  std::vector<std::string> images;
  for (std::size_t i = 0; i < mission.frames.size(); ++i) {
    images.push_back(numbered_name("", static_cast<std::int64_t>(i), ".jpg"));
    write_image(folder / "images" / images.back(), mission.frames[i].image, kJpegQuality);
  }
  write_colmap(mission, folder / "sparse", images);
  std::vector<Eigen::Vector3d> scan;
  for (const synth::Frame& frame : mission.frames) {  // scanned from the places of the images
    const RigidTransform world_from_cam = frame.cam_from_world.inverse();
    for (int y = 0; y < mission.height; ++y) {
      for (int x = 0; x < mission.width; ++x) {
        const double range = static_cast<double>(frame.depth(x, y));
        const Eigen::Vector3d bearing = bearing_from_pixel({x + 0.5, y + 0.5}, mission.width, mission.height);
        if (range > 0.0) scan.push_back(world_from_cam * (range * bearing));
      }
    }
  }
  write_file(folder / "lidar.ply", ply_of(scan));
}

// --- Hilti-Trimble: true poses, gt_poses.csv, and the map of a SLAM

void write_hilti(const synth::Mission& mission, const fs::path& folder, const SlamMapOptions& map) {
  make_folder(folder / "images");
  std::string poses = "# counter, sec, nsec, x, y, z, qx, qy, qz, qw\n";
  for (std::size_t i = 0; i < mission.frames.size(); ++i) {
    const synth::Frame& frame = mission.frames[i];
    write_image(folder / "images" / numbered_name("", static_cast<std::int64_t>(i), ".png"), frame.image);
    const Eigen::Vector3d p = frame.cam_from_world.center();
    const Eigen::Quaterniond q(frame.cam_from_world.rotation.transpose());
    const double whole = std::floor(frame.timestamp);
    poses += format("%zu, %.0f, %.0f, %.12g, %.12g, %.12g, %.12g, %.12g, %.12g, %.12g\n", i, whole,
                    std::round(1e9 * (frame.timestamp - whole)), p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w());
  }
  write_file(folder / "gt_poses.csv", poses);
  write_file(folder / "map.msg", slam_map(mission, map));
}

}  // namespace

std::vector<std::string> layout_names() { return {"ob3d", "tartanair", "fiord", "hilti-trimble"}; }

void write_layout(const std::string& layout, synth::Mission& mission, const MissionFilesOptions& options) {
  for (std::size_t i = 0; i < mission.frames.size(); ++i) {
    mission.frames[i].timestamp = static_cast<double>(i) * static_cast<double>(options.frame_step) / options.map.fps;
  }
  make_folder(options.folder);
  if (layout == "ob3d") write_ob3d(mission, options.folder);
  if (layout == "tartanair") write_tartanair(mission, options.folder);
  if (layout == "fiord") write_fiord(mission, options.folder);
  if (layout == "hilti-trimble") write_hilti(mission, options.folder, options.map);
}

}  // namespace pmsp::synth_tool
