// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <pybind11/pybind11.h>

#include "pmsp/densifier.h"
#include "pmsp/types.h"

namespace pmsp::python {

namespace py = pybind11;

/// Keyframe with the arrays that its images refer to; None = none.
struct ArrayKeyframe : Keyframe {
  py::object image_array = py::none();
  py::object mask_array = py::none();
  py::object prior_depth_array = py::none();
};

/// Adds a check for signals to `progress`, so that Ctrl-C ends the run.
DensifierCallbacks interruptible(DensifierCallbacks callbacks);

}  // namespace pmsp::python
