// SPDX-License-Identifier: BSD-2-Clause
#include "web/live_photos.h"

#include <algorithm>
#include <exception>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "io/image_decode.h"
#include "machine.h"
#include "pmsp/error.h"

namespace pmsp::web {
namespace {

constexpr int kQuality = 80;

}  // namespace

std::string photo_jpeg(const LiveImage& image, int width) {
  if (image.data == nullptr || image.width <= 0 || image.height <= 0) {
    throw InvalidInput("photo: has no pixels; expected an image");
  }
  const bool is_gray = image.format == PixelFormat::kGray;
  const std::size_t row = static_cast<std::size_t>(image.width) * (is_gray ? 1 : 3);
  const cv::Mat pixels(image.height, image.width, is_gray ? CV_8UC1 : CV_8UC3, const_cast<std::uint8_t*>(image.data),
                       image.stride > 0 ? static_cast<std::size_t>(image.stride) : row);  // read-only
  cv::Mat small = pixels;
  if (image.width > width) {
    cv::resize(pixels, small, {width, std::max(1, image.height * width / image.width)}, 0, 0, cv::INTER_AREA);
  }
  cv::Mat picture = small;
  if (image.format == PixelFormat::kRgb) cv::cvtColor(small, picture, cv::COLOR_RGB2BGR);
  const std::vector<unsigned char> bytes =
      io::encoded(".jpg", picture, "a photo cannot be encoded as JPEG", {cv::IMWRITE_JPEG_QUALITY, kQuality});
  return {bytes.begin(), bytes.end()};
}

LivePhotos::LivePhotos(int nice, std::size_t max_bytes, std::function<void(std::int64_t)> encoded)
    : nice_(nice), max_bytes_(max_bytes), encoded_(std::move(encoded)), thread_([this] { work(); }) {}

LivePhotos::~LivePhotos() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ends_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

void LivePhotos::add(std::int64_t id, LiveImage image) {
  std::pair<std::int64_t, LiveImage> dropped;  // its owner may do anything: released without the lock
  const std::lock_guard<std::mutex> lock(mutex_);
  pending_.emplace_back(id, std::move(image));
  if (pending_.size() > kMaxPending) {
    dropped = std::move(pending_.front());
    pending_.pop_front();
  }
  changed_.notify_one();
}

std::shared_ptr<const std::string> LivePhotos::find(std::int64_t id) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto found = photos_.find(id);
  return found != photos_.end() ? found->second.jpeg : nullptr;
}

void LivePhotos::work() {
  run_at_low_priority(nice_);
  for (;;) {
    std::pair<std::int64_t, LiveImage> next;
    {
      std::unique_lock<std::mutex> lock(mutex_);
      changed_.wait(lock, [this] { return ends_ || !pending_.empty(); });
      if (ends_) return;
      next = std::move(pending_.front());
      pending_.pop_front();
    }
    try {
      keep(next.first, photo_jpeg(next.second, kMaxWidth));
    } catch (const std::exception&) {  // the map is shown without this photo
      continue;
    }
    encoded_(next.first);
  }
}

void LivePhotos::keep(std::int64_t id, std::string jpeg) {
  const auto forget = [this](std::int64_t which) {
    const auto found = photos_.find(which);
    if (found == photos_.end()) return;
    bytes_ -= found->second.jpeg->size();
    by_number_.erase(found->second.number);
    photos_.erase(found);
  };
  const std::lock_guard<std::mutex> lock(mutex_);
  forget(id);
  bytes_ += jpeg.size();
  photos_[id] = {std::make_shared<const std::string>(std::move(jpeg)), next_number_};
  by_number_[next_number_++] = id;
  while (bytes_ > max_bytes_ && by_number_.size() > 1) forget(by_number_.begin()->second);
}

}  // namespace pmsp::web
