// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "arguments.h"
#include "live/live_map.h"
#include "pmsp/io/map.h"
#include "pmsp/web.h"

namespace pmsp::tool {

/// Live page of a run, or of successive runs (--follow). Keeps a subset of the points in memory, 32 bytes each, and
/// photos.
class LiveView {
 public:
  /// Prints the address to stderr. Throws as LiveServer and token_from_file.
  explicit LiveView(const LiveArguments& arguments);

  /// Starts a run.
  void begin(const SlamMap& map, LivePage page);
  void set_camera(const RigidTransform& cam_from_world) { server_.set_camera(cam_from_world); }
  void set_progress(const std::string& stage, double share, double seconds_left) {
    server_.set_progress({stage, share, seconds_left});
  }
  /// Copies the image, unless copies have taken more than 2 % of the time.
  void add_photo(const Keyframe& keyframe);
  /// Publishes a keyframe; sets only its pose if its points are unchanged.
  void add(const KeyframeCloud& cloud);
  /// Ends a run: removes keyframes not added since `begin`.
  void end();
  /// See LiveServer::set_report. Ignored if the server ends with the run.
  void set_report(const std::filesystem::path& report, const std::vector<std::string>& beside);

  std::string url() const { return server_.url(); }

  /// Announces the end; then, with `may_wait` and --live-keep, serves until a signal.
  void finish(bool may_wait);

 private:
  using Clock = std::chrono::steady_clock;

  const LiveArguments& arguments_;
  LiveMap map_;
  std::size_t points_each_ = 0;
  std::set<std::int64_t> added_;
  std::map<std::int64_t, std::int64_t> points_;  ///< number of points by keyframe, before thinning
  std::atomic<std::int64_t> total_points_{0};
  const Clock::time_point start_ = Clock::now();
  Clock::duration copying_{0};
  LiveServer server_;  ///< its thread reads the map
};

}  // namespace pmsp::tool
