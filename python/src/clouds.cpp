// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/io/cloud.h"

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <pybind11/eigen.h>
#include <pybind11/functional.h>
#include <pybind11/operators.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "arrays.h"
#include "calls.h"
#include "pmsp/io/depth.h"
#include "pmsp/io/map.h"

namespace pmsp::python {
namespace {

using std::filesystem::path;

void add_header(py::module_& m) {
  py::class_<Similarity>(m, "Similarity")
      .def(py::init<>())
      .def(py::init<double, const Eigen::Matrix3d&, const Eigen::Vector3d&>(), py::arg("scale"), py::arg("rotation"),
           py::arg("translation"))
      .def_readwrite("scale", &Similarity::scale)
      .def_readwrite("rotation", &Similarity::rotation)
      .def_readwrite("translation", &Similarity::translation)
      .def("is_identity", &Similarity::is_identity)
      .def(py::self * py::self)
      .def(py::self * RigidTransform())
      .def(py::self * Eigen::Vector3d());
  py::class_<CloudUnit> unit(m, "CloudUnit");
  py::enum_<CloudUnit::Kind>(unit, "Kind")
      .value("UNKNOWN", CloudUnit::Kind::kUnknown)
      .value("MAP", CloudUnit::Kind::kMap)
      .value("METRES", CloudUnit::Kind::kMetres);
  unit.def(py::init<>()).def_readwrite("kind", &CloudUnit::kind).def_readwrite("by", &CloudUnit::by);
  py::class_<OutputView> view(m, "OutputView");
  view.def(py::init<>());
  read_write(view, "keyframe_id", &OutputView::keyframe_id, "timestamp", &OutputView::timestamp, "cam_from_file",
             &OutputView::cam_from_file, "name", &OutputView::name, "width", &OutputView::width, "height",
             &OutputView::height, "has_mask", &OutputView::has_mask);
  py::class_<DatasetDepth> depth(m, "DatasetDepth");
  depth.def(py::init<>()).def("is_wanted", &DatasetDepth::is_wanted);
  read_write(depth, "png", &DatasetDepth::png, "exr", &DatasetDepth::exr, "png_scale", &DatasetDepth::png_scale,
             "lens_distance", &DatasetDepth::lens_distance);
  py::class_<CloudHeader>(m, "CloudHeader")
      .def(py::init<>())
      .def_readwrite("generator", &CloudHeader::generator)
      .def_readwrite("comments", &CloudHeader::comments)
      .def_readwrite("file_from_map", &CloudHeader::file_from_map)
      .def_readwrite("unit", &CloudHeader::unit)
      .def_readwrite("center", &CloudHeader::center)
      .def_readwrite("reach", &CloudHeader::reach)
      .def_readwrite("resolution", &CloudHeader::resolution)
      .def_readwrite("double_positions", &CloudHeader::double_positions)
      .def_readwrite("wkt", &CloudHeader::wkt)
      .def_readwrite("year", &CloudHeader::year)
      .def_readwrite("day_of_year", &CloudHeader::day_of_year)
      .def_readwrite("scratch", &CloudHeader::scratch)
      .def_readwrite("threads", &CloudHeader::threads)
      .def_readwrite("export_views", &CloudHeader::export_views)
      .def_readwrite("dataset_points", &CloudHeader::dataset_points)
      .def_readwrite("dataset_depth", &CloudHeader::dataset_depth)
      .def_readwrite("cameras", &CloudHeader::cameras)
      .def_readwrite("cell_size", &CloudHeader::cell_size)
      .def_readwrite("least_rays", &CloudHeader::least_rays)
      .def_readwrite("robot_height", &CloudHeader::robot_height)
      .def_readwrite("robot_step", &CloudHeader::robot_step)
      .def_readwrite("robot_slope_deg", &CloudHeader::robot_slope_deg)
      .def_readwrite("map_units", &CloudHeader::map_units);
  m.def("cloud_header_of", py::overload_cast<const SlamMap&, const DensifierOptions&>(&cloud_header_of), py::arg("map"),
        py::arg("options"), py::call_guard<py::gil_scoped_release>());
  m.def("cloud_header_of", py::overload_cast<const SlamMap&, const Similarity&, double>(&cloud_header_of),
        py::arg("map"), py::arg("file_from_map") = Similarity(), py::arg("range_margin") = InitOptions().range_margin,
        py::call_guard<py::gil_scoped_release>());
}

void add_output(py::module_& m) {
  py::class_<CloudOutput>(m, "CloudOutput")
      .def(py::init<const path&>(), py::arg("path"))
      .def(py::init<const path&, const CloudHeader&>(), py::arg("path"), py::arg("header"))
      .def(
          "add",
          [](CloudOutput& self, const KeyframeCloud& cloud, const KeyframePose* pose) {
            const Reserved reserved("CloudOutput.add", {&self});
            const KeyframePose at = pose != nullptr ? *pose : cloud.pose();
            const py::gil_scoped_release released;
            self.add(cloud, at);
          },
          py::arg("cloud"), py::arg("pose") = py::none())
      .def(
          "add",
          [](CloudOutput& self, const py::array& points, const Similarity& file_from_points) {
            const Reserved reserved("CloudOutput.add", {&self});
            const auto values = structs_from<OutputPoint>(points, "points");
            const py::gil_scoped_release released;
            self.add(values.data(), values.size(), file_from_points);
          },
          py::arg("points"), py::arg("file_from_points"))
      .def(
          "add_depth",
          [](CloudOutput& self, const DepthMap& map) {
            const Reserved reserved("CloudOutput.add_depth", {&self});
            const py::gil_scoped_release released;
            self.add_depth(map);
          },
          py::arg("map"))
      .def("wants_depth", checked("CloudOutput.wants_depth", &CloudOutput::wants_depth))
      .def("points_in", checked("CloudOutput.points_in", &CloudOutput::points_in))
      .def("points", checked("CloudOutput.points", &CloudOutput::points))
      .def("complete", exclusive("CloudOutput.complete", &CloudOutput::complete))
      .def("commit", exclusive("CloudOutput.commit", &CloudOutput::commit));
}

py::object read_points(CloudReader& reader, const std::function<void(const py::array&)>& take) {
  const Reserved reserved("CloudReader.read", {&reader});
  std::vector<OutputPoint> all;
  {
    const py::gil_scoped_release released;
    reader.read([&](const OutputPoint* points, std::size_t count) {
      std::vector<OutputPoint> block(points, points + count);
      if (!take) {
        all.insert(all.end(), block.begin(), block.end());
        check_signals();
        return;
      }
      const py::gil_scoped_acquire acquired;
      take(moved(std::move(block)));
    });
  }
  return take ? py::object(py::none()) : py::object(moved(std::move(all)));
}

void add_reader(py::module_& m) {
  {
    using T = CloudInfo;
    py::class_<T> c(m, "CloudInfo");
    read_only(c, "format", &T::format, "points", &T::points, "has_normals", &T::has_normals, "has_colors",
              &T::has_colors, "has_confidence", &T::has_confidence, "has_views", &T::has_views, "double_positions",
              &T::double_positions, "comments", &T::comments, "file_from_map", &T::file_from_map, "unit", &T::unit,
              "wkt", &T::wkt, "year", &T::year, "day_of_year", &T::day_of_year);
  }
  py::class_<CloudReader>(m, "CloudReader")
      .def("info", [](const CloudReader& self) { return self.info(); })
      .def("read", &read_points, py::arg("take") = py::none());
  m.def("open_cloud", &open_cloud, py::arg("path"), py::call_guard<py::gil_scoped_release>());
}

template <class T, class Write>
void write_image(const path& file, const py::object& image, Write write) {
  const Image<T> copy = image_from<T>(image, "write_pfm: image");
  const py::gil_scoped_release released;
  write(file, copy);
}

/// Calls `read` without the GIL; returns its image, None if empty.
template <class Read>
py::object read_image(Read read) {
  const auto run = [&] {
    const py::gil_scoped_release released;
    return read();
  };
  auto image = run();
  return image.empty() ? py::object(py::none()) : py::object(moved(std::move(image)));
}

void add_depth(py::module_& m) {
  m.def(
      "read_pfm", [](const path& file) { return read_image([&] { return read_pfm(file); }); }, py::arg("path"));
  m.def(
      "read_pfm3", [](const path& file) { return read_image([&] { return read_pfm3(file); }); }, py::arg("path"));
  m.def(
      "write_pfm",
      [](const path& file, const py::array& image) {
        if (image.ndim() == 3) {
          write_image<Eigen::Vector3f>(file, image, [](const path& to, const auto& values) { write_pfm(to, values); });
        } else {
          write_image<float>(file, image, [](const path& to, const auto& values) { write_pfm(to, values); });
        }
      },
      py::arg("path"), py::arg("image"));
  py::class_<DepthFolder>(m, "DepthFolder")
      .def(py::init<const path&, const path&>(), py::arg("folder"), py::arg("images"),
           py::call_guard<py::gil_scoped_release>())
      .def("is_indexed", &DepthFolder::is_indexed)
      .def("file_for", &DepthFolder::file_for, py::arg("keyframe_id"), py::arg("image"))
      .def(
          "read", [](const DepthFolder& self, const path& file) { return read_image([&] { return self.read(file); }); },
          py::arg("file"))
      .def(
          "read_normals",
          [](const DepthFolder& self, std::int64_t keyframe_id) {
            return read_image([&] { return self.read_normals(keyframe_id); });
          },
          py::arg("keyframe_id"))
      .def(
          "read_confidence",
          [](const DepthFolder& self, std::int64_t keyframe_id) {
            return read_image([&] { return self.read_confidence(keyframe_id); });
          },
          py::arg("keyframe_id"))
      .def("png_scale", &DepthFolder::png_scale)
      .def("kind", &DepthFolder::kind)
      .def("lens_distance", &DepthFolder::lens_distance);
}

}  // namespace

void add_clouds(py::module_& m) {
  add_header(m);
  add_output(m);
  add_reader(m);
  add_depth(m);
}

}  // namespace pmsp::python
