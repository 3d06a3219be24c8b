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

/// The live page of a run, or of run after run where one follows a map. Memory: 32 bytes a point, of some five million
/// at most. What it costs a run is a copy of some points of each keyframe, whoever looks.
class LiveView {
 public:
  /// Tells the address on stderr. Throws as LiveServer.
  explicit LiveView(const LiveArguments& arguments);

  /// A run begins.
  void begin(const SlamMap& map, LivePage page);
  void set_camera(const RigidTransform& cam_from_world) { server_.set_camera(cam_from_world); }
  /// A keyframe's points: new ones, or those that are there at another place.
  void add(const KeyframeCloud& cloud);
  /// The run is through: keyframes that were not named since it began are gone.
  void end();

  std::string url() const { return server_.url(); }

  void finish() { server_.finish(std::chrono::seconds(10)); }

 private:
  LiveMap map_;
  std::size_t points_each_ = 0;
  std::set<std::int64_t> named_;
  LiveServer server_;  ///< its thread reads the map
};

}  // namespace pmsp::tool
