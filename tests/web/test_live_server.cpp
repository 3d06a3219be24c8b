// SPDX-License-Identifier: BSD-2-Clause
#include <atomic>
#include <fstream>
#include <thread>

#include <catch2/catch.hpp>

#include <nlohmann/json.hpp>

#include "export/little_endian.h"
#include "live/live_map.h"
#include "live_view.h"
#include "pmsp/web.h"
#include "report_page.h"
#include "support/temp_dir.h"
#include "web/client.h"
#include "web/live_block.h"
#include "web/page.h"

using namespace pmsp;
using namespace pmsp::tool;
using namespace pmsp::web;
using namespace pmsp_test;
using Catch::Contains;
using nlohmann::json;

namespace {

KeyframeCloud cloud_of(std::int64_t id, int points, float depth = 2.0F) {
  KeyframeCloud cloud;
  cloud.keyframe_id = id;
  for (int i = 0; i < points; ++i) {
    CloudPoint point;
    point.position = {0.01F * static_cast<float>(i), 0.0F, depth};
    point.normal = {0.0F, 0.0F, -1.0F};
    point.color = {10, 20, 30};
    point.views = 3;
    point.confidence = 0.5F;
    cloud.points.push_back(point);
  }
  return cloud;
}

KeyframePose pose_at(double x) {
  KeyframePose pose;
  pose.cam_from_world.translation = {-x, 0.0, 0.0};
  return pose;
}

HttpOptions short_polls() {
  HttpOptions options;
  options.long_poll_timeout = std::chrono::milliseconds(200);
  return options;
}

/// The clouds of a page.
struct Looked {
  explicit Looked(const std::string& url)
      : port(static_cast<std::uint16_t>(std::stoi(url.substr(url.rfind(':') + 1)))), root(path_of(url)) {
    const std::string key = "\"live_page_version\":";
    const std::string html = get(port, root).body;
    page_version = std::stoull(html.substr(html.find(key) + key.size()));
  }

  json ask() {
    const Reply reply = get(port, root + "live/changes?page_version=" + std::to_string(page_version) + "&since=" +
                                      std::to_string(since) + "&state_version=" + std::to_string(state_version));
    REQUIRE(reply.status == 200);
    const json changes = json::parse(reply.body);
    since = changes["version"];
    state_version = changes["state_version"];
    return changes;
  }
  Reply points(std::int64_t id, std::uint64_t version) const {
    return get(port, root + "live/points/" + std::to_string(id) + "/" + std::to_string(version));
  }

  std::uint16_t port;
  std::string root;
  std::uint64_t since = 0, state_version = 0, page_version = 0;
};

/// A map served by LiveServer.
struct ServedMap {
  explicit ServedMap(const HttpOptions& options = short_polls())
      : server(options, {[this](LiveVersion since) {
                           ++queries;
                           LiveChanges changes = map.changes_since(since);
                           if (LiveServer* const ended = ends.exchange(nullptr)) {
                             publish(9);
                             ended->finish(std::chrono::milliseconds(0));
                           }
                           return changes;
                         },
                         [this] { return map.snapshot(); }}) {}

  void publish(std::int64_t id) {
    map.publish({id, pose_at(1.0), 0}, std::make_shared<const KeyframeCloud>(cloud_of(id, 3)), false);
  }

  LiveMap map;
  std::atomic<int> queries{0};             ///< of changes of the map
  std::atomic<LiveServer*> ends{nullptr};  ///< ends after the next query, with one more keyframe
  LiveServer server;
  Looked page{server.url()};
};

}  // namespace

TEST_CASE("a page receives added and replaced and moved and removed clouds") {
  if (!has_report_page()) return;
  ServedMap it;
  it.page.ask();
  it.map.publish({7, pose_at(1.0), 0}, std::make_shared<const KeyframeCloud>(cloud_of(7, 3)), true);
  json changes = it.page.ask();
  REQUIRE(changes["clouds"].size() == 1);
  CHECK(changes["clouds"][0]["id"] == "7");
  CHECK(changes["clouds"][0]["matrix"] == json({1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0}));
  const std::uint64_t first = changes["clouds"][0]["points_version"];
  const Reply block = it.page.points(7, first);
  REQUIRE(block.body.size() == 32 + 3 * 13);
  CHECK(get_little<double>(block.body.data() + 16) == 2.0);                // z of the corner
  CHECK(get_little<double>(block.body.data() + 24) == Approx(0.02));       // side
  CHECK(get_little<std::uint16_t>(block.body.data() + 32 + 12) == 65535);  // x of the last point

  it.map.move({{7, pose_at(4.0), 0}});
  changes = it.page.ask();
  REQUIRE(changes["clouds"].size() == 1);
  CHECK(changes["clouds"][0]["points_version"] == first);
  CHECK(changes["clouds"][0]["matrix"][3] == 4.0);

  it.map.publish({7, pose_at(4.0), 0}, std::make_shared<const KeyframeCloud>(cloud_of(7, 5)), false);
  changes = it.page.ask();
  const std::uint64_t second = changes["clouds"][0]["points_version"];
  CHECK(second > first);
  CHECK(it.page.points(7, second).body.size() == 32 + 5 * 13);
  CHECK(it.page.points(7, first).status == 204);
  CHECK(it.page.points(8, first).status == 204);

  it.map.remove({7});
  changes = it.page.ask();
  CHECK(changes["clouds"].empty());
  CHECK(changes["removed"] == json({"7"}));
  CHECK(it.page.ask()["removed"].empty());  // after a while, though nothing has happened
}

TEST_CASE("a page receives the camera pose and the end of the mission") {
  if (!has_report_page()) return;
  ServedMap it;
  it.page.ask();
  RigidTransform cam_from_world;  // turned by a quarter around z, at (1, 2, 3)
  cam_from_world.rotation << 0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0;
  cam_from_world.translation = -(cam_from_world.rotation * Eigen::Vector3d(1.0, 2.0, 3.0));
  it.server.set_camera(cam_from_world);
  const std::vector<double> matrix = it.page.ask()["camera"];
  const std::vector<double> expected{0.0, -1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 1.0, 3.0};
  REQUIRE(matrix.size() == expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) CHECK(matrix[i] == Approx(expected[i]).margin(1e-12));
  CHECK(it.page.ask()["done"] == false);
  std::thread ending([&] { it.server.finish(std::chrono::minutes(1)); });  // waits for pages without the final state
  bool is_done = false;
  for (int i = 0; i < 100 && !is_done; ++i) is_done = it.page.ask()["done"];
  CHECK(is_done);
  ending.join();
}

TEST_CASE("the end of a map never arrives before its last points") {
  if (!has_report_page()) return;
  ServedMap it;
  it.page.ask();
  it.publish(1);
  it.ends = &it.server;
  json changes = it.page.ask();
  CHECK(changes["clouds"].size() == 1);
  CHECK(changes["done"] == false);
  changes = it.page.ask();
  REQUIRE(changes["clouds"].size() == 1);
  CHECK(changes["clouds"][0]["id"] == "9");
  CHECK(changes["done"] == true);
}

TEST_CASE("the end of a map reaches pages that have waited since its begin") {
  if (!has_report_page()) return;
  HttpOptions options;
  options.long_poll_timeout = std::chrono::minutes(1);
  ServedMap it(options);
  it.page.state_version = 1;  // as the server's
  std::atomic<bool> is_done{false};
  std::thread waiting([&] { is_done = it.page.ask()["done"]; });
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  it.server.finish(std::chrono::minutes(1));
  CHECK(is_done);
  waiting.join();
}

TEST_CASE("a page that waits does not query an unchanged map") {
  if (!has_report_page()) return;
  ServedMap it;
  it.publish(1);
  it.page.ask();
  const int queries = it.queries;
  it.page.ask();  // after some polls of the handler
  CHECK(it.queries == queries + 1);
}

TEST_CASE("a page receives the trajectory again after a reset, and an empty one") {
  if (!has_report_page()) return;
  ServedMap it;
  it.server.set_page({}, {{3, {}}, {1, {}}});
  const json trajectory = it.page.ask()["trajectory"];
  REQUIRE(trajectory.size() == 2);
  CHECK(trajectory[0]["id"] == "3");
  it.publish(1);
  CHECK(it.page.ask().count("trajectory") == 0);
  it.map.reset();
  const json changes = it.page.ask();
  CHECK(changes["reset"] == true);
  CHECK(changes["trajectory"] == trajectory);
  it.server.set_page({}, {});
  CHECK(it.page.ask()["trajectory"] == json::array());
}

TEST_CASE("pages reload if their metadata or upward direction changes") {
  if (!has_report_page()) return;
  ServedMap it;
  const std::uint64_t first = it.page.page_version;
  it.server.set_page({}, {});
  CHECK(it.page.ask()["page_version"] == first);
  it.server.set_page({}, {{1, {}}});  // the upward direction is known from here on
  CHECK(it.page.ask()["page_version"] == first + 1);
  it.server.set_page({}, {{1, {}}, {2, {}}});
  CHECK(it.page.ask()["page_version"] == first + 1);
  it.server.set_page({"another title", "", {}}, {{1, {}}});
  CHECK(it.page.ask()["page_version"] == first + 2);
}

TEST_CASE("pages of an earlier server at the same address reload") {
  if (!has_report_page()) return;
  HttpOptions options = short_polls();
  options.token = "0123456789abcdef";
  std::uint64_t before = 0;
  {
    const ServedMap first(options);
    before = first.page.page_version;
    options.port = first.page.port;
  }
  ServedMap second(options);
  CHECK(second.page.page_version != before);
  second.page.since = 77;  // as a page of the first one
  second.page.page_version = before;
  CHECK(second.page.ask()["page_version"] != before);
}

TEST_CASE("a page receives landmarks before any points, and their changes") {
  if (!has_report_page()) return;
  ServedMap it;
  LivePage page;
  page.file_from_map.scale = 2.0;
  it.server.set_page(page, {});
  CHECK(it.page.ask().count("landmarks") == 0);
  it.server.set_landmarks({{1e6, 1.0, 2.0}, {1e6 + 1.0, 3.0, 4.0}});
  json changes = it.page.ask();
  const std::vector<double> matrix = changes["landmarks"]["matrix"];
  CHECK(matrix == std::vector<double>{2.0, 0.0, 0.0, 2e6 + 1.0, 0.0, 2.0, 0.0, 4.0, 0.0, 0.0, 2.0, 6.0});
  const std::uint64_t first = changes["landmarks"]["version"];
  const auto ask = [&](std::uint64_t version) {
    return get(it.page.port, it.page.root + "live/landmarks/" + std::to_string(version));
  };
  const Reply block = ask(first);
  REQUIRE(block.body.size() == 2 * 12);
  CHECK(get_little<float>(block.body.data()) == -0.5F);
  CHECK(get_little<float>(block.body.data() + 16) == 1.0F);
  CHECK(it.page.ask().count("landmarks") == 0);
  it.server.set_landmarks(std::vector<Eigen::Vector3d>(500'000, Eigen::Vector3d::Zero()));
  const std::uint64_t second = it.page.ask()["landmarks"]["version"];
  CHECK(ask(second).body.size() == 20'000 * 12);
  CHECK(ask(first).status == 404);
  it.map.reset();
  CHECK(it.page.ask()["landmarks"]["version"] == second);
}

TEST_CASE("a page receives the photos of keyframes, the newest one by name") {
  if (!has_report_page()) return;
  ServedMap it;
  CHECK(it.page.ask()["photos"].empty());
  const auto pixels = std::make_shared<std::vector<std::uint8_t>>(2048 * 1024 * 3, 200);
  const auto receive = [&](const std::string& id) {
    json changes = it.page.ask();
    for (int i = 0; i < 300 && changes["photos"] != json({id}); ++i) changes = it.page.ask();
    CHECK(changes["photos"] == json({id}));
    CHECK(changes["newest_photo"] == id);
  };
  it.server.add_photo(7, {pixels, pixels->data(), 2048, 1024});
  receive("7");
  it.server.add_photo(3, {pixels, pixels->data(), 2048, 1024});
  receive("3");
  const Reply photo = get(it.page.port, it.page.root + "live/photos/7");
  CHECK_THAT(photo.head, Contains("Content-Type: image/jpeg"));
  CHECK(photo.body.substr(0, 2) == "\xff\xd8");
  CHECK(get(it.page.port, it.page.root + "live/photos/8").status == 404);
  it.map.reset();
  CHECK(it.page.ask()["photos"] == json::array());  // the server's are still those
}

TEST_CASE("a page receives progress and the number of all points") {
  if (!has_report_page()) return;
  ServedMap it;
  json changes = it.page.ask();
  CHECK(changes.count("share") == 0);
  CHECK(changes["total_points"] == 0);
  it.publish(1);
  it.server.set_progress({"densify", 0.25, 90.0});
  changes = it.page.ask();
  CHECK(changes["stage"] == "densify");
  CHECK(changes["share"] == 0.25);
  CHECK(changes["seconds_left"] == 90.0);
  CHECK(changes["total_points"] == 3);
  it.server.set_progress({"writing \xff.ply"});  // paths need not be UTF-8
  changes = it.page.ask();
  CHECK(changes["stage"] == "writing \xef\xbf\xbd.ply");
  CHECK(changes.count("share") + changes.count("seconds_left") == 0);
}

TEST_CASE("of the directory of a report only what belongs to it is served") {
  if (!has_report_page()) return;
  const TempDir dir;
  const auto put = [&](const std::string& name, const std::string& text) {
    std::filesystem::create_directories((dir / name).parent_path());
    std::ofstream(dir / name) << text;
  };
  put("out/my report.html", "page");
  put("out/photos/7.jpg", "photo");
  put("out/photos/.key", "secret");
  put("out/private.txt", "secret");
  put("outside.txt", "secret");
  std::filesystem::create_symlink(dir / "outside.txt", dir / "out/photos/link");
  ServedMap it;
  CHECK(it.page.ask().count("report") == 0);
  const auto ask = [&](const std::string& target, const std::string& headers = "") {
    return get(it.page.port, it.page.root + target, headers);
  };
  CHECK(ask("report/my%20report.html").status == 404);
  it.server.set_report(dir / "out/my report.html", {"photos"});
  const std::string address = it.page.ask()["report"];
  CHECK(address == "report/my%20report.html");
  CHECK(ask(address).body == "page");
  CHECK_THAT(ask(address).head, Contains("Content-Type: text/html"));
  CHECK(ask("report/photos/7.jpg", "Range: bytes=1-2\r\n").body == "ho");
  for (const char* target :
       {"report", "report/", "report/private.txt", "report/photos", "report/photos/", "report/photos/.key",
        "report/photos/link", "report/photos/../private.txt", "report/photos/%2e%2e/private.txt",
        "report/..%2foutside.txt", "report/../outside.txt", "private.txt", "my%20report.html"}) {
    INFO(target);
    CHECK(ask(target).status == 404);
  }
  CHECK(get(it.page.port, "/report/my%20report.html").status == 404);
  CHECK_THROWS_AS(it.server.set_report(dir / "none" / "r.html"), IoError);
}

TEST_CASE("a live page that is not in the build is refused") {
  if (has_report_page()) return;
  CHECK_THROWS_WITH(LiveServer({}, LiveSource{}), Contains("PMSP_VIEWER=ON"));
}

TEST_CASE("unknown paths of a live page give 404") {
  if (!has_report_page()) return;
  ServedMap it;
  for (const char* target : {"live", "live/", "live/points/7", "live/points/x/1", "live/points/7/-1",
                             "live/points/7/1/2", "live/points/99999999999999999999/1", "live/other", "index.html",
                             "live%2fchanges", "live/landmarks", "live/landmarks/0", "live/landmarks/x", "live/photos",
                             "live/photos/7", "live/photos/7/1", "live/photos/..%2f7", "report/mission.html"}) {
    INFO(target);
    CHECK(get(it.page.port, it.page.root + target).status == 404);
  }
  CHECK(get(it.page.port, it.page.root + "live/changes?since=x&state_version=").status == 200);
  CHECK(get(it.page.port, "/live/changes").status == 404);
  const Reply page = get(it.page.port, it.page.root);
  CHECK_THAT(page.body, Contains("default-src 'none'; connect-src 'self';") && Contains("img-src 'self' data: blob:") &&
                            Contains("\"live_page_version\":"));
}

TEST_CASE("a second run moves clouds that it keeps and drops the others") {
  if (!has_report_page()) return;
  LiveArguments arguments;
  arguments.port = 0;
  LiveView view(arguments);
  SlamMap map;
  view.begin(map, {});
  KeyframeCloud a = cloud_of(1, 100'000), b = cloud_of(2, 10);
  view.add(a);
  view.add(b);
  view.end();
  Looked page(view.url());
  json changes = page.ask();
  REQUIRE(changes["clouds"].size() == 2);
  const std::uint64_t version = changes["clouds"][0]["points_version"];
  CHECK(page.points(1, version).body.size() == 32 + 13 * kMaxLivePoints);
  CHECK(changes["total_points"] == 100'010);
  view.begin(map, {});
  a.cam_from_world.translation = {0.0, 0.0, 5.0};
  view.add(a);
  view.end();
  changes = page.ask();
  REQUIRE(changes["clouds"].size() == 1);
  CHECK(changes["clouds"][0]["id"] == "1");
  CHECK(changes["clouds"][0]["points_version"] == version);
  CHECK(changes["clouds"][0]["matrix"][11] == -5.0);
  CHECK(changes["removed"] == json({"2"}));
  CHECK(changes["total_points"] == 100'000);
}

TEST_CASE("a thinned cloud is an even share") {
  const KeyframeCloud few = thinned(cloud_of(3, 1000), 10);
  REQUIRE(few.points.size() == 10);
  for (int i = 0; i < 10; ++i) CHECK(few.points[static_cast<std::size_t>(i)].position.x() == Approx(i));
  CHECK(thinned(cloud_of(3, 5), 10).points.size() == 5);
  CHECK(thinned(cloud_of(3, 0), 10).points.empty());
  CHECK(live_block(cloud_of(3, 0)).size() == 32);
}
