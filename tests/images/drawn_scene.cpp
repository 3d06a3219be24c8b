// SPDX-License-Identifier: BSD-2-Clause
#include "drawn_scene.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <random>
#include <stdexcept>

#include "pmsp/camera.h"

namespace pmsp::test {
namespace {

const Eigen::Vector3d kRoomHalf(2.5, 1.5, 2.0);
constexpr double kTextureCell = 0.2;
constexpr int kLandmarks = 250;
constexpr int kGrayStep = 5;

RigidTransform cam_from_world_at(int frame) {
  // Faster as it goes, and turning, so that no two pairs of frames are alike.
  const double t = frame;
  const double yaw = 0.03 * t;
  RigidTransform pose;
  pose.rotation << std::cos(yaw), 0.0, -std::sin(yaw), 0.0, 1.0, 0.0, std::sin(yaw), 0.0, std::cos(yaw);
  const Eigen::Vector3d centre(-1.5 + 0.06 * t + 0.0015 * t * t, 0.3 * std::sin(0.3 * t), 0.6 * std::cos(0.2 * t));
  pose.translation = -(pose.rotation * centre);
  return pose;
}

/// Where a ray from inside the room meets its walls.
Eigen::Vector3d hit_wall(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  double nearest = 1e9;
  for (int axis = 0; axis < 3; ++axis) {
    if (std::abs(direction[axis]) < 1e-12) continue;
    nearest = std::min(nearest, (std::copysign(kRoomHalf[axis], direction[axis]) - from[axis]) / direction[axis]);
  }
  return from + nearest * direction;
}

double lattice_value(std::int64_t x, std::int64_t y, std::int64_t z) {
  auto h = static_cast<std::uint64_t>(x * 73856093 ^ y * 19349663 ^ z * 83492791);
  h = (h ^ (h >> 31U)) * 0x9E3779B97F4A7C15ULL;
  h = (h ^ (h >> 29U)) * 0xBF58476D1CE4E5B9ULL;
  return static_cast<double>(h >> 40U) / static_cast<double>(1U << 24U);
}

double texture(const Eigen::Vector3d& point) {
  const Eigen::Vector3d p = point / kTextureCell;
  const Eigen::Vector3d floor = p.array().floor();
  const Eigen::Vector3d a = p - floor;
  double value = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    const int dx = corner & 1;
    const int dy = (corner >> 1) & 1;
    const int dz = corner >> 2;
    const double weight = (dx ? a.x() : 1.0 - a.x()) * (dy ? a.y() : 1.0 - a.y()) * (dz ? a.z() : 1.0 - a.z());
    value +=
        weight * lattice_value(std::lround(floor.x()) + dx, std::lround(floor.y()) + dy, std::lround(floor.z()) + dz);
  }
  return value;
}

SlamMap map_with_camera(int width, const std::vector<Shot>& shots) {
  SlamMap map;
  map.path = "hand-made.msg";
  map.cameras.push_back({"test camera", width, width / 2, 10.0});
  for (const Shot& shot : shots) {
    MapKeyframe keyframe;
    keyframe.id = shot.id;
    keyframe.timestamp = shot.timestamp;
    keyframe.cam_from_world = cam_from_world_at(shot.frame);
    map.keyframes.push_back(keyframe);
  }
  return map;
}

}  // namespace

SlamMap bare_map(const std::vector<Shot>& shots) { return map_with_camera(64, shots); }

void write_gray_frame(const std::filesystem::path& path, int frame) {
  if (!cv::imwrite(path.string(), cv::Mat(32, 64, CV_8UC3, cv::Scalar::all(kGrayStep * frame))))
    throw std::runtime_error("cannot write " + path.string());
}

int gray_frame(const Image<Rgb>& image) {
  return static_cast<int>(std::lround(image(image.width() / 2, image.height() / 2).g / static_cast<double>(kGrayStep)));
}

Image<Rgb> render_room(int frame, int width, double tile) {
  Image<Rgb> image(width, width / 2);
  const RigidTransform world_from_cam = cam_from_world_at(frame).inverse();
  for (int y = 0; y < image.height(); ++y)
    for (int x = 0; x < width; ++x) {
      const Eigen::Vector3d bearing = bearing_from_pixel({x + 0.5, y + 0.5}, width, width / 2);
      Eigen::Vector3d point = hit_wall(world_from_cam.translation, world_from_cam.rotation * bearing);
      if (tile > 0.0) point -= tile * (point / tile).array().floor().matrix();
      const double v = texture(point);
      const auto level = [v](double from, double to) { return static_cast<std::uint8_t>(from + (to - from) * v); };
      image(x, y) = {level(20, 230), level(40, 200), level(90, 120)};
    }
  return image;
}

cv::Mat bgr_of(const Image<Rgb>& image) {
  cv::Mat bgr(image.height(), image.width(), CV_8UC3);
  for (int y = 0; y < image.height(); ++y)
    for (int x = 0; x < image.width(); ++x) bgr.at<cv::Vec3b>(y, x) = {image(x, y).b, image(x, y).g, image(x, y).r};
  return bgr;
}

void write_image(const std::filesystem::path& path, const Image<Rgb>& image) {
  if (!cv::imwrite(path.string(), bgr_of(image))) throw std::runtime_error("cannot write " + path.string());
}

SlamMap room_map(const std::vector<Shot>& shots) {
  SlamMap map = map_with_camera(kRoomWidth, shots);
  std::mt19937 random(7);
  std::normal_distribution<double> gauss;
  for (int i = 0; i < kLandmarks; ++i) {
    const Eigen::Vector3d direction{gauss(random), gauss(random), gauss(random)};
    map.landmarks.push_back({10 + 3 * i, hit_wall(Eigen::Vector3d::Zero(), direction.normalized())});
  }
  for (MapKeyframe& keyframe : map.keyframes)
    for (const MapLandmark& landmark : map.landmarks) {
      const Eigen::Vector2d pixel =
          pixel_from_bearing(keyframe.cam_from_world * landmark.position_world, kRoomWidth, kRoomWidth / 2);
      keyframe.observations.push_back({landmark.id, pixel.cast<float>()});
    }
  return map;
}

Drained drain(ImageSource& source) {
  Drained drained;
  while (auto item = source.next()) {
    drained.ids.push_back(item->keyframe_id);
    drained.frames.push_back(gray_frame(item->image));
  }
  return drained;
}

void add_xmp(const std::filesystem::path& path, const std::string& xmp) {
  std::string bytes = pmsp_test::read_text(path);
  const std::string data = "http://ns.adobe.com/xap/1.0/" + std::string(1, '\0') + "<x:xmpmeta>" + xmp + "</x:xmpmeta>";
  const std::size_t size = data.size() + 2;
  bytes.insert(2, "\xFF\xE1" + std::string{static_cast<char>(size >> 8U), static_cast<char>(size & 255U)} + data);
  pmsp_test::write_text(path, bytes);
}

std::string skip_reason(const ImageSource& source, std::int64_t id) {
  for (const SkippedKeyframe& skipped : source.skipped())
    if (skipped.keyframe_id == id) return skipped.reason;
  return {};
}

}  // namespace pmsp::test
