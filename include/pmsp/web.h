// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/io/cloud.h"
#include "pmsp/live.h"

// Live map in a browser (library pmsp_web).
namespace pmsp {

/// Address and limits of an HTTP server.
struct HttpOptions {
  std::string address = "127.0.0.1";
  std::uint16_t port = 0;  ///< 0 = any free port
  /// Maximum number; a further one replaces a connection without token, or is refused.
  std::size_t connections = 64;
  std::size_t header_bytes = 8192;                ///< maximum size of request headers
  std::chrono::milliseconds for_headers{10'000};  ///< timeout for a request
  std::chrono::milliseconds for_chunk{20'000};    ///< timeout for the transfer of 64 KiB
  std::chrono::milliseconds long_poll_timeout{
      10'000};   ///< hold time of requests for changes, less than the page's 30 s
  int nice = 0;  ///< niceness added to its thread
  /// First segment of all paths, 16 to 128 letters, digits, '-' and '_'; "" = 128 random bits, others in each server.
  std::string token;
};

/// Source of a live map, as the members of LiveDensifier. Called on the thread of the server.
struct LiveSource {
  std::function<LiveChanges(LiveVersion since)> changes_since;
  std::function<std::shared_ptr<const LiveSnapshot>()> snapshot;
  /// Number of points of the map, if its clouds are thinned; empty = those of the snapshot.
  std::function<std::int64_t()> total_points = {};
};

/// Keyframe of the trajectory, with or without points.
struct TrajectoryPose {
  std::int64_t id = 0;
  RigidTransform cam_from_world;
};

/// Progress of the work.
struct LiveProgress {
  std::string stage;           ///< what is being done; "" = nothing to report
  double share = -1.0;         ///< of the work, 0 to 1; < 0 = unknown
  double seconds_left = -1.0;  ///< < 0 = unknown
};

/// Metadata of the page.
struct LivePage {
  std::string title = "live map";
  std::string unit;          ///< unit of lengths; "" = map units
  Similarity file_from_map;  ///< frame that is shown; identity = that of the SLAM
};

/// Server of a page that shows a live map. Browsers poll for changes and fetch points by keyframe; the source of the
/// map never waits for them. All members may be called from any thread, and return at once except `finish`.
///
///     pmsp::LiveDensifier live(options);
///     pmsp::LiveServer server({}, live);
///     std::cerr << server.url() << "\n";
class PMSP_API LiveServer {
 public:
  /// Throws InvalidOption if address or token are invalid, OutputError if it is not available, Error if the build has
  /// no page (PMSP_VIEWER).
  LiveServer(const HttpOptions& options, LiveSource source);
  /// `live` must outlive the server.
  LiveServer(const HttpOptions& options, const LiveDensifier& live);
  ~LiveServer();
  LiveServer(const LiveServer&) = delete;
  LiveServer& operator=(const LiveServer&) = delete;

  std::string url() const;  ///< with the token that all requests need

  /// `trajectory`: all keyframes in order; empty = those with points.
  void set_page(LivePage page, std::vector<TrajectoryPose> trajectory);
  void set_camera(const RigidTransform& cam_from_world);  ///< sets the current pose
  /// Sets all landmarks [world frame]. The page shows up to 20,000, evenly selected, where it has no dense points.
  void set_landmarks(std::vector<Eigen::Vector3d> positions);
  /// Adds or replaces the photo of a keyframe; the last one is shown as the newest. Encoded on an own thread, at most
  /// 1024 px wide; the oldest of more than 4 waiting ones are dropped. Memory: up to 256 MiB of JPEGs, the newest ones.
  void add_photo(std::int64_t keyframe_id, LiveImage image);
  void set_progress(LiveProgress progress);
  /// Sets the finished report, which the page links to. Of its directory, only the report and the files and directories
  /// `beside` it are served. Throws IoError if the directory cannot be opened.
  void set_report(const std::filesystem::path& report, std::vector<std::string> beside = {});
  /// Announces the end of the map and blocks until all polling pages were sent it and no request has come for 1.5 s, at
  /// most `at_most`. Slower pages may lack the last points.
  void finish(std::chrono::milliseconds at_most);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmsp
