// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "http_server.h"
#include "pmsp/io/similarity.h"
#include "pmsp/live_snapshot.h"

namespace pmsp::tool {

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
///     LiveServer server({}, {[&](auto since) { return live.changes_since(since); }, [&] { return live.snapshot(); }});
///     std::cerr << server.url() << "\n";
class LiveServer {
 public:
  /// Throws as HttpServer.
  LiveServer(const HttpOptions& options, LiveSource source);

  std::string url() const { return server_->url(); }

  /// What is shown, and the flight as far as it is known; without one, it is that of the keyframes with points.
  void set_page(LivePage page, std::vector<LivePlace> flight);
  /// Where the camera is now, and how it is turned.
  void set_camera(const RigidTransform& cam_from_world);
  /// No more will come. Waits until those who look have been told, and have fetched all, at most so long.
  void finish(std::chrono::milliseconds at_most);

 private:
  using Json = nlohmann::ordered_json;

  std::optional<HttpReply> answer(const HttpRequest& request);
  HttpReply page() const;
  std::optional<HttpReply> changes(const HttpRequest& request);
  HttpReply points(std::int64_t id, LiveVersion since);
  Json changes_json(const LiveChanges& changes, std::uint64_t news) const;
  Json matrix_json(const KeyframePose& pose) const;
  Json center_json(const Eigen::Vector3d& center) const;

  const LiveSource source_;
  mutable std::mutex mutex_;
  LivePage page_;
  std::vector<LivePlace> flight_;
  std::optional<RigidTransform> camera_;  ///< cam_from_world
  bool is_done_ = false;
  std::uint64_t epoch_ = 1;        ///< counts pages: one of an earlier epoch loads itself anew
  std::uint64_t news_ = 1;         ///< counts all else that happens besides points
  std::uint64_t flight_news_ = 1;  ///< when the flight changed last
  /// A page that asks for changes.
  struct Looker {
    std::chrono::steady_clock::time_point asked;
    bool is_told = false;  ///< that no more comes
  };
  std::map<std::uint64_t, Looker> lookers_;  ///< by the number that each gives itself; those of late
  std::optional<std::chrono::steady_clock::time_point> last_answer_;
  std::map<std::pair<std::int64_t, LiveVersion>, std::shared_ptr<const std::string>> blocks_;  ///< those asked for last
  std::unique_ptr<HttpServer> server_;  ///< its thread uses all of the above
};

}  // namespace pmsp::tool
