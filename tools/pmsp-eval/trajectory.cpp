// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/trajectory.h"

#include <array>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <sstream>
#include <string>

#include <Eigen/Geometry>

#include "export/files.h"
#include "pmsp/error.h"

namespace pmsp::eval {
namespace {

TimedPose parse_line(const std::string& line, const std::string& where) {
  std::istringstream stream(line);
  std::array<double, 8> v{};
  for (double& value : v) {
    if (!(stream >> value) || !std::isfinite(value)) {
      throw InvalidInput(where + ": expected eight numbers, timestamp tx ty tz qx qy qz qw");
    }
  }
  const Eigen::Quaterniond q(v[7], v[4], v[5], v[6]);
  if (std::abs(q.norm() - 1.0) > 0.01) {
    throw InvalidInput(where + ": the quaternion has length " + std::to_string(q.norm()) + ", expected 1");
  }
  return {0, v[0], {q.normalized().toRotationMatrix(), {v[1], v[2], v[3]}}};
}

}  // namespace

std::vector<TimedPose> read_tum(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) throw IoError(path.string() + ": cannot open the trajectory");
  std::vector<TimedPose> poses;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    const std::size_t first = line.find_first_not_of(" \t\r");
    if (first == std::string::npos || line[first] == '#') continue;
    poses.push_back(parse_line(line, path.string() + ":" + std::to_string(number)));
    poses.back().id = static_cast<std::int64_t>(poses.size()) - 1;
  }
  if (file.bad()) throw IoError(path.string() + ": reading the trajectory failed");
  if (poses.empty()) throw InvalidInput(path.string() + ": the trajectory holds no pose");
  return poses;
}

void write_tum(const std::filesystem::path& path, const std::vector<TimedPose>& trajectory) {
  std::ostringstream text;
  text << "# timestamp tx ty tz qx qy qz qw (camera to world)\n";
  for (const TimedPose& pose : trajectory) {
    const Eigen::Quaterniond q(pose.world_from_cam.rotation);
    const Eigen::Vector3d& t = pose.world_from_cam.translation;
    text << std::fixed << std::setprecision(9) << pose.timestamp << std::defaultfloat << std::setprecision(15);
    for (const double value : {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}) text << ' ' << value + 0.0;  // no -0
    text << '\n';
  }
  write_file(path, text.str());
}

std::vector<TimedPose> trajectory_of(const SlamMap& map) {
  std::vector<TimedPose> poses;
  poses.reserve(map.keyframes.size());
  for (const MapKeyframe& keyframe : map.keyframes) {
    poses.push_back({keyframe.id, keyframe.timestamp, keyframe.cam_from_world.inverse()});
  }
  return poses;
}

}  // namespace pmsp::eval
