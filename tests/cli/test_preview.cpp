// SPDX-License-Identifier: BSD-2-Clause
#include <cmath>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "pictures.h"
#include "preview.h"
#include "support/temp_dir.h"

using namespace pmsp;
using namespace pmsp::tool;
using Catch::Contains;

namespace {

/// The walls, the floor and the ceiling of a room of 8 x 6 x 3, seen from inside; z is up.
void add_room(ViewScene& scene, int along_side) {
  const Eigen::Vector3f half(4.0F, 3.0F, 1.5F);
  for (int axis = 0; axis < 3; ++axis) {
    for (const float side : {-1.0F, 1.0F}) {
      for (int i = 0; i < along_side * along_side; ++i) {
        const float a = 2.0F * (static_cast<float>(i % along_side) + 0.5F) / static_cast<float>(along_side) - 1.0F;
        const float b = 2.0F * (static_cast<float>(i / along_side) + 0.5F) / static_cast<float>(along_side) - 1.0F;
        ViewPoint point;
        point.position[axis] = side * half[axis];
        point.position[(axis + 1) % 3] = a * half[(axis + 1) % 3];
        point.position[(axis + 2) % 3] = b * half[(axis + 2) % 3];
        point.normal[axis] = static_cast<std::int8_t>(-127.0F * side);
        point.color = {200, 200, 200};
        scene.points.push_back(point);
      }
    }
  }
}

/// A street of 60 x 60, some 200 away, as glass walls let it through.
void add_street(ViewScene& scene, int points) {
  for (int i = 0; i < points; ++i) {
    ViewPoint point;
    point.position = {170.0F + static_cast<float>(i % 61), -30.0F + static_cast<float>(i * 7 % 61), -8.0F};
    point.normal = {0, 0, 127};
    point.color = {90, 200, 90};
    scene.points.push_back(point);
  }
}

ViewScene room(int street = 0) {
  ViewScene scene;
  scene.up = Eigen::Vector3d::UnitZ();
  for (int i = -20; i <= 20; ++i) scene.path.emplace_back(0.1 * i, 0.0, 0.0);
  add_room(scene, 120);
  add_street(scene, street);
  return scene;
}

/// Share of the picture that shows points of the room.
double shown(const cv::Mat& picture) {
  int count = 0;
  for (int y = 40; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      const auto& c = picture.at<cv::Vec3b>(y, x);
      count += c[0] == 200 && c[1] == 200 && c[2] == 200 ? 1 : 0;
    }
  }
  return static_cast<double>(count) / (picture.rows * picture.cols);
}

}  // namespace

TEST_CASE("the preview extent covers uniform points and excludes a distant cluster", "[preview]") {
  std::vector<double> values;
  for (int i = 0; i < 1000; ++i) values.push_back(0.008 * i - 3.0);
  const Interval even = framing_interval(values);
  CHECK(even.low == Approx(-2.92).margin(0.02));
  CHECK(even.high == Approx(4.92).margin(0.03));
  for (const int far : {20, 250, 500}) {
    INFO(far);
    std::vector<double> more = values;
    for (int i = 0; i < far; ++i) more.push_back(180.0 + 0.1 * i);
    const Interval stretch = framing_interval(more);
    CHECK(stretch.low >= -3.0);
    CHECK(stretch.low < -2.5);
    CHECK(stretch.high > 4.5);
    CHECK(stretch.high <= 5.0);
  }
  CHECK(framing_interval({2.0, 2.0, 2.0}).high == 2.0);
}

TEST_CASE("a wing visited by the camera is shown even with few points", "[preview]") {
  std::vector<Eigen::Vector3d> points, path;
  for (int i = 0; i < 4000; ++i) points.emplace_back(0.01 * (i % 1000), 0.01 * (i * 7 % 1000), 0.003 * (i * 13 % 1000));
  for (int i = 0; i < 400; ++i) points.emplace_back(10.0 + 0.15 * i, 5.0 + 2.0 * (i % 2), 0.003 * (i * 13 % 1000));
  path = {{5.0, 5.0, 1.0}, {10.0, 6.0, 1.0}, {40.0, 6.0, 1.0}, {68.0, 6.0, 1.0}};
  const FramedBox box = framing_box(points, path);
  CHECK(box.high.x() > 68.0);
  CHECK(box.high.x() < 71.0);
  CHECK(box.low.x() < 0.5);
}

TEST_CASE("pictures frame the room without the view through its windows and report it", "[preview]") {
  const ViewScene alone = room();
  CHECK(left_out_of(alone).empty());
  const double above = shown(draw_from_above(alone)), corner = shown(draw_from_corner(alone));
  CHECK(above > 0.2);
  CHECK(corner > 0.1);
  for (const int street : {1200, 12'000, 36'000}) {  // beside 86 400
    INFO(street);
    const ViewScene scene = room(street);
    CHECK(shown(draw_from_above(scene)) > 0.8 * above);
    CHECK(shown(draw_from_corner(scene)) > 0.8 * corner);
    char percent[32];
    std::snprintf(percent, sizeof(percent), "%.1f %% of the points lie outside", 100.0 * street / (86400.0 + street));
    CHECK_THAT(left_out_of(scene), Contains(percent) && Contains("up to 22"));
  }
}

TEST_CASE("a preview reports points outside its pictures", "[preview]") {
  const pmsp_test::TempDir dir;
  Preview preview(dir.path(), 1);
  const ViewScene scene = room(3000);
  const Image<Rgb> image(16, 8);
  RigidTransform cam_from_world;  // z up: the camera's y axis points down
  cam_from_world.rotation << 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0;
  preview.add_keyframe(0, 7, cam_from_world, image.view(), 16, 8);
  KeyframeCloud cloud;
  cloud.cam_from_world = cam_from_world;
  for (const ViewPoint& it : scene.points) {
    CloudPoint point;
    point.position = (cam_from_world * it.position.cast<double>()).cast<float>();
    point.normal = cam_from_world.rotation.cast<float>() * it.normal.cast<float>() / 127.0F;
    cloud.points.push_back(point);
  }
  preview.add_points(cloud);
  CHECK_THAT(preview.finish(static_cast<std::int64_t>(cloud.points.size())), Contains("of the points lie outside"));
  CHECK_FALSE(std::filesystem::exists(dir / "cloud_above.png"));
  preview.commit();
  CHECK(std::filesystem::exists(dir / "cloud_above.png"));
  CHECK(std::filesystem::exists(dir / "cloud_corner.png"));
}
