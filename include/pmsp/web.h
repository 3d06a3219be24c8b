// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/io/cloud.h"
#include "pmsp/live.h"

// A live map in a browser: the library pmsp_web.
namespace pmsp {

/// Address and limits of a server.
struct HttpOptions {
  std::string address = "127.0.0.1";
  std::uint16_t port = 0;        ///< 0 = one that is free
  std::size_t connections = 64;  ///< at once; where there are more, those go first that have not shown the token
  std::size_t header_bytes = 8192;
  std::chrono::milliseconds for_headers{10'000};  ///< until a request is there
  std::chrono::milliseconds for_chunk{20'000};    ///< until the client has taken the next 64 KiB
  std::chrono::milliseconds patience{10'000};
  int nice = 0;  ///< of its thread
};

/// Where the points of a live map come from: of a LiveDensifier, its members of these names.
struct LiveSource {
  std::function<LiveChanges(LiveVersion since)> changes_since;
  std::function<std::shared_ptr<const LiveSnapshot>()> snapshot;
};

/// A keyframe of the flight, with or without points.
struct LivePlace {
  std::int64_t id = 0;
  RigidTransform cam_from_world;
};

/// What the page is told once.
struct LivePage {
  std::string title = "live map";
  std::string unit;  ///< of lengths; "" = those of a map without scale
  Similarity file_from_map;
};

/// A page that shows a live map while it is made. Browsers ask for what has changed since they asked last, and fetch
/// the points of keyframe after keyframe: nothing is sent that nobody has asked for, and who makes the map waits for
/// nobody. All members may be called from any thread.
///
///     pmsp::LiveDensifier live(options);
///     pmsp::LiveServer server({}, live);
///     std::cerr << server.url() << "\n";
class PMSP_API LiveServer {
 public:
  /// Throws InvalidOption for an address that is none, OutputError where it cannot be had.
  LiveServer(const HttpOptions& options, LiveSource source);
  /// `live` must outlive the server.
  LiveServer(const HttpOptions& options, const LiveDensifier& live);
  ~LiveServer();
  LiveServer(const LiveServer&) = delete;
  LiveServer& operator=(const LiveServer&) = delete;

  /// With the token, without which nothing is answered.
  std::string url() const;

  /// What is shown, and the flight as far as it is known; without one, it is that of the keyframes with points.
  void set_page(LivePage page, std::vector<LivePlace> flight);
  /// Where the camera is now, and how it is turned.
  void set_camera(const RigidTransform& cam_from_world);
  /// No more will come. Waits until those who look have been told, and have fetched all, at most so long.
  void finish(std::chrono::milliseconds at_most);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmsp
