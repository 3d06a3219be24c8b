// SPDX-License-Identifier: BSD-2-Clause
//
// A trajectory as the TUM RGB-D benchmark has it and stella_vslam (keyframe_trajectory.txt) and ORB-SLAM3 write it:
// "timestamp tx ty tz qx qy qz qw", world from camera. A list of images names the keyframes: lines "timestamp name", or
// "name" for each pose in turn. Poses are taken as they are, see docs/formats.md.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "map_file.h"
#include "map_scene.h"
#include "text_input.h"
#include "util/median_of.h"

namespace pmsp::map_detail {
namespace {

constexpr double kNanoseconds = 1e14;  ///< timestamps beyond are in 1e-9 s
constexpr std::size_t kWords = 8;

double seconds(double timestamp) { return std::abs(timestamp) > kNanoseconds ? 1e-9 * timestamp : timestamp; }

/// Whether the first line that says anything has eight numbers.
bool matches(MapFile& file) {
  if (!file.is_text() || file.head().empty()) return false;
  const std::string& head = file.head();
  for (std::size_t at = 0; at < head.size();) {
    const std::size_t end = std::min(head.find('\n', at), head.size());
    const std::string line = head.substr(at, end - at);
    at = end + 1;
    const std::size_t first = line.find_first_not_of(" \t\r");
    if (first == std::string::npos || line[first] == '#') continue;
    std::size_t words = 0;
    for (std::size_t begin = first; begin != std::string::npos; ++words) {
      const std::size_t stop = std::min(line.find_first_of(" \t\r,", begin), line.size());
      if (line.find_first_not_of("0123456789+-.eEnaifNAIF", begin) < stop) return false;
      begin = line.find_first_not_of(" \t\r,", stop);
    }
    return words == kWords;
  }
  return false;
}

struct NamedTime {
  double timestamp = 0.0;
  std::string name;
};

/// `timed`: receives whether the lines have timestamps.
std::vector<NamedTime> read_image_list(const std::filesystem::path& path, bool& timed) {
  TextInput in(path);
  std::vector<NamedTime> images;
  timed = false;
  while (in.next()) {
    const std::string first(in.word("the timestamp or name"));
    double timestamp = 0.0;
    const auto [end, error] = std::from_chars(first.data(), first.data() + first.size(), timestamp);
    const bool has_time =
        error == std::errc() && end == first.data() + first.size() && std::isfinite(timestamp) && !in.at_end();
    if (images.empty()) timed = has_time;
    if (timed != has_time) in.refuse("expected all lines alike, \"timestamp name\" or \"name\"");
    const std::string name = has_time ? in.rest("the name") : first;
    if (!in.at_end()) in.refuse("expected \"timestamp name\" or \"name\"");
    images.push_back({seconds(timestamp), image_name(name, path, in.here())});
  }
  if (images.empty()) fail(path, "", "names no image, expected lines \"timestamp name\" or \"name\"");
  if (timed) {
    std::stable_sort(images.begin(), images.end(),
                     [](const NamedTime& a, const NamedTime& b) { return a.timestamp < b.timestamp; });
  }
  return images;
}

/// Half the usual time from one image to the next: nobody's image is farther away.
double tolerance_of(const std::vector<NamedTime>& images) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < images.size(); ++i) steps.push_back(images[i].timestamp - images[i - 1].timestamp);
  if (steps.empty()) return 0.02;
  return 0.5 * median(steps);
}

void name_images(SlamMap& map, const std::filesystem::path& path) {
  bool timed = false;
  const std::vector<NamedTime> images = read_image_list(path, timed);
  if (!timed) {
    if (images.size() != map.keyframes.size()) {
      fail(path, "",
           "names " + std::to_string(images.size()) + " images without timestamps, the trajectory has " +
               std::to_string(map.keyframes.size()) + " poses; expected as many");
    }
    for (std::size_t i = 0; i < images.size(); ++i) map.keyframes[i].image = images[i].name;
    return;
  }
  const double tolerance = tolerance_of(images);
  std::vector<const MapKeyframe*> of_image(images.size(), nullptr);  // the pose nearest in time
  const auto away = [&](const MapKeyframe& keyframe, std::size_t i) {
    return std::abs(images[i].timestamp - keyframe.timestamp);
  };
  for (const MapKeyframe& keyframe : map.keyframes) {
    const auto next = std::lower_bound(images.begin(), images.end(), keyframe.timestamp,
                                       [](const NamedTime& image, double t) { return image.timestamp < t; });
    auto i = static_cast<std::size_t>(next - images.begin());
    if (i == images.size() || (i > 0 && away(keyframe, i - 1) < away(keyframe, i))) --i;
    const bool is_nearest = of_image[i] == nullptr || away(keyframe, i) < away(*of_image[i], i);
    if (is_nearest && away(keyframe, i) <= tolerance) of_image[i] = &keyframe;
  }
  std::vector<MapKeyframe> named;
  for (std::size_t i = 0; i < images.size(); ++i) {
    if (of_image[i] == nullptr) continue;
    named.push_back(*of_image[i]);
    named.back().image = images[i].name;
  }
  if (named.size() < map.keyframes.size()) {
    map.notes.push_back("poses left out, without an image in " + path.string() + " within " + shown(tolerance) +
                        " s: " + std::to_string(map.keyframes.size() - named.size()));
  }
  map.keyframes = std::move(named);
}

SlamMap read(MapFile& file, const ReadMapOptions& options) {
  SlamMap map;
  map.path = file.path();
  map.format = "TUM trajectory";
  map.ids_are_row_numbers = true;
  map.cameras.push_back(panorama_of_any_size());
  TextInput in(file.path());
  while (in.next()) {
    MapKeyframe keyframe;
    keyframe.timestamp = seconds(in.number("the timestamp"));
    Eigen::Vector3d center;
    for (double& value : center) value = in.number("the position");
    std::array<double, 4> xyzw{};
    for (double& value : xyzw) value = in.number("the quaternion");
    if (!in.at_end()) in.refuse("expected 8 numbers: timestamp tx ty tz qx qy qz qw");
    const Eigen::Matrix3d turn = rotation_from_quaternion(xyzw, map.path, in.here()).transpose();
    keyframe.cam_from_world = {turn, -(turn * center)};
    map.keyframes.push_back(std::move(keyframe));
  }
  std::stable_sort(map.keyframes.begin(), map.keyframes.end(),
                   [](const MapKeyframe& a, const MapKeyframe& b) { return a.timestamp < b.timestamp; });
  for (std::size_t i = 0; i < map.keyframes.size(); ++i) map.keyframes[i].id = static_cast<std::int64_t>(i);
  if (!options.image_list.empty()) name_images(map, options.image_list);
  return finish_scene(std::move(map));
}

}  // namespace

extern const MapFormat kTum;
const MapFormat kTum{"TUM", "a TUM trajectory", matches, read};

}  // namespace pmsp::map_detail
