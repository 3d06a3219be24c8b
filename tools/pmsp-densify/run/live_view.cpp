// SPDX-License-Identifier: BSD-2-Clause
#include "live_view.h"

#include <algorithm>
#include <iostream>
#include <utility>

#include "mission_input.h"
#include "web/http_server.h"
#include "web/live_block.h"

namespace pmsp::tool {
namespace {

constexpr std::size_t kMaxShownPoints = 5'000'000;
constexpr std::size_t kMinPointsEach = 1'000;

HttpOptions http_options(const LiveArguments& arguments) {
  HttpOptions options;
  options.address = arguments.address;
  options.port = *arguments.port;
  options.nice = 10;
  return options;
}

bool are_same(const CloudPoint& a, const CloudPoint& b) {
  return a.position == b.position && a.normal == b.normal && a.color.r == b.color.r && a.color.g == b.color.g &&
         a.color.b == b.color.b && a.views == b.views && a.confidence == b.confidence;
}

}  // namespace

LiveView::LiveView(const LiveArguments& arguments)
    : server_(http_options(arguments),
              {[this](LiveVersion since) { return map_.changes_since(since); }, [this] { return map_.snapshot(); }}) {
  if (!web::is_loopback(arguments.address)) {
    std::cerr << "pmsp-densify: warning: " << web::address_warning(arguments.address) << "\n";
  }
  std::cerr << "live view: " << server_.url() << std::endl;
}

void LiveView::begin(const SlamMap& map, LivePage page) {
  added_.clear();
  points_each_ =
      std::clamp(kMaxShownPoints / std::max<std::size_t>(map.keyframes.size(), 1), kMinPointsEach, web::kMaxLivePoints);
  std::vector<TrajectoryPose> trajectory;
  for (const MapKeyframe* keyframe : in_time_order(map)) trajectory.push_back({keyframe->id, keyframe->cam_from_world});
  server_.set_page(std::move(page), std::move(trajectory));
}

void LiveView::add(const KeyframeCloud& cloud) {
  const std::int64_t id = cloud.keyframe_id;
  added_.insert(id);
  auto points = std::make_shared<const KeyframeCloud>(web::thinned(cloud, points_each_));
  const std::shared_ptr<const LiveSnapshot> now = map_.snapshot();
  const auto found = std::lower_bound(now->clouds.begin(), now->clouds.end(), id,
                                      [](const LiveCloud& it, std::int64_t wanted) { return it.keyframe_id < wanted; });
  if (found != now->clouds.end() && found->keyframe_id == id &&
      std::equal(points->points.begin(), points->points.end(), found->cloud->points.begin(), found->cloud->points.end(),
                 are_same)) {
    map_.move({{id, cloud.pose(), 0}});
  } else {
    map_.publish({id, cloud.pose(), 0}, std::move(points), false);
  }
}

void LiveView::end() {
  const std::shared_ptr<const LiveSnapshot> snapshot = map_.snapshot();
  std::vector<std::int64_t> removed;
  for (const LiveCloud& cloud : snapshot->clouds) {
    if (added_.count(cloud.keyframe_id) == 0) removed.push_back(cloud.keyframe_id);
  }
  map_.remove(removed);
}

}  // namespace pmsp::tool
