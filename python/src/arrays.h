// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <climits>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include "pmsp/io/cloud.h"
#include "pmsp/io/map.h"
#include "pmsp/types.h"

// Images and vectors of the library as NumPy arrays, and arrays as images, without copies.
namespace pmsp::python {

namespace py = pybind11;

/// Scalars of an element: an Rgb or Eigen vector is an axis of 3 in the array.
template <class T>
struct Scalars {
  using Type = T;
  static constexpr int kCount = 1;
};
template <>
struct Scalars<Rgb> {
  using Type = std::uint8_t;
  static constexpr int kCount = 3;
};
template <>
struct Scalars<Eigen::Vector3f> {
  using Type = float;
  static constexpr int kCount = 3;
};

/// Structs are records with the names of their members.
template <class T>
py::dtype dtype_of() {
  return py::dtype::of<typename Scalars<T>::Type>();
}
template <>
py::dtype dtype_of<CloudPoint>();
template <>
py::dtype dtype_of<OutputPoint>();
template <>
py::dtype dtype_of<Landmark>();
template <>
py::dtype dtype_of<MapLandmark>();
template <>
py::dtype dtype_of<MapObservation>();

/// Array of the memory at `data`, which `owner` keeps alive.
template <class T>
py::array array_at(const T* data, std::vector<py::ssize_t> shape, py::handle owner, bool writeable) {
  if constexpr (Scalars<T>::kCount > 1) shape.push_back(Scalars<T>::kCount);
  py::array array(dtype_of<T>(), std::move(shape), data, owner);
  if (!writeable) py::detail::array_proxy(array.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  return array;
}

template <class T>
py::array array_at(const Image<T>& image, py::handle owner, bool writeable) {
  return array_at(image.pixels().data(), {image.height(), image.width()}, owner, writeable);
}
template <class T>
py::array array_at(const std::vector<T>& values, py::handle owner, bool writeable) {
  return array_at(values.data(), {static_cast<py::ssize_t>(values.size())}, owner, writeable);
}

/// Returns a read-only array of an image or vector that is a member of `owner`.
template <class Values>
py::array view(const Values& values, py::handle owner) {
  return array_at(values, owner, false);
}

/// Returns a getter of `view` for a member.
template <class Owner, class Values>
auto view_of(Values Owner::*member) {
  return [member](const py::object& self) { return view(self.cast<const Owner&>().*member, self); };
}

/// Returns an array that owns the image or vector.
template <class Values>
py::array moved(Values&& values) {
  auto* const kept = new Values(std::forward<Values>(values));
  const py::capsule owner(kept, [](void* pointer) { delete static_cast<Values*>(pointer); });
  return array_at(*kept, owner, true);
}

/// Returns a read-only array of a shared image; None if null.
template <class T>
py::object shared(const std::shared_ptr<const Image<T>>& image) {
  if (!image) return py::none();
  auto* const kept = new std::shared_ptr<const Image<T>>(image);
  const py::capsule owner(kept, [](void* pointer) { delete static_cast<std::shared_ptr<const Image<T>>*>(pointer); });
  return array_at(*image, owner, false);
}

/// Returns "an array of float64, (3, 4)" or "a list".
std::string text_of(const py::object& object);

/// Throws TypeError or ValueError: `name`, the object, `expected`.
[[noreturn]] void refuse_type(const std::string& name, const py::object& object, const std::string& expected);
[[noreturn]] void refuse_value(const std::string& name, const py::object& object, const std::string& expected);

/// Returns whether the object is an array of aligned elements of the dtype.
bool is_array_of(const py::object& object, const py::dtype& dtype);

/// Returns the image at the memory of an array, (height, width) or (height, width, 3); empty if None. Throws TypeError
/// if the object is no array of the elements, ValueError if the shape differs or pixels of a row are not contiguous.
template <class T>
ImageView<const T> image_at(const py::object& object, const std::string& name) {
  if (object.is_none()) return {};
  using Scalar = typename Scalars<T>::Type;
  constexpr int kChannels = Scalars<T>::kCount;
  const std::string expected = "an array of " + std::string(py::str(dtype_of<T>())) +
                               (kChannels > 1 ? ", (height, width, 3)" : ", (height, width)");
  if (!is_array_of(object, dtype_of<T>())) refuse_type(name, object, expected);
  const auto array = py::reinterpret_borrow<py::array>(object);
  constexpr py::ssize_t kSize = sizeof(T);
  const py::ssize_t axes = kChannels > 1 ? 3 : 2;
  const bool fits = array.ndim() == axes && (axes < 3 || array.shape(2) == kChannels) && array.size() > 0 &&
                    array.shape(0) <= INT_MAX && array.shape(1) <= INT_MAX;
  if (!fits) refuse_value(name, object, expected);
  const py::ssize_t stride = array.strides(0);
  const bool is_packed = array.strides(1) == kSize && (axes < 3 || array.strides(2) == sizeof(Scalar)) &&
                         stride % kSize == 0 && stride >= array.shape(1) * kSize;
  if (!is_packed) refuse_value(name, object, "rows of contiguous pixels, as of numpy.ascontiguousarray");
  return {static_cast<const T*>(array.data()), static_cast<int>(array.shape(1)), static_cast<int>(array.shape(0)),
          stride / kSize};
}

/// Returns a copy of an array as image; throws as image_at.
template <class T>
Image<T> image_from(const py::object& object, const std::string& name) {
  const ImageView<const T> view = image_at<T>(object, name);
  if (view.empty()) return {};
  Image<T> image(view.width, view.height, view(0, 0));
  for (int y = 0; y < view.height; ++y) std::copy_n(view.row(y), view.width, image.row(y));
  return image;
}

/// Returns the structs of a one-dimensional array, or of a sequence of tuples. Throws TypeError, ValueError.
template <class T>
std::vector<T> structs_from(const py::object& object, const std::string& name) {
  const std::string expected = "an array of " + std::string(py::str(dtype_of<T>())) + ", (n,), or tuples like it";
  const bool is_array = py::isinstance<py::array>(object);
  if (is_array && !py::reinterpret_borrow<py::array>(object).dtype().equal(dtype_of<T>())) {
    refuse_type(name, object, expected);
  }
  py::array array;
  try {
    array = py::module_::import("numpy").attr("array")(object, dtype_of<T>());
  } catch (const py::error_already_set&) {
    refuse_type(name, object, expected);
  }
  if (array.ndim() != 1) refuse_value(name, object, expected);
  std::vector<T> values(static_cast<std::size_t>(array.size()));
  const auto* const from = static_cast<const T*>(array.data());
  std::copy_n(from, values.size(), values.begin());
  return values;
}

}  // namespace pmsp::python
