// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/types.h"

#include <cstddef>
#include <sstream>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <pybind11/eigen.h>
#include <pybind11/operators.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "arrays.h"
#include "calls.h"
#include "pmsp/camera.h"

namespace pmsp::python {
namespace {

struct Member {
  const char* name;
  const char* format;  ///< of NumPy
  std::size_t offset;
};

template <class T>
py::dtype record(std::initializer_list<Member> members) {
  static_assert(std::is_standard_layout_v<T>, "offsets of members");
  py::list names, formats, offsets;
  for (const Member& member : members) {
    names.append(member.name);
    formats.append(member.format);
    offsets.append(member.offset);
  }
  return {names, formats, offsets, sizeof(T)};
}

using Pixels = Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor>;
using Directions = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

Directions bearings_of(const Eigen::Ref<const Pixels>& pixels, int width, int height) {
  Directions bearings(pixels.rows(), 3);
  for (Eigen::Index i = 0; i < pixels.rows(); ++i)
    bearings.row(i) = bearing_from_pixel(pixels.row(i).transpose(), width, height).transpose();
  return bearings;
}

Pixels pixels_of(const Eigen::Ref<const Directions>& directions, int width, int height) {
  Pixels pixels(directions.rows(), 2);
  for (Eigen::Index i = 0; i < directions.rows(); ++i)
    pixels.row(i) = pixel_from_bearing(directions.row(i).transpose(), width, height).transpose();
  return pixels;
}

std::string text_of_pose(const RigidTransform& pose) {
  static const Eigen::IOFormat rows(Eigen::FullPrecision, Eigen::DontAlignCols, ", ", ", ", "[", "]", "[", "]");
  static const Eigen::IOFormat row(Eigen::FullPrecision, Eigen::DontAlignCols, ", ", "", "[", "]");
  std::ostringstream text;
  text << "RigidTransform(rotation=" << pose.rotation.format(rows)
       << ", translation=" << pose.translation.transpose().format(row) << ")";
  return text.str();
}

void add_poses(py::module_& m) {
  py::class_<RigidTransform>(m, "RigidTransform")
      .def(py::init<>())
      .def(py::init<const Eigen::Matrix3d&, const Eigen::Vector3d&>(), py::arg("rotation"), py::arg("translation"))
      .def_readwrite("rotation", &RigidTransform::rotation)
      .def_readwrite("translation", &RigidTransform::translation)
      .def("inverse", &RigidTransform::inverse)
      .def("center", &RigidTransform::center)
      .def(py::self * py::self)
      .def(py::self * Eigen::Vector3d())
      .def(py::self == py::self)
      .def("__repr__", &text_of_pose);
  py::class_<KeyframePose>(m, "KeyframePose")
      .def(py::init<>())
      .def(py::init<const RigidTransform&, double>(), py::arg("cam_from_world"), py::arg("scale") = 1.0)
      .def_readwrite("cam_from_world", &KeyframePose::cam_from_world)
      .def_readwrite("scale", &KeyframePose::scale)
      .def(py::self == py::self);
  m.def(
      "rigid_transform", [](const Eigen::Matrix4d& matrix) { return rigid_transform(matrix); }, py::arg("matrix"));
  m.def("cam_from_slam_cam", &cam_from_slam_cam, py::arg("image_width"));
  m.def("bearing_from_pixel", &bearings_of, py::arg("pixels"), py::arg("width"), py::arg("height"));
  m.def("pixel_from_bearing", &pixels_of, py::arg("directions"), py::arg("width"), py::arg("height"));
}

void add_results(py::module_& m) {
  py::class_<DepthMap>(m, "DepthMap")
      .def_readonly("keyframe_id", &DepthMap::keyframe_id)
      .def_property_readonly("cam_from_world", [](const DepthMap& self) { return self.cam_from_world; })
      .def_property_readonly("depth", view_of(&DepthMap::depth))
      .def_property_readonly("normal", view_of(&DepthMap::normal))
      .def_property_readonly("confidence", view_of(&DepthMap::confidence))
      .def_readonly("scale", &DepthMap::scale);
  py::class_<KeyframeCloud, std::shared_ptr<KeyframeCloud>>(m, "KeyframeCloud")
      .def_readonly("keyframe_id", &KeyframeCloud::keyframe_id)
      .def_property_readonly("cam_from_world", [](const KeyframeCloud& self) { return self.cam_from_world; })
      .def_readonly("scale", &KeyframeCloud::scale)
      .def("pose", &KeyframeCloud::pose)
      .def_property_readonly("points", view_of(&KeyframeCloud::points))
      .def_property_readonly("pixels", view_of(&KeyframeCloud::pixels))
      .def_property_readonly("agree", view_of(&KeyframeCloud::agree))
      .def_property_readonly("window_ids", view_of(&KeyframeCloud::window_ids));
  m.def(
      "transform_points",
      [](const KeyframeCloud& cloud, const KeyframePose& pose) {
        const auto transform = [&] {
          const py::gil_scoped_release released;
          return transform_points(cloud, pose);
        };
        return moved(transform());
      },
      py::arg("cloud"), py::arg("pose"));
}

}  // namespace

template <>
py::dtype dtype_of<CloudPoint>() {
  return record<CloudPoint>({{"position", "3f4", offsetof(CloudPoint, position)},
                             {"normal", "3f4", offsetof(CloudPoint, normal)},
                             {"color", "3u1", offsetof(CloudPoint, color)},
                             {"views", "u1", offsetof(CloudPoint, views)},
                             {"confidence", "f4", offsetof(CloudPoint, confidence)}});
}

template <>
py::dtype dtype_of<OutputPoint>() {
  return record<OutputPoint>({{"position", "3f8", offsetof(OutputPoint, position)},
                              {"normal", "3f4", offsetof(OutputPoint, normal)},
                              {"confidence", "f4", offsetof(OutputPoint, confidence)},
                              {"keyframe_id", "i8", offsetof(OutputPoint, keyframe_id)},
                              {"pixel", "u4", offsetof(OutputPoint, pixel)},
                              {"agree", "u4", offsetof(OutputPoint, agree)},
                              {"color", "3u1", offsetof(OutputPoint, color)},
                              {"views", "u1", offsetof(OutputPoint, views)}});
}

template <>
py::dtype dtype_of<Landmark>() {
  return record<Landmark>(
      {{"id", "i8", offsetof(Landmark, id)}, {"position_world", "3f8", offsetof(Landmark, position_world)}});
}

template <>
py::dtype dtype_of<MapLandmark>() {
  return record<MapLandmark>(
      {{"id", "i8", offsetof(MapLandmark, id)}, {"position_world", "3f8", offsetof(MapLandmark, position_world)}});
}

template <>
py::dtype dtype_of<MapObservation>() {
  return record<MapObservation>({{"landmark_id", "i8", offsetof(MapObservation, landmark_id)},
                                 {"pixel", "2f4", offsetof(MapObservation, pixel)}});
}

void add_types(py::module_& m) {
  m.attr("CloudPoint") = dtype_of<CloudPoint>();
  m.attr("OutputPoint") = dtype_of<OutputPoint>();
  m.attr("Landmark") = dtype_of<Landmark>();
  m.attr("MapLandmark") = dtype_of<MapLandmark>();
  m.attr("MapObservation") = dtype_of<MapObservation>();
  add_poses(m);
  add_results(m);
}

}  // namespace pmsp::python
