// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/io/map.h"

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <pybind11/functional.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "arrays.h"
#include "calls.h"
#include "keyframe.h"
#include "pmsp/io/densify.h"
#include "pmsp/io/images.h"

namespace pmsp::python {
namespace {

using std::filesystem::path;

void add_map(py::module_& m) {
  {
    using T = MapCamera;
    py::class_<T> c(m, "MapCamera");
    read_only(c, "name", &T::name, "width", &T::width, "height", &T::height, "fps", &T::fps);
  }
  {
    using T = MapKeyframe;
    py::class_<T> c(m, "MapKeyframe");
    read_only(c, "id", &T::id, "timestamp", &T::timestamp, "source_frame", &T::source_frame, "camera", &T::camera,
              "image", &T::image, "mask", &T::mask, "prior_depth", &T::prior_depth);
    c.def_property_readonly("cam_from_world", [](const MapKeyframe& self) {
       return self.cam_from_world;
     }).def_property_readonly("observations", view_of(&MapKeyframe::observations));
  }
  {
    using T = SlamMap;
    py::class_<T> c(m, "SlamMap");
    read_only(c, "path", &T::path, "format", &T::format, "cameras", &T::cameras, "observations_skipped",
              &T::observations_skipped, "observations_repeated", &T::observations_repeated, "images", &T::images,
              "component", &T::component, "component_keyframes", &T::component_keyframes, "pixel_centers_at_integers",
              &T::pixel_centers_at_integers, "observations_are_measured", &T::observations_are_measured,
              "ids_are_row_numbers", &T::ids_are_row_numbers, "masks_are_instances", &T::masks_are_instances, "notes",
              &T::notes);
    c.def_property_readonly(
         "keyframes",
         [](const py::object& self) {
           py::list keyframes;
           for (const MapKeyframe& keyframe : self.cast<const SlamMap&>().keyframes)
             keyframes.append(py::cast(&keyframe, py::return_value_policy::reference_internal, self));
           return keyframes;
         })
        .def_property_readonly("landmarks", view_of(&SlamMap::landmarks))
        .def("find_keyframe", &SlamMap::find_keyframe, py::arg("id"), py::return_value_policy::reference_internal);
  }
  m.def(
      "read_map",
      [](const path& file, std::optional<int> component, const path& points, const path& image_list,
         const path& camera_from_body) {
        const py::gil_scoped_release released;
        return std::make_unique<SlamMap>(read_map(file, {component, points, image_list, camera_from_body}));
      },
      py::arg("path"), py::kw_only(), py::arg("component") = py::none(), py::arg("points") = "",
      py::arg("image_list") = "", py::arg("camera_from_body") = "");
  m.def("map_formats", &map_formats);
  m.def(
      "keyframe_of",
      [](const SlamMap& map, const MapKeyframe& in_map) {
        ArrayKeyframe keyframe;
        static_cast<Keyframe&>(keyframe) = keyframe_of(map, in_map);
        return keyframe;
      },
      py::arg("map"), py::arg("in_map"));
}

void add_images(py::module_& m) {
  {
    using T = SkippedKeyframe;
    py::class_<T> c(m, "SkippedKeyframe");
    read_only(c, "keyframe_id", &T::keyframe_id, "reason", &T::reason);
  }
  py::class_<ImageSource> source(m, "ImageSource");
  py::class_<ImageSource::Item>(source, "Item")
      .def_readonly("keyframe_id", &ImageSource::Item::keyframe_id)
      .def_property_readonly("image", view_of(&ImageSource::Item::image));
  py::class_<ImageSource::Origin>(source, "Origin")
      .def_readonly("file", &ImageSource::Origin::file)
      .def_readonly("frame", &ImageSource::Origin::frame)
      .def("name", &ImageSource::Origin::name);
  using Source = ImageSource;
  source.def("keyframe_ids", checked("ImageSource.keyframe_ids", &Source::keyframe_ids))
      .def("skipped", checked("ImageSource.skipped", &Source::skipped))
      .def("description", checked("ImageSource.description", &Source::description))
      .def("next", exclusive("ImageSource.next", &Source::next))
      .def("origin", checked("ImageSource.origin", &Source::origin), py::arg("keyframe_id"))
      .def("read_ahead", exclusive("ImageSource.read_ahead", &Source::read_ahead), py::arg("images"))
      .def("restrict_to", exclusive("ImageSource.restrict_to", &Source::restrict_to), py::arg("keyframe_ids"))
      .def("reopen", checked("ImageSource.reopen", &Source::reopen));
  m.def(
      "open_image_folder",
      [](const SlamMap& map, const path& folder, double fps, std::optional<std::int64_t> frame_offset,
         bool allow_missing) {
        const py::gil_scoped_release released;
        return open_image_folder(map, folder, {fps, frame_offset, allow_missing});
      },
      py::arg("map"), py::arg("folder"), py::kw_only(), py::arg("fps") = 0.0, py::arg("frame_offset") = py::none(),
      py::arg("allow_missing") = false);
  m.def(
      "open_video",
      [](const SlamMap& map, const path& video, double fps, std::optional<std::int64_t> frame_offset,
         bool presentation_times, bool allow_missing) {
        const py::gil_scoped_release released;
        return open_video(map, video, {fps, frame_offset, presentation_times, allow_missing});
      },
      py::arg("map"), py::arg("video"), py::kw_only(), py::arg("fps") = 0.0, py::arg("frame_offset") = py::none(),
      py::arg("presentation_times") = false, py::arg("allow_missing") = false);
}

void add_masks(py::module_& m) {
  py::class_<MaskSource>(m, "MaskSource")
      .def(py::init([](const path& file, const path& images, double nadir_deg, double zenith_deg, bool found) {
             MaskOptions options;
             options.path = file;
             options.images = images;
             options.nadir_deg = nadir_deg;
             options.zenith_deg = zenith_deg;
             options.found = found;
             const py::gil_scoped_release released;
             return std::make_unique<MaskSource>(options);
           }),
           py::arg("path") = "", py::kw_only(), py::arg("images") = "", py::arg("nadir_deg") = 0.0,
           py::arg("zenith_deg") = 0.0, py::arg("found") = true)
      .def(
          "mask_for",
          [](MaskSource& self, const path& image, int width, int height) -> py::object {
            const Reserved reserved("MaskSource.mask_for", {&self});
            const auto read = [&] {
              const py::gil_scoped_release released;
              return self.mask_for(image, width, height);
            };
            const ImageView<const std::uint8_t> mask = read();
            if (mask.empty()) return py::none();
            Image<std::uint8_t> copy(mask.width, mask.height);
            for (int y = 0; y < mask.height; ++y) std::copy_n(mask.row(y), mask.width, copy.row(y));
            return moved(std::move(copy));
          },
          py::arg("image"), py::arg("width"), py::arg("height"));
}

/// A callback without a result continues.
std::function<bool(std::size_t, std::size_t)> continuing(std::function<py::object(std::size_t, std::size_t)> progress) {
  return [progress = std::move(progress)](std::size_t done, std::size_t all) {
    check_signals();
    if (!progress) return true;
    const py::gil_scoped_acquire acquired;
    const py::object result = progress(done, all);
    return result.is_none() || py::bool_(result);
  };
}

DensifierStats densify_files(const SlamMap& map, ImageSource& images, const DensifierOptions& options,
                             CloudOutput* output, std::function<void(const DepthMap&)> raw_depth,
                             std::function<void(const DepthMap&)> filtered_depth,
                             std::function<void(const KeyframeCloud&)> cloud, MaskSource* masks,
                             const path& prior_depth, const path& image_folder, bool verify,
                             std::function<void(const std::string&)> warning, const CalibrationOptions& calibrate,
                             std::function<py::object(std::size_t, std::size_t)> progress) {
  const Reserved reserved("densify", {&images, output, masks});
  DensifierCallbacks callbacks = interruptible({std::move(raw_depth), std::move(filtered_depth), std::move(cloud), {}});
  if (output != nullptr) {
    callbacks.cloud = [output, cloud = std::move(callbacks.cloud)](const KeyframeCloud& points) {
      output->add(points);
      if (cloud) cloud(points);
    };
    if (output->wants_depth()) {
      callbacks.filtered_depth = [output, take = std::move(callbacks.filtered_depth)](const DepthMap& depth) {
        output->add_depth(depth);
        if (take) take(depth);
      };
    }
  }
  DensifyExtras extras;
  extras.masks = masks;
  extras.prior_depth = prior_depth;
  extras.image_folder = image_folder;
  extras.verify = verify;
  extras.warning = std::move(warning);
  extras.calibrate = calibrate;
  extras.progress = continuing(std::move(progress));
  const DensifierOptions copy = options;  // other threads may change the given ones
  const py::gil_scoped_release released;
  return densify(map, images, copy, callbacks, extras);
}

}  // namespace

void add_maps(py::module_& m) {
  add_map(m);
  add_images(m);
  add_masks(m);
}

void add_densify(py::module_& m) {
  py::class_<CalibrationOptions>(m, "CalibrationOptions")
      .def(py::init([](bool lenses, bool rig) {
             return CalibrationOptions{lenses, rig};
           }),
           py::arg("lenses") = true, py::arg("rig") = true)
      .def_readwrite("lenses", &CalibrationOptions::lenses)
      .def_readwrite("rig", &CalibrationOptions::rig);
  m.def("densify", &densify_files, py::arg("map"), py::arg("images"), py::arg("options"),
        py::arg("output") = py::none(), py::kw_only(), py::arg("raw_depth") = py::none(),
        py::arg("filtered_depth") = py::none(), py::arg("cloud") = py::none(), py::arg("masks") = py::none(),
        py::arg("prior_depth") = "", py::arg("image_folder") = "", py::arg("verify") = true,
        py::arg("warning") = py::none(), py::arg("calibrate") = CalibrationOptions(), py::arg("progress") = py::none());
}

}  // namespace pmsp::python
