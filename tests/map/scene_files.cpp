// SPDX-License-Identifier: BSD-2-Clause
#include "scene_files.h"

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <map>
#include <random>
#include <sstream>

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "pmsp/camera.h"
#include "support/temp_dir.h"
#include "support/zip_file.h"

namespace pmsp::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int kWidth = 640;

Eigen::Quaterniond quaternion(const RigidTransform& pose) { return Eigen::Quaterniond(pose.rotation); }

const MapCamera& camera_of(const SlamMap& map, const MapKeyframe& keyframe) {
  return map.cameras[static_cast<std::size_t>(keyframe.camera)];
}

std::string number(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.17g", value);
  return text;
}

void write(const fs::path& path, const std::string& bytes) {
  fs::create_directories(path.parent_path());
  pmsp_test::write_text(path, bytes);
}

json vector_json(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

template <class T>
void put(std::string& bytes, T value) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  bytes.append(raw, sizeof(T));
}

}  // namespace

SlamMap sample_scene(int keyframes, int landmarks) {
  SlamMap map;
  map.path = "sample";
  map.cameras = {{"camera 1", kWidth, kWidth / 2, 0.0}};
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto vector = [&] { return Eigen::Vector3d{uniform(random), uniform(random), uniform(random)}; };
  for (int i = 0; i < landmarks; ++i) map.landmarks.push_back({10 + 3 * i, 5.0 * vector().normalized()});
  for (int i = 0; i < keyframes; ++i) {
    MapKeyframe keyframe;
    keyframe.id = i;
    keyframe.timestamp = 0.5 * i;
    char name[40];
    std::snprintf(name, sizeof name, "part %d/frame %d.png", i < 3 ? 1 : 2, i + 5);  // 10 comes after 9
    keyframe.image = name;
    const Eigen::AngleAxisd turn(0.4 + 0.3 * i, vector().normalized());
    const Eigen::Vector3d center(0.3 * i - 1.0, 0.2 * std::sin(i), 0.3 * std::cos(2 * i));
    keyframe.cam_from_world.rotation = turn.toRotationMatrix();
    keyframe.cam_from_world.translation = -(keyframe.cam_from_world.rotation * center);
    for (const MapLandmark& landmark : map.landmarks) {
      const Eigen::Vector2d pixel =
          pixel_from_bearing(keyframe.cam_from_world * landmark.position_world, kWidth, kWidth / 2);
      keyframe.observations.push_back({landmark.id, pixel.cast<float>()});
    }
    map.keyframes.push_back(keyframe);
  }
  return map;
}

SlamMap with_fault(SlamMap map, Fault fault) {
  for (MapKeyframe& keyframe : map.keyframes) {
    const auto width = static_cast<float>(camera_of(map, keyframe).width);
    if (fault == Fault::inverted) keyframe.cam_from_world = keyframe.cam_from_world.inverse();
    for (MapObservation& observation : keyframe.observations) {
      float& x = observation.pixel.x();
      if (fault == Fault::mirrored) x = width - x;
      if (fault == Fault::shifted) {
        x = std::min(x + 0.5F, width);
        observation.pixel.y() += 0.5F;
      }
    }
  }
  return map;
}

void write_colmap_text(const fs::path& folder, const SlamMap& map) {
  std::string cameras =
      "# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n";
  for (std::size_t i = 0; i < map.cameras.size(); ++i) {
    const std::string size = std::to_string(map.cameras[i].width) + " " + std::to_string(map.cameras[i].height);
    cameras += std::to_string(i + 1) + " EQUIRECTANGULAR " + size + " " + size + "\n";
  }
  std::string images = "# Image list with two lines of data per image:\n";
  std::map<std::int64_t, std::string> tracks;
  for (const MapKeyframe& keyframe : map.keyframes) {
    const Eigen::Quaterniond q = quaternion(keyframe.cam_from_world);
    images += std::to_string(keyframe.id);
    for (const double value : {q.w(), q.x(), q.y(), q.z()}) images += " " + number(value);
    for (const double value : keyframe.cam_from_world.translation) images += " " + number(value);
    images += " " + std::to_string(keyframe.camera + 1) + " " + keyframe.image + "\n1.5 2.5 -1";
    std::size_t place = 1;
    for (const MapObservation& o : keyframe.observations) {
      images += " " + number(static_cast<double>(o.pixel.x())) + " " + number(static_cast<double>(o.pixel.y())) + " " +
                std::to_string(o.landmark_id);
      tracks[o.landmark_id] += " " + std::to_string(keyframe.id) + " " + std::to_string(place++);
    }
    images += "\n";
  }
  std::string points = "# 3D point list with one line of data per point:\n";
  for (const MapLandmark& landmark : map.landmarks) {
    points += std::to_string(landmark.id);
    for (const double value : landmark.position_world) points += " " + number(value);
    points += " 1 2 3 0.25" + tracks[landmark.id] + "\n";
  }
  write(folder / "cameras.txt", cameras);
  write(folder / "images.txt", images);
  write(folder / "points3D.txt", points);
}

void write_colmap_binary(const fs::path& folder, const SlamMap& map, bool with_rigs) {
  std::string cameras, images, points;
  put<std::uint64_t>(cameras, map.cameras.size());
  for (std::size_t i = 0; i < map.cameras.size(); ++i) {
    put(cameras, static_cast<std::uint32_t>(i + 1));
    put<std::int32_t>(cameras, 17);
    put(cameras, static_cast<std::uint64_t>(map.cameras[i].width));
    put(cameras, static_cast<std::uint64_t>(map.cameras[i].height));
    put(cameras, static_cast<double>(map.cameras[i].width));
    put(cameras, static_cast<double>(map.cameras[i].height));
  }
  std::map<std::int64_t, std::vector<std::uint32_t>> tracks;
  put<std::uint64_t>(images, map.keyframes.size());
  for (const MapKeyframe& keyframe : map.keyframes) {
    const Eigen::Quaterniond q = quaternion(keyframe.cam_from_world);
    put(images, static_cast<std::uint32_t>(keyframe.id));
    for (const double value : {q.w(), q.x(), q.y(), q.z()}) put(images, value);
    for (const double value : keyframe.cam_from_world.translation) put(images, value);
    put(images, static_cast<std::uint32_t>(keyframe.camera + 1));
    images += keyframe.image + '\0';
    put<std::uint64_t>(images, keyframe.observations.size() + 1);
    put(images, 1.5);
    put(images, 2.5);
    put<std::int64_t>(images, -1);
    std::uint32_t place = 1;
    for (const MapObservation& o : keyframe.observations) {
      put(images, static_cast<double>(o.pixel.x()));
      put(images, static_cast<double>(o.pixel.y()));
      put(images, o.landmark_id);
      tracks[o.landmark_id].push_back(static_cast<std::uint32_t>(keyframe.id));
      tracks[o.landmark_id].push_back(place++);
    }
  }
  put<std::uint64_t>(points, map.landmarks.size());
  for (const MapLandmark& landmark : map.landmarks) {
    put(points, landmark.id);
    for (const double value : landmark.position_world) put(points, value);
    points += "\x01\x02\x03";
    put(points, 0.25);
    put<std::uint64_t>(points, tracks[landmark.id].size() / 2);
    for (const std::uint32_t value : tracks[landmark.id]) put(points, value);
  }
  write(folder / "cameras.bin", cameras);
  write(folder / "images.bin", images);
  write(folder / "points3D.bin", points);
  if (!with_rigs) return;
  std::string rigs, frames;
  put<std::uint64_t>(rigs, 1);
  put<std::uint32_t>(rigs, 1);
  put<std::uint32_t>(rigs, 1);
  put<std::int32_t>(rigs, 0);
  put<std::uint32_t>(rigs, 1);
  put<std::uint64_t>(frames, 0);
  write(folder / "rigs.bin", rigs);
  write(folder / "frames.bin", frames);
}

void write_opensfm(const fs::path& folder, const SlamMap& map, const std::vector<SlamMap>& others) {
  json all = json::array();
  std::string tracks = "OPENSFM_TRACKS_VERSION_v2\n";
  std::vector<const SlamMap*> maps{&map};
  for (const SlamMap& other : others) maps.push_back(&other);
  for (const SlamMap* one : maps) {
    json tree = {{"cameras", json::object()}, {"shots", json::object()}, {"points", json::object()}};
    for (const MapCamera& camera : one->cameras) {
      tree["cameras"][camera.name] = {
          {"projection_type", "spherical"}, {"width", camera.width}, {"height", camera.height}};
    }
    for (const MapKeyframe& keyframe : one->keyframes) {
      const MapCamera& camera = camera_of(*one, keyframe);
      const Eigen::AngleAxisd turn(keyframe.cam_from_world.rotation);
      tree["shots"][keyframe.image] = {{"rotation", vector_json(turn.angle() * turn.axis())},
                                       {"translation", vector_json(keyframe.cam_from_world.translation)},
                                       {"camera", camera.name},
                                       {"capture_time", 0.0},
                                       {"orientation", 1}};
      for (const MapObservation& o : keyframe.observations) {
        const double x = (static_cast<double>(o.pixel.x()) - 0.5 * camera.width) / camera.width;
        const double y = (static_cast<double>(o.pixel.y()) - 0.5 * camera.height) / camera.width;
        tracks += keyframe.image + "\t" + std::to_string(o.landmark_id) + "\t7\t" + number(x) + "\t" + number(y) +
                  "\t0.004\t1\t2\t3\t-1\t-1\n";
      }
    }
    for (const MapLandmark& landmark : one->landmarks) {
      tree["points"][std::to_string(landmark.id)] = {{"color", {1.0, 2.0, 3.0}},
                                                     {"coordinates", vector_json(landmark.position_world)}};
    }
    all.push_back(tree);
  }
  write(folder / "reconstruction.json", all.dump(1));
  write(folder / "tracks.csv", tracks);
}

void write_openmvg(const fs::path& file, const SlamMap& map, const std::string& root_path) {
  json tree = {{"sfm_data_version", "0.3"}, {"root_path", root_path}};
  for (const char* section : {"views", "intrinsics", "extrinsics", "structure", "control_points"}) {
    tree[section] = json::array();
  }
  for (std::size_t i = 0; i < map.cameras.size(); ++i) {
    json value = {{"polymorphic_id", i == 0 ? 2147483649U : 1U},
                  {"ptr_wrapper",
                   {{"id", 2147483650U + i},
                    {"data", {{"value0", {{"width", map.cameras[i].width}, {"height", map.cameras[i].height}}}}}}}};
    if (i == 0) value["polymorphic_name"] = "spherical";
    tree["intrinsics"].push_back({{"key", i}, {"value", value}});
  }
  std::map<std::int64_t, json> observations;
  for (const MapKeyframe& keyframe : map.keyframes) {
    const MapCamera& camera = camera_of(map, keyframe);
    const fs::path image = keyframe.image;
    const json data = {{"local_path", image.parent_path().string()},
                       {"filename", image.filename().string()},
                       {"width", camera.width},
                       {"height", camera.height},
                       {"id_view", keyframe.id},
                       {"id_intrinsic", keyframe.camera},
                       {"id_pose", keyframe.id}};
    tree["views"].push_back(
        {{"key", keyframe.id},
         {"value",
          {{"polymorphic_id", 1073741824}, {"ptr_wrapper", {{"id", 2147483700 + keyframe.id}, {"data", data}}}}}});
    const RigidTransform pose = cam_from_slam_cam(camera.width).inverse() * keyframe.cam_from_world;
    json rotation = json::array();
    for (int row = 0; row < 3; ++row) rotation.push_back(vector_json(pose.rotation.row(row).transpose()));
    tree["extrinsics"].push_back(
        {{"key", keyframe.id}, {"value", {{"rotation", rotation}, {"center", vector_json(pose.center())}}}});
    for (const MapObservation& o : keyframe.observations) {
      const json place = {static_cast<double>(o.pixel.x()) - 0.5, static_cast<double>(o.pixel.y()) - 0.5};
      observations[o.landmark_id].push_back({{"key", keyframe.id}, {"value", {{"id_feat", 3}, {"x", place}}}});
    }
  }
  for (const MapLandmark& landmark : map.landmarks) {
    json seen = observations[landmark.id];
    if (seen.is_null()) seen = json::array();
    tree["structure"].push_back(
        {{"key", landmark.id}, {"value", {{"X", vector_json(landmark.position_world)}, {"observations", seen}}}});
  }
  write(file, tree.dump(1));
}

void write_points(const fs::path& file, const SlamMap& map) {
  std::string text = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(map.landmarks.size()) +
                     "\nproperty double x\nproperty double y\nproperty double z\nend_header\n";
  for (const MapLandmark& landmark : map.landmarks) {
    const Eigen::Vector3d& p = landmark.position_world;
    text += number(p.x()) + " " + number(p.y()) + " " + number(p.z()) + "\n";
  }
  write(file, text);
}

void write_nerfstudio(const fs::path& folder, const SlamMap& map) {
  json tree = {{"camera_model", "EQUIRECTANGULAR"}, {"w", map.cameras[0].width},     {"h", map.cameras[0].height},
               {"fl_x", map.cameras[0].height},     {"ply_file_path", "points.ply"}, {"frames", json::array()}};
  for (const MapKeyframe& keyframe : map.keyframes) {
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
    matrix.topLeftCorner<3, 3>() =
        keyframe.cam_from_world.rotation.transpose() * Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
    matrix.topRightCorner<3, 1>() = keyframe.cam_from_world.center();
    json rows = json::array();
    for (int row = 0; row < 4; ++row) {
      rows.push_back({matrix(row, 0), matrix(row, 1), matrix(row, 2), matrix(row, 3)});
    }
    tree["frames"].push_back({{"file_path", "images/" + keyframe.image}, {"transform_matrix", rows}});
  }
  write(folder / "transforms.json", tree.dump(1));
  write_points(folder / "points.ply", map);
}

void write_metashape(const fs::path& file, const SlamMap& map) {
  // The chunk has a frame and a unit of its own.
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1.0, 2.0, 3.0).normalized()).toRotationMatrix();
  const Eigen::Vector3d shift(10.0, -20.0, 30.0);
  constexpr double kScale = 2.5;
  std::ostringstream out;
  out.precision(17);
  out << "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<document version=\"2.0.0\">\n"
      << "  <chunk label=\"Chunk 1\" enabled=\"true\">\n    <sensors next_id=\"1\">\n";
  for (std::size_t i = 0; i < map.cameras.size(); ++i) {
    out << "      <sensor id=\"" << i << "\" label=\"unknown\" type=\"spherical\"><resolution width=\""
        << map.cameras[i].width << "\" height=\"" << map.cameras[i].height << "\"/></sensor>\n";
  }
  const auto rows = [&](const Eigen::Matrix3d& m) {
    for (int i = 0; i < 9; ++i) out << (i > 0 ? " " : "") << m(i / 3, i % 3);
  };
  out << "    </sensors>\n    <components next_id=\"1\" active_id=\"0\"><component id=\"0\" label=\"Component 1\">"
      << "<transform><rotation locked=\"false\">";
  rows(turn);
  out << "</rotation><translation>" << shift.x() << " " << shift.y() << " " << shift.z() << "</translation><scale>"
      << kScale << "</scale></transform></component></components>\n    <cameras next_id=\"9\">\n";
  for (const MapKeyframe& keyframe : map.keyframes) {
    const Eigen::Matrix3d rotation = turn.transpose() * keyframe.cam_from_world.rotation.transpose();
    const Eigen::Vector3d center = turn.transpose() * (keyframe.cam_from_world.center() - shift) / kScale;
    out << "      <camera id=\"" << keyframe.id << "\" sensor_id=\"" << keyframe.camera
        << "\" component_id=\"0\" label=\"" << keyframe.image << "\"><transform>";
    for (int i = 0; i < 3; ++i) {
      out << rotation(i, 0) << " " << rotation(i, 1) << " " << rotation(i, 2) << " " << center[i] << " ";
    }
    out << "0 0 0 1</transform></camera>\n";
  }
  out << "      <camera id=\"1000\" sensor_id=\"0\" component_id=\"0\" label=\"not aligned.jpg\"/>\n"
      << "    </cameras>\n  </chunk>\n</document>\n";
  write(file, out.str());
}

void write_alicevision(const fs::path& file, const SlamMap& map) {
  json tree = {{"version", {"1", "2", "8"}}};
  for (const char* section : {"views", "intrinsics", "poses", "structure"}) tree[section] = json::array();
  for (std::size_t i = 0; i < map.cameras.size(); ++i) {
    tree["intrinsics"].push_back({{"intrinsicId", std::to_string(i)},
                                  {"width", std::to_string(map.cameras[i].width)},
                                  {"height", std::to_string(map.cameras[i].height)},
                                  {"type", "equirectangular"},
                                  {"principalPoint", {"0", "0"}}});
  }
  std::map<std::int64_t, json> observations;
  for (const MapKeyframe& keyframe : map.keyframes) {
    const std::string id = std::to_string(1'000'000'000 - 7 * keyframe.id);  // a hash, in no order
    tree["views"].push_back({{"viewId", id},
                             {"poseId", id},
                             {"intrinsicId", std::to_string(keyframe.camera)},
                             {"path", "/data/" + keyframe.image}});
    const RigidTransform pose = cam_from_slam_cam(camera_of(map, keyframe).width).inverse() * keyframe.cam_from_world;
    json rotation = json::array(), center = json::array();
    for (Eigen::Index i = 0; i < 9; ++i) rotation.push_back(number(pose.rotation(i % 3, i / 3)));
    for (const double value : pose.center()) center.push_back(number(value));
    tree["poses"].push_back(
        {{"poseId", id}, {"pose", {{"transform", {{"rotation", rotation}, {"center", center}}}, {"locked", "0"}}}});
    for (const MapObservation& o : keyframe.observations) {
      observations[o.landmark_id].push_back(
          {{"observationId", id},
           {"featureId", "3"},
           {"x", {number(static_cast<double>(o.pixel.x()) - 0.5), number(static_cast<double>(o.pixel.y()) - 0.5)}}});
    }
  }
  for (const MapLandmark& landmark : map.landmarks) {
    json seen = observations[landmark.id], place = json::array();
    if (seen.is_null()) seen = json::array();
    for (const double value : landmark.position_world) place.push_back(number(value));
    tree["structure"].push_back({{"landmarkId", std::to_string(landmark.id)}, {"X", place}, {"observations", seen}});
  }
  write(file, tree.dump(1));
}

void write_kitti(const fs::path& file, const SlamMap& map) {
  std::string text;
  for (const MapKeyframe& keyframe : map.keyframes) {
    const RigidTransform pose = keyframe.cam_from_world.inverse();
    for (int i = 0; i < 12; ++i) {
      text += (i > 0 ? " " : "") + number(i % 4 < 3 ? pose.rotation(i / 4, i % 4) : pose.translation[i / 4]);
    }
    text += "\n";
  }
  write(file, text);
}

void write_euroc(const fs::path& file, const SlamMap& map, double first) {
  std::string text =
      "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], v_RS_R_x [m "
      "s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1], b_w_RS_S_y [rad s^-1], b_w_RS_S_z [rad "
      "s^-1], b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], b_a_RS_S_z [m s^-2]\r\n";
  for (const MapKeyframe& keyframe : map.keyframes) {
    const RigidTransform pose = keyframe.cam_from_world.inverse();
    const Eigen::Quaterniond q = quaternion(pose);
    text += std::to_string(std::llround((first + keyframe.timestamp) * 1e3)) + "000000";
    for (const double value : pose.translation) text += "," + number(value);
    for (const double value : {q.w(), q.x(), q.y(), q.z()}) text += "," + number(value);
    for (int i = 0; i < 9; ++i) text += ",0.5";
    text += "\r\n";
  }
  write(file, text);
}

void write_tum(const fs::path& file, const SlamMap& map) {
  std::string text = "# timestamp tx ty tz qx qy qz qw\n";
  std::string list = "# timestamp filename\n";
  for (const MapKeyframe& keyframe : map.keyframes) {
    const Eigen::Vector3d center = keyframe.cam_from_world.center();
    const Eigen::Quaterniond q = quaternion(keyframe.cam_from_world).conjugate();
    text += number(keyframe.timestamp);
    for (const double value : center) text += " " + number(value);
    for (const double value : {q.x(), q.y(), q.z(), q.w()}) text += " " + number(value);
    text += "\n";
    list += number(keyframe.timestamp + 0.001) + " " + keyframe.image + "\n";
  }
  write(file, text);
  write(file.parent_path() / "images.txt", list);
  write_points(file.parent_path() / "points.ply", map);
}

std::string npy_bytes(const std::string& type, const std::string& shape, const std::string& values) {
  const std::string header = "{'descr': '" + type + "', 'fortran_order': False, 'shape': (" + shape + "), }\n";
  std::string bytes = "\x93NUMPY";
  put(bytes, std::uint16_t{1});  // version 1.0
  put(bytes, static_cast<std::uint16_t>(header.size()));
  return bytes + header + values;
}

void write_vipe(const fs::path& folder, const SlamMap& map, const std::string& name) {
  std::string poses, frames, cameras;
  for (const MapKeyframe& keyframe : map.keyframes) {
    const RigidTransform pose = keyframe.cam_from_world.inverse();
    for (int row = 0; row < 4; ++row) {
      for (int column = 0; column < 4; ++column) {
        const double value = row == 3      ? (column == 3 ? 1.0 : 0.0)
                             : column == 3 ? pose.translation[row]
                                           : pose.rotation(row, column);
        put(poses, static_cast<float>(value));
      }
    }
    put(frames, keyframe.id);
    cameras += std::to_string(keyframe.id) + ": PANORAMA\n";
  }
  const std::string count = std::to_string(map.keyframes.size());
  pmsp_test::write_zip(folder / "pose" / (name + ".npz"), {{"data.npy", npy_bytes("<f4", count + ", 4, 4", poses)},
                                                           {"inds.npy", npy_bytes("<i8", count + ",", frames)}});
  write(folder / "intrinsics" / (name + "_camera.txt"), cameras);
}

ReadMapOptions FormatFiles::options(const fs::path& folder) const {
  ReadMapOptions options;
  if (!has_points || std::string(name) == "TUM") options.points = folder / "points.ply";
  if (std::string(name) == "TUM") options.image_list = folder / "images.txt";
  return options;
}

const std::vector<FormatFiles>& all_formats() {
  static const std::vector<FormatFiles> formats{
      {"COLMAP text",
       true,
       true,
       [](const fs::path& folder, const SlamMap& map) {
         write_colmap_text(folder, map);
         return folder;
       },
       {"cameras.txt", "images.txt", "points3D.txt"}},
      {"COLMAP binary",
       true,
       true,
       [](const fs::path& folder, const SlamMap& map) {
         write_colmap_binary(folder, map);
         return folder;
       },
       {"cameras.bin", "images.bin", "points3D.bin"}},
      {"OpenSfM",
       true,
       true,
       [](const fs::path& folder, const SlamMap& map) {
         write_opensfm(folder, map);
         return folder / "reconstruction.json";
       },
       {"reconstruction.json", "tracks.csv"}},
      {"openMVG",
       true,
       true,
       [](const fs::path& folder, const SlamMap& map) {
         write_openmvg(folder / "sfm_data.json", map);
         return folder / "sfm_data.json";
       },
       {"sfm_data.json"}},
      {"nerfstudio",
       false,
       true,
       [](const fs::path& folder, const SlamMap& map) {
         write_nerfstudio(folder, map);
         return folder / "transforms.json";
       },
       {"transforms.json", "points.ply"}},
      {"Metashape",
       false,
       false,
       [](const fs::path& folder, const SlamMap& map) {
         write_metashape(folder / "cameras.xml", map);
         write_points(folder / "points.ply", map);
         return folder / "cameras.xml";
       },
       {"cameras.xml", "points.ply"}},
      {"AliceVision",
       true,
       true,
       [](const fs::path& folder, const SlamMap& map) {
         write_alicevision(folder / "cameras.sfm", map);
         return folder / "cameras.sfm";
       },
       {"cameras.sfm"}},
      {"TUM",
       false,
       true,
       [](const fs::path& folder, const SlamMap& map) {
         write_tum(folder / "trajectory.txt", map);
         return folder / "trajectory.txt";
       },
       {"trajectory.txt", "images.txt", "points.ply"}},
  };
  return formats;
}

}  // namespace pmsp::test
