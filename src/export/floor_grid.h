// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

#include "export/voxel_map.h"
#include "pmsp/api.h"

namespace pmsp {

/// What moves on the floor.
struct FloorRobot {
  double height = 1.0;      ///< of its top above the floor, > 0 [unit of the file]
  double step = 0.1;        ///< largest step of the floor, > 0 [unit of the file]
  double slope_deg = 20.0;  ///< steepest slope, > 0 to 60 [deg]
};

/// Grid of a floor seen from above: occupied, free and unknown columns of cells, with the height of the floor.
///
/// The floor is the level with the largest area of upward surfaces below the cameras, and what can be reached from it
/// under the cameras without steps, slopes or obstacles that are too high. A column is free if it is reached and three
/// quarters of the space up to the height of the robot are free; occupied if it has an occupied cell there, if the
/// floor has a hole, or is too steep; else unknown. Gaps of at most three columns in the floor are bridged if nothing
/// is seen through them. Takes about 4 bytes of memory per column.
class PMSP_API FloorGrid {
 public:
  enum Column : std::uint8_t { kOccupied = 0, kUnknown = 205, kFree = 254 };  ///< as gray levels of a map of ROS

  /// Throws InvalidInput if there is no floor under the cameras, or the grid is too large. `cameras`: positions.
  FloorGrid(const VoxelMap& map, const std::vector<Eigen::Vector3d>& cameras, const FloorRobot& robot);

  int width() const { return width_; }
  int height() const { return height_; }
  double cell() const { return map_.cell(); }
  /// Corner of column (0, 0) with the least x and y [unit of the file].
  double low_x() const { return low_[0] * map_.cell(); }
  double low_y() const { return low_[1] * map_.cell(); }

  Column at(int x, int y) const { return columns_[place(x, y)]; }
  /// Height of the floor, to half a cell; NaN unless the column is free [unit of the file].
  float elevation(int x, int y) const;
  /// Slope of the plane through the floor around a column; NaN unless it is free [deg].
  float slope(int x, int y) const;

 private:
  static constexpr std::int16_t kNoFloor = INT16_MIN;

  std::size_t place(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
  }
  bool is_inside(int x, int y) const { return x >= 0 && y >= 0 && x < width_ && y < height_; }

  struct Floor {
    enum Kind { kReached, kGap, kHole } kind;  ///< kGap: not seen; kHole: seen through
    int z = 0;                                 ///< layer
  };

  void find_bounds();
  int find_level(const std::vector<Eigen::Vector3d>& cameras) const;
  std::vector<std::uint32_t> find_seeds(const std::vector<Eigen::Vector3d>& cameras, int level);
  Space space(int x, int y, int z) const;
  Floor look(int x, int y, int z) const;
  bool is_passable(int x, int y, int floor) const;
  void reach(int x, int y, int z, std::deque<std::uint32_t>& open);
  void flood(const std::vector<std::uint32_t>& from);
  float slope_at(int x0, int y0) const;
  bool is_high_step(int x0, int y0) const;
  void remove_steep(const std::vector<std::uint32_t>& from);
  void mark_obstacles();
  void trim();

  const VoxelMap& map_;
  FloorRobot robot_;
  int robot_cells_, step_cells_, window_;
  CellIndex low_{};  ///< of column (0, 0), layer 0
  int width_ = 0, height_ = 0, layers_ = 0;
  std::vector<Column> columns_;
  std::vector<std::int16_t> floor_;  ///< layer

  // Last block of `space`.
  mutable const VoxelBlock* cached_ = nullptr;
  mutable CellIndex cached_at_{};
  mutable bool is_cached_ = false;
};

}  // namespace pmsp
