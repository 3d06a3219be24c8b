// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/ground_truth.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <system_error>

#include "pmsp/error.h"
#include "pmsp/io/depth.h"
#include "util/number_from.h"
#include "util/numbered_name.h"

namespace pmsp::eval {
namespace {

namespace fs = std::filesystem;

/// Returns the number that a name begins with: 12 for "00012.exr" and "00012_depth.exr"; nullopt for other names.
std::optional<std::int64_t> frame_in_name(const fs::path& path) {
  const std::string stem = path.stem().string();
  const std::size_t end = std::min(stem.find('_'), stem.size());
  return number_from<std::int64_t>(digits_in_name(stem.substr(0, end), "", ""));
}

/// Returns the files of a folder with one of the endings, by frame; empty without such a folder.
std::map<std::int64_t, fs::path> list_frames(const fs::path& folder, const std::vector<std::string>& endings) {
  std::map<std::int64_t, fs::path> files;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const fs::path& path = it->path();
    if (std::find(endings.begin(), endings.end(), path.extension().string()) == endings.end()) continue;
    const auto frame = frame_in_name(path);
    if (!frame) continue;
    const auto [other, is_new] = files.emplace(*frame, path);
    if (!is_new) {
      throw InvalidInput(path.string() + ": frame " + std::to_string(*frame) + " has a second file, " +
                         other->second.filename().string() + "; expected one");
    }
  }
  return files;
}

std::vector<GroundTruth::RangeMap> list_range_maps(const fs::path& folder, double png_scale) {
  auto files = list_frames(folder / "range_mm", {".png"});
  double gray_m = 0.001;
  if (files.empty()) {
    files = list_frames(folder / "range", {".pfm", ".exr", ".npy", ".png"});
    gray_m = png_scale;
  }
  const auto normals = list_frames(folder / "normal", {".exr", ".pfm", ".png"});
  const auto labels = list_frames(folder / "label", {".png"});
  const auto path_of = [](const std::map<std::int64_t, fs::path>& listed, std::int64_t frame) {
    const auto found = listed.find(frame);
    return found == listed.end() ? fs::path() : found->second;
  };
  std::vector<GroundTruth::RangeMap> maps;
  for (const auto& [frame, path] : files) {
    maps.push_back({frame, -1, path, gray_m, path_of(normals, frame), path_of(labels, frame)});
  }
  return maps;
}

fs::path find_cloud(const fs::path& folder) {
  std::error_code ignored;
  for (const char* name : {"cloud.ply", "cloud.las"}) {
    if (fs::exists(folder / name, ignored)) return folder / name;
  }
  return {};
}

template <class T>
void check_panorama(const Image<T>& image, const fs::path& path, const char* what) {
  if (!image.empty() && image.width() == 2 * image.height()) return;
  throw InvalidInput(path.string() + ": the " + what + " has " + std::to_string(image.width()) + " x " +
                     std::to_string(image.height()) + " pixels, expected twice as wide as high");
}

Image<Eigen::Vector3f> read_exr_normals(const fs::path& path) {
  Image<Eigen::Vector3f> normals = read_exr_vectors(path, {"X", "Y", "Z"});
  if (!normals.empty()) return normals;
  throw InvalidInput(path.string() +
                     ": lacks one of the channels X, Y, Z, expected all, half or float: normals in the world of the "
                     "poses; write it again with these");
}

/// Gray levels of 16 bits times `gray_m`, 0 for saturated ones.
Image<float> read_png_range(const fs::path& path, double gray_m) {
  Image<float> range = read_png16(path, gray_m);
  const auto saturated = static_cast<float>(65534.5 * gray_m);
  for (float& value : range.pixels()) value = value < saturated ? value : 0.0F;
  return range;
}

int row_at(const std::vector<TimedPose>& trajectory, double time) {
  const auto nearer = [time](const TimedPose& a, const TimedPose& b) {
    return std::abs(a.timestamp - time) < std::abs(b.timestamp - time);
  };
  return static_cast<int>(std::min_element(trajectory.begin(), trajectory.end(), nearer) - trajectory.begin());
}

}  // namespace

std::vector<TimedPose> read_true_trajectory(const fs::path& folder) {
  if (!fs::is_directory(folder)) throw IoError(folder.string() + ": no such directory of ground truth");
  const fs::path path = folder / "traj_tum.txt";
  std::vector<TimedPose> trajectory = read_tum(path);
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    if (trajectory[i].timestamp < trajectory[i - 1].timestamp) {
      throw InvalidInput(path.string() + ": pose " + std::to_string(i) + " is earlier than the one before it");
    }
  }
  return trajectory;
}

GroundTruth::GroundTruth(const fs::path& folder, const TruthOptions& options)
    : trajectory_(options.poses != nullptr ? *options.poses : read_true_trajectory(folder)),
      range_maps_(list_range_maps(folder, options.png_scale)),
      cloud_(find_cloud(folder)) {
  if (range_maps_.empty() && cloud_.empty()) {
    throw InvalidInput(folder.string() +
                       ": no truth; expected range maps, range_mm/<frame>.png or range/<frame>.pfm, .exr, .npy, .png, "
                       "or scanned points, cloud.ply or cloud.las");
  }
  if (options.poses != nullptr) {
    place_by_id();
  } else {
    place_by_time(options.fps);
  }
  for (const TimedPose& pose : trajectory_) origin_ += pose.world_from_cam.translation;
  origin_ = (origin_ / static_cast<double>(trajectory_.size())).array().round();
}

void GroundTruth::place_by_time(double fps) {
  for (RangeMap& map : range_maps_) {
    const double time = static_cast<double>(map.frame) / fps;
    map.row = row_at(trajectory_, time);
    if (std::abs(trajectory_[static_cast<std::size_t>(map.row)].timestamp - time) > 0.5 / fps) {
      throw InvalidInput(map.path.string() + ": no true pose near " + std::to_string(time) + " s, where frame " +
                         std::to_string(map.frame) + " lies at " + std::to_string(fps) +
                         " frames per second; set --gt-fps to the rate that the frame numbers count in");
    }
  }
}

void GroundTruth::place_by_id() {
  for (RangeMap& map : range_maps_) {
    const auto pose =
        std::find_if(trajectory_.begin(), trajectory_.end(), [&](const TimedPose& p) { return p.id == map.frame; });
    if (pose == trajectory_.end()) {
      throw InvalidInput(map.path.string() + ": the map has no keyframe " + std::to_string(map.frame) +
                         "; with --map-is-truth range maps are named by keyframe id");
    }
    map.row = static_cast<int>(pose - trajectory_.begin());
  }
}

const GroundTruth::RangeMap* GroundTruth::find(int row) const {
  const auto it =
      std::find_if(range_maps_.begin(), range_maps_.end(), [row](const RangeMap& map) { return map.row == row; });
  return it == range_maps_.end() ? nullptr : &*it;
}

Image<float> GroundTruth::load(const RangeMap& map) {
  const std::string extension = map.path.extension().string();
  if (extension == ".png" && !(map.gray_m > 0.0)) {
    throw InvalidInput(map.path.string() + ": a PNG of range/ needs --gt-png-scale, the length of one gray level [m]");
  }
  Image<float> range = extension == ".pfm"   ? read_pfm(map.path)
                       : extension == ".exr" ? read_exr_depth(map.path)
                       : extension == ".npy" ? read_npy(map.path)
                                             : read_png_range(map.path, map.gray_m);
  check_panorama(range, map.path, "range map");
  return range;
}

Image<Eigen::Vector3f> GroundTruth::load_normals(const RangeMap& map) const {
  if (map.normal.empty()) return {};
  const std::string extension = map.normal.extension().string();
  Image<Eigen::Vector3f> normals = extension == ".exr"   ? read_exr_normals(map.normal)
                                   : extension == ".pfm" ? read_pfm3(map.normal)
                                                         : read_png16_normals(map.normal);
  check_panorama(normals, map.normal, "image of normals");
  const Eigen::Matrix3f cam_from_world =
      trajectory_[static_cast<std::size_t>(map.row)].world_from_cam.rotation.transpose().cast<float>();
  for (Eigen::Vector3f& normal : normals.pixels()) normal = cam_from_world * normal;
  return normals;
}

Image<std::uint8_t> GroundTruth::load_labels(const RangeMap& map) {
  if (map.label.empty()) return {};
  const Image<float> values = read_png16(map.label, 1.0);
  check_panorama(values, map.label, "label image");
  Image<std::uint8_t> labels(values.width(), values.height());
  std::transform(values.pixels().begin(), values.pixels().end(), labels.pixels().begin(),
                 [](float value) { return static_cast<std::uint8_t>(std::min(value, 255.0F)); });
  return labels;
}

}  // namespace pmsp::eval
