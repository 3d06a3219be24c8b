// SPDX-License-Identifier: BSD-2-Clause
#include "trajectory.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string_view>

#include <Eigen/Geometry>

#include "map_scene.h"
#include "text_input.h"
#include "util/median_of.h"
#include "util/text.h"

namespace pmsp::map_detail {
namespace {

constexpr std::size_t kMostColumns = 64;
constexpr std::size_t kTumColumns = 8;
constexpr std::size_t kKittiColumns = 12;
constexpr std::size_t kVinsColumns = 11;   ///< with velocities
constexpr std::size_t kEurocColumns = 17;  ///< with velocities and biases
constexpr const char* kBlanks = " \t\r,;";

/// Which columns of a line hold what; those of quaternions in the order x, y, z, w.
struct Columns {
  std::size_t time = 0;
  std::optional<std::size_t> nanoseconds;  ///< beside whole seconds, as in ROS's messages
  std::array<std::size_t, 3> position{1, 2, 3};
  std::array<std::size_t, 4> rotation{4, 5, 6, 7};
};
constexpr std::array<std::size_t, 4> kWFirst{5, 6, 7, 4};

/// A line as it stands.
struct PoseRow {
  std::vector<double> values;
  std::size_t line = 0;
};

/// What the text of the lines says about the format.
struct Style {
  std::optional<Columns> named;
  bool has_commas = false;
  bool ends_with_comma = false;
  bool has_whole_times = true;
};

bool is_numbers(const std::vector<std::string>& words) {
  return !words.empty() && words.size() <= kMostColumns &&
         std::all_of(words.begin(), words.end(),
                     [](const std::string& word) { return number_from<double>(word).has_value(); });
}

bool ends_with(const std::string& text, const char* end) {
  const std::string_view tail(end);
  return text.size() >= tail.size() && text.compare(text.size() - tail.size(), tail.size(), tail) == 0;
}

/// Columns by their names, such as "#timestamp, p_RS_R_x [m], ..., q_RS_w [], ..." or "timestamp tx ty tz qx qy qz qw".
std::optional<Columns> columns_named(std::string line) {
  for (std::size_t open = line.find('['); open != std::string::npos; open = line.find('[')) {
    const std::size_t close = line.find(']', open);
    line.erase(open, close == std::string::npos ? close : close - open + 1);  // units
  }
  line.erase(std::remove(line.begin(), line.end(), '#'), line.end());
  const std::vector<std::string> names = words_of(lower_case(line), kBlanks);
  if (names.size() > kMostColumns) return std::nullopt;
  std::array<int, 3> position{-1, -1, -1};
  std::array<int, 4> rotation{-1, -1, -1, -1};
  int time = -1, nanoseconds = -1;
  const auto set = [](int& column, std::size_t i) { column = column < 0 ? static_cast<int>(i) : column; };
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string& name = names[i];
    const bool turns = name[0] == 'q' || name.find("quat") != std::string::npos ||
                       name.find("orient") != std::string::npos || name.find("rot") != std::string::npos;
    if (ends_with(name, "idx") || ends_with(name, "index")) continue;
    const bool is_time = name.find("time") != std::string::npos || name.find("stamp") != std::string::npos;
    if (is_time || name == "t" || name == "sec" || name == "secs") set(time, i);
    if (name == "nsec" || name == "nsecs" || name == "nanosec") set(nanoseconds, i);
    constexpr std::array<const char*, 4> kAxes{"x", "y", "z", "w"};
    for (std::size_t axis = 0; axis < kAxes.size(); ++axis) {
      if (!ends_with(name, kAxes[axis])) continue;
      if (turns) set(rotation[axis], i);
      if (!turns && axis < 3) set(position[axis], i);
    }
  }
  const auto is_missing = [](int column) { return column < 0; };
  if (std::any_of(position.begin(), position.end(), is_missing)) return std::nullopt;
  if (std::any_of(rotation.begin(), rotation.end(), is_missing)) return std::nullopt;
  Columns columns;
  columns.time = static_cast<std::size_t>(std::max(time, 0));
  if (time >= 0 && nanoseconds >= 0) columns.nanoseconds = static_cast<std::size_t>(nanoseconds);
  for (std::size_t i = 0; i < 3; ++i) columns.position[i] = static_cast<std::size_t>(position[i]);
  for (std::size_t i = 0; i < 4; ++i) columns.rotation[i] = static_cast<std::size_t>(rotation[i]);
  return columns;
}

std::vector<PoseRow> read_rows(const std::filesystem::path& path, Style& style) {
  TextInput in(path);
  std::vector<PoseRow> rows;
  while (in.next_line()) {
    if (in.at_end()) continue;
    const std::string line = in.rest("the pose");
    const std::vector<std::string> words = words_of(line, kBlanks);
    if (rows.empty() && (line[0] == '#' || !is_numbers(words))) {
      if (const std::optional<Columns> named = columns_named(line)) {
        style.named = named;
        continue;
      }
    }
    if (line[0] == '#') continue;
    PoseRow row;
    row.line = in.number_of_line();
    if (words.size() > kMostColumns) in.refuse("has more than 64 columns, expected a pose");
    for (const std::string& word : words) {
      const std::optional<double> value = number_from<double>(word);
      if (!value) in.refuse(in_quotes(word) + " is no number, expected the numbers of a pose");
      row.values.push_back(*value);
    }
    if (rows.empty()) {
      style.has_commas = line.find(',') != std::string::npos;
      style.ends_with_comma = line.back() == ',';
    } else if (row.values.size() != rows.front().values.size()) {
      in.refuse("has " + std::to_string(words.size()) + " numbers, line " + std::to_string(rows.front().line) +
                " has " + std::to_string(rows.front().values.size()) + "; expected as many in each line");
    }
    style.has_whole_times = style.has_whole_times && words[0].find_first_not_of("0123456789") == std::string::npos;
    rows.push_back(std::move(row));
  }
  return rows;
}

std::array<double, 4> quaternion_of(const PoseRow& row, const std::array<std::size_t, 4>& columns) {
  return {row.values[columns[0]], row.values[columns[1]], row.values[columns[2]], row.values[columns[3]]};
}

/// How much the camera moves in one direction of its own, 0 to 1, by one reading of the quaternions; a camera that is
/// carried mostly looks the same way along its path. nullopt: too few moves to say.
std::optional<double> steadiness(const std::vector<PoseRow>& rows, const Columns& columns) {
  constexpr std::size_t kFewest = 8;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  std::size_t moves = 0;
  const PoseRow* before = nullptr;
  for (const PoseRow& row : rows) {
    const std::array<double, 4> q = quaternion_of(row, columns.rotation);
    if (is_invalid_pose(q)) continue;
    if (before != nullptr) {
      Eigen::Vector3d step;
      for (std::size_t i = 0; i < 3; ++i) {
        step[static_cast<Eigen::Index>(i)] = row.values[columns.position[i]] - before->values[columns.position[i]];
      }
      const double length = step.norm();
      if (length > 0.0 && std::isfinite(length)) {
        sum += Eigen::Quaterniond(q[3], q[0], q[1], q[2]).normalized().conjugate() * (step / length);
        ++moves;
      }
    }
    before = &row;
  }
  if (moves < kFewest) return std::nullopt;
  return sum.norm() / static_cast<double>(moves);
}

/// The angle of a row's rotation [rad].
double angle_of(const PoseRow& row, const Columns& columns) {
  const std::array<double, 4> q = quaternion_of(row, columns.rotation);
  return 2.0 * std::atan2(std::hypot(q[0], q[1], q[2]), std::abs(q[3]));
}

/// Whether a camera, y down, stands upright throughout in a world with y down or z up.
bool is_upright(const std::vector<PoseRow>& rows, const Columns& columns) {
  constexpr double kTogether = 0.8;
  constexpr double kDown = 0.85;  // the cosine of about 30 degrees
  Eigen::Vector3d down = Eigen::Vector3d::Zero();
  std::size_t poses = 0;
  for (const PoseRow& row : rows) {
    const std::array<double, 4> q = quaternion_of(row, columns.rotation);
    if (is_invalid_pose(q)) continue;
    down += Eigen::Quaterniond(q[3], q[0], q[1], q[2]).normalized() * Eigen::Vector3d::UnitY();
    ++poses;
  }
  return down.norm() > kTogether * static_cast<double>(poses) && std::max(down.y(), -down.z()) > kDown * down.norm();
}

/// The order of quaternions in a file that does not name its columns. The angles between poses are the same in both
/// readings, so other things decide: most programs begin without a rotation, which the other reading turns by half a
/// turn; cameras stand upright; and along its path a camera keeps looking the same way. `likely`: by the file's style.
bool is_w_first(const std::vector<PoseRow>& rows, bool likely, std::string& why) {
  constexpr double kUnturned = 0.26;  // [rad], 15 degrees
  constexpr double kSteady = 0.7;
  constexpr double kSteadier = 0.25;
  Columns w_last, w_first;
  w_first.rotation = kWFirst;
  const auto first = std::find_if(rows.begin(), rows.end(), [&](const PoseRow& row) {
    return !is_invalid_pose(quaternion_of(row, w_last.rotation));
  });
  if (first == rows.end()) return likely;
  const auto is_usual = [&](const Columns& columns) {
    return angle_of(*first, columns) < kUnturned || is_upright(rows, columns);
  };
  bool result = likely;
  if (is_usual(w_last) != is_usual(w_first)) {
    result = is_usual(w_first);
    why = "so that the path begins without a rotation, or the camera stands upright";
  } else {
    const std::optional<double> last_steady = steadiness(rows, w_last);
    const std::optional<double> first_steady = steadiness(rows, w_first);
    const double lead = first_steady && last_steady ? *first_steady - *last_steady : 0.0;
    if (std::abs(lead) > kSteadier && std::max(*first_steady, *last_steady) >= kSteady) result = lead > 0.0;
    why = "so that the camera keeps its direction along the path";
  }
  if (result == likely) why.clear();
  return result;
}

/// Steps of a camera are of a millisecond or more, also where whole numbers are too small for Unix times.
bool are_nanoseconds(const std::vector<PoseRow>& rows, std::size_t column) {
  constexpr double kMillisecond = 1e6;
  std::vector<double> steps;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    steps.push_back(std::abs(rows[i].values[column] - rows[i - 1].values[column]));
  }
  return !steps.empty() && median(steps) >= kMillisecond;
}

RigidTransform lost_pose() { return {invalid_rotation(), Eigen::Vector3d::Constant(std::nan(""))}; }

Trajectory read_matrices(const std::vector<PoseRow>& rows, const std::filesystem::path& path) {
  Trajectory result;
  result.format = "KITTI poses";
  result.notes.emplace_back(
      "poses have no timestamps; line N is read as frame N - 1, unless --image-list names the images");
  for (const PoseRow& row : rows) {
    Eigen::Matrix<double, 3, 4> m;
    for (Eigen::Index i = 0; i < 3; ++i) {
      for (Eigen::Index k = 0; k < 4; ++k) m(i, k) = row.values[static_cast<std::size_t>(4 * i + k)];
    }
    const Eigen::Matrix3d turn =
        rotation_from_matrix(m.leftCols<3>().transpose(), path, "line " + std::to_string(row.line));
    result.poses.push_back({0.0, {turn, -(turn * m.col(3))}});
  }
  return result;
}

}  // namespace

double seconds(double timestamp) {
  const double size = std::abs(timestamp);
  const auto is_unix = [size](double unit) { return size > 0.9e9 * unit && size < 5e9 * unit; };
  if (is_unix(1e3)) return 1e-3 * timestamp;
  if (is_unix(1e6)) return 1e-6 * timestamp;
  return size > 1e14 ? 1e-9 * timestamp : timestamp;
}

bool is_trajectory(const std::string& head) {
  bool is_named = false;
  for (std::size_t at = 0; at < head.size();) {
    const std::size_t end = std::min(head.find('\n', at), head.size());
    const std::string line = head.substr(at, end - at);
    at = end + 1;
    const std::vector<std::string> words = words_of(line, kBlanks);
    if (words.empty()) continue;
    const std::size_t count = words.size();
    const bool is_comment = words[0][0] == '#';
    if (is_comment || !is_numbers(words)) {
      const bool names = columns_named(line).has_value();
      is_named = is_named || names;
      if (is_comment || names) continue;
      return false;
    }
    const bool has_more = count == kVinsColumns || count == kEurocColumns;
    return count == kTumColumns || count == kKittiColumns || (is_named && count > kTumColumns) ||
           (has_more && line.find(',') != std::string::npos);
  }
  return false;
}

Trajectory read_trajectory(const std::filesystem::path& path) {
  Style style;
  const std::vector<PoseRow> rows = read_rows(path, style);
  if (rows.empty()) fail(path, "", "holds no pose, expected one a line");
  const std::size_t count = rows.front().values.size();
  if (count == kKittiColumns && !style.named) return read_matrices(rows, path);
  Trajectory result;
  result.has_times = true;
  Columns columns = style.named.value_or(Columns{});
  const bool is_euroc = style.has_commas && (style.ends_with_comma || count == kVinsColumns || count == kEurocColumns);
  const bool has_nanoseconds =
      style.has_commas && style.has_whole_times && count > columns.time && are_nanoseconds(rows, columns.time);
  std::string why;
  if (!style.named && (count < kTumColumns || (count > kTumColumns && !is_euroc))) {
    fail(path, "line " + std::to_string(rows.front().line),
         "has " + std::to_string(count) +
             " numbers, expected 8 (timestamp tx ty tz qx qy qz qw), 12 (KITTI: the rows of a matrix), or a first line "
             "that names the columns");
  }
  if (!style.named && (is_euroc || is_w_first(rows, has_nanoseconds, why))) {
    columns.rotation = kWFirst;
    if (is_euroc) why = "as EuRoC and VINS write them";
    if (why.empty()) why = "as files with commas and nanoseconds have them";
  }
  const bool is_tum = columns.time == 0 && columns.position == Columns{}.position &&
                      (columns.rotation == Columns{}.rotation || columns.rotation == kWFirst);
  result.format = !is_tum                                          ? "trajectory, a table with named columns"
                  : columns.rotation == kWFirst && has_nanoseconds ? "EuRoC or VINS trajectory"
                                                                   : "TUM trajectory";
  const bool is_order_first = columns.rotation[3] < columns.rotation[0];
  if (style.named && is_order_first) why = "by the line with the names of the columns";
  if (!why.empty()) {
    result.notes.push_back("quaternions are read with w " + std::string(is_order_first ? "first" : "last") + ", " +
                           why +
                           (style.named      ? ""
                            : is_order_first ? "; a first line \"# timestamp tx ty tz qx qy qz qw\" selects w last"
                                             : "; a first line \"# timestamp tx ty tz qw qx qy qz\" selects w first"));
  }
  const std::size_t last = std::max({columns.time, columns.nanoseconds.value_or(0),
                                     *std::max_element(columns.position.begin(), columns.position.end()),
                                     *std::max_element(columns.rotation.begin(), columns.rotation.end())});
  std::size_t unnormalised = 0;
  for (const PoseRow& row : rows) {
    const std::string where = "line " + std::to_string(row.line);
    if (row.values.size() <= last) fail(path, where, "has fewer numbers than columns are named");
    TrajectoryPose& pose = result.poses.emplace_back();
    const double time = row.values[columns.time];
    if (!std::isfinite(time)) fail(path, where, "the timestamp is not finite");
    pose.timestamp = has_nanoseconds ? 1e-9 * time : seconds(time);
    if (columns.nanoseconds) {
      const double part = row.values[*columns.nanoseconds];
      if (!(part >= 0.0 && part < 1e9)) {
        fail(path, where, "the nanoseconds are " + to_message(part) + ", expected 0 to 999999999");
      }
      pose.timestamp = time + 1e-9 * part;
    }
    Eigen::Vector3d center;
    for (std::size_t i = 0; i < 3; ++i) center[static_cast<Eigen::Index>(i)] = row.values[columns.position[i]];
    const std::array<double, 4> xyzw = quaternion_of(row, columns.rotation);
    const Eigen::Matrix3d turn = rotation_from_quaternion(xyzw, path, where, unnormalised).transpose();
    pose.body_from_world = turn.allFinite() ? RigidTransform{turn, -(turn * center)} : lost_pose();
  }
  if (unnormalised > 0) {
    result.notes.push_back("quaternions that were not of length 1, normalised: " + std::to_string(unnormalised));
  }
  return result;
}

RigidTransform read_camera_from_body(const std::filesystem::path& path, std::string& note) {
  constexpr std::size_t kMostBytes = std::size_t{1} << 20;
  TextInput in(path);
  std::string text;
  while (in.next_line()) {
    if (in.at_end()) continue;
    const std::string line = in.rest("the transform");
    if (line[0] == '%') continue;
    text += line.substr(0, line.find('#')) + "\n";
    if (text.size() > kMostBytes) fail(path, "", "is larger than 1 MiB, expected a transform of 7, 12 or 16 numbers");
  }
  struct Key {
    const char* name;
    bool is_body_from_camera;
  };
  constexpr std::array<Key, 7> kKeys{{{"T_cam_imu", false},
                                      {"camera_from_body", false},
                                      {"T_CB", false},
                                      {"T_BS", true},
                                      {"body_T_cam0", true},
                                      {"body_T_cam", true},
                                      {"T_imu_cam", true}}};
  std::size_t at = 0;
  const Key* key = nullptr;
  for (const Key& candidate : kKeys) {
    if (key != nullptr || text.find(candidate.name) == std::string::npos) continue;
    key = &candidate;
    at = std::min(text.find('[', text.find(candidate.name)), text.size());
  }
  std::vector<double> numbers;
  while (numbers.size() <= 16) {
    at = text.find_first_not_of(" \t\r\n,;[]", at);
    if (at == std::string::npos) break;
    const std::size_t end = std::min(text.find_first_of(" \t\r\n,;[]", at), text.size());
    const std::string word = text.substr(at, end - at);
    at = end;
    if (word == "-" && key != nullptr) continue;  // a row of YAML
    const std::optional<double> value = number_from<double>(word);
    if (!value) {
      if (key != nullptr && numbers.size() >= 12) break;  // the next key
      fail(path, "", in_quotes(word) + " is no number, expected a transform of 7, 12 or 16 numbers");
    }
    numbers.push_back(*value);
  }
  const PoseRow row{numbers, 0};
  std::size_t ignored = 0;
  RigidTransform result;
  if (numbers.size() == 7) {
    result.rotation = rotation_from_quaternion(quaternion_of(row, {3, 4, 5, 6}), path, "", ignored);
    result.translation = {numbers[0], numbers[1], numbers[2]};
  } else if (numbers.size() == 12 || numbers.size() == 16) {
    Eigen::Matrix3d turn;
    for (Eigen::Index i = 0; i < 3; ++i) {
      for (Eigen::Index k = 0; k < 3; ++k) turn(i, k) = numbers[static_cast<std::size_t>(4 * i + k)];
      result.translation[i] = numbers[static_cast<std::size_t>(4 * i + 3)];
    }
    result.rotation = rotation_from_matrix(turn, path, "");
    if (numbers.size() == 16 &&
        (numbers[12] != 0.0 || numbers[13] != 0.0 || numbers[14] != 0.0 || numbers[15] != 1.0)) {
      fail(path, "", "last row is not 0 0 0 1, expected a rotation and a translation, row by row");
    }
  } else {
    fail(path, "",
         "holds " + std::to_string(numbers.size()) +
             " numbers, expected a transform of 7 (tx ty tz qx qy qz "
             "qw), 12 or 16 (rows of a matrix)");
  }
  if (!result.rotation.allFinite() || !is_position(result.translation)) {
    fail(path, "", std::string("is no transform, ") + kExpectedPosition);
  }
  note = "poses are those of a body; transform to the camera: " + path.filename().string() +
         (key != nullptr ? std::string(" (") + key->name + (key->is_body_from_camera ? ", inverted)" : ")") : "");
  return key != nullptr && key->is_body_from_camera ? result.inverse() : result;
}

}  // namespace pmsp::map_detail
