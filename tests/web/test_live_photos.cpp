// SPDX-License-Identifier: BSD-2-Clause
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <vector>

#include <catch2/catch.hpp>
#include <opencv2/imgcodecs.hpp>

#include "pmsp/error.h"
#include "web/live_photos.h"

using namespace pmsp;
using namespace pmsp::web;

namespace {

/// Left half red, right half blue.
LiveImage image_of(int width, int height, PixelFormat format, std::ptrdiff_t padding = 0) {
  const int channels = format == PixelFormat::kGray ? 1 : 3;
  LiveImage image;
  image.width = width;
  image.height = height;
  image.format = format;
  image.stride = padding > 0 ? width * channels + padding : 0;
  const std::ptrdiff_t row = width * channels + padding;
  auto pixels = std::make_shared<std::vector<std::uint8_t>>(static_cast<std::size_t>(row * height), 0);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      std::uint8_t* const at = pixels->data() + y * row + x * channels;
      const bool is_left = 2 * x < width;
      if (format == PixelFormat::kGray) {
        at[0] = is_left ? 200 : 50;
      } else {
        at[is_left == (format == PixelFormat::kRgb) ? 0 : 2] = 255;
      }
    }
  }
  image.data = pixels->data();
  image.owner = pixels;
  return image;
}

cv::Mat decoded(const std::string& jpeg) {
  return cv::imdecode(std::vector<unsigned char>(jpeg.begin(), jpeg.end()), cv::IMREAD_COLOR);
}

/// Photos that have been encoded.
struct Arrivals {
  void add(std::int64_t id) {
    const std::lock_guard<std::mutex> lock(mutex);
    ids.push_back(id);
    changed.notify_all();
  }
  void wait_for(std::int64_t id) {
    std::unique_lock<std::mutex> lock(mutex);
    changed.wait(lock, [&] { return !ids.empty() && ids.back() == id; });
  }
  std::mutex mutex;
  std::condition_variable changed;
  std::vector<std::int64_t> ids;
};

}  // namespace

TEST_CASE("photos keep their colours in all pixel formats and are reduced to a width") {
  for (const PixelFormat format : {PixelFormat::kRgb, PixelFormat::kBgr, PixelFormat::kGray}) {
    for (const std::ptrdiff_t padding : {0, 5}) {
      const cv::Mat picture = decoded(photo_jpeg(image_of(400, 200, format, padding), 100));
      REQUIRE(picture.cols == 100);
      REQUIRE(picture.rows == 50);
      const cv::Vec3b left = picture.at<cv::Vec3b>(25, 10), right = picture.at<cv::Vec3b>(25, 90);
      CHECK(left[2] > (format == PixelFormat::kGray ? 190 : 240));
      CHECK(right[2] < 60);
      CHECK(right[0] > (format == PixelFormat::kGray ? 40 : 240));
    }
  }
  CHECK(decoded(photo_jpeg(image_of(64, 32, PixelFormat::kRgb), 100)).cols == 64);
  CHECK_THROWS_AS(photo_jpeg({}, 100), InvalidInput);
}

TEST_CASE("the oldest photos are removed beyond the limit of memory") {
  const std::size_t size = photo_jpeg(image_of(64, 32, PixelFormat::kRgb), LivePhotos::kMaxWidth).size();
  Arrivals arrivals;
  LivePhotos photos(0, 2 * size, [&](std::int64_t id) { arrivals.add(id); });
  for (const std::int64_t id : {1, 2, 1, 3}) {
    photos.add(id, image_of(64, 32, PixelFormat::kRgb));
    arrivals.wait_for(id);
  }
  CHECK(photos.find(1) != nullptr);
  CHECK(photos.find(2) == nullptr);
  CHECK(photos.find(3) != nullptr);
}

TEST_CASE("pending photos are bounded, images without pixels are skipped, and owners are released") {
  const auto owner = std::make_shared<int>(0);
  Arrivals arrivals;
  std::atomic<bool> goes_on{false};
  LivePhotos photos(0, 1U << 30U, [&](std::int64_t id) {
    arrivals.add(id);
    while (!goes_on) std::this_thread::yield();
  });
  photos.add(0, image_of(64, 32, PixelFormat::kRgb));
  arrivals.wait_for(0);
  photos.add(1, {});
  for (std::int64_t id = 2; id < 20; ++id) {
    LiveImage image = image_of(64, 32, PixelFormat::kRgb);
    image.owner = std::make_shared<std::pair<std::shared_ptr<const void>, std::shared_ptr<int>>>(image.owner, owner);
    photos.add(id, std::move(image));
  }
  CHECK(owner.use_count() <= 1 + static_cast<long>(LivePhotos::kMaxPending));
  goes_on = true;
  arrivals.wait_for(19);
  CHECK(photos.find(15) == nullptr);
  CHECK(photos.find(16) != nullptr);
}
