// SPDX-License-Identifier: BSD-2-Clause
#include <map>
#include <string>
#include <thread>
#include <utility>

#include <pybind11/pybind11.h>

#include "arrays.h"
#include "calls.h"
#include "pmsp/error.h"
#include "pmsp/version.h"

namespace pmsp::python {
namespace {

/// Reserved objects and their threads; guarded by the GIL.
std::map<const void*, std::thread::id>& reserved_objects() {
  static std::map<const void*, std::thread::id> objects;
  return objects;
}

[[noreturn]] void refuse(const char* what) {
  throw Error(std::string(what) + ": in use by another call; expected one call at a time, none of them in a callback");
}

std::string kind_of(const py::object& object) { return py::str(py::type::of(object).attr("__name__")); }

}  // namespace

Reserved::Reserved(const char* what, std::initializer_list<const void*> objects) {
  for (const void* object : objects) {
    if (object != nullptr && reserved_objects().count(object) != 0) refuse(what);
  }
  for (const void* object : objects) {
    if (object != nullptr && reserved_objects().emplace(object, std::this_thread::get_id()).second)
      objects_.push_back(object);
  }
}

Reserved::~Reserved() {
  for (const void* object : objects_) reserved_objects().erase(object);
}

void Reserved::check(const char* what, const void* object) {
  const auto found = reserved_objects().find(object);
  if (found != reserved_objects().end() && found->second != std::this_thread::get_id()) refuse(what);
}

void check_signals() {
  const py::gil_scoped_acquire acquired;
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

std::string text_of(const py::object& object) {
  if (!py::isinstance<py::array>(object)) return "of type " + kind_of(object);
  return "an array of " + std::string(py::str(object.attr("dtype"))) + ", shape " +
         std::string(py::str(object.attr("shape"))) + ", strides " + std::string(py::str(object.attr("strides")));
}

void refuse_type(const std::string& name, const py::object& object, const std::string& expected) {
  throw py::type_error(name + " is " + text_of(object) + "; expected " + expected);
}

void refuse_value(const std::string& name, const py::object& object, const std::string& expected) {
  throw py::value_error(name + " is " + text_of(object) + "; expected " + expected);
}

bool is_array_of(const py::object& object, const py::dtype& dtype) {
  return py::isinstance<py::array>(object) && py::reinterpret_borrow<py::array>(object).dtype().equal(dtype) &&
         py::detail::check_flags(object.ptr(), py::detail::npy_api::NPY_ARRAY_ALIGNED_);
}

}  // namespace pmsp::python

PYBIND11_MODULE(_pmsp, m) {
  using namespace pmsp;
  namespace py = pybind11;
  const py::object name = m.attr("__name__");
  m.attr("__name__") = "pmsp";  // of classes and exceptions
  m.attr("__version__") = PMSP_VERSION_STRING;
  const auto& error = py::register_exception<Error>(m, "Error", PyExc_RuntimeError);
  py::register_exception<InvalidOption>(m, "InvalidOption", error);
  py::register_exception<InvalidInput>(m, "InvalidInput", error);
  py::register_exception<IoError>(m, "IoError", error);
  py::register_exception<OutputError>(m, "OutputError", error);
  py::register_exception<DeviceError>(m, "DeviceError", error);
  py::register_exception<BackendUnavailable>(m, "BackendUnavailable", error);
  python::add_options(m);
  python::add_types(m);
  python::add_densifier(m);
  python::add_live(m);
  python::add_maps(m);
  python::add_clouds(m);
  python::add_densify(m);
  m.attr("__name__") = name;
}
