// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <catch2/catch.hpp>

#include <nlohmann/json.hpp>

#include <Eigen/Geometry>

#include "elementary.h"
#include "export/sample_points.h"
#include "pmsp/camera.h"
#include "pmsp/error.h"
#include "pmsp/io/cloud.h"
#include "pmsp/io/depth.h"
#include "support/temp_dir.h"

using namespace pmsp;
using namespace pmsp_test;

namespace fs = std::filesystem;

namespace {

/// Keyframes of sample_points(): keyframe i is at i % 5 places.
std::vector<OutputView> sample_views() {
  std::vector<OutputView> views;
  for (int i = 0; i < 8; ++i) {
    OutputView view;
    view.keyframe_id = i;
    view.timestamp = 0.1 * i;
    view.name = "frame" + std::to_string(i) + ".jpg";
    view.width = i < 6 ? 512 : 640;
    view.height = view.width / 2;
    view.has_mask = true;
    const Eigen::Matrix3d file_from_cam =
        Eigen::AngleAxisd(0.9 * i, Eigen::Vector3d(0.2, 1.0, 0.1).normalized()).toRotationMatrix();
    view.cam_from_file = RigidTransform{file_from_cam, {1000.0 + i, -500.0, 30.5}}.inverse();
    views.push_back(view);
  }
  return views;
}

CloudHeader dataset_header() {
  CloudHeader header = sample_header();
  header.dataset_points = 700;
  header.export_views = [](const fs::path& folder) {
    for (const OutputView& view : sample_views()) write_text(folder / "images" / view.name, "image of " + view.name);
    return sample_views();
  };
  return header;
}

void write(const char* format, const fs::path& path, const std::vector<OutputPoint>& points) {
  CloudHeader header = dataset_header();
  const TempDir scratch;
  header.scratch = scratch.path();
  const auto writer = find_cloud_format(format)->open(path, header);
  for (std::int64_t id = 0; id < 8; ++id) writer->set_window(id, {id - 1, id + 1, 77});
  writer->add(points.data(), points.size());
  writer->finish();
  CHECK(scratch.entries() == 0);
}

std::vector<OutputPoint> points_with_tracks(std::size_t count) {
  std::vector<OutputPoint> points = sample_points(count);
  for (std::size_t i = 0; i < count; ++i) points[i].agree = static_cast<std::uint32_t>(i % 8);
  return points;
}

/// A sequential reader of a text.
struct Bytes {
  explicit Bytes(const fs::path& path) : text(read_text(path)) {}
  template <class T>
  T get() {
    const T value = number_at<T>(text, at);
    at += sizeof(T);
    return value;
  }
  bool is_at_end() const { return at == text.size(); }
  std::string text;
  std::size_t at = 0;
};

struct Pose {
  explicit Pose(Bytes& bytes) {
    std::array<double, 7> v{};
    for (double& value : v) value = bytes.get<double>();
    rotation = Eigen::Quaterniond(v[0], v[1], v[2], v[3]).toRotationMatrix();
    translation = {v[4], v[5], v[6]};
  }
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
};

/// A model as COLMAP's reconstruction_io_binary.cc reads it.
struct Model {
  struct Camera {
    std::uint64_t width, height;
  };
  struct Image {
    Eigen::Matrix3d rotation;
    Eigen::Vector3d translation;
    std::uint32_t camera;
    std::string name;
    std::vector<std::pair<Eigen::Vector2d, std::uint64_t>> points;
  };
  struct Point {
    Eigen::Vector3d position;
    Rgb color;
    std::vector<std::pair<std::uint32_t, std::uint32_t>> track;
  };

  explicit Model(const fs::path& folder) {
    Bytes c(folder / "cameras.bin");
    for (auto n = c.get<std::uint64_t>(); n > 0; --n) {
      const auto id = c.get<std::uint32_t>();
      REQUIRE(c.get<std::int32_t>() == 17);
      Camera& camera = cameras[id];
      camera.width = c.get<std::uint64_t>();
      camera.height = c.get<std::uint64_t>();
      CHECK(c.get<double>() == static_cast<double>(camera.width));
      CHECK(c.get<double>() == static_cast<double>(camera.height));
    }
    CHECK(c.is_at_end());
    Bytes i(folder / "images.bin");
    for (auto n = i.get<std::uint64_t>(); n > 0; --n) {
      Image& image = images[i.get<std::uint32_t>()];
      const Pose pose(i);
      image.rotation = pose.rotation;
      image.translation = pose.translation;
      image.camera = i.get<std::uint32_t>();
      while (const char letter = i.get<char>()) image.name += letter;
      for (auto k = i.get<std::uint64_t>(); k > 0; --k) {
        const double x = i.get<double>(), y = i.get<double>();
        image.points.push_back({{x, y}, i.get<std::uint64_t>()});
      }
    }
    CHECK(i.is_at_end());
    Bytes p(folder / "points3D.bin");
    for (auto n = p.get<std::uint64_t>(); n > 0; --n) {
      Point& point = points[p.get<std::uint64_t>()];
      for (int axis = 0; axis < 3; ++axis) point.position[axis] = p.get<double>();
      point.color = p.get<Rgb>();
      p.get<double>();
      for (auto k = p.get<std::uint64_t>(); k > 0; --k) {
        const auto image = p.get<std::uint32_t>();
        point.track.emplace_back(image, p.get<std::uint32_t>());
      }
    }
    CHECK(p.is_at_end());
    Bytes r(folder / "rigs.bin");
    CHECK(r.get<std::uint64_t>() == cameras.size());
    for (std::size_t k = 0; k < cameras.size(); ++k) {
      const auto rig = r.get<std::uint32_t>();
      CHECK(r.get<std::uint32_t>() == 1);
      CHECK(r.get<std::int32_t>() == 0);
      CHECK(cameras.count(r.get<std::uint32_t>()) == 1);
      rigs.push_back(rig);
    }
    CHECK(r.is_at_end());
    Bytes f(folder / "frames.bin");
    CHECK(f.get<std::uint64_t>() == images.size());
    for (std::size_t k = 0; k < images.size(); ++k) {
      f.get<std::uint32_t>();
      const auto rig = f.get<std::uint32_t>();
      const Pose pose(f);
      CHECK(f.get<std::uint32_t>() == 1);
      CHECK(f.get<std::int32_t>() == 0);
      CHECK(f.get<std::uint32_t>() == rig);  // the sensor is the rig's only camera
      const Image& image = images.at(static_cast<std::uint32_t>(f.get<std::uint64_t>()));
      CHECK(image.camera == rig);
      CHECK((image.rotation - pose.rotation).norm() + (image.translation - pose.translation).norm() == 0.0);
    }
    CHECK(f.is_at_end());
  }

  std::map<std::uint32_t, Camera> cameras;
  std::map<std::uint32_t, Image> images;
  std::map<std::uint64_t, Point> points;
  std::vector<std::uint32_t> rigs;
};

}  // namespace

TEST_CASE("a COLMAP model has consistent cameras and images and points and tracks") {
  const TempDir dir;
  const std::vector<OutputPoint> given = points_with_tracks(4000);  // of keyframes 0 to 7
  write("colmap", dir / "m", given);
  const Model model(dir / "m/sparse/0");
  CHECK(model.cameras.size() == 2);
  REQUIRE(model.images.size() == 8);
  CHECK(model.points.size() == 700);
  const std::vector<OutputView> views = sample_views();
  for (const auto& [id, image] : model.images) {
    const OutputView& view = views.at(id - 1);
    CHECK(image.name == view.name);
    CHECK(read_text(dir / "m/images" / image.name) == "image of " + view.name);
    CHECK((image.rotation - view.cam_from_file.rotation).norm() < 1e-12);
    CHECK((image.translation - view.cam_from_file.translation).norm() < 1e-12);
    CHECK(model.cameras.at(image.camera).width == static_cast<std::uint64_t>(view.width));
  }
  std::map<std::array<double, 3>, const OutputPoint*> by_place;
  for (const OutputPoint& p : given) by_place[{p.position.x(), p.position.y(), p.position.z()}] = &p;
  std::size_t sightings = 0, wrong = 0;
  for (const auto& [id, point] : model.points) {
    const OutputPoint& from = *by_place.at({point.position.x(), point.position.y(), point.position.z()});
    wrong += point.color == from.color ? 0 : 1;
    std::vector<std::uint32_t> seen{static_cast<std::uint32_t>(from.keyframe_id + 1)};
    if ((from.agree & 1U) != 0 && from.keyframe_id > 0) seen.push_back(static_cast<std::uint32_t>(from.keyframe_id));
    if ((from.agree & 2U) != 0 && from.keyframe_id < 7)
      seen.push_back(static_cast<std::uint32_t>(from.keyframe_id + 2));
    REQUIRE(point.track.size() == seen.size());
    for (std::size_t k = 0; k < seen.size(); ++k) {
      wrong += point.track[k].first != seen[k];
      const Model::Image& image = model.images.at(seen[k]);
      const auto& [pixel, same] = image.points.at(point.track[k].second);
      wrong += same != id;
      // COLMAP's EquirectangularCameraModel: theta = 2 pi (x / w - 1/2), phi = pi (1/2 - y / h)
      const Model::Camera& camera = model.cameras.at(image.camera);
      const double theta = 2.0 * kernels::kPi * (pixel.x() / static_cast<double>(camera.width) - 0.5);
      const double phi = kernels::kPi * (0.5 - pixel.y() / static_cast<double>(camera.height));
      const Eigen::Vector3d ray(std::cos(phi) * std::sin(theta), -std::sin(phi), std::cos(phi) * std::cos(theta));
      wrong += (ray - (image.rotation * point.position + image.translation).normalized()).norm() > 1e-9;
      ++sightings;
    }
  }
  CHECK(wrong == 0);
  std::size_t listed = 0;
  for (const auto& [id, image] : model.images) listed += image.points.size();
  CHECK(listed == sightings);
}

TEST_CASE("rays of a nerfstudio dataset meet the points at their pixels") {
  const TempDir dir;
  const std::vector<OutputPoint> given = points_with_tracks(4000);
  write("nerfstudio", dir / "n", given);
  const auto json = nlohmann::json::parse(read_text(dir / "n/transforms.json"));
  CHECK(json["camera_model"] == "EQUIRECTANGULAR");
  REQUIRE(json["frames"].size() == 8);
  const PlyCloud cloud = read_ply(dir / "n" / json["ply_file_path"].get<std::string>());
  REQUIRE(cloud.positions.size() == 700);
  for (std::size_t i = 0; i < 8; ++i) {
    const auto& frame = json["frames"][i];
    const OutputView view = sample_views()[i];
    CHECK(fs::exists(dir / "n" / frame["file_path"].get<std::string>()));
    CHECK(frame["mask_path"] == "masks/" + view.name + ".png");
    CHECK(frame["w"] == view.width);
    const Eigen::Vector3d p = view.cam_from_file * cloud.positions[i];
    const double x = (std::atan2(p.x(), p.z()) / (2.0 * kernels::kPi) + 0.5) * view.width;
    const double y = (0.5 + std::asin(p.y() / p.norm()) / kernels::kPi) * view.height;
    // nerfstudio's Cameras: the camera looks along -z, y is up
    const double across = (x - frame["cx"].get<double>()) / frame["fl_x"].get<double>();
    const double upwards = -(y - frame["cy"].get<double>()) / frame["fl_y"].get<double>();
    const double theta = -kernels::kPi * across, phi = kernels::kPi * (0.5 - upwards);
    const Eigen::Vector3d ray(-std::sin(theta) * std::sin(phi), std::cos(phi), -std::cos(theta) * std::sin(phi));
    Eigen::Matrix4d m;
    for (int r = 0; r < 4; ++r) {
      for (int c = 0; c < 4; ++c) {
        m(r, c) = frame["transform_matrix"][static_cast<std::size_t>(r)][static_cast<std::size_t>(c)].get<double>();
      }
    }
    const Eigen::Vector3d towards = (cloud.positions[i] - m.topRightCorner<3, 1>()).normalized();
    CHECK((m.topLeftCorner<3, 3>() * ray - towards).norm() < 1e-6);
  }
}

TEST_CASE("datasets have the depth of each image from the camera centre in the unit of the poses") {
  constexpr int kWidth = 64, kHeight = 32;
  const auto depth_map = [](std::int64_t id) {
    DepthMap map;
    map.keyframe_id = id;
    map.scale = 2.0;
    map.depth = map.confidence = Image<float>(kWidth, kHeight, 0.0F);
    map.normal = Image<Eigen::Vector3f>(kWidth, kHeight, Eigen::Vector3f::Zero());
    for (int x = 1; x < kWidth; ++x) {
      map.depth(x, 3) = 1.0F + 0.02F * static_cast<float>(x) + 0.1F * static_cast<float>(id);
      map.normal(x, 3) = Eigen::Vector3f(0.1F, 0.2F, -1.0F).normalized();
      map.confidence(x, 3) = 0.01F * static_cast<float>(x);
    }
    return map;
  };
  const double lens_distance = GENERATE(0.0, 0.3);
  for (const std::string format : {"nerfstudio", "colmap"}) {
    CAPTURE(format, lens_distance);
    const TempDir dir, scratch;
    CloudHeader header = dataset_header();
    header.scratch = scratch.path();
    header.file_from_map.scale = 3.0;
    header.dataset_depth.png = header.dataset_depth.exr = true;
    header.dataset_depth.png_scale = 5e-4;
    header.dataset_depth.lens_distance = lens_distance;
    const fs::path folder = dir / "d";
    const auto write = [&](const CloudHeader& with, const std::vector<std::int64_t>& ids) {
      CloudOutput output(with, {}, {{find_cloud_format(format), folder}});
      for (const std::int64_t id : ids) output.add_depth(depth_map(id));
      output.commit();
    };
    write(header, {0, 1, 2, 4, 99});  // 99 has no image, others no depth map
    const auto json =
        nlohmann::json::parse(read_text(folder / (format == "colmap" ? "depths.json" : "transforms.json")));
    CHECK(json["is_euclidean_depth"] == true);
    const double unit = json["depth_unit_scale_factor"].get<double>();
    CHECK(unit == 5e-4);
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < 8; ++i) {
      const std::string stem = "frame" + std::to_string(i), name = "depths/" + stem;
      if (format != "colmap") {
        const auto& frame = json["frames"][i];
        CHECK(frame["depth_file_path"] == name + ".png");
        CHECK(frame["exr_file_path"] == name + ".exr");
        CHECK(frame["normal_file_path"] == "normals/" + stem + ".png");
        CHECK(frame["confidence_file_path"] == "confidences/" + stem + ".png");
      }
      const Image<float> png = read_png16(folder / (name + ".png"), unit),
                         exr = read_exr_depth(folder / (name + ".exr"));
      const Image<Eigen::Vector3f> normals = read_png16_normals(folder / "normals" / (stem + ".png"));
      const Image<float> confidence = read_png16(folder / "confidences" / (stem + ".png"), 1.0 / 65535.0);
      REQUIRE(png.width() == kWidth);
      const bool has_depth = i < 3 || i == 4;
      const DepthMap map = depth_map(static_cast<std::int64_t>(i));
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          Eigen::Vector3d point =
              map.depth(x, y) * bearing_from_pixel({x + 0.5, y + 0.5}, kWidth, kHeight);  // from the lens
          point.z() += (point.z() < 0.0 ? -0.5 : 0.5) * header.dataset_depth.lens_distance;
          const double expected = has_depth && map.depth(x, y) > 0.0F ? 6.0 * point.norm() : 0.0;
          wrong += std::abs(png(x, y) - expected) > 0.6 * unit || std::abs(exr(x, y) - expected) > 1e-5;
          const bool is_known = expected > 0.0;
          wrong += (normals(x, y) - (is_known ? map.normal(x, y) : Eigen::Vector3f(0, 0, 0))).norm() > 1e-4F;
          wrong += std::abs(confidence(x, y) - (is_known ? map.confidence(x, y) : 0.0F)) > 1e-4F;
        }
      }
    }
    CHECK(wrong == 0);
    CHECK(std::distance(fs::directory_iterator(folder / "depths"), fs::directory_iterator()) == 16);
    header.dataset_depth.exr = false;
    write(header, {1});  // files of the earlier run are removed
    CHECK(std::distance(fs::directory_iterator(folder / "depths"), fs::directory_iterator()) == 8);
    write(dataset_header(), {1});
    for (const char* name : {"depths", "normals", "confidences", "depths.json"}) CHECK(!fs::exists(folder / name));
  }
}

TEST_CASE("datasets of no point and of one and an aborted one") {
  for (const char* format : {"colmap", "nerfstudio"}) {
    INFO(format);
    const TempDir dir;
    for (const std::size_t count : {0, 1}) {
      const fs::path path = dir / ("d" + std::to_string(count));
      write(format, path, points_with_tracks(count));
      if (format == std::string("colmap")) CHECK(Model(path / "sparse/0").points.size() == count);
      if (format != std::string("colmap")) CHECK(read_ply(path / "points.ply").positions.size() == count);
    }
    const std::vector<OutputPoint> points = points_with_tracks(100);
    find_cloud_format(format)->open(dir / "given up", dataset_header())->add(points.data(), points.size());
    CHECK(!fs::exists(dir / "given up"));
  }
}
