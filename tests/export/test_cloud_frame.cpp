// SPDX-License-Identifier: BSD-2-Clause
#include <cmath>
#include <sstream>

#include <catch2/catch.hpp>

#include <Eigen/Geometry>

#include "elementary.h"
#include "export/cloud_frame.h"
#include "pmsp/error.h"
#include "support/temp_dir.h"

using namespace pmsp;
using namespace pmsp_test;
using Catch::Contains;

namespace {

// A flight in a curve, at heights that change, turning all the while, slightly tilted: a SLAM's frame with y down.
SlamMap flight(bool is_straight = false) {
  SlamMap map;
  for (int i = 0; i < 12; ++i) {
    MapKeyframe keyframe;
    keyframe.id = 10 * i;
    keyframe.timestamp = 0.5 * i;
    const double a = is_straight ? 0.0 : 0.3 * i;
    const Eigen::Vector3d center =
        is_straight ? Eigen::Vector3d(0.1 * i, 0.0, 0.0) : Eigen::Vector3d(std::sin(a), 0.1 * (i % 3), std::cos(a));
    const Eigen::Matrix3d map_from_cam =
        (Eigen::AngleAxisd(1.1 * i, Eigen::Vector3d::UnitY()) * Eigen::AngleAxisd(0.03, Eigen::Vector3d::UnitX()))
            .toRotationMatrix();
    keyframe.cam_from_world = RigidTransform{map_from_cam, center}.inverse();
    map.keyframes.push_back(keyframe);
  }
  return map;
}

const Similarity& truth() {
  static const Similarity it{2.5,
                             Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix(),
                             {400000.0, 5000000.0, 80.0}};
  return it;
}

void check_same(const Similarity& a, const Similarity& b, double tolerance) {
  CHECK(a.scale == Approx(b.scale).epsilon(tolerance));
  CHECK((a.rotation - b.rotation).norm() < tolerance);
  CHECK((a.translation - b.translation).norm() < 100.0 * tolerance);
}

std::string line_of(std::initializer_list<double> numbers) {
  std::ostringstream text;
  text.precision(17);
  for (const double number : numbers) text << number << ' ';
  return text.str() + "\n";
}

std::string trajectory(const SlamMap& map, double time_offset, bool between) {
  std::string text = "# a trajectory\n";
  for (const MapKeyframe& keyframe : map.keyframes) {
    const RigidTransform pose = truth() * keyframe.cam_from_world.inverse();
    const Eigen::Quaterniond q(pose.rotation);
    const Eigen::Vector3d& t = pose.translation;
    const double time = keyframe.timestamp + time_offset + (between ? 0.25 : 0.0);
    text += line_of({time, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()});
  }
  return text;
}

CloudFrame aligned(const std::filesystem::path& file, const SlamMap& map, double time_offset = 0.0) {
  FrameOptions options;
  options.align = file;
  options.align_time_offset = time_offset;
  return find_cloud_frame(options, map);
}

}  // namespace

TEST_CASE("control points and camera positions and a trajectory each give the frame with zero residuals") {
  const TempDir dir;
  const SlamMap map = flight();
  std::string points = "# NAME x y z X Y Z\n", places;
  for (const MapKeyframe& keyframe : map.keyframes) {
    const Eigen::Vector3d x = keyframe.cam_from_world.center() + Eigen::Vector3d(0.1, 0.2, 0.3);
    const Eigen::Vector3d X = truth() * x;
    const Eigen::Vector3d C = truth() * keyframe.cam_from_world.center();
    points += "P" + std::to_string(keyframe.id) + ", " + line_of({x.x(), x.y(), x.z(), X.x(), X.y(), X.z()});
    places += line_of({static_cast<double>(keyframe.id), C.x(), C.y(), C.z()});
  }
  write_text(dir / "points", points);
  write_text(dir / "places", places);
  write_text(dir / "tum", trajectory(map, 1.7e9, false));
  for (const char* name : {"points", "places", "tum"}) {
    INFO(name);
    const CloudFrame frame = aligned(dir / name, map, name == std::string("tum") ? 1.7e9 : 0.0);
    check_same(frame.file_from_map, truth(), 1e-5);
    CHECK(frame.residuals.size() == map.keyframes.size());
    CHECK(frame.residual_max() < 1e-5);
    CHECK_THAT(frame.description, Contains("12 points") && Contains("scale 2.5") && Contains("residuals"));
  }
  CHECK(aligned(dir / "points", map).residuals[3].name == "P30");
}

TEST_CASE("camera positions are read by image name with a byte order mark and a header and other images") {
  const TempDir dir;
  SlamMap map = flight();
  ImageFiles files;
  std::string text = "\xEF\xBB\xBFImage, X, Y, Z\r\n", twice = "left/7.jpg,1,2,3\n";
  for (std::size_t i = 0; i < map.keyframes.size(); ++i) {
    MapKeyframe& keyframe = map.keyframes[i];
    const std::string stem = "frame " + std::to_string(keyframe.id);
    if (i % 2 == 0) keyframe.image = "part/" + stem + ".png";  // the map names it
    if (i % 2 == 1) files[keyframe.id] = "/data/part/" + stem + ".jpg";
    const std::string name = i % 3 == 0   ? stem
                             : i % 3 == 1 ? "\"part/" + stem + ".tif\""
                                          : "C:\\x\\part\\" + stem + ".jpg";
    const Eigen::Vector3d C = truth() * keyframe.cam_from_world.center();
    text += name + "," + line_of({C.x(), C.y(), C.z()}) + "no keyframe " + std::to_string(i) + ".jpg,1,2,3\n";
  }
  write_text(dir / "table", text);
  FrameOptions options;
  options.align = dir / "table";
  const CloudFrame frame = find_cloud_frame(options, map, files);
  check_same(frame.file_from_map, truth(), 1e-5);
  CHECK(frame.residuals.size() == map.keyframes.size());

  write_text(dir / "table", "other.jpg 1 2 3\nb.jpg 2 3 4\n");
  CHECK_THROWS_WITH(find_cloud_frame(options, map, files), Contains("0 keyframes") && Contains("other.jpg"));
  map.keyframes[0].image = "left/7.jpg";
  map.keyframes[1].image = "right/7.jpg";
  write_text(dir / "table", twice + "7.jpg,1,2,3\n");
  CHECK_THROWS_WITH(find_cloud_frame(options, map, files), Contains("line 2") && Contains("several keyframes"));
  write_text(dir / "table", "image,latitude,longitude,altitude\na,52,7,100\n");
  CHECK_THROWS_WITH(find_cloud_frame(options, map, files), Contains("latitude and longitude") && Contains("metres"));
}

TEST_CASE("a trajectory in nanoseconds with w first aligns like TUM and one without times is refused") {
  const TempDir dir;
  const SlamMap map = flight();
  std::string text = "#timestamp [ns],p_x,p_y,p_z,q_w,q_x,q_y,q_z\n";
  for (const MapKeyframe& keyframe : map.keyframes) {
    const RigidTransform pose = truth() * keyframe.cam_from_world.inverse();
    const Eigen::Quaterniond q(pose.rotation);
    const Eigen::Vector3d& t = pose.translation;
    char line[300];
    std::snprintf(line, sizeof line, "%.0f,%.15g,%.15g,%.15g,%.15g,%.15g,%.15g,%.15g\n",
                  std::round((1.7e9 + keyframe.timestamp) * 1e3) * 1e6, t.x(), t.y(), t.z(), q.w(), q.x(), q.y(),
                  q.z());
    text += line;
  }
  write_text(dir / "data.csv", text);
  check_same(aligned(dir / "data.csv", map, 1.7e9).file_from_map, truth(), 1e-5);
  write_text(dir / "kitti", "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 0\n");
  CHECK_THROWS_WITH(aligned(dir / "kitti", map), Contains("no times"));
}

TEST_CASE("a wrong control point appears in the residuals by name") {
  const TempDir dir;
  std::string text;
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d x(i % 2, i / 2 % 2, i / 4);
    const Eigen::Vector3d X = truth() * x + Eigen::Vector3d(0.0, 0.0, i == 5 ? 0.5 : 0.0);
    text += "P" + std::to_string(i) + " " + line_of({x.x(), x.y(), x.z(), X.x(), X.y(), X.z()});
  }
  write_text(dir / "points", text);
  const CloudFrame frame = aligned(dir / "points", flight());
  CHECK_THAT(frame.description, Contains("(P5)"));
  CHECK((frame.residual_max() > 0.1 && frame.residual_max() < 0.5));
  CHECK((frame.residual_rms() > 0.05 && frame.residual_rms() < frame.residual_max()));
}

TEST_CASE("camera positions are interpolated between poses of a trajectory") {
  const TempDir dir;
  SlamMap map = flight();
  write_text(dir / "tum", trajectory(map, 0.0, true));
  for (MapKeyframe& keyframe : map.keyframes) keyframe.timestamp += 0.25;
  map.keyframes[4].timestamp += 0.25;  // half way to the next one
  map.keyframes[4].cam_from_world.translation =
      -(map.keyframes[4].cam_from_world.rotation * 0.5 *
        (map.keyframes[4].cam_from_world.center() + map.keyframes[5].cam_from_world.center()));
  const CloudFrame frame = aligned(dir / "tum", map);
  check_same(frame.file_from_map, truth(), 1e-5);
  CHECK(frame.residuals.size() == 12);
}

TEST_CASE("on a straight flight the orientations of a trajectory are used and positions alone are refused") {
  const TempDir dir;
  const SlamMap map = flight(true);
  write_text(dir / "tum", trajectory(map, 0.0, false));
  check_same(aligned(dir / "tum", map).file_from_map, truth(), 1e-5);
  write_text(dir / "places", "0 1 0 0\n10 2 0 0\n20 3 0 0\n30 4 0 0\n");
  CHECK_THROWS_WITH(aligned(dir / "places", map), Contains("on a line"));
}

TEST_CASE("invalid tables are refused with file and line") {
  const TempDir dir;
  const std::vector<std::pair<std::string, std::string>> cases{
      {"", "contains no line"},
      {"1 2 3\n", "line 1: expected lines of one kind"},
      {"0 1 2 3\n10 1 2\n", "line 2: expected lines of one kind"},
      {"0 1 2 3\n11 1 2 3\n", "line 2: the map has no keyframe"},
      {"1 2 3 4 5 x\n", "line 1: \"x\" is no number"},
      {"1 2 3 4 5 nan\n", "is no number"},
      {"a 0 1 2 3\n", "line 1: expected"},
      {"1 2 3 4 5 6\n", "at least 3"},
      {"1 2 3 4 5 6\n1 2 3 4 5 6\n1 2 3 4 5 6\n", "on a line"},
      {"0 0 0 0 0 0 0 2.1\n", "has length 2.1"},
      {"100 0 0 0 0 0 0 1\n101 0 0 0 0 0 0 1\n", "positions of 0 of 12 keyframes"}};
  for (const auto& [text, expected] : cases) {
    write_text(dir / "table", text);
    INFO(text);
    CHECK_THROWS_WITH(aligned(dir / "table", flight()), Contains(expected) && Contains("table"));
  }
  CHECK_THROWS_AS(aligned(dir / "none", flight()), IoError);
}

TEST_CASE("a 4 x 4 matrix must be a similarity and the scale is applied after it") {
  const TempDir dir;
  write_text(dir / "m", "0 -2 0 10\n2 0 0 20\n0 0 2 30\n0 0 0 1\n");
  FrameOptions options;
  options.transform = dir / "m";
  options.scale = 3.0;
  const Similarity it = find_cloud_frame(options, flight()).file_from_map;
  CHECK((it * Eigen::Vector3d(1, 2, 3) - 3.0 * Eigen::Vector3d(6, 22, 36)).norm() < 1e-9);
  const std::vector<std::pair<std::string, std::string>> cases{
      {"1 0 0 0 0 1 0 0 0 0 1 0", "holds 12 numbers"},          {"1 0 0 0\n0 1 0 0\n0 0 1 0\n1 2 3 1\n", "last row"},
      {"-1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n", "no rotation"}, {"1 0 0 0\n0 2 0 0\n0 0 1 0\n0 0 0 1\n", "no rotation"},
      {"0 0 0 0\n0 0 0 0\n0 0 0 0\n0 0 0 1\n", "no rotation"},  {"m 1 0 0 0\n", "\"m\" is no number"}};
  for (const auto& [text, expected] : cases) {
    write_text(dir / "bad", text);
    CHECK_THROWS_WITH(read_similarity(dir / "bad"), Contains(expected) && Contains("bad"));
  }
}

TEST_CASE("a 4 x 4 matrix is applied after the upright rotation") {
  const TempDir dir;
  write_text(dir / "m", "0 -2 0 10\n2 0 0 20\n0 0 2 30\n0 0 0 1\n");
  FrameOptions options;
  options.up = true;
  const Similarity upright = find_cloud_frame(options, flight()).file_from_map;
  options.transform = dir / "m";
  const Similarity both = find_cloud_frame(options, flight()).file_from_map;
  check_same(both, read_similarity(dir / "m") * upright, 1e-9);
}

TEST_CASE("up is the consensus of the cameras' up vectors") {
  SlamMap map = flight();
  FrameOptions options;
  options.up = true;
  const CloudFrame frame = find_cloud_frame(options, map);
  CHECK((frame.file_from_map.rotation * Eigen::Vector3d(0, -1, 0) - Eigen::Vector3d::UnitZ()).norm() < 0.03);
  CHECK(*frame.up_spread_deg == Approx(1.7).margin(0.5));
  for (int i = 0; i < 4; ++i) {  // a third lies on its side
    map.keyframes[static_cast<std::size_t>(3 * i)].cam_from_world.rotation =
        Eigen::AngleAxisd(1.5, Eigen::Vector3d::UnitX()).toRotationMatrix();
  }
  const CloudFrame tilted = find_cloud_frame(options, map);
  CHECK((tilted.file_from_map.rotation * Eigen::Vector3d(0, -1, 0) - Eigen::Vector3d::UnitZ()).norm() < 0.1);
  for (std::size_t i = 0; i < map.keyframes.size(); ++i) {  // up and down in turns
    map.keyframes[i].cam_from_world.rotation =
        Eigen::AngleAxisd(kernels::kPi * static_cast<double>(i), Eigen::Vector3d::UnitX()).toRotationMatrix();
  }
  CHECK_THROWS_WITH(find_cloud_frame(options, map), Contains("no direction in common"));
}
