// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/live.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <mutex>
#include <set>
#include <shared_mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <pybind11/functional.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "arrays.h"
#include "calls.h"
#include "pmsp/error.h"

namespace pmsp::python {
namespace {

/// Whether Python's code is called on a worker or within a call, where it must not wait for the end of a worker.
thread_local bool in_callback = false;

/// Acquires the GIL for such code.
class CallbackScope {
 public:
  CallbackScope() : before_(std::exchange(in_callback, true)) {}
  ~CallbackScope() { in_callback = before_; }
  CallbackScope(const CallbackScope&) = delete;
  CallbackScope& operator=(const CallbackScope&) = delete;

 private:
  py::gil_scoped_acquire acquired_;
  bool before_;
};

/// Returns a callback for worker threads, where an exception of Python must not outlive the GIL.
template <class Argument>
std::function<void(Argument)> on_worker(std::function<void(Argument)> callback) {
  if (!callback) return {};
  return [callback = std::move(callback)](Argument argument) {
    const CallbackScope scope;
    try {
      callback(argument);
    } catch (const py::error_already_set& error) {
      throw Error(error.what());
    }
  };
}

/// LiveDensifier that ends without the GIL, which its worker needs for callbacks and for the release of images.
class Live {
 public:
  Live(const LiveOptions& options, LiveCallbacks callbacks) {
    {
      const py::gil_scoped_release released;
      worker_ = std::make_unique<Worker>(options, std::move(callbacks));
    }
    all().insert(this);
  }
  ~Live() {
    if (in_callback && worker_) {
      all().erase(this);
      ending().emplace_back([ended = std::move(worker_)]() mutable { ended.reset(); });
    } else {
      close();
    }
  }
  Live(const Live&) = delete;
  Live& operator=(const Live&) = delete;

  /// Ends the worker after the calls of other threads; further calls throw Error.
  void close() {
    if (!worker_) return;
    if (in_callback) {
      throw Error(
          "LiveDensifier: closed by a callback, expected a thread that may wait for the worker's end; let the callback "
          "set an event that the with statement waits for");
    }
    all().erase(this);
    std::unique_ptr<Worker> ended = std::move(worker_);
    const py::gil_scoped_release released;
    { const std::unique_lock<std::shared_mutex> none_in_progress(ended->calls); }  // no further call finds it
    ended.reset();
  }

  /// Before the end of the interpreter, when threads can no longer acquire the GIL.
  static void close_all() {
    while (!all().empty()) (*all().begin())->close();
    while (!ending().empty()) {
      std::thread thread = std::move(ending().back());
      ending().pop_back();
      const py::gil_scoped_release released;
      thread.join();
    }
  }

  /// Calls `action` without the GIL.
  template <class Action>
  auto call(Action action) const {
    if (!worker_) throw Error("LiveDensifier: closed; expected calls before the end of its with statement");
    Worker& worker = *worker_;
    const std::shared_lock<std::shared_mutex> in_progress(worker.calls);
    const py::gil_scoped_release released;
    return action(worker.live);
  }

  /// Waits in slices, between which signals are checked.
  bool wait(double at_most) const {
    constexpr double kSlice = 0.1;
    using Seconds = std::chrono::duration<double>;
    const auto begin = std::chrono::steady_clock::now();
    for (;;) {
      const double left = at_most - Seconds(std::chrono::steady_clock::now() - begin).count();
      const auto slice = std::chrono::ceil<std::chrono::milliseconds>(Seconds(std::clamp(left, 0.0, kSlice)));
      if (call([&](const LiveDensifier& live) { return live.wait(slice); })) return true;
      check_signals();
      if (!(left > kSlice)) return false;
    }
  }

 private:
  struct Worker {
    Worker(const LiveOptions& options, LiveCallbacks callbacks) : live(options, std::move(callbacks)) {}
    std::shared_mutex calls;  ///< shared by calls in progress
    LiveDensifier live;
  };

  static std::set<Live*>& all() {
    static std::set<Live*> instances;
    return instances;
  }
  /// Threads that end those whose last reference a callback has dropped.
  static std::vector<std::thread>& ending() {
    static std::vector<std::thread> threads;
    return threads;
  }

  std::unique_ptr<Worker> worker_;  ///< null after close()
};

/// Wraps a member.
template <class Result, class... Arguments>
auto released(Result (LiveDensifier::*member)(Arguments...)) {
  return [member](const Live& self, Arguments... arguments) {
    return self.call([&](LiveDensifier& live) { return (live.*member)(std::forward<Arguments>(arguments)...); });
  };
}
template <class Result, class... Arguments>
auto released(Result (LiveDensifier::*member)(Arguments...) const) {
  return [member](const Live& self, Arguments... arguments) {
    return self.call([&](const LiveDensifier& live) { return (live.*member)(std::forward<Arguments>(arguments)...); });
  };
}

/// Returns an owner that keeps a Python object alive and may be released on any thread.
std::shared_ptr<const void> kept_alive(py::object object) {
  const void* const pointer = object.ptr();
  return {pointer, [handle = object.release()](const void*) {
            const CallbackScope scope;
            handle.dec_ref();
          }};
}

LiveImage live_image(const py::object& pixels, PixelFormat format) {
  LiveImage image;
  image.format = format;
  const std::string name = "LiveImage.pixels";
  if (pixels.is_none()) refuse_type(name, pixels, "an array of uint8");
  if (format == PixelFormat::kGray) {
    const ImageView<const std::uint8_t> view = image_at<std::uint8_t>(pixels, name);
    image.data = view.data;
    image.width = view.width;
    image.height = view.height;
    image.stride = view.stride;
  } else {
    const ImageView<const Rgb> view = image_at<Rgb>(pixels, name);
    image.data = &view.data->r;
    image.width = view.width;
    image.height = view.height;
    image.stride = view.stride * static_cast<std::ptrdiff_t>(sizeof(Rgb));
  }
  image.owner = kept_alive(pixels);
  return image;
}

void add_state(py::module_& m) {
  py::class_<LiveCloud>(m, "LiveCloud")
      .def_readonly("keyframe_id", &LiveCloud::keyframe_id)
      .def_readonly("map_id", &LiveCloud::map_id)
      .def_property_readonly("pose", [](const LiveCloud& self) { return self.pose; })
      .def_property_readonly("cloud",
                             [](const LiveCloud& self) { return std::const_pointer_cast<KeyframeCloud>(self.cloud); })
      .def_readonly("preliminary", &LiveCloud::preliminary)
      .def_readonly("cloud_since", &LiveCloud::cloud_since)
      .def_readonly("pose_since", &LiveCloud::pose_since);
  py::class_<LiveSnapshot, std::shared_ptr<LiveSnapshot>>(m, "LiveSnapshot")
      .def_readonly("version", &LiveSnapshot::version)
      .def_readonly("clouds", &LiveSnapshot::clouds);
  // `from` is a keyword of Python.
  py::class_<LiveChanges>(m, "LiveChanges")
      .def_readonly("from_", &LiveChanges::from)
      .def_readonly("to", &LiveChanges::to)
      .def_readonly("reset", &LiveChanges::reset)
      .def_readonly("added", &LiveChanges::added)
      .def_readonly("replaced", &LiveChanges::replaced)
      .def_readonly("moved", &LiveChanges::moved)
      .def_readonly("removed", &LiveChanges::removed)
      .def("empty", &LiveChanges::empty);
  {
    using T = LiveStats;
    py::class_<T> c(m, "LiveStats");
    read_only(c, "added", &T::added, "erased", &T::erased, "resets", &T::resets, "used", &T::used, "not_needed",
              &T::not_needed, "dropped_late", &T::dropped_late, "previews", &T::previews, "previews_late",
              &T::previews_late, "passes", &T::passes, "matched_again", &T::matched_again, "clouds", &T::clouds,
              "rescaled", &T::rescaled, "images_dropped", &T::images_dropped, "keyframes_frozen", &T::keyframes_frozen,
              "errors", &T::errors, "last_error", &T::last_error, "failed", &T::failed, "memory_mib", &T::memory_mib,
              "lens_distance", &T::lens_distance, "rig", &T::rig);
  }
  {
    using T = LiveBacklog;
    py::class_<T> c(m, "LiveBacklog");
    read_only(c, "unstable", &T::unstable, "waiting", &T::waiting, "refining", &T::refining, "idle", &T::idle);
  }
}

void add_input(py::module_& m) {
  py::enum_<PixelFormat>(m, "PixelFormat")
      .value("RGB", PixelFormat::kRgb)
      .value("BGR", PixelFormat::kBgr)
      .value("GRAY", PixelFormat::kGray);
  py::class_<LiveImage>(m, "LiveImage")
      .def(py::init(&live_image), py::arg("pixels"), py::arg("format") = PixelFormat::kRgb)
      .def_readonly("width", &LiveImage::width)
      .def_readonly("height", &LiveImage::height)
      .def_readonly("format", &LiveImage::format);
  py::class_<LiveKeyframe>(m, "LiveKeyframe")
      .def(py::init<>())
      .def_readwrite("id", &LiveKeyframe::id)
      .def_readwrite("cam_from_world", &LiveKeyframe::cam_from_world)
      .def_property(
          "landmarks", [](const LiveKeyframe& self) { return moved(std::vector<Landmark>(self.landmarks)); },
          [](LiveKeyframe& self, const py::object& given) {
            self.landmarks = structs_from<Landmark>(given, "LiveKeyframe.landmarks");
          })
      .def_property(
          "image",
          [](const LiveKeyframe& self) -> py::object { return self.image.owner ? py::cast(self.image) : py::none(); },
          [](LiveKeyframe& self, const LiveImage* image) { self.image = image != nullptr ? *image : LiveImage(); })
      .def_property(
          "prior_depth", [](const LiveKeyframe& self) { return shared(self.prior_depth); },
          [](LiveKeyframe& self, const py::object& given) {
            self.prior_depth =
                given.is_none()
                    ? nullptr
                    : std::make_shared<const Image<float>>(image_from<float>(given, "LiveKeyframe.prior_depth"));
          })
      .def_readwrite("pose_error", &LiveKeyframe::pose_error)
      .def_readwrite("map_id", &LiveKeyframe::map_id);
  py::class_<LiveOptions>(m, "LiveOptions")
      .def(py::init<>())
      .def_readwrite("densifier", &LiveOptions::densifier)
      .def_readwrite("nice", &LiveOptions::nice)
      .def_readwrite("calibrate_lenses", &LiveOptions::calibrate_lenses)
      .def_readwrite("find_rig", &LiveOptions::find_rig)
      .def_readwrite("previews", &LiveOptions::previews)
      .def_readwrite("memory_mib", &LiveOptions::memory_mib)
      .def_readwrite("max_waiting", &LiveOptions::max_waiting)
      .def_readwrite("stable_after", &LiveOptions::stable_after)
      .def_readwrite("stable_at_latest", &LiveOptions::stable_at_latest)
      .def_readwrite("stable_move", &LiveOptions::stable_move)
      .def_readwrite("max_move_px", &LiveOptions::max_move_px)
      .def_property(
          "mask", [](const LiveOptions& self) { return shared(self.mask); },
          [](LiveOptions& self, const py::object& given) {
            self.mask =
                given.is_none()
                    ? nullptr
                    : std::make_shared<const Image<std::uint8_t>>(image_from<std::uint8_t>(given, "LiveOptions.mask"));
          })
      .def("validate", &LiveOptions::validate);
}

}  // namespace

void add_live(py::module_& m) {
  add_state(m);
  add_input(m);
  py::class_<Live>(m, "LiveDensifier")
      .def(py::init([](const LiveOptions& options, std::function<void(LiveVersion)> changed,
                       std::function<void(const std::string&)> on_error) {
             return std::make_unique<Live>(
                 options, LiveCallbacks{on_worker(std::move(changed)), on_worker(std::move(on_error))});
           }),
           py::arg("options") = LiveOptions(), py::kw_only(), py::arg("changed") = py::none(),
           py::arg("on_error") = py::none())
      .def("__enter__", [](Live& self) -> Live& { return self; })
      .def("__exit__", [](Live& self, const py::args&) { self.close(); })
      .def("add", released(&LiveDensifier::add), py::arg("keyframe"))
      .def("update", released(&LiveDensifier::update), py::arg("keyframes"))
      .def("sync", released(&LiveDensifier::sync), py::arg("keyframes"))
      .def("erase", released(&LiveDensifier::erase), py::arg("ids"))
      .def("reset", released(&LiveDensifier::reset))
      .def("pause", released(&LiveDensifier::pause))
      .def("resume", released(&LiveDensifier::resume))
      .def("finish", released(&LiveDensifier::finish))
      .def("wait", &Live::wait, py::arg("at_most"))
      .def("snapshot",
           [](const Live& self) {
             return std::const_pointer_cast<LiveSnapshot>(
                 self.call([](const LiveDensifier& live) { return live.snapshot(); }));
           })
      .def("changes_since", released(&LiveDensifier::changes_since), py::arg("version"))
      .def("stats", released(&LiveDensifier::stats))
      .def("backlog", released(&LiveDensifier::backlog))
      .def("backend", released(&LiveDensifier::backend));
  py::module_::import("atexit").attr("register")(py::cpp_function(&Live::close_all));
}

}  // namespace pmsp::python
