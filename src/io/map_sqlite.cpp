// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <memory>
#include <new>
#include <string>
#include <utility>
#include <vector>

#include <sqlite3.h>
#include <Eigen/Geometry>

#include "map_raw.h"
#include "pmsp/error.h"

// Blobs are memory dumps of the writing program, which runs on little-endian machines only.
static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "blobs are little-endian");

namespace pmsp::map_detail {
namespace {

/// Limit for hostile files: larger than any row of a map, images included; bounds SQLite's allocations.
constexpr int kMaxRowBytes = 1 << 28;

/// Compares the file's length with its header: SQLite notices missing pages only on access, and descriptors, which are
/// never read, may be among them.
void check_length(const std::filesystem::path& path) {
  constexpr std::size_t kHeaderBytes = 100;
  BinaryInput in(path);
  if (in.size() < kHeaderBytes) {
    in.fail("the file has " + std::to_string(in.size()) + " bytes, expected a SQLite header of 100: it is truncated");
  }
  const char* const header = in.take(kHeaderBytes);
  const auto field = get_big<std::uint16_t>(header + 16);
  const std::uint64_t page_bytes = field == 1 ? 65536 : field;
  const std::uint64_t expected = page_bytes * get_big<std::uint32_t>(header + 28);
  const bool count_is_valid = get_big<std::uint32_t>(header + 24) == get_big<std::uint32_t>(header + 92);
  if (count_is_valid && in.size() < expected) {
    in.fail("the file has " + std::to_string(in.size()) + " bytes, its header states " + std::to_string(expected) +
            ": it is truncated; copy it again");
  }
}

/// Throws for an unfinished transaction: an immutable database is read without its journal.
void check_no_open_transaction(const std::filesystem::path& path) {
  for (const char* suffix : {"-wal", "-journal"}) {
    const std::filesystem::path beside = path.string() + suffix;
    std::ifstream file(beside, std::ios::binary);
    unsigned char first = 0;
    // A journal kept after its transaction begins with zeros.
    if (!file.read(reinterpret_cast<char*>(&first), 1) || first == 0) continue;
    fail(path, "",
         "there is an unfinished transaction beside it (" + beside.filename().string() +
             "), expected a map that was written completely: end the SLAM that writes it, or open and close " +
             "the file once with sqlite3");
  }
}

/// File as URI: read-only and immutable, so that SQLite creates no -wal, -shm or -journal.
std::string uri_of(const std::filesystem::path& path) {
  static const char* const kHex = "0123456789ABCDEF";
  std::string uri = "file:";
  for (const char c : std::filesystem::absolute(path).string()) {
    const auto byte = static_cast<unsigned char>(c);
    const bool plain = (byte >= 'a' && byte <= 'z') || (byte >= 'A' && byte <= 'Z') || (byte >= '0' && byte <= '9') ||
                       c == '/' || c == '.' || c == '-' || c == '_';
    if (plain) {
      uri += c;
    } else {
      uri += {'%', kHex[byte >> 4U], kHex[byte & 15U]};
    }
  }
  return uri + "?mode=ro&immutable=1";
}

class Database {
 public:
  explicit Database(const std::filesystem::path& path) : path_(path) {
    sqlite3* handle = nullptr;
    const int result = sqlite3_open_v2(uri_of(path).c_str(), &handle, SQLITE_OPEN_READONLY | SQLITE_OPEN_URI, nullptr);
    handle_.reset(handle);
    if (result != SQLITE_OK) throw IoError(path.string() + ": cannot be opened: " + sqlite3_errstr(result));
    sqlite3_db_config(handle, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
    sqlite3_db_config(handle, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
    sqlite3_limit(handle, SQLITE_LIMIT_LENGTH, kMaxRowBytes);
  }

  sqlite3* handle() const { return handle_.get(); }
  const std::filesystem::path& path() const { return path_; }

  /// Throws the error of the last SQLite call.
  [[noreturn]] void fail_here(const std::string& where) const {
    const int code = sqlite3_errcode(handle_.get());
    const std::string what = std::string(sqlite3_errmsg(handle_.get()));
    if ((code & 0xFF) == SQLITE_IOERR || (code & 0xFF) == SQLITE_CANTOPEN) {
      throw IoError(path_.string() + ": " + where + ": cannot be read: " + what);
    }
    if ((code & 0xFF) == SQLITE_NOMEM) throw std::bad_alloc();
    fail(path_, where, "broken SQLite database: " + what);
  }

 private:
  struct Close {
    void operator()(sqlite3* handle) const { sqlite3_close(handle); }
  };
  std::filesystem::path path_;
  std::unique_ptr<sqlite3, Close> handle_;
};

/// Rows of a query, with columns by index. Column 0 is an id, which names the row in messages.
class Rows {
 public:
  Rows(const Database& database, std::string table, const std::string& sql)
      : database_(database), table_(std::move(table)) {
    sqlite3_stmt* statement = nullptr;
    const int result = sqlite3_prepare_v2(database.handle(), sql.c_str(), -1, &statement, nullptr);
    statement_.reset(statement);
    if (result != SQLITE_OK) database.fail_here("table " + table_);
  }

  bool next() {
    const int result = sqlite3_step(statement_.get());
    if (result != SQLITE_ROW && result != SQLITE_DONE) database_.fail_here("table " + table_);
    return result == SQLITE_ROW;
  }

  bool is_null(int column) const { return sqlite3_column_type(statement_.get(), column) == SQLITE_NULL; }

  std::int64_t integer(int column) const {
    const double value = number(column);
    if (sqlite3_column_type(statement_.get(), column) == SQLITE_INTEGER) {
      return sqlite3_column_int64(statement_.get(), column);
    }
    if (!(std::abs(value) < 9e15) || std::floor(value) != value) wrong(column, "a whole number");
    return static_cast<std::int64_t>(value);
  }

  double number(int column) const {
    const int type = sqlite3_column_type(statement_.get(), column);
    if (type != SQLITE_INTEGER && type != SQLITE_FLOAT) wrong(column, "a number");
    return sqlite3_column_double(statement_.get(), column);
  }

  /// String, stored as BLOB or TEXT.
  std::string string(int column) const {
    const int type = sqlite3_column_type(statement_.get(), column);
    if (type != SQLITE_BLOB && type != SQLITE_TEXT) wrong(column, "a string");
    const std::pair<const char*, std::size_t> data = bytes(column);
    return data.second == 0 ? std::string() : std::string(data.first, data.second);
  }

  /// Blob of elements of type T; NULL is written for an empty one.
  template <class T>
  void array(int column, std::vector<T>& result) const {
    const int type = sqlite3_column_type(statement_.get(), column);
    if (type != SQLITE_BLOB && type != SQLITE_NULL) wrong(column, "a blob");
    const std::pair<const char*, std::size_t> data = bytes(column);
    if (data.second % sizeof(T) != 0) {
      wrong(column,
            "a multiple of " + std::to_string(sizeof(T)) + " bytes (it has " + std::to_string(data.second) + ")");
    }
    result.resize(data.second / sizeof(T));
    if (data.second > 0) std::memcpy(result.data(), data.first, data.second);
  }

  /// Blob of exactly `count` doubles.
  void doubles(int column, double* result, std::size_t count) const {
    const std::pair<const char*, std::size_t> data = bytes(column);
    if (sqlite3_column_type(statement_.get(), column) != SQLITE_BLOB || data.second != count * sizeof(double)) {
      wrong(column, "a blob of " + std::to_string(count) + " doubles");
    }
    std::memcpy(result, data.first, data.second);
  }

  [[noreturn]] void wrong(int column, const std::string& expected) const {
    const char* const names[] = {"an integer", "a real number", "text", "a blob", "NULL"};
    const int type = sqlite3_column_type(statement_.get(), column);
    fail(database_.path(), where(column), "expected " + expected + ", found " + names[type - 1]);
  }

  std::string where(int column) const {
    const char* name = sqlite3_column_name(statement_.get(), column);
    const std::string id = is_null(0) ? "NULL" : std::to_string(sqlite3_column_int64(statement_.get(), 0));
    return place(Dialect::sqlite, table_, id, name == nullptr ? "" : name);
  }

 private:
  std::pair<const char*, std::size_t> bytes(int column) const {
    const auto* data = static_cast<const char*>(sqlite3_column_blob(statement_.get(), column));
    const int size = sqlite3_column_bytes(statement_.get(), column);
    return {data, data == nullptr ? 0 : static_cast<std::size_t>(size)};
  }

  struct Finalize {
    void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
  };
  const Database& database_;
  std::string table_;
  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
};

/// Returns the columns of a table; empty if there is none. Views and virtual tables are ignored: evaluating them may
/// never end.
std::vector<std::string> columns_of(const Database& database, const std::string& table) {
  std::vector<std::string> columns;
  Rows entries(database, table, "SELECT rootpage FROM sqlite_master WHERE type = 'table' AND name = '" + table + "'");
  if (!entries.next() || entries.is_null(0) || entries.integer(0) == 0) return columns;
  Rows rows(database, table, "PRAGMA table_info(" + table + ")");  // without generated columns
  while (rows.next()) columns.push_back(rows.string(1));
  return columns;
}

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

void require_columns(const Database& database, const std::string& table, const std::vector<std::string>& present,
                     const std::vector<std::string>& required) {
  if (present.empty()) {
    fail(database.path(), "table " + table,
         "is missing, expected the tables cameras, keyframes, landmarks and associations of a stella_vslam map");
  }
  for (const std::string& name : required) {
    if (!contains(present, name)) fail(database.path(), "table " + table, "has no column " + name);
  }
}

/// Requires ascending ids, as in any sound table: damaged ones may cycle through the same pages.
class AscendingIds {
 public:
  std::int64_t next(const Rows& rows, const Database& database) {
    const std::int64_t id = rows.integer(0);
    if (id < 0) fail(database.path(), rows.where(0), "expected an id >= 0");
    if (id == last_) fail(database.path(), rows.where(0), "this id appears more than once, expected unique ids");
    if (id < last_) fail(database.path(), rows.where(0), "broken SQLite database: the rows are out of order");
    last_ = id;
    return id;
  }

 private:
  std::int64_t last_ = -1;
};

void read_cameras(const Database& database, RawMap& map) {
  require_columns(database, "cameras", columns_of(database, "cameras"),
                  {"id", "name", "model_type", "cols", "rows", "fps"});
  Rows rows(database, "cameras", "SELECT id, name, model_type, cols, rows, fps FROM cameras ORDER BY id");
  AscendingIds ids;
  while (rows.next()) {
    ids.next(rows, database);
    map.cameras.push_back({rows.string(1), rows.string(2), rows.integer(3), rows.integer(4), rows.number(5)});
  }
}

void read_landmarks(const Database& database, RawMap& map) {
  require_columns(database, "landmarks", columns_of(database, "landmarks"), {"id", "pos_w"});
  Rows rows(database, "landmarks", "SELECT id, pos_w FROM landmarks ORDER BY id");
  AscendingIds ids;
  while (rows.next()) {
    MapLandmark landmark;
    landmark.id = ids.next(rows, database);
    rows.doubles(1, landmark.position_world.data(), 3);
    map.landmarks.push_back(landmark);
  }
}

/// Memory layout of cv::KeyPoint.
struct KeyPoint {
  float x, y, size, angle, response;
  std::int32_t octave, class_id;
};
static_assert(sizeof(KeyPoint) == 28, "this is the layout of the file");

/// World-to-camera matrix, 4 x 4, column-major.
void read_pose(const Database& database, const Rows& rows, int column, RawKeyframe& keyframe) {
  Eigen::Matrix4d pose;
  rows.doubles(column, pose.data(), 16);
  const Eigen::Matrix3d rotation = pose.topLeftCorner<3, 3>();
  if (!pose.allFinite() || pose.isZero(0.0)) return;  // lost pose: the quaternion stays zero
  const double bottom = (pose.row(3) - Eigen::RowVector4d(0.0, 0.0, 0.0, 1.0)).cwiseAbs().maxCoeff();
  const double skew = (rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(bottom <= 1e-6)) {
    fail(database.path(), rows.where(column),
         "expected 16 finite numbers, column by column, whose last row is 0 0 0 1");
  }
  if (!(skew <= 1e-3) || !(rotation.determinant() > 0.0)) {
    fail(database.path(), rows.where(column),
         "the upper left 3 x 3 numbers are no rotation, expected one within 0.001");
  }
  const Eigen::Quaterniond quaternion(rotation);
  keyframe.rotation_xyzw = {quaternion.x(), quaternion.y(), quaternion.z(), quaternion.w()};
  keyframe.translation = pose.topRightCorner<3, 1>();
}

void read_keyframes(const Database& database, RawMap& map, const std::vector<std::string>& columns) {
  require_columns(database, "keyframes", columns, {"id", "ts", "cam", "pose_cw"});
  map.keypoint_field = contains(columns, "undist_keypts") ? "undist_keypts" : "undists";
  require_columns(database, "keyframes", columns, {map.keypoint_field});
  require_columns(database, "associations", columns_of(database, "associations"), {"id", "lm_ids"});
  Rows rows(database, "keyframes",
            "SELECT k.id AS id, k.ts AS ts, k.cam AS cam, k.pose_cw AS pose_cw, k." + map.keypoint_field + " AS " +
                map.keypoint_field + ", a.id AS associations, a.lm_ids AS \"associations.lm_ids\", " +
                (contains(columns, "src_frm_id") ? "k.src_frm_id" : "NULL") + " AS src_frm_id " +
                "FROM keyframes AS k LEFT JOIN associations AS a ON a.id = k.id ORDER BY k.id");
  AscendingIds ids;
  std::vector<KeyPoint> keypoints;
  std::vector<std::int32_t> landmark_ids;
  while (rows.next()) {
    RawKeyframe keyframe;
    keyframe.keyframe.id = ids.next(rows, database);
    keyframe.keyframe.timestamp = rows.number(1);
    keyframe.camera = rows.string(2);
    read_pose(database, rows, 3, keyframe);
    rows.array(4, keypoints);
    if (rows.is_null(5)) {
      fail(database.path(), place(Dialect::sqlite, "associations", std::to_string(keyframe.keyframe.id), ""),
           "there is no such row, expected one for each keyframe");
    }
    rows.array(6, landmark_ids);
    if (landmark_ids.size() != keypoints.size()) {
      fail(database.path(), place(Dialect::sqlite, "associations", std::to_string(keyframe.keyframe.id), "lm_ids"),
           "has " + std::to_string(landmark_ids.size()) + " elements where there are " +
               std::to_string(keypoints.size()) + " keypoints, expected one for each");
    }
    if (!rows.is_null(7)) {
      keyframe.keyframe.source_frame = rows.integer(7);
      if (*keyframe.keyframe.source_frame < 0) {
        fail(database.path(), rows.where(7),
             "is " + std::to_string(*keyframe.keyframe.source_frame) + ", expected a number >= 0");
      }
    }
    set_observations(keyframe.keyframe, landmark_ids,
                     [&](std::size_t i) { return Eigen::Vector2f(keypoints[i].x, keypoints[i].y); });
    map.keyframes.push_back(std::move(keyframe));
  }
}

std::string format_of(const Database& database, const RawMap& map) {
  const bool old = std::any_of(map.keyframes.begin(), map.keyframes.end(),
                               [](const RawKeyframe& k) { return k.keyframe.source_frame.has_value(); });
  const char* version = "stella_vslam >= 0.3.6";
  if (!columns_of(database, "dense_points").empty()) {
    version = "stella_vslam_dense";
  } else if (map.keypoint_field == "undists") {
    version = "stella_vslam 0.3.1";
  } else if (old) {
    version = "stella_vslam 0.3.2 to 0.3.5";
  }
  return std::string(version) + ", SQLite";
}

}  // namespace

RawMap read_sqlite(const std::filesystem::path& path) {
  check_length(path);
  check_no_open_transaction(path);
  RawMap map;
  map.path = path;
  map.dialect = Dialect::sqlite;
  const Database database(path);
  // Keyframes first: errors of databases that are no maps appear there.
  read_keyframes(database, map, columns_of(database, "keyframes"));
  read_cameras(database, map);
  read_landmarks(database, map);
  map.format = format_of(database, map);
  return map;
}

}  // namespace pmsp::map_detail
