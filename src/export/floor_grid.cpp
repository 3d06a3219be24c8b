// SPDX-License-Identifier: BSD-2-Clause
#include "export/floor_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <limits>

#include "elementary.h"
#include "pmsp/error.h"
#include "util/check_option.h"
#include "util/percent.h"
#include "util/text.h"

namespace pmsp {
namespace {

constexpr int kWidestGap = 3;             ///< of the floor, that is bridged [columns]
constexpr std::int64_t kLeastLevel = 64;  ///< area of the floor's level [columns]
constexpr double kLeastShare = 0.1;       ///< of all upward surfaces below the cameras
constexpr std::size_t kMostColumns = std::size_t{1} << 27;
constexpr int kMostLayers = std::numeric_limits<std::int16_t>::max();
constexpr int kHoleDepth = 2;      ///< below a step, that is seen [cells]
constexpr int kWidestWindow = 12;  ///< half of that of the slope [columns]
constexpr std::array<std::array<int, 2>, 4> kBeside{{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};

/// At most kMostLayers.
int cells_in(double length, double cell) {
  return static_cast<int>(std::min(std::ceil(length / cell - 1e-6), static_cast<double>(kMostLayers)));
}

bool has_points(Space space) { return space == Space::kWeak || space == Space::kOccupied; }

}  // namespace

FloorGrid::FloorGrid(const VoxelMap& map, const std::vector<Eigen::Vector3d>& cameras, const FloorRobot& robot)
    : map_(map), robot_(robot) {
  check_option("robot_slope_deg", robot.slope_deg, 1.0, 60.0);
  const double cell = map.cell();
  robot_cells_ = cells_in(robot.height, cell) + 1;  // a cell of rounding
  step_cells_ = std::max(1, static_cast<int>(std::min(std::floor(robot.step / cell + 1e-6), 1.0 * kMostLayers)));
  // A step that is allowed must not count as a slope: a plane fitted to it across 2 w columns rises by 1.5 steps.
  const double half = 0.75 * robot.step / std::tan(robot.slope_deg * kernels::kDegree);
  window_ = std::clamp(cells_in(half, cell), 2, kWidestWindow);
  find_bounds();
  const std::size_t size = static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
  columns_.assign(size, kUnknown);
  floor_.assign(size, kNoFloor);
  const std::vector<std::uint32_t> from = find_seeds(cameras, find_level(cameras));
  flood(from);
  remove_steep(from);
  mark_obstacles();
  trim();
}

void FloorGrid::find_bounds() {
  CellIndex low{}, high{};
  low.fill(std::numeric_limits<std::int32_t>::max());
  high.fill(std::numeric_limits<std::int32_t>::min());
  for (const CellIndex& at : map_.blocks()) {
    for (std::size_t i = 0; i < 3; ++i) {
      low[i] = std::min(low[i], at[i] * VoxelBlock::kSide);
      high[i] = std::max(high[i], (at[i] + 1) * VoxelBlock::kSide);
    }
  }
  if (low[0] >= high[0]) throw InvalidInput("the map has no cells; expected points, is --crop right?");
  const std::int64_t layers = std::int64_t{high[2]} - low[2];
  const std::size_t size = static_cast<std::size_t>(high[0] - low[0]) * static_cast<std::size_t>(high[1] - low[1]);
  if (size > kMostColumns || layers > kMostLayers) {
    throw InvalidInput("the grid has " + std::to_string(high[0] - low[0]) + " x " + std::to_string(high[1] - low[1]) +
                       " columns of " + std::to_string(layers) + " cells, expected at most " +
                       std::to_string(kMostColumns) + " columns of " + std::to_string(kMostLayers) +
                       "; give a larger --cell-size, or --crop");
  }
  low_ = low;
  width_ = high[0] - low[0];
  height_ = high[1] - low[1];
  layers_ = static_cast<int>(layers);
}

/// Level of the floor [layer].
int FloorGrid::find_level(const std::vector<Eigen::Vector3d>& cameras) const {
  double highest = -std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3d& camera : cameras) highest = std::max(highest, camera.z());
  std::vector<std::int64_t> area(static_cast<std::size_t>(layers_), 0);
  std::int64_t all = 0;
  for (const CellIndex& at : map_.blocks()) {
    for (std::int32_t n = 0; n < static_cast<std::int32_t>(VoxelBlock::kCells); ++n) {
      constexpr std::int32_t kSide = VoxelBlock::kSide;
      const int x = at[0] * kSide + n % kSide - low_[0], y = at[1] * kSide + n / kSide % kSide - low_[1];
      const int z = at[2] * kSide + n / (kSide * kSide) - low_[2];
      if (!has_points(space(x, y, z)) || has_points(space(x, y, z + 1))) continue;
      const bool is_upward = space(x, y, z + 2) == Space::kFree || space(x, y, z + 3) == Space::kFree;
      if (!is_upward || (low_[2] + z) * map_.cell() > highest) continue;
      ++area[static_cast<std::size_t>(z)];
      ++all;
    }
  }
  // The level with the largest area, together with the cells up to a step above it; then its fullest layer.
  std::int64_t most = 0;
  int level = 0;
  for (int z = 0; z < layers_; ++z) {
    std::int64_t sum = 0;
    for (int k = z; k <= std::min(z + step_cells_, layers_ - 1); ++k) sum += area[static_cast<std::size_t>(k)];
    if (sum <= most) continue;
    most = sum;
    level = z;
  }
  if (most < kLeastLevel || static_cast<double>(most) < kLeastShare * static_cast<double>(all)) {
    throw InvalidInput("the grid has no floor: the largest level surface below the cameras has " +
                       std::to_string(most) + " columns of " + std::to_string(all) + ", expected at least " +
                       std::to_string(kLeastLevel) + " and " + percent(kLeastShare) +
                       "; is z upwards (--up), is the floor inside --crop, is --cell-size not too small?");
  }
  const auto begin = area.begin() + level;
  const auto end = area.begin() + std::min(level + step_cells_ + 1, layers_);
  return static_cast<int>(std::max_element(begin, end) - area.begin());
}

/// Columns of the floor around the cameras.
std::vector<std::uint32_t> FloorGrid::find_seeds(const std::vector<Eigen::Vector3d>& cameras, int level) {
  std::vector<bool> seen(columns_.size(), false);
  std::vector<std::uint32_t> from;
  for (const Eigen::Vector3d& camera : cameras) {
    const int center_x = static_cast<int>(std::floor(camera.x() / map_.cell())) - low_[0];
    const int center_y = static_cast<int>(std::floor(camera.y() / map_.cell())) - low_[1];
    for (int y = std::max(center_y - robot_cells_, 0); y <= std::min(center_y + robot_cells_, height_ - 1); ++y) {
      for (int x = std::max(center_x - robot_cells_, 0); x <= std::min(center_x + robot_cells_, width_ - 1); ++x) {
        if (seen[place(x, y)]) continue;
        seen[place(x, y)] = true;
        const Floor floor = look(x, y, level);
        if (floor.kind != Floor::kReached || !is_passable(x, y, floor.z)) continue;
        columns_[place(x, y)] = kFree;
        floor_[place(x, y)] = static_cast<std::int16_t>(floor.z);
        from.push_back(static_cast<std::uint32_t>(place(x, y)));
      }
    }
  }
  if (from.empty()) {
    throw InvalidInput("the grid has no free floor within " + number_text(robot_.height) +
                       " of a camera, seen from above; expected some at the height " +
                       number_text((low_[2] + level + 0.5) * map_.cell()) +
                       "; is z upwards (--up), is --robot-height lower than the space?");
  }
  return from;
}

Space FloorGrid::space(int x, int y, int z) const {
  const CellIndex cell{low_[0] + x, low_[1] + y, low_[2] + z};
  const CellIndex in = VoxelBlock::of(cell);
  if (in != cached_at_ || !is_cached_) {
    cached_ = map_.block(in);
    cached_at_ = in;
    is_cached_ = true;
  }
  if (cached_ == nullptr || !map_.contains(cell)) return Space::kUnknown;
  return map_.state(cached_->cells[VoxelBlock::place(cell)]);
}

/// Floor of a column beside one whose floor is at layer `z`.
FloorGrid::Floor FloorGrid::look(int x, int y, int z) const {
  for (int at = z + step_cells_; at >= z - step_cells_; --at) {
    if (has_points(space(x, y, at))) return {Floor::kReached, at};
  }
  // Within a step below, rays to the noisy floor beside are no evidence.
  for (int at = z - step_cells_ - 1; at >= z - step_cells_ - kHoleDepth; --at) {
    if (space(x, y, at) != Space::kUnknown) return {Floor::kHole, z};
  }
  return {Floor::kGap, z};
}

bool FloorGrid::is_passable(int x, int y, int floor) const {
  int free = 0;
  for (int z = floor + 1; z <= floor + robot_cells_; ++z) {
    const Space it = space(x, y, z);
    if (has_points(it)) return false;
    free += it == Space::kFree ? 1 : 0;
  }
  return 4 * free >= 3 * robot_cells_;
}

void FloorGrid::reach(int x, int y, int z, std::deque<std::uint32_t>& open) {
  columns_[place(x, y)] = kFree;
  floor_[place(x, y)] = static_cast<std::int16_t>(z);
  open.push_back(static_cast<std::uint32_t>(place(x, y)));
}

void FloorGrid::flood(const std::vector<std::uint32_t>& from) {
  std::deque<std::uint32_t> open(from.begin(), from.end());
  for (; !open.empty(); open.pop_front()) {
    const int x0 = static_cast<int>(open.front() % static_cast<std::uint32_t>(width_));
    const int y0 = static_cast<int>(open.front() / static_cast<std::uint32_t>(width_));
    const int z = floor_[open.front()];
    for (const auto& [dx, dy] : kBeside) {
      for (int gap = 0; gap <= kWidestGap; ++gap) {
        const int x = x0 + (gap + 1) * dx, y = y0 + (gap + 1) * dy;
        if (!is_inside(x, y) || columns_[place(x, y)] == kFree) break;
        const Floor floor = look(x, y, z);
        if (floor.kind == Floor::kHole) columns_[place(x, y)] = kOccupied;
        if (floor.kind == Floor::kHole || !is_passable(x, y, floor.z)) break;
        if (floor.kind == Floor::kGap) continue;
        reach(x, y, floor.z, open);
        for (int k = 1; k <= gap; ++k) reach(x0 + k * dx, y0 + k * dy, z, open);
        break;
      }
    }
  }
}

/// Plane of the floor around a column, by least squares; NaN if undetermined.
float FloorGrid::slope_at(int x0, int y0) const {
  double n = 0, sx = 0, sy = 0, sz = 0, sxx = 0, sxy = 0, syy = 0, sxz = 0, syz = 0;
  for (int dy = -window_; dy <= window_; ++dy) {
    for (int dx = -window_; dx <= window_; ++dx) {
      if (!is_inside(x0 + dx, y0 + dy) || columns_[place(x0 + dx, y0 + dy)] != kFree) continue;
      const double z = floor_[place(x0 + dx, y0 + dy)] - floor_[place(x0, y0)];
      n += 1.0;
      sx += dx, sy += dy, sz += z;
      sxx += dx * dx, sxy += dx * dy, syy += dy * dy;
      sxz += dx * z, syz += dy * z;
    }
  }
  const double xx = sxx - sx * sx / n, xy = sxy - sx * sy / n, yy = syy - sy * sy / n;
  const double xz = sxz - sx * sz / n, yz = syz - sy * sz / n, determinant = xx * yy - xy * xy;
  if (!(determinant > 1e-3 * (xx + yy) * (xx + yy))) return std::numeric_limits<float>::quiet_NaN();
  const double a = (xz * yy - yz * xy) / determinant, b = (yz * xx - xz * xy) / determinant;
  return static_cast<float>(std::atan(std::hypot(a, b)) / kernels::kDegree);
}

/// Whether the floor rises by more than a step, and a cell of rounding, to this column from one at a distance where the
/// steepest slope rises by a step: noise turns high steps into several of one cell.
bool FloorGrid::is_high_step(int x0, int y0) const {
  const int reach = std::clamp(window_ * 4 / 3, 1, kWidestWindow);
  for (int dy = -reach; dy <= reach; ++dy) {
    for (int dx = -reach; dx <= reach; ++dx) {
      if (dx * dx + dy * dy > reach * reach || !is_inside(x0 + dx, y0 + dy)) continue;
      const std::size_t at = place(x0 + dx, y0 + dy);
      if (columns_[at] == kFree && floor_[place(x0, y0)] - floor_[at] > step_cells_ + 1) return true;
    }
  }
  return false;
}

/// Steep columns are occupied, what was reached across them only is unknown.
void FloorGrid::remove_steep(const std::vector<std::uint32_t>& from) {
  std::vector<std::uint32_t> steep;
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      if (columns_[place(x, y)] != kFree) continue;
      if (!(slope_at(x, y) > robot_.slope_deg) && !is_high_step(x, y)) continue;
      steep.push_back(static_cast<std::uint32_t>(place(x, y)));
    }
  }
  for (const std::uint32_t at : steep) columns_[at] = kOccupied;
  std::vector<bool> reached(columns_.size(), false);
  std::deque<std::uint32_t> open;
  const auto add = [&](std::size_t at) {
    if (columns_[at] != kFree || reached[at]) return;
    reached[at] = true;
    open.push_back(static_cast<std::uint32_t>(at));
  };
  for (const std::uint32_t at : from) add(at);
  for (; !open.empty(); open.pop_front()) {
    const int x = static_cast<int>(open.front() % static_cast<std::uint32_t>(width_));
    const int y = static_cast<int>(open.front() / static_cast<std::uint32_t>(width_));
    for (const auto& [dx, dy] : kBeside) {
      if (is_inside(x + dx, y + dy)) add(place(x + dx, y + dy));
    }
  }
  for (std::size_t at = 0; at < columns_.size(); ++at) {
    if (columns_[at] == kFree && !reached[at]) columns_[at] = kUnknown;
  }
}

/// Columns that are not free get the floor of the nearest free one, and are occupied if they have points above a step.
void FloorGrid::mark_obstacles() {
  std::deque<std::uint32_t> open;
  for (std::size_t at = 0; at < columns_.size(); ++at) {
    if (columns_[at] != kFree) floor_[at] = kNoFloor;
  }
  const auto spread = [&](std::size_t from, bool is_free) {
    const int x0 = static_cast<int>(from % static_cast<std::size_t>(width_));
    const int y0 = static_cast<int>(from / static_cast<std::size_t>(width_));
    for (const auto& [dx, dy] : kBeside) {
      if (!is_inside(x0 + dx, y0 + dy)) continue;
      const std::size_t at = place(x0 + dx, y0 + dy);
      if (floor_[at] != kNoFloor) continue;
      floor_[at] = floor_[from];
      open.push_back(static_cast<std::uint32_t>(at));
      const int floor = floor_[at];
      for (int z = floor + step_cells_ + 1; z <= floor + robot_cells_ && columns_[at] != kOccupied; ++z) {
        if (space(x0 + dx, y0 + dy, z) == Space::kOccupied) columns_[at] = kOccupied;
      }
    }
    if (!is_free) open.pop_front();
  };
  for (std::size_t at = 0; at < columns_.size(); ++at) {
    if (columns_[at] == kFree) spread(at, true);
  }
  while (!open.empty()) spread(open.front(), false);
}

/// Removes the margin of unknown columns.
void FloorGrid::trim() {
  int low_x = width_, high_x = 0, low_y = height_, high_y = 0;
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      if (columns_[place(x, y)] == kUnknown) continue;
      low_x = std::min(low_x, x);
      high_x = std::max(high_x, x + 1);
      low_y = std::min(low_y, y);
      high_y = std::max(high_y, y + 1);
    }
  }
  const int width = high_x - low_x, height = high_y - low_y;
  std::size_t to = 0;
  for (int y = low_y; y < high_y; ++y) {
    for (int x = low_x; x < high_x; ++x, ++to) {
      columns_[to] = columns_[place(x, y)];
      floor_[to] = floor_[place(x, y)];
    }
  }
  columns_.resize(to);
  floor_.resize(to);
  low_[0] += low_x;
  low_[1] += low_y;
  width_ = width;
  height_ = height;
}

float FloorGrid::elevation(int x, int y) const {
  if (at(x, y) != kFree) return std::numeric_limits<float>::quiet_NaN();
  return static_cast<float>((low_[2] + floor_[place(x, y)] + 0.5) * map_.cell());
}

float FloorGrid::slope(int x, int y) const {
  return at(x, y) == kFree ? slope_at(x, y) : std::numeric_limits<float>::quiet_NaN();
}

}  // namespace pmsp
