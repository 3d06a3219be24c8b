// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/web.h"

#include <algorithm>
#include <map>
#include <mutex>
#include <optional>
#include <random>
#include <thread>
#include <utility>

#include <nlohmann/json.hpp>

#include "export/little_endian.h"
#include "pmsp/error.h"
#include "pmsp/version.h"
#include "util/number_from.h"
#include "web/http_server.h"
#include "web/live_block.h"
#include "web/live_photos.h"
#include "web/page.h"

namespace pmsp {
namespace {

using namespace web;

using Clock = std::chrono::steady_clock;

constexpr std::size_t kMaxBlocks = 32;
constexpr std::size_t kMaxLandmarks = 20'000;
constexpr std::size_t kMaxPhotoBytes = std::size_t{256} << 20;
/// Time without requests after which a client is assumed to be closed.
constexpr auto kClientTimeout = std::chrono::seconds(15);
constexpr std::size_t kMaxClients = 64;
/// Idle time after the end of the map after which clients are assumed to have all points.
constexpr auto kIdleTime = std::chrono::milliseconds(1500);

HttpReply reply_of(std::string body, const char* type) {
  HttpReply reply;
  reply.type = type;
  reply.body = std::make_shared<const std::string>(std::move(body));
  return reply;
}

nlohmann::ordered_json vector_json(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

/// Random, so that pages of an earlier server at the same address reload.
std::uint64_t first_page_version() {
  std::random_device random;
  return (std::uint64_t{random() & 0xFFFFU} << 32U) + random() + 1;
}

std::int64_t points_of(const LiveSnapshot& snapshot) {
  std::int64_t points = 0;
  for (const LiveCloud& cloud : snapshot.clouds) points += static_cast<std::int64_t>(cloud.cloud->points.size());
  return points;
}

/// Landmarks as the page receives them.
struct LandmarkBlock {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< of the positions
  std::string bytes;                                 ///< positions from the centre, 3 x 32 bits each
};

LandmarkBlock block_of(const std::vector<Eigen::Vector3d>& positions) {
  const std::size_t all = positions.size(), count = std::min(all, kMaxLandmarks);
  LandmarkBlock block;
  for (std::size_t i = 0; i < count; ++i) block.center += positions[i * all / count] / static_cast<double>(count);
  block.bytes.reserve(12 * count);
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3f position = (positions[i * all / count] - block.center).cast<float>();
    for (int k = 0; k < 3; ++k) append_little(block.bytes, position[k]);
  }
  return block;
}

}  // namespace

struct LiveServer::Impl {
  Impl(const HttpOptions& options, LiveSource source)
      : source_(std::move(source)),
        photos_(options.nice, kMaxPhotoBytes,
                [this](std::int64_t id) {
                  const std::lock_guard<std::mutex> lock(mutex_);
                  photo_versions_[id] = ++state_version_;
                  newest_photo_ = id;
                }),
        server_(std::make_unique<HttpServer>(options, [this](const HttpRequest& request) { return answer(request); })) {
  }

  void set_page(LivePage page, std::vector<TrajectoryPose> trajectory);
  void set_camera(const RigidTransform& cam_from_world);
  void set_landmarks(std::vector<Eigen::Vector3d> positions);
  void add_photo(std::int64_t id, LiveImage image) { photos_.add(id, std::move(image)); }
  void set_progress(LiveProgress progress);
  void set_report(const std::filesystem::path& report, std::vector<std::string> beside);
  void finish(std::chrono::milliseconds at_most);
  std::string url() const { return server_->url(); }

 private:
  using Json = nlohmann::ordered_json;

  /// What a reply reports about the map. Read before the points, so that `is_done` implies all of them.
  struct State {
    bool is_done = false;
    std::uint64_t page_version = 0, state_version = 0;
  };

  std::optional<HttpReply> answer(const HttpRequest& request);
  HttpReply page() const;
  std::optional<HttpReply> changes(const HttpRequest& request);
  void add_client(std::uint64_t number);
  HttpReply points(std::int64_t id, LiveVersion version);
  HttpReply landmarks(std::uint64_t version);
  HttpReply photo(std::int64_t id) const;
  HttpReply report_file(const HttpRequest& request) const;
  Json changes_json(const LiveChanges& changes, const State& state, std::uint64_t state_version,
                    std::int64_t total_points) const;
  Json matrix_json(const KeyframePose& pose) const;
  Json center_json(const Eigen::Vector3d& center) const;

  const LiveSource source_;
  mutable std::mutex mutex_;  ///< guards page_ to last_answer_; blocks_ is used by the server's thread only
  LivePage page_;
  std::vector<TrajectoryPose> trajectory_;
  std::optional<RigidTransform> camera_;  ///< cam_from_world
  bool is_done_ = false;
  std::uint64_t page_version_ = first_page_version();  ///< pages of other versions reload
  std::uint64_t state_version_ = 1;                    ///< incremented by changes of page, trajectory, camera and end
  std::uint64_t trajectory_version_ = 1;               ///< `state_version_` at its last change
  LiveProgress progress_;
  LandmarkBlock landmarks_;
  std::uint64_t landmarks_version_ = 0;                   ///< `state_version_` at their last change; 0 = none
  std::map<std::int64_t, std::uint64_t> photo_versions_;  ///< `state_version_` at the last photo of each keyframe
  std::int64_t newest_photo_ = 0;
  std::string report_;                     ///< name of its file; "" = none
  std::vector<std::string> served_names_;  ///< the report and what is beside it
  std::shared_ptr<const ServedFolder> report_folder_;
  /// Page that polls for changes.
  struct Client {
    std::chrono::steady_clock::time_point last_request;
    bool received_end = false;  ///< of the map
  };
  std::map<std::uint64_t, Client> clients_;  ///< recent ones, by the number that each chooses for itself
  std::optional<std::chrono::steady_clock::time_point> last_answer_;
  /// By keyframe and version of its points; the newest ones requested.
  std::map<std::pair<std::int64_t, LiveVersion>, std::shared_ptr<const std::string>> blocks_;
  LivePhotos photos_;                   ///< its thread uses the members above
  std::unique_ptr<HttpServer> server_;  ///< last member: its thread uses the others
};

LiveServer::LiveServer(const HttpOptions& options, LiveSource source) {
  if (!has_report_page()) {
    throw Error("LiveServer: this build of pmsp_web has no page; build it with PMSP_VIEWER=ON");
  }
  impl_ = std::make_unique<Impl>(options, std::move(source));
}
LiveServer::LiveServer(const HttpOptions& options, const LiveDensifier& live)
    : LiveServer(options, {[&live](LiveVersion since) { return live.changes_since(since); },
                           [&live] { return live.snapshot(); }}) {}
LiveServer::~LiveServer() = default;

std::string LiveServer::url() const { return impl_->url(); }
void LiveServer::set_page(LivePage page, std::vector<TrajectoryPose> trajectory) {
  impl_->set_page(std::move(page), std::move(trajectory));
}
void LiveServer::set_camera(const RigidTransform& cam_from_world) { impl_->set_camera(cam_from_world); }
void LiveServer::set_landmarks(std::vector<Eigen::Vector3d> positions) { impl_->set_landmarks(std::move(positions)); }
void LiveServer::add_photo(std::int64_t keyframe_id, LiveImage image) {
  impl_->add_photo(keyframe_id, std::move(image));
}
void LiveServer::set_progress(LiveProgress progress) { impl_->set_progress(std::move(progress)); }
void LiveServer::set_report(const std::filesystem::path& report, std::vector<std::string> beside) {
  impl_->set_report(report, std::move(beside));
}
void LiveServer::finish(std::chrono::milliseconds at_most) { impl_->finish(at_most); }

void LiveServer::Impl::set_page(LivePage page, std::vector<TrajectoryPose> trajectory) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const Similarity &now = page.file_from_map, &before = page_.file_from_map;
  const bool is_same = page.title == page_.title && page.unit == page_.unit && now.scale == before.scale &&
                       now.rotation == before.rotation && now.translation == before.translation;
  if (!is_same || (trajectory_.empty() && !trajectory.empty())) ++page_version_;
  page_ = std::move(page);
  trajectory_ = std::move(trajectory);
  trajectory_version_ = ++state_version_;
}

void LiveServer::Impl::set_camera(const RigidTransform& cam_from_world) {
  const std::lock_guard<std::mutex> lock(mutex_);
  camera_ = cam_from_world;
  ++state_version_;
}

void LiveServer::Impl::set_landmarks(std::vector<Eigen::Vector3d> positions) {
  LandmarkBlock block = block_of(positions);
  const std::lock_guard<std::mutex> lock(mutex_);
  landmarks_ = std::move(block);
  landmarks_version_ = ++state_version_;
}

void LiveServer::Impl::set_progress(LiveProgress progress) {
  const std::lock_guard<std::mutex> lock(mutex_);
  progress_ = std::move(progress);
  ++state_version_;
}

void LiveServer::Impl::set_report(const std::filesystem::path& report, std::vector<std::string> beside) {
  const std::filesystem::path whole = std::filesystem::absolute(report);
  auto folder = std::make_shared<const ServedFolder>(whole.parent_path());
  const std::lock_guard<std::mutex> lock(mutex_);
  report_ = whole.filename().string();
  served_names_ = std::move(beside);
  served_names_.push_back(report_);
  report_folder_ = std::move(folder);
  ++state_version_;
}

void LiveServer::Impl::finish(std::chrono::milliseconds at_most) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_done_ = true;
    ++state_version_;
  }
  const Clock::time_point begin = Clock::now();
  for (;; std::this_thread::sleep_for(std::chrono::milliseconds(20))) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const Clock::time_point now = Clock::now();
    if (now - begin > at_most) return;
    const bool have_end = std::all_of(clients_.begin(), clients_.end(), [now](const auto& it) {
      return it.second.received_end || now - it.second.last_request > kClientTimeout;
    });
    const bool is_unused = !last_answer_ || now - *last_answer_ > kClientTimeout;
    if (have_end && (is_unused || now - std::max(*last_answer_, begin) > kIdleTime)) return;
  }
}

std::optional<HttpReply> LiveServer::Impl::answer(const HttpRequest& request) {
  const std::vector<std::string>& path = request.path;
  std::optional<HttpReply> reply;
  if (path == std::vector<std::string>{""}) {
    reply = page();
  } else if (path == std::vector<std::string>{"live", "changes"}) {
    reply = changes(request);
  } else if (path.size() == 4 && path[0] == "live" && path[1] == "points") {
    const auto id = number_from<std::int64_t>(path[2]);
    const auto version = number_from<LiveVersion>(path[3]);
    reply = id && version ? points(*id, *version) : not_found();
  } else if (path.size() == 3 && path[0] == "live" && path[1] == "landmarks") {
    const auto version = number_from<std::uint64_t>(path[2]);
    reply = version ? landmarks(*version) : not_found();
  } else if (path.size() == 3 && path[0] == "live" && path[1] == "photos") {
    const auto id = number_from<std::int64_t>(path[2]);
    reply = id ? photo(*id) : not_found();
  } else if (path.size() > 1 && path[0] == "report") {
    reply = report_file(request);
  } else {
    reply = not_found();
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  if (reply) last_answer_ = Clock::now();
  return reply;
}

HttpReply LiveServer::Impl::page() const {
  const std::shared_ptr<const LiveSnapshot> snapshot = source_.snapshot();
  const std::lock_guard<std::mutex> lock(mutex_);
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  const auto add_up = [&](const RigidTransform& cam_from_world) {
    up -= page_.file_from_map.rotation * cam_from_world.rotation.row(1).transpose();
  };
  for (const TrajectoryPose& pose : trajectory_) add_up(pose.cam_from_world);
  if (trajectory_.empty()) {
    for (const LiveCloud& cloud : snapshot->clouds) add_up(cloud.pose.cam_from_world);
  }
  Json json{{"format", "pmsp-report"},
            {"version", 1},
            {"title", page_.title},
            {"generator", "libpmsp " PMSP_VERSION_STRING},
            {"unit", page_.unit.empty() ? "map units" : page_.unit},
            {"up", vector_json(up.norm() > 1e-9 ? Eigen::Vector3d(up.normalized()) : Eigen::Vector3d(0.0, -1.0, 0.0))},
            {"origin", vector_json(page_.file_from_map.translation)},
            {"points_in", 0},
            {"points", 0}};
  for (const char* none : {"nodes", "keyframes", "confidences", "facts", "times", "problems"})
    json[none] = Json::array();
  json["pixel"] = 0.01;
  json["notes"] = {"The page shows points while they are computed: at most " + std::to_string(kMaxLivePoints) +
                   " of each keyframe. A report (--report) contains more."};
  json["live_page_version"] = page_version_;
  const std::string data = "<script type=\"application/json\" id=\"pmsp-data\">" + script_json(json) + "</script>\n";
  const auto [before, after] = page_around_data(true);
  return reply_of(before + data + after, "text/html; charset=utf-8");
}

std::optional<HttpReply> LiveServer::Impl::changes(const HttpRequest& request) {
  const auto number = [&](const char* name) { return number_in_query(request.query, name).value_or(0); };
  const std::uint64_t page_version = number("page_version"), state_version = number("state_version");
  const std::uint64_t client = number("client");
  const LiveVersion since = number("since");
  State state;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    state = {is_done_, page_version_, state_version_};
    add_client(client);
  }
  const bool may_wait = !request.must_answer && !state.is_done && state_version == state.state_version &&
                        page_version == state.page_version;
  if (may_wait && source_.snapshot()->version == since) return std::nullopt;
  const LiveChanges changes = source_.changes_since(since);
  if (may_wait && changes.empty()) return std::nullopt;
  const std::int64_t total_points = source_.total_points ? source_.total_points() : points_of(*source_.snapshot());
  const std::lock_guard<std::mutex> lock(mutex_);
  clients_[client].received_end = state.is_done;
  const Json json = changes_json(changes, state, state_version, total_points);
  return reply_of(json.dump(-1, ' ', false, Json::error_handler_t::replace), "application/json");
}

/// Records a request of a page.
void LiveServer::Impl::add_client(std::uint64_t number) {
  clients_[number].last_request = Clock::now();
  while (clients_.size() > kMaxClients) {
    clients_.erase(std::min_element(clients_.begin(), clients_.end(), [](const auto& a, const auto& b) {
      return a.second.last_request < b.second.last_request;
    }));
  }
}

nlohmann::ordered_json LiveServer::Impl::changes_json(const LiveChanges& changes, const State& state,
                                                      std::uint64_t state_version, std::int64_t total_points) const {
  Json json{{"page_version", state.page_version},
            {"version", changes.to},
            {"state_version", state.state_version},
            {"reset", changes.reset},
            {"done", state.is_done}};
  json["clouds"] = Json::array();
  for (const auto* clouds : {&changes.added, &changes.replaced, &changes.moved}) {
    for (const LiveCloud& cloud : *clouds) {
      json["clouds"].push_back({{"id", std::to_string(cloud.keyframe_id)},
                                {"points_version", cloud.cloud_since},
                                {"matrix", matrix_json(cloud.pose)}});
    }
  }
  json["removed"] = Json::array();
  for (const std::int64_t id : changes.removed) json["removed"].push_back(std::to_string(id));
  if (camera_) json["camera"] = matrix_json({*camera_, 1.0});
  json["total_points"] = total_points;
  if (!progress_.stage.empty()) json["stage"] = progress_.stage;
  if (progress_.share >= 0.0) json["share"] = progress_.share;
  if (progress_.seconds_left >= 0.0) json["seconds_left"] = progress_.seconds_left;
  if (!report_.empty()) json["report"] = "report/" + relative_address(report_).substr(2);
  if (landmarks_version_ > (changes.reset ? 0 : state_version)) {
    Json matrix = matrix_json({RigidTransform{Eigen::Matrix3d::Identity(), -landmarks_.center}, 1.0});
    json["landmarks"] = {{"version", landmarks_version_}, {"matrix", std::move(matrix)}};
  }
  json["photos"] = Json::array();
  for (const auto& [id, version] : photo_versions_) {
    if (version > state_version) json["photos"].push_back(std::to_string(id));
  }
  if (!photo_versions_.empty()) json["newest_photo"] = std::to_string(newest_photo_);
  if (!changes.reset && state_version >= trajectory_version_) return json;
  json["trajectory"] = Json::array();
  for (const TrajectoryPose& pose : trajectory_) {
    json["trajectory"].push_back(
        {{"id", std::to_string(pose.id)}, {"matrix", matrix_json({pose.cam_from_world, 1.0})}});
  }
  return json;
}

/// Returns the 3x4 matrix, row-major, from keyframe to page, without the translation of file_from_map, which is
/// `origin` of the page.
nlohmann::ordered_json LiveServer::Impl::matrix_json(const KeyframePose& pose) const {
  const Similarity& file_from_map = page_.file_from_map;
  const RigidTransform world_from_cam = pose.cam_from_world.inverse();
  const Eigen::Matrix3d linear = file_from_map.scale * pose.scale * (file_from_map.rotation * world_from_cam.rotation);
  const Json center = center_json(world_from_cam.translation);
  Json json = Json::array();
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) json.push_back(linear(r, c));
    json.push_back(center[static_cast<std::size_t>(r)]);
  }
  return json;
}

nlohmann::ordered_json LiveServer::Impl::center_json(const Eigen::Vector3d& center) const {
  return vector_json(page_.file_from_map.scale * (page_.file_from_map.rotation * center));
}

HttpReply LiveServer::Impl::points(std::int64_t id, LiveVersion version) {
  const std::shared_ptr<const LiveSnapshot> snapshot = source_.snapshot();
  const auto found =
      std::lower_bound(snapshot->clouds.begin(), snapshot->clouds.end(), id,
                       [](const LiveCloud& cloud, std::int64_t wanted) { return cloud.keyframe_id < wanted; });
  if (found == snapshot->clouds.end() || found->keyframe_id != id || found->cloud_since != version) {
    HttpReply outdated;  // replaced or removed since
    outdated.status = 204;
    return outdated;
  }
  std::shared_ptr<const std::string>& block = blocks_[{id, version}];
  if (!block) {
    block = std::make_shared<const std::string>(live_block(thinned(*found->cloud, kMaxLivePoints)));
  }
  HttpReply reply;
  reply.type = "application/octet-stream";
  reply.body = block;
  while (blocks_.size() > kMaxBlocks) {  // clients request the same blocks at about the same time
    auto oldest = blocks_.begin();
    for (auto it = blocks_.begin(); it != blocks_.end(); ++it) {
      if (it->first.second < oldest->first.second) oldest = it;
    }
    blocks_.erase(oldest);
  }
  return reply;
}

HttpReply LiveServer::Impl::landmarks(std::uint64_t version) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (version == 0 || version != landmarks_version_) return not_found();
  return reply_of(landmarks_.bytes, "application/octet-stream");
}

HttpReply LiveServer::Impl::photo(std::int64_t id) const {
  HttpReply reply;
  reply.type = "image/jpeg";
  reply.body = photos_.find(id);
  if (!reply.body) return not_found();
  return reply;
}

/// Opens only names that belong to the report.
HttpReply LiveServer::Impl::report_file(const HttpRequest& request) const {
  const std::vector<std::string> path(request.path.begin() + 1, request.path.end());
  std::shared_ptr<const ServedFolder> folder;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (std::find(served_names_.begin(), served_names_.end(), path.front()) == served_names_.end()) return not_found();
    folder = report_folder_;
  }
  return file_reply(folder->open(path), path.back(), request.range);
}

}  // namespace pmsp
