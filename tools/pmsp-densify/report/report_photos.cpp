// SPDX-License-Identifier: BSD-2-Clause
#include "report_photos.h"

#include <memory>
#include <system_error>
#include <utility>
#include <vector>

#include <opencv2/imgcodecs.hpp>

#include "export/files.h"
#include "io/image_decode.h"
#include "page_depth.h"
#include "pictures.h"
#include "util/number_from.h"

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;

constexpr int kQuality = 85;
constexpr std::size_t kMaxWriting = 4;
constexpr const char* kExtension = ".jpg";
constexpr const char* kDepthExtension = ".depth";

std::string jpeg_of(const cv::Mat& picture) {
  const std::vector<unsigned char> bytes =
      io::encoded(kExtension, picture, "a photo cannot be encoded as JPEG", {cv::IMWRITE_JPEG_QUALITY, kQuality});
  return {bytes.begin(), bytes.end()};
}

}  // namespace

fs::path path_beside(const fs::path& page, const fs::path& place) {
  if (place.empty()) return {};
  const auto plain = [](const fs::path& path) {
    const fs::path whole = fs::absolute(path).lexically_normal();
    return whole.has_filename() ? whole : whole.parent_path();  // "folder/"
  };
  const fs::path beside = plain(place).lexically_relative(plain(page).parent_path());
  return beside.empty() || *beside.begin() == ".." || beside == "." ? fs::path() : beside;
}

std::string photo_name(std::int64_t keyframe_id) { return std::to_string(keyframe_id) + kExtension; }
std::string depth_name(std::int64_t keyframe_id) { return std::to_string(keyframe_id) + kDepthExtension; }

std::string photo_of(ImageView<const Rgb> image) { return jpeg_of(picture_of(image, kPhotoWidth)); }

ReportPhotos::~ReportPhotos() {
  for (std::future<void>& one : writing_) one.wait();
}

void ReportPhotos::add(std::int64_t keyframe_id, ImageView<const Rgb> image) {
  auto picture = std::make_shared<const cv::Mat>(picture_of(image, kPhotoWidth));
  write_later(photo_name(keyframe_id), [picture = std::move(picture)] { return jpeg_of(*picture); });
  ids_.insert(keyframe_id);
}

void ReportPhotos::add_depth(const DepthMap& map, double scale) {
  auto images = std::make_shared<const std::pair<Image<float>, Image<float>>>(map.depth, map.confidence);
  write_later(depth_name(map.keyframe_id), [images = std::move(images), scale] {
    return page_depth(images->first.view(), images->second.view(), scale);
  });
  depths_.insert(map.keyframe_id);
}

void ReportPhotos::write_later(const std::string& name, std::function<std::string()> encode) {
  if (!folder_) folder_.emplace(target_, is_photo_file, ".part-photos");
  if (writing_.size() >= kMaxWriting) finish_one();
  writing_.push_back(std::async(std::launch::async,
                                [encode = std::move(encode), path = *folder_ / name] { write_file(path, encode()); }));
}

void ReportPhotos::keep_previous(const std::vector<std::int64_t>& keyframe_ids) {
  for (const std::int64_t id : keyframe_ids) {
    const fs::path photo = target_ / photo_name(id);
    if (contains(id) || !is_file(photo)) continue;
    if (folder_) {  // which replaces the existing files
      std::error_code error;
      fs::create_hard_link(photo, *folder_ / photo_name(id), error);
      if (error) write_file(*folder_ / photo_name(id), read_whole_file(photo));
    }
    ids_.insert(id);
  }
}

void ReportPhotos::finish_one() {
  std::future<void> one = std::move(writing_.front());
  writing_.pop_front();
  one.get();
}

void ReportPhotos::commit() {
  while (!writing_.empty()) finish_one();
  if (folder_) folder_->commit();
}

bool is_photo_file(const std::string& name) {
  const fs::path path(name);
  const bool is_ours = path.extension() == kExtension || path.extension() == kDepthExtension;
  return is_ours && number_from<std::int64_t>(path.stem().string()).has_value();
}

}  // namespace pmsp::tool
