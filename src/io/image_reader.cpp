// SPDX-License-Identifier: BSD-2-Clause
#include "io/image_reader.h"

#include <algorithm>
#include <utility>

#include "pmsp/calibration.h"
#include "pmsp/error.h"

namespace pmsp::io {

Decoded Decoder::next() {
  Decoded decoded;
  while (!take_image(decoded)) continue;
  return decoded;
}

bool Decoder::take_image(Decoded& decoded) {
  try {
    decoded.item = source_.next();
    take_skipped(decoded);
    ++next_id_;
    return true;
  } catch (const IoError& error) {
    take_skipped(decoded);
    decoded.skipped.push_back({source_.keyframe_ids().at(next_id_++), error.what()});
    if (first_error_.empty()) first_error_ = error.what();
    return false;
  }
}

/// Appends keyframes that the source has skipped since the last call.
void Decoder::take_skipped(Decoded& decoded) {
  for (; listed_ < source_.skipped().size(); ++listed_, ++next_id_) {
    decoded.skipped.push_back(source_.skipped()[listed_]);
  }
}

void restrict_to_sample(ImageSource& source) {
  const std::vector<std::int64_t> all = source.keyframe_ids();
  if (all.empty()) return;
  std::vector<std::int64_t> some = keyframes_for_lens_distance(all);
  const bool is_video = !source.origin(all.front()).frame.empty();
  if (is_video) some.assign(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(some.size()));
  source.restrict_to({some.begin(), some.end()});
}

int images_ahead(const SlamMap& map, int threads) {
  constexpr std::size_t kBytes = std::size_t{512} << 20;
  std::size_t largest = 1;
  for (const MapCamera& camera : map.cameras) {
    largest = std::max(largest, 3 * static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
  }
  const std::size_t most = static_cast<std::size_t>(std::max(2, threads));
  return static_cast<int>(std::clamp(kBytes / largest, std::size_t{2}, most));
}

ImageReader::ImageReader(ImageSource& source, const SlamMap& map, int threads, PairingVerifier* verifier)
    : decoder_(source), map_(map), verifier_(verifier) {
  source.read_ahead(images_ahead(map, threads));
  thread_ = std::thread([this] { work(); });
}

ImageReader::~ImageReader() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void ImageReader::work() {
  for (bool is_last = false; !is_last;) {
    std::optional<ImageSource::Item> done;
    {
      std::unique_lock<std::mutex> lock(mutex_);
      changed_.wait(lock, [&] { return stop_ || !ready_; });
      if (stop_) return;
      done.swap(done_);
    }
    done.reset();
    Read image;
    std::exception_ptr failed;
    try {
      image = read();
    } catch (...) {
      failed = std::current_exception();
    }
    is_last = failed || !image.item;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      ready_ = std::move(image);
      failed_ = failed;
    }
    changed_.notify_all();
  }
}

ImageReader::Read ImageReader::read() {
  Read read{decoder_.next(), {}, std::nullopt};
  if (!read.item) return read;
  const std::int64_t id = read.item->keyframe_id;
  const MapKeyframe* const found = map_.find_keyframe(id);
  if (found == nullptr) {
    throw InvalidInput("an image names keyframe " + std::to_string(id) + ", which the map lacks");
  }
  read.keyframe = keyframe_of(map_, *found);
  if (verifier_ == nullptr) return read;
  verifier_->add(id, read.item->image.view());
  read.pairing = verifier_->verdict();
  if (read.pairing->conclusive && !read.pairing->belongs) throw InvalidInput(read.pairing->message);
  return read;
}

ImageReader::Read ImageReader::next() {
  Read read;
  {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [&] { return ready_.has_value(); });
    if (failed_) std::rethrow_exception(failed_);
    read = *std::move(ready_);
    ready_.reset();
  }
  changed_.notify_all();
  if (read.item) read.keyframe.image = read.item->image.view();
  return read;
}

void ImageReader::release_async(ImageSource::Item item) {
  std::optional<ImageSource::Item> before;  // not yet picked up by the thread
  const std::lock_guard<std::mutex> lock(mutex_);
  before = std::exchange(done_, std::move(item));
}

ImageLoop::End ImageLoop::operator()() const {
  End end;
  for (;; ++end.images) {
    if (waits) waits(true);
    ImageReader::Read read = images.next();
    if (waits) waits(false);
    if (read.pairing) end.pairing = read.pairing;
    if (check) check();
    for (const SkippedKeyframe& keyframe : read.skipped) {
      if (skipped) skipped(keyframe);
    }
    if (!read.item) break;
    visit(end.images, read.keyframe);
    images.release_async(std::move(*read.item));
    if (check) check();
  }
  if (end.images == 0) end.first_error = images.first_error();
  return end;
}

}  // namespace pmsp::io
