// SPDX-License-Identifier: BSD-2-Clause
//
// Results of ViPE (github.com/nv-tlabs/vipe, vipe/utils/io.py) for a panoramic video NAME:
// - pose/NAME.npz: data, N x 4 x 4, world from camera in OpenCV's axes; inds, frame of each;
// - intrinsics/NAME_camera.txt: lines "FRAME: PANORAMA"; rgb/NAME.mp4: the frames;
// - depth/NAME.zip: FRAME.exr of five digits, distance along the ray in the unit of the poses, 0 = none;
// - mask/NAME.zip: FRAME.png, ids of moving objects, 0 = none.
// The middle of the image looks along +z; latitude and longitude end at the centres of the outermost pixels.
#include <algorithm>
#include <filesystem>
#include <set>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "export/files.h"
#include "map_file.h"
#include "map_scene.h"
#include "npy.h"
#include "text_input.h"
#include "util/text.h"
#include "zip_member.h"

namespace pmsp::map_detail {
namespace {

namespace fs = std::filesystem;

constexpr const char* kPoseEnding = ".npz";

bool is_pose_file(const fs::path& path) {
  return path.extension() == kPoseEnding && fs::absolute(path).parent_path().filename() == "pose";
}

/// Pose files of the videos in a directory of results.
std::set<fs::path> pose_files(const fs::path& folder) {
  std::set<fs::path> files;
  std::error_code error;
  for (fs::directory_iterator it(folder / "pose", error), end; !error && it != end; it.increment(error)) {
    if (is_pose_file(it->path())) files.insert(it->path());
  }
  return files;
}

bool is_vipe(MapFile& file) {
  return file.is_folder() ? !pose_files(file.path()).empty()
                          : is_pose_file(file.path()) && file.head().compare(0, 2, "PK") == 0;
}

/// Frames whose camera is a panorama.
std::set<std::int64_t> panorama_frames(const fs::path& path) {
  if (!is_file(path)) {
    fail(path, "", "there is no such file; expected the cameras of the frames, which ViPE writes beside the poses");
  }
  std::set<std::int64_t> frames;
  TextInput in(path, ':');
  while (in.next()) {
    const auto frame = in.number<std::int64_t>("the frame");
    const std::string camera = in.rest("the camera");
    if (camera.find_first_not_of(' ') == camera.find("PANORAMA")) frames.insert(frame);
  }
  return frames;
}

/// Sets a path of each keyframe whose frame is in an archive, if that exists. Returns their number.
std::size_t name_members(SlamMap& map, const fs::path& archive, const char* ending, fs::path MapKeyframe::*field) {
  if (!is_file(archive)) return 0;
  const std::set<std::string> members = io::zip_members(archive);
  std::size_t count = 0;
  for (MapKeyframe& keyframe : map.keyframes) {
    const std::string name = format("%05lld", static_cast<long long>(keyframe.id)) + ending;
    if (members.count(name) == 0) continue;
    keyframe.*field = archive / name;
    ++count;
  }
  if (count > 0) return count;
  fail(archive, "",
       "holds none of the " + std::to_string(map.keyframes.size()) + " frames of " + map.path.string() +
           ", expected members such as 00000" + ending + "; it may be of another video");
}

SlamMap read_vipe(MapFile& file, const ReadMapOptions& /*options*/) {
  SlamMap map;
  map.path = file.path();
  if (file.is_folder()) {
    const std::set<fs::path> files = pose_files(file.path());
    map.path = *files.begin();
    if (files.size() > 1) {
      fail(file.path(), "",
           "holds results of " + std::to_string(files.size()) +
               " videos, expected one; give the poses of one, such as " + map.path.string());
    }
  }
  map.format = "ViPE";
  map.cameras = {equirectangular_camera_of_unknown_size()};
  const fs::path folder = fs::absolute(map.path).parent_path().parent_path();
  const std::string name = map.path.stem().string();
  const NpyArray poses = read_npy_array(map.path / "data.npy");
  const NpyArray frames = read_npy_array(map.path / "inds.npy");
  const auto count = static_cast<std::int64_t>(frames.values.size());
  if (poses.sides != std::vector<std::int64_t>{count, 4, 4}) {
    fail(map.path, "data.npy",
         "has " + std::to_string(poses.values.size()) + " numbers, expected a 4 x 4 matrix for each of the " +
             std::to_string(count) + " frames in inds.npy");
  }
  const std::set<std::int64_t> panoramas = panorama_frames(folder / "intrinsics" / (name + "_camera.txt"));
  std::size_t others = 0;
  for (std::size_t i = 0; i < frames.values.size(); ++i) {
    if (!(frames.values[i] >= 0.0 && frames.values[i] < 1e9)) {
      fail(map.path, "inds.npy", "contains " + to_message(frames.values[i]) + ", expected numbers of frames, from 0");
    }
    MapKeyframe keyframe;
    keyframe.id = static_cast<std::int64_t>(frames.values[i]);
    keyframe.source_frame = keyframe.id;
    if (panoramas.count(keyframe.id) == 0) {
      ++others;
      continue;
    }
    using Matrix = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
    const Eigen::Map<const Matrix> world_from_camera(poses.values.data() + 16 * i);
    const Eigen::Matrix3d rotation = rotation_from_matrix(world_from_camera.topLeftCorner<3, 3>().transpose(), map.path,
                                                          "data.npy: frame " + std::to_string(keyframe.id));
    keyframe.cam_from_world = {rotation, -(rotation * world_from_camera.topRightCorner<3, 1>())};
    map.keyframes.push_back(std::move(keyframe));
  }
  note_others(map, "frames left out, of other cameras than PANORAMA", others);
  map = finalize_map(std::move(map));
  const fs::path video = folder / "rgb" / (name + ".mp4");
  if (is_file(video)) map.images = video;
  const std::size_t depths = name_members(map, folder / "depth" / (name + ".zip"), ".exr", &MapKeyframe::prior_depth);
  map.masks_are_instances = name_members(map, folder / "mask" / (name + ".zip"), ".png", &MapKeyframe::mask) > 0;
  if (depths == 0) {
    map.notes.push_back(
        "there is no depth/" + name +
        ".zip, so that no prior depth is used; ViPE writes it with pipeline.post.depth_align_model=dap");
  }
  return map;
}

}  // namespace

extern const MapFormat kVipe;
const MapFormat kVipe{"ViPE", "results of ViPE for a panoramic video (directory with pose/)", is_vipe, read_vipe};

}  // namespace pmsp::map_detail
