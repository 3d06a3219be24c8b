// SPDX-License-Identifier: BSD-2-Clause
#include "export/robot_map.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <unordered_set>
#include <utility>

#include "elementary.h"
#include "export/floor_grid.h"
#include "export/grid_files.h"
#include "export/octomap.h"
#include "export/spool.h"
#include "export/voxel_map.h"
#include "pmsp/camera.h"
#include "pmsp/error.h"
#include "util/median_of.h"
#include "util/text.h"
#include "util/thread_pool.h"

namespace pmsp {
namespace {

/// Ray from a camera to a cell.
struct MapRay {
  std::uint64_t cell;    ///< packed
  std::uint32_t camera;  ///< index
  std::uint32_t unused = 0;

  bool operator<(const MapRay& other) const { return std::pair(camera, cell) < std::pair(other.camera, other.cell); }
  bool operator==(const MapRay& other) const { return camera == other.camera && cell == other.cell; }
};

/// Cell with points of the current keyframe, and the keyframes of the window that see them.
struct SeenCell {
  std::uint64_t cell;
  std::uint32_t agree;
};

VoxelMap::Options voxel_options(const CloudHeader& header, const std::optional<Box>& box) {
  VoxelMap::Options options;
  options.cell = header.cell_size;
  options.least_rays = header.least_rays;
  options.box = box;
  options.most_bytes = kMostMapBytes;
  return options;
}

/// Throws InvalidInput if the mean up axis of the cameras is far from z.
void require_upright(const std::string& path, const CloudHeader& header) {
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const auto& [id, pose] : header.cameras) up -= pose.rotation.col(1);
  constexpr double kMostTilt_deg = 30.0;
  if (up.norm() > 0.0 && up.normalized().z() >= std::cos(kMostTilt_deg * kernels::kDegree)) return;
  throw InvalidInput(path + ": z of the cloud is more than 30 degrees from the cameras' mean vertical axis, but the " +
                     "grid of a floor needs z upwards; give --up, --align or --transform");
}

class RobotMap final : public CloudWriter {
 public:
  RobotMap(const std::vector<CloudOutput::Target>& targets, const CloudHeader& header, const std::optional<Box>& box)
      : targets_(targets), header_(header), map_(voxel_options(header, box)), rays_(header.scratch.string(), kLists) {
    for (const auto& [id, pose] : header.cameras) {
      indices_[id] = static_cast<std::uint32_t>(cameras_.size());
      cameras_.push_back(pose.translation);
    }
    for (const CloudOutput::Target& target : targets_) check(target, box.has_value());
  }

  void set_window(std::int64_t keyframe_id, const std::vector<std::int64_t>& window_ids) override {
    flush();
    keyframe_ = index_of(keyframe_id);
    window_.clear();
    for (const std::int64_t id : window_ids) window_.push_back(index_of(id));
  }

  void add(const OutputPoint* points, std::size_t count) override {
    if (keyframe_ == kNone || !failure_.empty()) return;
    try {
      for (const OutputPoint* point = points; point != points + count; ++point) {
        ++points_;
        if ((point->position - cameras_[keyframe_]).norm() > range()) {
          ++far_points_;
          continue;
        }
        const CellIndex cell = map_.index_of(point->position);
        map_.add_point(cell, point->confidence);
        seen_.push_back({packed(cell), point->agree});
      }
    } catch (const InvalidInput& error) {
      failure_ = error.what();
      return;
    }
    if (seen_.size() <= kMostSeen) return;
    merge();
    if (seen_.size() > kMostSeen / 2) flush();
  }

  void finish() override {
    if (static_cast<double>(far_points_) > kMostFar * static_cast<double>(points_)) {
      failure_ = "the maps for robots lack " + std::to_string(far_points_) + " of " + std::to_string(points_) +
                 " points, which are more than " + number_text(VoxelMap::kRange) + " cells of " +
                 number_text(map_.cell()) + " from their keyframes; give a larger --cell-size";
    }
    if (!failure_.empty()) throw InvalidInput(failure_);
    flush();
    trace();
    for (const CloudOutput::Target& target : targets_) {
      try {
        write(target);
      } catch (const InvalidInput& error) {
        if (failure_.empty()) failure_ = target.path.string() + ": " + error.what();
      }
    }
    if (!failure_.empty()) throw InvalidInput(failure_);
  }

 private:
  static constexpr std::size_t kLists = 256;
  static constexpr std::size_t kMostSeen = std::size_t{1} << 20;
  static constexpr std::size_t kRaysOfTask = 4096;
  static constexpr std::uint32_t kNone = UINT32_MAX;
  static constexpr double kMostFar = 0.1;  ///< share of points out of range

  double range() const { return VoxelMap::kRange * map_.cell(); }

  std::uint32_t index_of(std::int64_t keyframe_id) const {
    const auto found = indices_.find(keyframe_id);
    return found != indices_.end() ? found->second : kNone;
  }

  void write(const CloudOutput::Target& target) const {
    const std::string name = target.format->name;
    if (name == "pgm") {
      const FloorRobot robot{header_.robot_height, header_.robot_step, header_.robot_slope_deg};
      write_grid(target.path, header_, FloorGrid(map_, cameras_, robot));
    } else {
      write_octomap(target.path, map_, name == "bt", {origin_of_map(header_)});
    }
  }

  void check(const CloudOutput::Target& target, bool is_cropped) const {
    const std::string path = target.path.string();
    if (!(header_.cell_size > 0.0)) throw InvalidInput(path + ": the size of its cells is unknown; give --cell-size");
    if (header_.unit.kind != CloudUnit::Kind::kMetres && !header_.map_units) {
      throw InvalidInput(path + ": the lengths of this map would be no metres, since no scale is known; give --scale " +
                         "(1 if the map is in metres) or --align, or accept map units with --map-units");
    }
    if (header_.cameras.empty()) {
      throw InvalidInput(path + ": a map needs the positions of the cameras; write it in a run, or from a workspace");
    }
    if (target.format->name == std::string("pgm")) {
      require_upright(path, header_);
      if (header_.robot_step < (1.0 - 1e-6) * header_.cell_size) {
        throw InvalidInput(path + ": the robot's step " + number_text(header_.robot_step) + " is less than a cell of " +
                           number_text(header_.cell_size) + "; give a smaller --cell-size or a larger --robot-step");
      }
    }
    for (const Eigen::Vector3d& camera : cameras_) {
      const CellIndex cell = map_.index_of(camera);
      if (!is_cropped && target.format->name != std::string("pgm")) require_octomap_range(map_, cell);
    }
  }

  /// Joins the entries of equal cells.
  void merge() {
    std::sort(seen_.begin(), seen_.end(), [](const SeenCell& a, const SeenCell& b) { return a.cell < b.cell; });
    std::size_t last = 0;
    for (std::size_t i = 1; i < seen_.size(); ++i) {
      if (seen_[i].cell == seen_[last].cell) {
        seen_[last].agree |= seen_[i].agree;
      } else {
        seen_[++last] = seen_[i];
      }
    }
    if (!seen_.empty()) seen_.resize(last + 1);
  }

  /// Spills the rays of the current keyframe's points.
  void flush() {
    merge();
    const auto put = [this](std::uint64_t cell, std::uint32_t camera) {
      if (camera != kNone) rays_.add(camera % kLists, {cell, camera});
    };
    for (const SeenCell& it : seen_) {
      put(it.cell, keyframe_);
      for (std::size_t k = 0; k < window_.size() && k < 32; ++k) {
        if ((it.agree >> k & 1U) != 0) put(it.cell, window_[k]);
      }
    }
    seen_.clear();
  }

  /// One ray for each camera and occupied cell.
  void trace() {
    ThreadPool pool(header_.threads);
    for (std::size_t list = 0; list < kLists; ++list) {
      std::vector<MapRay> all;
      rays_.read(list, [&all](const MapRay* rays, std::size_t count) { all.insert(all.end(), rays, rays + count); });
      rays_.drop(list);
      std::sort(all.begin(), all.end());
      all.erase(std::unique(all.begin(), all.end()), all.end());
      pool.for_each(static_cast<int>((all.size() + kRaysOfTask - 1) / kRaysOfTask), [&](int task) {
        VoxelMap::Rays rays(map_);
        const std::size_t first = static_cast<std::size_t>(task) * kRaysOfTask;
        for (std::size_t i = first; i < std::min(first + kRaysOfTask, all.size()); ++i) {
          const CellIndex end = unpacked(all[i].cell);
          const Eigen::Vector3d& camera = cameras_[all[i].camera];
          if ((map_.center_of(end) - camera).norm() <= range()) rays.add(camera, end);
        }
      });
    }
  }

  std::vector<CloudOutput::Target> targets_;
  CloudHeader header_;
  VoxelMap map_;
  std::vector<Eigen::Vector3d> cameras_;
  std::map<std::int64_t, std::uint32_t> indices_;  ///< into `cameras_`, by keyframe id
  Spool<MapRay> rays_;
  std::uint32_t keyframe_ = kNone;
  std::vector<std::uint32_t> window_;
  std::vector<SeenCell> seen_;
  std::size_t points_ = 0, far_points_ = 0;
  std::string failure_;  ///< why there are no maps; "" = there are
};

}  // namespace

std::unique_ptr<CloudWriter> open_robot_map(const std::vector<CloudOutput::Target>& targets, const CloudHeader& header,
                                            const std::optional<Box>& box) {
  return std::make_unique<RobotMap>(targets, header, box);
}

std::unique_ptr<CloudWriter> open_bt(const std::filesystem::path& path, const CloudHeader& header) {
  return open_robot_map({{find_cloud_format("bt"), path}}, header, {});
}

std::unique_ptr<CloudWriter> open_ot(const std::filesystem::path& path, const CloudHeader& header) {
  return open_robot_map({{find_cloud_format("ot"), path}}, header, {});
}

std::unique_ptr<CloudWriter> open_pgm(const std::filesystem::path& path, const CloudHeader& header) {
  return open_robot_map({{find_cloud_format("pgm"), path}}, header, {});
}

double default_cell_size(std::vector<double> ranges, int width) {
  if (ranges.empty() || width <= 0) return 0.0;
  const double least = 1.5 * (2.0 * kernels::kPi / width) * median(ranges);
  if (!(least > 0.0)) return 0.0;
  const double power = std::pow(10.0, std::floor(std::log10(least)));
  for (const double digit : {1.0, 2.0, 5.0}) {
    if (digit * power >= least) return digit * power;
  }
  return 10.0 * power;
}

std::vector<double> landmark_ranges(const SlamMap& map) {
  std::vector<double> ranges;
  for (const MapKeyframe& in_map : map.keyframes) {
    const Keyframe keyframe = keyframe_of(map, in_map);
    for (const Landmark& landmark : keyframe.landmarks) {
      ranges.push_back((keyframe.cam_from_world * landmark.position_world).norm());
    }
  }
  return ranges;
}

double expected_map_bytes(const SlamMap& map, const CloudHeader& header, const std::optional<Box>& box) {
  constexpr int kColumns = 32;        // directions around a camera
  constexpr double kFarthest = 0.01;  // share of landmarks beyond each side of the box
  constexpr std::size_t kMostCameras = 100;
  std::vector<double> ranges = landmark_ranges(map);
  if (ranges.empty()) return 0.0;
  const double block = header.cell_size * VoxelBlock::kSide;
  const double side = std::max(block, header.file_from_map.scale * median(ranges) * 2.0 * kernels::kPi / kColumns);
  Box most;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    std::vector<double> at;
    for (const MapLandmark& it : map.landmarks) at.push_back((header.file_from_map * it.position_world)[axis]);
    std::sort(at.begin(), at.end());
    const auto last = static_cast<double>(at.size() - 1);
    most.low[axis] = at[static_cast<std::size_t>(kFarthest * last)];
    most.high[axis] = at[static_cast<std::size_t>((1.0 - kFarthest) * last)];
    for (const auto& [id, pose] : header.cameras) {
      most.low[axis] = std::min(most.low[axis], pose.translation[axis]);
      most.high[axis] = std::max(most.high[axis], pose.translation[axis]);
    }
    if (box) most.low[axis] = std::max(most.low[axis], box->low[axis]);
    if (box) most.high[axis] = std::min(most.high[axis], box->high[axis]);
  }
  const Eigen::Array3d low = (most.low / side).array().floor(), high = (most.high / side).array().floor();
  std::unordered_set<std::uint64_t> cubes;
  for (std::size_t i = 0; i < map.keyframes.size(); i += 1 + map.keyframes.size() / kMostCameras) {
    const Keyframe keyframe = keyframe_of(map, map.keyframes[i]);
    const Eigen::Vector3d camera = header.file_from_map * keyframe.cam_from_world.center() / side;
    Eigen::Matrix3Xd directions(3, keyframe.landmarks.size());
    std::vector<double> distances;
    for (const Landmark& landmark : keyframe.landmarks) {
      const Eigen::Vector3d ray = header.file_from_map * landmark.position_world / side - camera;
      directions.col(static_cast<Eigen::Index>(distances.size())) = ray.normalized();
      distances.push_back(std::min(ray.norm(), VoxelMap::kRange * header.cell_size / side));
    }
    if (distances.empty() || !(2.0 * camera.array().abs() < kCellLimit).all()) continue;
    for (int n = 0; n < kColumns * kColumns / 2; ++n) {
      const int column = n % kColumns, row = n / kColumns;
      const Eigen::Vector3d ray = bearing_from_pixel({column + 0.5, row + 0.5}, kColumns, kColumns / 2);
      Eigen::Index nearest = 0;
      (ray.transpose() * directions).maxCoeff(&nearest);
      traverse(camera, camera + distances[static_cast<std::size_t>(nearest)] * ray,
               [&](const CellIndex& cube, double /*entry*/, double /*exit*/) {
                 const Eigen::Array3d at(cube[0], cube[1], cube[2]);
                 if ((at >= low).all() && (at <= high).all()) cubes.insert(packed(cube));
                 return true;
               });
    }
  }
  return static_cast<double>(cubes.size() * sizeof(VoxelBlock)) * std::pow(side / block, 3);
}

}  // namespace pmsp
