// SPDX-License-Identifier: BSD-2-Clause
#include "live_view.h"

#include <algorithm>
#include <iostream>
#include <memory>
#include <thread>
#include <utility>

#include "exit_code.h"
#include "mission_input.h"
#include "page_address.h"
#include "process.h"
#include "web/http_server.h"
#include "web/live_block.h"

namespace pmsp::tool {
namespace {

constexpr std::size_t kMaxShownPoints = 5'000'000;
constexpr std::size_t kMinPointsEach = 1'000;
constexpr int kPhotoWidth = 2048;     ///< minimum, if larger images are subsampled
constexpr double kMaxCopying = 0.02;  ///< share of the time

HttpOptions http_options(const LiveArguments& arguments) {
  HttpOptions options;
  options.address = arguments.address;
  options.port = *arguments.port;
  options.token = token_from_file(arguments.token_file);
  options.nice = 10;
  return options;
}

bool are_same(const CloudPoint& a, const CloudPoint& b) {
  return a.position == b.position && a.normal == b.normal && a.color.r == b.color.r && a.color.g == b.color.g &&
         a.color.b == b.color.b && a.views == b.views && a.confidence == b.confidence;
}

/// Returns a copy, of every second pixel or fewer if the image is large.
LiveImage copy_of(ImageView<const Rgb> image) {
  const int step = std::max(1, image.width / kPhotoWidth);
  LiveImage copy;
  copy.width = image.width / step;
  copy.height = std::max(1, image.height / step);
  auto pixels =
      std::make_shared<std::vector<Rgb>>(static_cast<std::size_t>(copy.width) * static_cast<std::size_t>(copy.height));
  Rgb* to = pixels->data();
  for (int y = 0; y < copy.height; ++y) {
    for (int x = 0; x < copy.width; ++x) *to++ = image(step * x, step * y);
  }
  copy.data = &pixels->data()->r;
  copy.owner = std::move(pixels);
  return copy;
}

}  // namespace

LiveView::LiveView(const LiveArguments& arguments)
    : arguments_(arguments),
      server_(http_options(arguments), {[this](LiveVersion since) { return map_.changes_since(since); },
                                        [this] { return map_.snapshot(); }, [this] { return total_points_.load(); }}) {
  std::cerr << "live view: " << server_.url() << std::endl;
  print_access(arguments.address, server_.url());
}

void LiveView::begin(const SlamMap& map, LivePage page) {
  added_.clear();
  points_each_ =
      std::clamp(kMaxShownPoints / std::max<std::size_t>(map.keyframes.size(), 1), kMinPointsEach, web::kMaxLivePoints);
  std::vector<TrajectoryPose> trajectory;
  for (const MapKeyframe* keyframe : in_time_order(map)) trajectory.push_back({keyframe->id, keyframe->cam_from_world});
  server_.set_page(std::move(page), std::move(trajectory));
  std::vector<Eigen::Vector3d> landmarks;
  for (const MapLandmark& landmark : map.landmarks) landmarks.push_back(landmark.position_world);
  server_.set_landmarks(std::move(landmarks));
}

void LiveView::add_photo(const Keyframe& keyframe) {
  const Clock::time_point begin = Clock::now();
  if (copying_ > kMaxCopying * (begin - start_)) return;
  server_.add_photo(keyframe.id, copy_of(keyframe.image));
  copying_ += Clock::now() - begin;
}

void LiveView::add(const KeyframeCloud& cloud) {
  const std::int64_t id = cloud.keyframe_id;
  added_.insert(id);
  std::int64_t& count = points_[id];
  total_points_ += static_cast<std::int64_t>(cloud.points.size()) - count;
  count = static_cast<std::int64_t>(cloud.points.size());
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
  for (const std::int64_t id : removed) {
    total_points_ -= points_[id];
    points_.erase(id);
  }
}

void LiveView::set_report(const std::filesystem::path& report, const std::vector<std::string>& beside) {
  if (arguments_.keep) server_.set_report(report, beside);
}

void LiveView::finish(bool may_wait) {
  server_.set_progress({});
  server_.finish(std::chrono::seconds(10));
  if (!may_wait || !arguments_.keep) return;
  const InterruptGuard guard(nullptr);
  std::cerr << "serving " << server_.url() << "; Ctrl-C ends it" << std::endl;
  try {
    for (;; std::this_thread::sleep_for(std::chrono::milliseconds(100))) guard.check();
  } catch (const Interrupted&) {  // that is how it ends
  }
}

}  // namespace pmsp::tool
