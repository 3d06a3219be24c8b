// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/densifier.h"

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <pybind11/functional.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "arrays.h"
#include "calls.h"
#include "keyframe.h"

namespace pmsp::python {
namespace {

void add_stats(py::module_& m) {
  {
    using T = DensifierStats;
    py::class_<T> c(m, "DensifierStats");
    read_only(c, "keyframes_added", &T::keyframes_added, "keyframes_accepted", &T::keyframes_accepted,
              "keyframes_rejected", &T::keyframes_rejected, "keyframes_blurred", &T::keyframes_blurred, "depth_maps",
              &T::depth_maps, "keyframes_without_neighbour", &T::keyframes_without_neighbour, "keyframes_without_range",
              &T::keyframes_without_range, "pixels", &T::pixels, "pixels_matched", &T::pixels_matched,
              "pixels_after_median", &T::pixels_after_median, "pixels_after_consistency", &T::pixels_after_consistency,
              "pixels_far", &T::pixels_far, "points_fused", &T::points_fused, "points_repeated", &T::points_repeated,
              "points", &T::points, "work_done", &T::work_done, "work_remaining", &T::work_remaining, "seconds_prepare",
              &T::seconds_prepare, "seconds_init", &T::seconds_init, "seconds_patchmatch", &T::seconds_patchmatch,
              "seconds_median", &T::seconds_median, "seconds_consistency", &T::seconds_consistency, "seconds_fusion",
              &T::seconds_fusion, "seconds_free_space", &T::seconds_free_space, "seconds_duplicates",
              &T::seconds_duplicates);
  }
}

/// Adds a property for an image at the memory of an array.
template <class T>
void add_image(py::class_<ArrayKeyframe>& keyframe, const char* name, ImageView<const T> ArrayKeyframe::*image,
               py::object ArrayKeyframe::*array) {
  keyframe.def_property(
      name, [array](const ArrayKeyframe& self) { return self.*array; },
      [name, image, array](ArrayKeyframe& self, const py::object& given) {
        self.*image = image_at<T>(given, std::string("Keyframe.") + name);
        self.*array = given;
      });
}

void add_keyframe(py::module_& m) {
  py::class_<ArrayKeyframe> keyframe(m, "Keyframe");
  keyframe.def(py::init<>())
      .def_readwrite("id", &ArrayKeyframe::id)
      .def_readwrite("timestamp", &ArrayKeyframe::timestamp)
      .def_readwrite("cam_from_world", &ArrayKeyframe::cam_from_world)
      .def_property(
          "landmarks", [](const ArrayKeyframe& self) { return moved(std::vector<Landmark>(self.landmarks)); },
          [](ArrayKeyframe& self, const py::object& given) {
            self.landmarks = structs_from<Landmark>(given, "Keyframe.landmarks");
          })
      .def_readwrite("pose_error", &ArrayKeyframe::pose_error)
      .def_readwrite("scale", &ArrayKeyframe::scale)
      .def("pose", [](const ArrayKeyframe& self) { return self.pose(); });
  add_image(keyframe, "image", static_cast<ImageView<const Rgb> ArrayKeyframe::*>(&ArrayKeyframe::image),
            &ArrayKeyframe::image_array);
  add_image(keyframe, "mask", static_cast<ImageView<const std::uint8_t> ArrayKeyframe::*>(&ArrayKeyframe::mask),
            &ArrayKeyframe::mask_array);
  add_image(keyframe, "prior_depth", static_cast<ImageView<const float> ArrayKeyframe::*>(&ArrayKeyframe::prior_depth),
            &ArrayKeyframe::prior_depth_array);
}

}  // namespace

DensifierCallbacks interruptible(DensifierCallbacks callbacks) {
  callbacks.progress = [progress = std::move(callbacks.progress)] {
    check_signals();
    if (progress) progress();
  };
  return callbacks;
}

void add_densifier(py::module_& m) {
  add_stats(m);
  add_keyframe(m);
  using TakeDepthMap = std::function<void(const DepthMap&)>;
  py::class_<Densifier>(m, "Densifier")
      .def(py::init([](const DensifierOptions& options, TakeDepthMap raw_depth, TakeDepthMap filtered_depth,
                       std::function<void(const KeyframeCloud&)> cloud, std::function<void()> progress) {
             DensifierCallbacks callbacks = interruptible(
                 {std::move(raw_depth), std::move(filtered_depth), std::move(cloud), std::move(progress)});
             const py::gil_scoped_release released;
             return std::make_unique<Densifier>(options, std::move(callbacks));
           }),
           py::arg("options"), py::kw_only(), py::arg("raw_depth") = py::none(), py::arg("filtered_depth") = py::none(),
           py::arg("cloud") = py::none(), py::arg("progress") = py::none())
      .def(
          "add",
          [](Densifier& self, const ArrayKeyframe& given) {
            const Reserved reserved("Densifier.add", {&self});
            const ArrayKeyframe keyframe = given;  // other threads may change the given one
            const py::gil_scoped_release released;
            return self.add(keyframe);
          },
          py::arg("keyframe"))
      .def("flush", exclusive("Densifier.flush", &Densifier::flush))
      .def("cancel", &Densifier::cancel)
      .def("cancelled", &Densifier::cancelled)
      .def("stats", checked("Densifier.stats", &Densifier::stats))
      .def("options", checked("Densifier.options", &Densifier::options))
      .def("backend", checked("Densifier.backend", &Densifier::backend));
}

}  // namespace pmsp::python
