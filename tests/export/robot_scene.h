// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <queue>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "pmsp/io/cloud.h"
#include "support/temp_dir.h"

namespace pmsp_test {

/// Boxes seen by panoramic cameras: z upwards, in metres.
struct RobotScene {
  std::vector<pmsp::Box> boxes;
  std::vector<Eigen::Vector3d> cameras;
  float confidence = 0.7F;

  void add(double x, double y, double z, double X, double Y, double Z) { boxes.push_back({{x, y, z}, {X, Y, Z}}); }

  /// Distance to the nearest box along a ray; infinity = none.
  double hit(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) const {
    double nearest = std::numeric_limits<double>::infinity();
    for (const pmsp::Box& box : boxes) {
      double enter = 0.0, leave = nearest;
      for (int i = 0; i < 3; ++i) {
        const double a = (box.low[i] - from[i]) / direction[i], b = (box.high[i] - from[i]) / direction[i];
        enter = std::max(enter, std::min(a, b));
        leave = std::min(leave, std::max(a, b));
      }
      if (enter > 0.0 && enter < leave) nearest = std::min(nearest, enter);
    }
    return nearest;
  }

  /// Camera with x to the right along x, y downwards, z forward along y.
  static pmsp::RigidTransform cam_from_world(const Eigen::Vector3d& camera) {
    pmsp::RigidTransform pose;
    pose.rotation << 1, 0, 0, 0, 0, -1, 0, 1, 0;
    pose.translation = -(pose.rotation * camera);
    return pose;
  }

  /// Points of a camera; the next keyframe sees those that nothing hides from it.
  pmsp::KeyframeCloud cloud(std::size_t index, int width = 720) const {
    pmsp::KeyframeCloud result;
    result.keyframe_id = static_cast<std::int64_t>(index);
    result.cam_from_world = cam_from_world(cameras[index]);
    const std::size_t other = (index + 1) % cameras.size();
    if (other != index) result.window_ids = {static_cast<std::int64_t>(other)};
    for (int row = 0; row < width / 2; ++row) {
      for (int column = 0; column < width; ++column) {
        const double lon = ((column + 0.5) / width - 0.5) * 2.0 * M_PI, lat = (0.5 - (row + 0.5) * 2.0 / width) * M_PI;
        const Eigen::Vector3d bearing(std::cos(lat) * std::sin(lon), -std::sin(lat), std::cos(lat) * std::cos(lon));
        const Eigen::Vector3d direction = result.cam_from_world.rotation.transpose() * bearing;
        const double range = hit(cameras[index], direction);
        if (!std::isfinite(range)) continue;
        pmsp::CloudPoint point;
        point.position = (range * bearing).cast<float>();
        point.confidence = confidence;
        const Eigen::Vector3d at = cameras[index] + range * direction, back = at - cameras[other];
        result.points.push_back(point);
        result.pixels.push_back(static_cast<std::uint32_t>(row * width + column));
        result.agree.push_back(hit(cameras[other], back.normalized()) > back.norm() - 0.01 ? 1U : 0U);
      }
    }
    return result;
  }

  /// Header with cells of 0.1 m, for a robot of 1 m.
  pmsp::CloudHeader header(const TempDir& dir) const {
    pmsp::CloudHeader header;
    header.generator = "a test";
    header.unit = {pmsp::CloudUnit::Kind::kMetres, "--scale"};
    header.scratch = dir.path();
    header.cell_size = 0.1;
    header.threads = 1;
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      header.cameras[static_cast<std::int64_t>(i)] = cam_from_world(cameras[i]).inverse();
    }
    return header;
  }

  /// Writes the maps of these names, and `more` points of the first camera's.
  void write(const pmsp::CloudHeader& header, const TempDir& dir, const std::vector<std::string>& names,
             const pmsp::CloudSelection& amount = {}, const std::vector<Eigen::Vector3d>& more = {}) const {
    std::vector<pmsp::CloudOutput::Target> targets;
    for (const std::string& name : names) targets.push_back({pmsp::cloud_format_of(name), dir / name});
    pmsp::CloudOutput output(header, amount, targets);
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      pmsp::KeyframeCloud points = cloud(i);
      for (const Eigen::Vector3d& at : more) {
        pmsp::CloudPoint point;
        point.position = (points.cam_from_world * at).cast<float>();
        point.confidence = 0.9F;
        points.points.push_back(point);
        points.pixels.push_back(0);
        points.agree.push_back(1);
      }
      output.add(points);
    }
    output.commit();
  }
};

/// A room of about 8 x 6 x 3 m with floor (-0.05), ceiling and walls, and two cameras in its left half. Surfaces lie in
/// the middle of cells.
inline RobotScene room() {
  RobotScene scene;
  scene.add(-4.3, -3.3, -0.35, 4.3, 3.3, -0.05);
  scene.add(-4.3, -3.3, 3.05, 4.3, 3.3, 3.35);
  scene.add(-4.35, -3.3, -0.05, -4.05, 3.3, 3.05);
  scene.add(4.05, -3.3, -0.05, 4.35, 3.3, 3.05);
  scene.add(-4.05, -3.35, -0.05, 4.05, -3.05, 3.05);
  scene.add(-4.05, 3.05, -0.05, 4.05, 3.35, 3.05);
  scene.cameras = {{-2.5, -0.7, 1.3}, {-2.2, 0.8, 1.4}};
  return scene;
}

/// Grid as a reader of Nav2 sees it: PGM and YAML.
class ReadGrid {
 public:
  explicit ReadGrid(const std::filesystem::path& yaml) {
    const std::string text = read_text(yaml);
    const auto value = [&text](const std::string& key) {
      const std::size_t at = text.find("\n" + key + ": ");
      const std::size_t begin = at + key.size() + 3;
      return at == std::string::npos ? std::string() : text.substr(begin, text.find('\n', begin) - begin);
    };
    const std::string name = value("image");
    image = cv::imread((yaml.parent_path() / name.substr(1, name.size() - 2)).string(), cv::IMREAD_UNCHANGED);
    mode = value("mode");
    cell = std::stod(value("resolution"));
    const std::string origin = value("origin");
    low_x = std::stod(origin.substr(1));
    low_y = std::stod(origin.substr(origin.find(',') + 1));
    negate = value("negate");
    occupied_thresh = std::stod(value("occupied_thresh"));
    free_thresh = std::stod(value("free_thresh"));
  }

  cv::Point pixel(double x, double y) const {
    return {static_cast<int>(std::floor((x - low_x) / cell)),
            image.rows - 1 - static_cast<int>(std::floor((y - low_y) / cell))};
  }
  bool is_inside(const cv::Point& at) const { return at.x >= 0 && at.y >= 0 && at.x < image.cols && at.y < image.rows; }
  int at(double x, double y) const { return is_inside(pixel(x, y)) ? image.at<unsigned char>(pixel(x, y)) : 205; }
  int count(int value, double x, double y, double X, double Y) const {
    int sum = 0;
    for (double v = y + 0.05; v < Y; v += 0.1) {
      for (double u = x + 0.05; u < X; u += 0.1) sum += at(u, v) == value;
    }
    return sum;
  }

  /// Whether a breadth-first search finds a path of free pixels.
  bool has_path(double x, double y, double X, double Y) const {
    const cv::Point from = pixel(x, y), to = pixel(X, Y);
    cv::Mat_<unsigned char> open(image.size());
    cv::compare(image, 254, open, cv::CMP_EQ);
    if (!is_inside(from) || !is_inside(to) || open(from) == 0) return false;
    std::queue<cv::Point> next;
    next.push(from);
    open(from) = 0;
    for (; !next.empty(); next.pop()) {
      if (next.front() == to) return true;
      for (const cv::Point& step : {cv::Point(1, 0), cv::Point(-1, 0), cv::Point(0, 1), cv::Point(0, -1)}) {
        const cv::Point at = next.front() + step;
        if (!is_inside(at) || open(at) == 0) continue;
        open(at) = 0;
        next.push(at);
      }
    }
    return false;
  }

  cv::Mat image;
  double cell = 0.0, low_x = 0.0, low_y = 0.0, occupied_thresh = 0.0, free_thresh = 0.0;
  std::string mode, negate;
};

}  // namespace pmsp_test
