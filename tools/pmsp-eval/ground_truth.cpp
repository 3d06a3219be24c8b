// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/ground_truth.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <system_error>

#include "pmsp-eval/depth_files.h"
#include "pmsp/error.h"
#include "pmsp/io/depth.h"

namespace pmsp::eval {
namespace {

namespace fs = std::filesystem;

std::vector<GroundTruth::RangeMap> list_range_maps(const fs::path& folder) {
  std::vector<GroundTruth::RangeMap> maps;
  for (const auto& [name, extension] : {std::pair{"range_mm", ".png"}, std::pair{"range", ".pfm"}}) {
    std::error_code error;
    for (fs::directory_iterator it(folder / name, error), end; !error && it != end; it.increment(error)) {
      const auto frame = number_in_name(it->path(), "", extension);
      if (frame) maps.push_back({*frame, -1, it->path()});
    }
    if (!maps.empty()) break;
  }
  std::sort(maps.begin(), maps.end(), [](const auto& a, const auto& b) { return a.frame < b.frame; });
  return maps;
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

GroundTruth::GroundTruth(const fs::path& folder, double fps)
    : trajectory_(read_true_trajectory(folder)), range_maps_(list_range_maps(folder)) {
  if (range_maps_.empty()) {
    throw InvalidInput(folder.string() + ": no range maps; expected range_mm/<frame>.png or range/<frame>.pfm");
  }
  for (RangeMap& map : range_maps_) {
    const double time = static_cast<double>(map.frame) / fps;
    map.row = row_at(trajectory_, time);
    if (std::abs(trajectory_[static_cast<std::size_t>(map.row)].timestamp - time) > 0.5 / fps) {
      throw InvalidInput(map.path.string() + ": no true pose near " + std::to_string(time) + " s, where frame " +
                         std::to_string(map.frame) + " lies at " + std::to_string(fps) +
                         " frames per second; set --gt-fps to the rate that the frame numbers count in");
    }
  }
  for (const TimedPose& pose : trajectory_) origin_ += pose.world_from_cam.translation;
  origin_ = (origin_ / static_cast<double>(trajectory_.size())).array().round();
}

const GroundTruth::RangeMap* GroundTruth::find(int row) const {
  const auto it =
      std::find_if(range_maps_.begin(), range_maps_.end(), [row](const RangeMap& map) { return map.row == row; });
  return it == range_maps_.end() ? nullptr : &*it;
}

Image<float> GroundTruth::load(const RangeMap& map) {
  Image<float> range = map.path.extension() == ".pfm" ? read_pfm(map.path) : read_png16(map.path, 0.001);
  if (range.empty() || range.width() != 2 * range.height()) {
    throw InvalidInput(map.path.string() + ": the range map has " + std::to_string(range.width()) + " x " +
                       std::to_string(range.height()) + " pixels, expected twice as wide as high");
  }
  return range;
}

Image<std::uint8_t> GroundTruth::load_labels(const RangeMap& map) {
  const fs::path path = map.path.parent_path().parent_path() / "label" / (map.path.stem().string() + ".png");
  if (!fs::exists(path)) return {};
  const Image<float> values = read_png16(path, 1.0);
  if (values.empty() || values.width() != 2 * values.height()) {
    throw InvalidInput(path.string() + ": the label image has " + std::to_string(values.width()) + " x " +
                       std::to_string(values.height()) + " pixels, expected twice as wide as high");
  }
  Image<std::uint8_t> labels(values.width(), values.height());
  std::transform(values.pixels().begin(), values.pixels().end(), labels.pixels().begin(),
                 [](float value) { return static_cast<std::uint8_t>(std::min(value, 255.0F)); });
  return labels;
}

}  // namespace pmsp::eval
