// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <set>
#include <string>

#include "arguments.h"
#include "live/live_map.h"
#include "pmsp/io/map.h"
#include "pmsp/web.h"

namespace pmsp::tool {

/// Live page of a run, or of successive runs (--follow). Keeps a subset of the points in memory, 32 bytes each.
class LiveView {
 public:
  /// Prints the address to stderr. Throws as LiveServer.
  explicit LiveView(const LiveArguments& arguments);

  /// Starts a run.
  void begin(const SlamMap& map, LivePage page);
  void set_camera(const RigidTransform& cam_from_world) { server_.set_camera(cam_from_world); }
  /// Publishes a keyframe; sets only its pose if its points are unchanged.
  void add(const KeyframeCloud& cloud);
  /// Ends a run: removes keyframes not added since `begin`.
  void end();

  std::string url() const { return server_.url(); }

  void finish() { server_.finish(std::chrono::seconds(10)); }

 private:
  LiveMap map_;
  std::size_t points_each_ = 0;
  std::set<std::int64_t> added_;
  LiveServer server_;  ///< its thread reads the map
};

}  // namespace pmsp::tool
