// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include "pmsp/api.h"
#include "pmsp/live.h"

namespace pmsp::web {

/// JPEGs of keyframes, encoded on an own thread. All members may be called from any thread.
class PMSP_API LivePhotos {
 public:
  static constexpr int kMaxWidth = 1024;
  static constexpr std::size_t kMaxPending = 4;

  /// `encoded`: called on the own thread for each photo. `max_bytes`: of all photos; the oldest ones are removed.
  LivePhotos(int nice, std::size_t max_bytes, std::function<void(std::int64_t id)> encoded);
  ~LivePhotos();
  LivePhotos(const LivePhotos&) = delete;
  LivePhotos& operator=(const LivePhotos&) = delete;

  /// Replaces an earlier photo. Drops the oldest of more than kMaxPending pending ones.
  void add(std::int64_t id, LiveImage image);

  /// nullptr = no such photo.
  std::shared_ptr<const std::string> find(std::int64_t id) const;

 private:
  struct Photo {
    std::shared_ptr<const std::string> jpeg;
    std::uint64_t number = 0;  ///< order of arrival
  };

  void work();
  void keep(std::int64_t id, std::string jpeg);

  const int nice_;
  const std::size_t max_bytes_;
  const std::function<void(std::int64_t)> encoded_;
  mutable std::mutex mutex_;  ///< guards all below
  std::condition_variable changed_;
  std::deque<std::pair<std::int64_t, LiveImage>> pending_;
  std::map<std::int64_t, Photo> photos_;
  std::map<std::uint64_t, std::int64_t> by_number_;
  std::size_t bytes_ = 0;
  std::uint64_t next_number_ = 0;
  bool ends_ = false;
  std::thread thread_;  ///< last member, since it uses the others
};

/// Returns an image as JPEG, at most `width` wide. Throws InvalidInput if it is empty, OutputError.
PMSP_API std::string photo_jpeg(const LiveImage& image, int width);

}  // namespace pmsp::web
