// SPDX-License-Identifier: BSD-2-Clause
// Trajectory formats and detection of the quaternion order.
#include <catch2/catch.hpp>
#include <cmath>

#include <Eigen/Geometry>

#include "io/trajectory.h"
#include "map_files.h"
#include "pmsp/error.h"
#include "pmsp/io/map.h"
#include "scene_files.h"
#include "support/temp_dir.h"

namespace pmsp::test {

using Catch::Contains;
using pmsp_test::TempDir;

namespace {

void check_same_poses(const SlamMap& read, const SlamMap& map) {
  REQUIRE(read.keyframes.size() == map.keyframes.size());
  for (std::size_t i = 0; i < map.keyframes.size(); ++i) {
    const RigidTransform& a = read.keyframes[i].cam_from_world;
    const RigidTransform& b = map.keyframes[i].cam_from_world;
    CHECK((a.rotation - b.rotation).cwiseAbs().maxCoeff() < 2e-9);
    CHECK((a.translation - b.translation).norm() < 1e-8);
  }
}

/// A flight along a curve, the camera looking ahead, from `yaw` [rad] on, in a world whose z is up if `z_up`.
SlamMap flight(double yaw, bool z_up) {
  SlamMap map;
  map.cameras = {{"camera", 640, 320, 0.0}};
  Eigen::Matrix3d world_from_level = Eigen::Matrix3d::Identity();  // y down
  if (z_up) world_from_level << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  Eigen::Vector3d center(1.0, 2.0, 3.0);
  for (int i = 0; i < 40; ++i) {
    const double turn = yaw + 0.06 * i;
    const Eigen::Matrix3d level = Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitY()).toRotationMatrix() *
                                  Eigen::AngleAxisd(0.05 * std::sin(i), Eigen::Vector3d::UnitX()).toRotationMatrix();
    MapKeyframe keyframe;
    keyframe.id = i;
    keyframe.timestamp = 100.0 + 0.1 * i;
    keyframe.cam_from_world.rotation = (world_from_level * level).transpose();
    keyframe.cam_from_world.translation = -(keyframe.cam_from_world.rotation * center);
    center += world_from_level * level * Eigen::Vector3d(0.02 * std::cos(3 * i), 0.0, 0.2);
    map.keyframes.push_back(keyframe);
  }
  return map;
}

struct Style {
  bool w_first = false;
  double unit = 1.0;  ///< of a second
  const char* separator = " ";
  const char* end = "";
  const char* header = "";
};

std::string text_of(const SlamMap& map, const Style& style) {
  std::string text = style.header;
  for (const MapKeyframe& keyframe : map.keyframes) {
    const RigidTransform pose = keyframe.cam_from_world.inverse();
    const Eigen::Quaterniond q(pose.rotation);
    char line[300];
    std::snprintf(line, sizeof line, style.unit > 1.0 ? "%.0f" : "%.6f", keyframe.timestamp * style.unit);
    text += line;
    std::vector<double> values{pose.translation.x(), pose.translation.y(), pose.translation.z()};
    const std::vector<double> last{q.x(), q.y(), q.z(), q.w()}, first{q.w(), q.x(), q.y(), q.z()};
    values.insert(values.end(), (style.w_first ? first : last).begin(), (style.w_first ? first : last).end());
    for (const double value : values) {
      std::snprintf(line, sizeof line, "%s%.15g", style.separator, value);
      text += line;
    }
    text += style.end + std::string("\n");
  }
  return text;
}

SlamMap read_text(const std::string& text, const ReadMapOptions& options = {}) {
  const TempDir folder;
  write_file(folder / "trajectory", text);
  return read_map(folder / "trajectory", options);
}

}  // namespace

TEST_CASE("KITTI has twelve numbers per line and one line per frame") {
  const TempDir folder;
  const SlamMap map = sample_scene();
  write_kitti(folder / "poses.txt", map);
  const SlamMap read = read_map(folder / "poses.txt");
  check_same_poses(read, map);
  CHECK(read.format == "KITTI poses");
  CHECK(read.ids_are_row_numbers);
  CHECK(read.keyframes[3].timestamp == 0.0);
  CHECK(read.keyframes[3].source_frame == 3);
  REQUIRE(read.notes.size() == 1);
  CHECK_THAT(read.notes[0], Contains("no times") && Contains("--image-list"));
  ReadMapOptions options;
  options.image_list = folder / "list";
  write_file(options.image_list,
             "\xEF\xBB\xBF"
             "a.png\nb.png\nc.png\nd.png\ne.png\nf.png\ng.png\nh.png\n");
  CHECK(read_map(folder / "poses.txt", options).keyframes[0].image == "a.png");
  write_file(folder / "poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n2 0 0 0 0 1 0 0 0 0 1 0\n");
  CHECK_THAT(error_of(folder / "poses.txt"), Contains("line 2") && Contains("no rotation"));
  write_file(folder / "poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1\n");
  CHECK_THAT(error_of(folder / "poses.txt"), Contains("line 2") && Contains("11 numbers"));
}

TEST_CASE("EuRoC and VINS have nanoseconds and w first and further columns") {
  const TempDir folder;
  const SlamMap map = sample_scene();
  write_euroc(folder / "data.csv", map);
  const SlamMap read = read_map(folder / "data.csv");
  check_same_poses(read, map);
  CHECK(read.format == "EuRoC or VINS trajectory");
  CHECK(read.keyframes[3].timestamp == Approx(1.6e9 + 1.5).epsilon(1e-15));
  CHECK_THAT(read.notes.at(0), Contains("w first"));
  const std::string text = read_file(folder / "data.csv");
  check_same_poses(read_text(text.substr(text.find('\n') + 1)), map);  // without the header
  write_euroc(folder / "short.csv", map, 10.0);                        // nanoseconds of a simulation
  CHECK(read_map(folder / "short.csv").keyframes[3].timestamp == Approx(11.5).epsilon(1e-12));
  for (const char* end : {",", ",0.1,0.2,0.3,"}) {
    check_same_poses(read_text(text_of(map, {true, 1e9, ",", end})), map);
  }
}

TEST_CASE("columns are identified by the header where present") {
  const SlamMap map = sample_scene();
  check_same_poses(read_text(text_of(map, {true, 1.0, " ", "", "# timestamp tx ty tz qw qx qy qz\n"})), map);
  check_same_poses(read_text(text_of(map, {false, 1.0, ",", "", "time,x,y,z,qx,qy,qz,qw\n"})), map);
  const SlamMap named = read_text(text_of(map, {true, 1e9, ",", ",7",
                                                "%time,field.pose.position.x,field.pose.position.y,field.pose.position."
                                                "z,field.pose.orientation.w,field.pose.orientation.x,field.pose."
                                                "orientation.y,field.pose.orientation.z,seq\n"}));
  check_same_poses(named, map);
  CHECK(read_text(text_of(map, {false, 1.0, " ", "", "# timestamp tx ty tz qx qy qz qw\n"})).format ==
        "TUM trajectory");
  CHECK_THROWS_WITH(read_text(text_of(map, {false, 1.0, " ", " 5"})), Contains("this looks like a text file"));
}

TEST_CASE("the quaternion order is detected from an identity start or a camera along its path") {
  for (const double yaw : {0.0, 0.9, 2.5}) {
    for (const bool z_up : {false, true}) {
      for (const bool w_first : {false, true}) {
        for (const double unit : {1.0, 1e9}) {
          CAPTURE(yaw, z_up, w_first, unit);
          const SlamMap map = flight(yaw, z_up);
          const SlamMap read = read_text(text_of(map, {w_first, unit, unit > 1.0 ? "," : " "}));
          check_same_poses(read, map);
          CHECK(read.keyframes[5].timestamp == Approx(100.5).epsilon(1e-12));
          const bool has_note = !read.notes.empty();
          CHECK(has_note == (w_first || unit > 1.0));
          if (w_first) CHECK_THAT(read.notes.at(0), Contains("w first"));
        }
      }
    }
  }
  // Without evidence, TUM's order is kept.
  const SlamMap random = sample_scene();
  const SlamMap read = read_text(text_of(random, {}));
  check_same_poses(read, random);
  CHECK(read.notes.empty());
}

TEST_CASE("lost poses of a trajectory are skipped and non-unit quaternions normalised") {
  const std::string pose = " 1 2 3 0 0 0 1\n";
  const SlamMap map =
      read_text("1" + pose + "2 nan nan nan nan nan nan nan\n3 0 0 0 0 0 0 0\n4 1 2 3 0 0 0 1.2\n5" + pose);
  CHECK(map.keyframes.size() == 3);
  REQUIRE(map.notes.size() == 2);
  CHECK_THAT(map.notes[0], Contains("normalised: 1"));
  CHECK_THAT(map.notes[1], Contains("poses are lost") && Contains(": 2"));
  CHECK(map.keyframes[1].cam_from_world.rotation.isIdentity(1e-12));
  CHECK_THROWS_WITH(read_text("1 0 0 0 0 0 0 0\n2 0 0 0 0 0 0 0\n"), Contains("poses are lost") && Contains(": 2"));
  CHECK_THROWS_WITH(read_text("1" + pose + "2 1 2 3 0 0 0 3\n"), Contains("line 2") && Contains("length 3"));
}

TEST_CASE("times may be in seconds or milli- or micro- or nanoseconds") {
  for (const double unit : {1.0, 1e3, 1e6, 1e9}) {
    CAPTURE(unit);
    CHECK(map_detail::seconds(1.7e9 * unit) == Approx(1.7e9).epsilon(1e-12));
  }
  CHECK(map_detail::seconds(12.5) == 12.5);
}

TEST_CASE("the camera extrinsics are applied in every notation") {
  const TempDir folder;
  const SlamMap map = sample_scene();
  RigidTransform camera_from_body;
  camera_from_body.rotation = Eigen::AngleAxisd(0.5, Eigen::Vector3d(1.0, 2.0, 3.0).normalized()).toRotationMatrix();
  camera_from_body.translation = {0.1, -0.2, 0.3};
  SlamMap bodies = map;
  for (MapKeyframe& keyframe : bodies.keyframes) {
    keyframe.cam_from_world = camera_from_body.inverse() * keyframe.cam_from_world;
  }
  write_tum(folder / "t.txt", bodies);
  const auto rows = [](const RigidTransform& transform, const char* open, const char* close) {
    std::string text;
    for (int i = 0; i < 4; ++i) {
      text += open;
      for (int k = 0; k < 4; ++k) {
        char number[40];
        const double value = i == 3   ? (k == 3 ? 1.0 : 0.0)
                             : k == 3 ? transform.translation[i]
                                      : transform.rotation(i, k);
        std::snprintf(number, sizeof number, "%s%.17g", k > 0 ? ", " : "", value);
        text += number;
      }
      text += close;
    }
    return text;
  };
  const RigidTransform inverse = camera_from_body.inverse();
  const Eigen::Quaterniond q(camera_from_body.rotation);
  char seven[200];
  std::snprintf(seven, sizeof seven, "0.1 -0.2 0.3 %.17g %.17g %.17g %.17g\n", q.x(), q.y(), q.z(), q.w());
  const std::string plain = rows(camera_from_body, "", "\n");
  const std::vector<std::string> texts{
      "\xEF\xBB\xBF# camera from body\n" + plain,
      plain.substr(0, plain.rfind('\n', plain.size() - 2)),
      seven,
      "%YAML:1.0\ncam0:\n  T_cam_imu:\n" + rows(camera_from_body, "  - [", "]\n") + "  camera_model: omni\n",
      "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [" + rows(inverse, "", ",\n") + "]\nrate_hz: 20\n",
      "body_T_cam0: !!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: d\n   data: [" + rows(inverse, "", ",\n") + "]\n"};
  ReadMapOptions options;
  options.camera_from_body = folder / "transform";
  for (const std::string& text : texts) {
    CAPTURE(text);
    write_file(options.camera_from_body, text);
    const SlamMap read = read_map(folder / "t.txt", options);
    check_same_poses(read, map);
    CHECK_THAT(read.notes.at(0), Contains("poses are those of a body"));
  }
  for (const char* text :
       {"", "1 2 3\n", "0 0 0 0 0 0 0\n", "1 0 0 0\n0 1 0 0\n0 0 1 0\n1 2 3 1\n", "a b c d e f g\n"}) {
    CAPTURE(text);
    write_file(options.camera_from_body, text);
    CHECK_THROWS_AS(read_map(folder / "t.txt", options), InvalidInput);
  }
  write_openmvg(folder / "sfm_data.json", map);
  CHECK_THROWS_AS(read_map(folder / "sfm_data.json", options), InvalidOption);
}

}  // namespace pmsp::test
