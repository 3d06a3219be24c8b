// SPDX-License-Identifier: BSD-2-Clause
#include "map_files.h"

#include <cmath>
#include <cstdio>
#include <fstream>
#include <random>

#include <sqlite3.h>
#include <unistd.h>

#include "elementary.h"
#include "pmsp/error.h"
#include "pmsp/io/map.h"

namespace pmsp::test {
namespace {

using nlohmann::json;

Eigen::Matrix3d turn(double angle, const Eigen::Vector3d& axis) {
  return Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
}

json numbers(const Eigen::Vector3d& v) { return json::array({v.x(), v.y(), v.z()}); }

bool has_raw_keypoints(MsgpackVersion version) {
  return version == MsgpackVersion::openvslam || version == MsgpackVersion::stella_0_3_0 ||
         version == MsgpackVersion::patchmatch || version == MsgpackVersion::patchmatch_dense;
}

bool is_before_orb_params(MsgpackVersion version) {
  return version == MsgpackVersion::openvslam || version == MsgpackVersion::patchmatch ||
         version == MsgpackVersion::patchmatch_dense;
}

json camera_tree(const SampleCamera& camera) {
  return {{"model_type", "Equirectangular"},
          {"setup_type", "Monocular"},
          {"color_order", "BGR"},
          {"cols", camera.cols},
          {"rows", camera.rows},
          {"fps", camera.fps},
          {"focal_x_baseline", 0.0}};
}

void add_keypoints(json& tree, const SampleKeyframe& keyframe, MsgpackVersion version) {
  json objects = json::array();
  json arrays = json::array();
  for (const Eigen::Vector2f& p : keyframe.keypoints) {
    objects.push_back({{"pt", {p.x(), p.y()}}, {"ang", 12.5}, {"oct", 3}});
    arrays.push_back(json::array({p.x(), p.y()}));
  }
  if (has_raw_keypoints(version)) {
    tree["keypts"] = objects;
    tree["undists"] = arrays;
  } else {
    tree["undist_keypts"] = version == MsgpackVersion::stella_0_3_2 ? arrays : objects;
  }
  if (version == MsgpackVersion::patchmatch_dense) {
    // Pixels of the depth map, which is smaller than the image.
    for (json& keypoint : tree["keypts"]) keypoint = {{"pt", {1, 2}}};
    tree["undists"] = json::array({json::array({1.0, 2.0})});
  }
}

json keyframe_tree(const SampleKeyframe& keyframe, MsgpackVersion version) {
  const Eigen::Quaterniond q(keyframe.rotation_cw);
  const bool stereo_filled = version == MsgpackVersion::openvslam || version == MsgpackVersion::stella_0_3_0;
  const std::size_t n = keyframe.keypoints.size();
  json tree = {{"ts", keyframe.timestamp},
               {"cam", keyframe.camera},
               {"rot_cw", {q.x(), q.y(), q.z(), q.w()}},
               {"trans_cw", numbers(keyframe.translation_cw)},
               {"n_keypts", n},
               {"x_rights", stereo_filled ? json(std::vector<double>(n, -1.0)) : json::array()},
               {"depths", stereo_filled ? json(std::vector<double>(n, -1.0)) : json::array()},
               {"descs", json(std::vector<std::vector<std::uint32_t>>(n, std::vector<std::uint32_t>(8, 4026531840U)))},
               {"lm_ids", keyframe.landmark_ids},
               {"span_parent", 4294967295U},
               {"span_children", json::array()},
               {"loop_edges", json::array()}};
  add_keypoints(tree, keyframe, version);
  if (version != MsgpackVersion::stella_0_3_6 && version != MsgpackVersion::stella_dense) {
    tree["src_frm_id"] = keyframe.source_frame;
  }
  if (is_before_orb_params(version)) {
    tree["depth_thr"] = 40.0;
    tree["n_scale_levels"] = 8;
    tree["scale_factor"] = 1.2000000476837158;
  } else {
    tree["orb_params"] = "default";
  }
  if (version == MsgpackVersion::stella_dense) {
    for (const char* key : {"image", "depth", "mask"}) tree[key] = std::vector<int>(500, 200);
  }
  return tree;
}

json landmark_tree(const SampleLandmark& landmark, MsgpackVersion version, std::int64_t keyframe) {
  json tree = {
      {"pos_w", numbers(landmark.position)}, {"1st_keyfrm", 1}, {"ref_keyfrm", keyframe}, {"n_vis", 7}, {"n_fnd", 5}};
  if (version == MsgpackVersion::patchmatch) tree["color"] = {std::nan(""), 0.0, 1e300};
  if (version == MsgpackVersion::patchmatch_dense) tree["color"] = {120.0, 130.0, 140.0};
  return tree;
}

}  // namespace

SampleMap sample_map() {
  SampleMap map;
  map.cameras = {{"theta", 1920, 960, 10.0}, {"another", 640, 320, 29.97}};
  map.landmarks = {{100, {0.1, -0.2, 3.25}},
                   {5, {1.5, 0.0, -2.0}},
                   {1, {-4.0, 0.5, 0.3}},
                   {30, {0.0, 2.0, 1.0}},
                   {12, {5.0, 1.0, 9.0}}};
  map.keyframes = {
      {10,
       2.5,
       25,
       "theta",
       turn(3.1, {0.1, 1.0, -0.2}),
       {-1.25, 0.1, 7.0},
       {{22.0F, 900.5F}, {1896.75F, 30.0F}},
       {12, 1}},
      {2,
       0.1,
       1,
       "theta",
       turn(0.02, {1.0, 0.5, 0.2}),
       {0.003, -0.001, 0.0625},
       {{100.0F, 200.0F}, {300.5F, 400.25F}, {7.0F, 8.0F}, {50.0F, 60.0F}, {70.0F, 80.0F}},
       {5, -1, 100, 77, 77}},
      {9,
       1.7,
       17,
       "another",
       turn(-1.3, {0.3, -0.9, 0.4}),
       {4.0, 5.0, -6.0},
       {{600.0F, 300.0F}, {10.0F, 20.0F}, {30.0F, 40.0F}},
       {30, 30, 5}},
  };
  return map;
}

SampleMap random_map(int count, int landmarks, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto vector = [&] { return Eigen::Vector3d{uniform(random), uniform(random), uniform(random)}; };
  SampleMap map;
  map.cameras = {{"theta", 1920, 960, 10.0}};
  for (int i = 0; i < landmarks; ++i) map.landmarks.push_back({3 * i, 10.0 * vector()});
  for (int i = 0; i < count; ++i) {
    SampleKeyframe keyframe;
    keyframe.id = 2 * i;
    keyframe.timestamp = i / 30.0;
    keyframe.camera = "theta";
    keyframe.rotation_cw = turn(kernels::kPi * uniform(random), vector());
    keyframe.translation_cw = vector();
    for (int k = 0; k < 20; ++k) {
      keyframe.keypoints.emplace_back(static_cast<float>(960.0 + 930.0 * uniform(random)),
                                      static_cast<float>(480.0 + 460.0 * uniform(random)));
      keyframe.landmark_ids.push_back(static_cast<std::int64_t>(random() % static_cast<unsigned>(4 * landmarks)) - 10);
      if (keyframe.landmark_ids.back() < 0) keyframe.landmark_ids.back() = -1;
    }
    map.keyframes.push_back(keyframe);
  }
  return map;
}

json msgpack_tree(const SampleMap& map, MsgpackVersion version) {
  json tree = {{"cameras", json::object()}, {"keyframes", json::object()}, {"landmarks", json::object()}};
  for (const SampleCamera& camera : map.cameras) {
    tree["cameras"][camera.name] = camera_tree(camera);
    if (has_raw_keypoints(version)) {
      tree["cameras"][camera.name]["num_grid_cols"] = 64;
      tree["cameras"][camera.name]["num_grid_rows"] = 48;
    }
  }
  for (const SampleKeyframe& k : map.keyframes) tree["keyframes"][std::to_string(k.id)] = keyframe_tree(k, version);
  for (const SampleLandmark& landmark : map.landmarks) {
    tree["landmarks"][std::to_string(landmark.id)] = landmark_tree(landmark, version, map.keyframes.front().id);
  }
  if (version != MsgpackVersion::patchmatch_dense) {
    tree["keyframe_next_id"] = 11;
    tree["landmark_next_id"] = 101;
    if (version != MsgpackVersion::stella_0_3_6 && version != MsgpackVersion::stella_dense) tree["frame_next_id"] = 300;
  }
  if (!is_before_orb_params(version)) {
    tree["orb_params"]["default"] = {{"name", "default"}, {"scale_factor", 1.2F}, {"num_levels", 8}};
  }
  if (version == MsgpackVersion::stella_dense) {
    tree["dense_points"]["0"] = {{"pos_w", {1.0, 2.0, 3.0}}, {"color", {1, 2, 3}}, {"ref_keyfrm", -1}};
    tree["dense_point_next_id"] = 1;
  }
  return tree;
}

void write_file(const std::filesystem::path& path, const std::string& bytes) {
  std::filesystem::remove(path);  // to overwrite a file makes some file systems wait for the disk
  std::ofstream file(path, std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) throw std::runtime_error("cannot write " + path.string());
}

std::string msgpack_bytes(const json& tree) {
  const std::vector<std::uint8_t> bytes = json::to_msgpack(tree);
  return {bytes.begin(), bytes.end()};
}

std::string error_of(const std::filesystem::path& path) {
  try {
    read_map(path);
  } catch (const InvalidInput& error) {
    return std::string("InvalidInput: ") + error.what();
  } catch (const IoError& error) {
    return std::string("IoError: ") + error.what();
  } catch (const std::exception& error) {
    return std::string("not an error of the library: ") + error.what();
  }
  return "";
}

// ---- SQLite

namespace {

class SqliteWriter {
 public:
  explicit SqliteWriter(const std::filesystem::path& path) {
    if (sqlite3_open(path.string().c_str(), &database_) != SQLITE_OK) throw std::runtime_error("sqlite3_open");
  }
  ~SqliteWriter() { sqlite3_close(database_); }
  SqliteWriter(const SqliteWriter&) = delete;
  SqliteWriter& operator=(const SqliteWriter&) = delete;

  void run(const std::string& sql) {
    char* message = nullptr;
    if (sqlite3_exec(database_, sql.c_str(), nullptr, nullptr, &message) != SQLITE_OK) {
      throw std::runtime_error(sql + ": " + (message == nullptr ? "?" : message));
    }
  }

 private:
  sqlite3* database_ = nullptr;
};

/// X'...' literal of the bytes of an array, NULL when there are none, as stella_vslam writes it.
template <class T>
std::string blob(const T* data, std::size_t count) {
  static const char* const kHex = "0123456789abcdef";
  if (count == 0) return "NULL";
  const auto* bytes = reinterpret_cast<const unsigned char*>(data);
  std::string text = "X'";
  for (std::size_t i = 0; i < count * sizeof(T); ++i) {
    text += kHex[bytes[i] >> 4U];
    text += kHex[bytes[i] & 15U];
  }
  return text + "'";
}

std::string blob(const std::string& text) { return blob(text.data(), text.size()); }

std::string real(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.17g", value);
  return text;
}

struct CvKeyPoint {
  float x, y, size, angle, response;
  std::int32_t octave, class_id;
};

void insert_keyframe(SqliteWriter& writer, const SampleKeyframe& keyframe, SqliteVersion version) {
  Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
  pose.topLeftCorner<3, 3>() = keyframe.rotation_cw;
  pose.topRightCorner<3, 1>() = keyframe.translation_cw;
  std::vector<CvKeyPoint> keypoints;
  for (const Eigen::Vector2f& p : keyframe.keypoints) keypoints.push_back({p.x(), p.y(), 31.0F, 12.5F, 20.0F, 3, -1});
  const std::string points = blob(keypoints.data(), keypoints.size());
  const std::string id = std::to_string(keyframe.id);
  const bool old = version == SqliteVersion::stella_0_3_1 || version == SqliteVersion::stella_0_3_2;
  std::string values = id;
  if (version != SqliteVersion::stella_dense) values += old ? ", " + std::to_string(keyframe.source_frame) : ", NULL";
  values += ", " + real(keyframe.timestamp) + ", " + blob(keyframe.camera) + ", " + blob(std::string("default"));
  values += ", " + blob(pose.data(), 16) + ", " + std::to_string(keypoints.size());
  values += ", " + points + (version == SqliteVersion::stella_0_3_1 ? ", " + points : "");
  values += ", NULL, NULL, " + blob(std::string(32 * keypoints.size(), 'd'));
  if (version == SqliteVersion::stella_0_6_0) values += ", 0, NULL";
  if (version == SqliteVersion::stella_dense) values += ", X'89504e47', X'00', X'00'";
  writer.run("INSERT INTO keyframes VALUES(" + values + ")");
  const std::vector<std::int32_t> ids(keyframe.landmark_ids.begin(), keyframe.landmark_ids.end());
  writer.run("INSERT INTO associations VALUES(" + id + ", " + blob(ids.data(), ids.size()) + ", -1, 0, NULL, 0, NULL)");
}

void create_tables(SqliteWriter& writer, SqliteVersion version) {
  const std::string frame = version == SqliteVersion::stella_dense ? "" : "src_frm_id INTEGER, ";
  const std::string points =
      version == SqliteVersion::stella_0_3_1 ? "keypts BLOB, undists BLOB, " : "undist_keypts BLOB, ";
  const std::string extra = version == SqliteVersion::stella_0_6_0   ? ", n_markers INTEGER, markers BLOB"
                            : version == SqliteVersion::stella_dense ? ", image BLOB, depth BLOB, mask BLOB"
                                                                     : "";
  writer.run(
      "CREATE TABLE cameras(id INTEGER PRIMARY KEY, name BLOB, setup_type BLOB, model_type BLOB, color_type BLOB, cols "
      "INTEGER, rows INTEGER, fps REAL, fx REAL, fy REAL, cx REAL, cy REAL, k1 REAL, k2 REAL, p1 REAL, p2 REAL, k3 "
      "REAL, "
      "k4 REAL, focal_x_baseline REAL, distortion REAL);"
      "CREATE TABLE keyframes(id INTEGER PRIMARY KEY, " +
      frame + "ts REAL, cam BLOB, orb_params BLOB, pose_cw BLOB, n_keypts INTEGER, " + points +
      "x_rights BLOB, depths BLOB, descs BLOB" + extra +
      ");"
      "CREATE TABLE landmarks(id INTEGER PRIMARY KEY, first_keyfrm INTEGER, pos_w BLOB, ref_keyfrm INTEGER, n_vis "
      "INTEGER, "
      "n_fnd INTEGER);"
      "CREATE TABLE associations(id INTEGER PRIMARY KEY, lm_ids BLOB, span_parent INTEGER, n_spanning_children "
      "INTEGER, "
      "spanning_children BLOB, n_loop_edges INTEGER, loop_edges BLOB);"
      "CREATE TABLE stats(id INTEGER PRIMARY KEY, frame_next_id INTEGER, keyframe_next_id INTEGER, landmark_next_id "
      "INTEGER);");
  if (version == SqliteVersion::stella_dense) {
    writer.run("CREATE TABLE dense_points(id INTEGER PRIMARY KEY, pos_w BLOB, color BLOB, ref_keyfrm INTEGER)");
  }
}

}  // namespace

void write_sqlite(const std::filesystem::path& path, const SampleMap& map, SqliteVersion version,
                  const std::string& sql) {
  std::filesystem::remove(path);
  SqliteWriter writer(path);
  writer.run("PRAGMA synchronous = OFF; BEGIN");
  create_tables(writer, version);
  for (std::size_t i = 0; i < map.cameras.size(); ++i) {
    const SampleCamera& camera = map.cameras[i];
    writer.run("INSERT INTO cameras(id, name, setup_type, model_type, color_type, cols, rows, fps) VALUES(" +
               std::to_string(i) + ", " + blob(camera.name) + ", " + blob(std::string("Monocular")) + ", " +
               blob(std::string("Equirectangular")) + ", " + blob(std::string("BGR")) + ", " +
               std::to_string(camera.cols) + ", " + std::to_string(camera.rows) + ", " + real(camera.fps) + ")");
  }
  for (const SampleKeyframe& keyframe : map.keyframes) insert_keyframe(writer, keyframe, version);
  for (const SampleLandmark& landmark : map.landmarks) {
    writer.run("INSERT INTO landmarks VALUES(" + std::to_string(landmark.id) + ", 1, " +
               blob(landmark.position.data(), 3) + ", 2, 7, 5)");
  }
  writer.run("COMMIT");
  if (!sql.empty()) writer.run(sql);
}

}  // namespace pmsp::test
