// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <initializer_list>
#include <type_traits>
#include <utility>
#include <vector>

#include <pybind11/pybind11.h>

// What classes and calls have in common.
namespace pmsp::python {

namespace py = pybind11;

/// Reserves objects that must not be used by two threads at once for one call. Lives while the GIL is held: it is
/// created before the GIL is released, and destroyed afterwards.
class Reserved {
 public:
  /// Throws Error if one of the objects is reserved; `what`: its description.
  Reserved(const char* what, std::initializer_list<const void*> objects);
  ~Reserved();
  Reserved(const Reserved&) = delete;
  Reserved& operator=(const Reserved&) = delete;

  /// Throws Error if another thread has reserved the object.
  static void check(const char* what, const void* object);

 private:
  std::vector<const void*> objects_;
};

/// Wraps a const member: Error while another thread uses the object, and a copy as result.
template <class T, class Result, class... Arguments>
auto checked(const char* what, Result (T::*member)(Arguments...) const) {
  return [what, member](const T& self, Arguments... arguments) -> std::decay_t<Result> {
    Reserved::check(what, &self);
    return (self.*member)(std::forward<Arguments>(arguments)...);
  };
}

/// Wraps a member that computes or blocks: reserves the object and releases the GIL.
template <class T, class Result, class... Arguments>
auto exclusive(const char* what, Result (T::*member)(Arguments...)) {
  return [what, member](T& self, Arguments... arguments) -> Result {
    const Reserved reserved(what, {&self});
    const py::gil_scoped_release released;
    return (self.*member)(std::forward<Arguments>(arguments)...);
  };
}

/// Adds members under their names: read_only(c, "a", &T::a, "b", &T::b).
template <class Class, class Member, class... Rest>
void read_only(Class& c, const char* name, Member member, Rest... rest) {
  c.def_readonly(name, member);
  if constexpr (sizeof...(rest) > 0) read_only(c, rest...);
}
template <class Class, class Member, class... Rest>
void read_write(Class& c, const char* name, Member member, Rest... rest) {
  c.def_readwrite(name, member);
  if constexpr (sizeof...(rest) > 0) read_write(c, rest...);
}

/// Throws the exception of a pending signal, as KeyboardInterrupt. Acquires the GIL.
void check_signals();

void add_options(py::module_& m);
void add_types(py::module_& m);
void add_densifier(py::module_& m);
void add_live(py::module_& m);
void add_maps(py::module_& m);
void add_clouds(py::module_& m);
void add_densify(py::module_& m);

}  // namespace pmsp::python
