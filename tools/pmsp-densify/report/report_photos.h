// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <future>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "export/atomic_folder.h"
#include "pmsp/types.h"

namespace pmsp::tool {

/// Returns the path of `place` from the directory of the file `page`; empty unless it is below that directory.
std::filesystem::path path_beside(const std::filesystem::path& page, const std::filesystem::path& place);

/// Width of the photos of a report [px], if the images are larger.
constexpr int kPhotoWidth = 2048;

/// Returns an image as JPEG, at most kPhotoWidth wide. Throws OutputError.
std::string photo_of(ImageView<const Rgb> image);

/// Return the names of a keyframe's files.
std::string photo_name(std::int64_t keyframe_id);
std::string depth_name(std::int64_t keyframe_id);

/// Directory with photo and depth map (see page_depth) of each keyframe, from which a report loads them when served.
/// Files are encoded on other threads, at most 4 at a time; their errors are thrown by a later call.
class ReportPhotos {
 public:
  /// The directory is created by the first file.
  explicit ReportPhotos(std::filesystem::path folder) : target_(std::move(folder)) {}
  ~ReportPhotos();
  ReportPhotos(const ReportPhotos&) = delete;
  ReportPhotos& operator=(const ReportPhotos&) = delete;

  /// Throws OutputError.
  void add(std::int64_t keyframe_id, ImageView<const Rgb> image);
  /// `scale`: the depths' unit in units of the page. Throws OutputError.
  void add_depth(const DepthMap& map, double scale);
  /// Keeps the photos of these keyframes from a previous run, except those added in this one. Throws OutputError.
  void keep_previous(const std::vector<std::int64_t>& keyframe_ids);
  bool contains(std::int64_t keyframe_id) const { return ids_.count(keyframe_id) > 0; }
  bool has_depth(std::int64_t keyframe_id) const { return depths_.count(keyframe_id) > 0; }

  /// Moves the directory to its final name. Throws OutputError.
  void commit();

 private:
  void write_later(const std::string& name, std::function<std::string()> encode);
  void finish_one();

  const std::filesystem::path target_;
  std::optional<AtomicFolder> folder_;
  std::set<std::int64_t> ids_, depths_;
  std::deque<std::future<void>> writing_;  ///< last member, since it uses the others
};

/// True for file names of ReportPhotos.
bool is_photo_file(const std::string& name);

}  // namespace pmsp::tool
