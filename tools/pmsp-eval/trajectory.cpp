// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/trajectory.h"

#include <iomanip>
#include <sstream>

#include <Eigen/Geometry>

#include "export/files.h"
#include "pmsp/io/map.h"

namespace pmsp::eval {

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

std::vector<TimedPose> read_trajectory(const std::filesystem::path& path) {
  const SlamMap map = read_map(path);
  std::vector<TimedPose> poses;
  poses.reserve(map.keyframes.size());
  for (const MapKeyframe& keyframe : map.keyframes) {
    poses.push_back({keyframe.id, keyframe.timestamp, keyframe.cam_from_world.inverse()});
  }
  return poses;
}

}  // namespace pmsp::eval
