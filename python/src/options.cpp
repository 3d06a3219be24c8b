// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/options.h"

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "calls.h"
#include "pmsp/io/densify.h"

namespace pmsp::python {
namespace {

void add_enumerations(py::module_& m) {
  py::enum_<Simd>(m, "Simd")
      .value("AUTO", Simd::kAuto)
      .value("SCALAR", Simd::kScalar)
      .value("AVX2", Simd::kAvx2)
      .value("AVX512", Simd::kAvx512);
  py::enum_<Backend>(m, "Backend")
      .value("AUTO", Backend::kAuto)
      .value("CPU", Backend::kCpu)
      .value("CUDA", Backend::kCuda);
  py::enum_<Quality>(m, "Quality")
      .value("PAPER", Quality::kPaper)
      .value("ONLINE", Quality::kOnline)
      .value("NORMAL", Quality::kNormal)
      .value("HIGH", Quality::kHigh);
  m.def("quality_from_name", &quality_from_name, py::arg("name"));
  m.def("simd_from_name", &simd_from_name, py::arg("name"));
  m.def("backend_from_name", &backend_from_name, py::arg("name"));
}

void add_matching(py::module_& m) {
  {
    using T = ViewFilterOptions;
    py::class_<T> c(m, "ViewFilterOptions");
    c.def(py::init<>()).def("validate", &T::validate);
    read_write(c, "enabled", &T::enabled, "min_parallax_deg", &T::min_parallax_deg, "max_parallax_deg",
               &T::max_parallax_deg, "min_share", &T::min_share, "min_sharpness", &T::min_sharpness);
  }
  {
    using T = InitOptions;
    py::class_<T> c(m, "InitOptions");
    c.def(py::init<>()).def("validate", &T::validate);
    read_write(c, "sparse_points", &T::sparse_points, "sparse_radius_px", &T::sparse_radius_px, "warp_previous",
               &T::warp_previous, "chain_keyframes", &T::chain_keyframes, "range_margin", &T::range_margin);
  }
  {
    using T = PatchMatchOptions;
    py::class_<T> c(m, "PatchMatchOptions");
    c.def(py::init<>()).def("validate", &T::validate);
    read_write(c, "iterations", &T::iterations, "neighbours", &T::neighbours, "refinements", &T::refinements,
               "fine_patch", &T::fine_patch, "image_scale", &T::image_scale, "sigma_color", &T::sigma_color,
               "min_sigma_color", &T::min_sigma_color, "plane_priors", &T::plane_priors, "geometric_passes",
               &T::geometric_passes);
  }
}

void add_filters(py::module_& m) {
  {
    using T = MedianFilterOptions;
    py::class_<T> c(m, "MedianFilterOptions");
    c.def(py::init<>()).def("validate", &T::validate);
    read_write(c, "enabled", &T::enabled, "max_relative_deviation", &T::max_relative_deviation, "min_score",
               &T::min_score, "weighted", &T::weighted);
  }
  {
    using T = ConsistencyFilterOptions;
    py::class_<T> c(m, "ConsistencyFilterOptions");
    c.def(py::init<>()).def("validate", &T::validate);
    read_write(c, "enabled", &T::enabled, "window", &T::window, "min_views", &T::min_views, "max_relative_depth",
               &T::max_relative_depth);
  }
  {
    using T = FusionOptions;
    py::class_<T> c(m, "FusionOptions");
    c.def(py::init<>()).def("validate", &T::validate);
    read_write(c, "window", &T::window, "spacing_px", &T::spacing_px, "max_relative_depth", &T::max_relative_depth,
               "max_normal_deg", &T::max_normal_deg, "min_confidence", &T::min_confidence, "suppression",
               &T::suppression, "history", &T::history);
  }
  {
    using T = FreeSpaceOptions;
    py::class_<T> c(m, "FreeSpaceOptions");
    c.def(py::init<>()).def("validate", &T::validate);
    read_write(c, "enabled", &T::enabled, "views", &T::views, "max_relative_depth", &T::max_relative_depth,
               "min_relative_gap", &T::min_relative_gap, "max_contradiction", &T::max_contradiction, "mirrors",
               &T::mirrors, "whole_mission", &T::whole_mission, "history", &T::history);
  }
}

}  // namespace

void add_options(py::module_& m) {
  add_enumerations(m);
  add_matching(m);
  add_filters(m);
  {
    using T = AdvancedOptions;
    py::class_<T> c(m, "AdvancedOptions");
    c.def(py::init<>());
    read_write(c, "view_filter", &T::view_filter, "init", &T::init, "patchmatch", &T::patchmatch, "median", &T::median,
               "consistency", &T::consistency, "fusion", &T::fusion, "free_space", &T::free_space, "pipelined",
               &T::pipelined, "expected_keyframes", &T::expected_keyframes);
  }
  {
    using T = DensifierOptions;
    py::class_<T> c(m, "DensifierOptions");
    c.def(py::init<>()).def("validate", &T::validate);
    read_write(c, "width", &T::width, "height", &T::height, "seed", &T::seed, "backend", &T::backend, "devices",
               &T::devices, "threads", &T::threads, "simd", &T::simd, "scratch_folder", &T::scratch_folder,
               "lens_distance", &T::lens_distance, "unordered", &T::unordered, "advanced", &T::advanced);
  }
  m.def("preset", &preset, py::arg("quality"));
}

}  // namespace pmsp::python
