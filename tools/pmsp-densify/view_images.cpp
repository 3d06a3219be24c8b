// SPDX-License-Identifier: BSD-2-Clause
#include "view_images.h"

#include <fstream>
#include <set>
#include <string>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "export/atomic_file.h"
#include "output_folder.h"
#include "pmsp/error.h"
#include "verbs.h"

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;

void copy_image(const fs::path& from, const fs::path& to) {
  std::ifstream file(from, std::ios::binary);
  if (!file) throw IoError(from.string() + ": cannot be opened for reading");
  AtomicFile copy(to);
  std::vector<char> bytes(std::size_t{1} << 20);
  while (file.read(bytes.data(), static_cast<std::streamsize>(bytes.size())) || file.gcount() > 0) {
    copy.write(bytes.data(), static_cast<std::size_t>(file.gcount()));
  }
  if (file.bad()) throw IoError(from.string() + ": cannot be read");
  copy.commit();
}

void write_jpeg(const fs::path& path, const Image<Rgb>& image) {
  constexpr int kQuality = 95;
  const cv::Mat rgb(image.height(), image.width(), CV_8UC3,
                    const_cast<void*>(static_cast<const void*>(image.pixels().data())));
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  std::vector<unsigned char> encoded;
  if (!cv::imencode(".jpg", bgr, encoded, {cv::IMWRITE_JPEG_QUALITY, kQuality})) {
    throw OutputError(path.string() + ": cannot be encoded as JPEG");
  }
  write_file(path, encoded);
}

}  // namespace

ViewImages::ViewImages(const Arguments& arguments, const SlamMap& map, const ImageSource& source)
    : arguments_(arguments), map_(map) {
  for (const std::int64_t id : source.keyframe_ids()) origins_[id] = source.origin(id);
}

std::vector<OutputView> ViewImages::put(const fs::path& folder, const Similarity& file_from_map) const {
  std::vector<OutputView> views;
  std::map<std::int64_t, std::string> frames;
  std::set<std::string> names;
  for (const auto& [id, size] : sizes_) {
    const MapKeyframe* keyframe = map_.find_keyframe(id);
    const auto origin = origins_.find(id);
    if (keyframe == nullptr || origin == origins_.end()) continue;
    const bool is_frame = !origin->second.frame.empty();
    std::string name = is_frame ? numbered_name("", id, ".jpg") : origin->second.file.filename().string();
    if (!names.insert(name).second) {  // from another subfolder
      name = numbered_name("", id, ("_" + name).c_str());
      names.insert(name);
    }
    if (is_frame) {
      frames[id] = name;
    } else {
      copy_image(origin->second.file, folder / name);
    }
    const RigidTransform pose = file_from_map * keyframe->cam_from_world.inverse();
    views.push_back({id, keyframe->timestamp, pose.inverse(), name, size.width, size.height});
  }
  if (!frames.empty()) copy_frames(folder, frames);
  return views;
}

void ViewImages::copy_frames(const fs::path& folder, const std::map<std::int64_t, std::string>& names) const {
  std::set<std::int64_t> ids;
  for (const auto& [id, name] : names) ids.insert(id);
  const std::unique_ptr<ImageSource> source = open_images(arguments_, map_);
  source->restrict_to(ids);
  while (const std::optional<ImageSource::Item> item = source->next()) {
    write_jpeg(folder / names.at(item->keyframe_id), item->image);
    ids.erase(item->keyframe_id);
  }
  if (ids.empty()) return;
  throw IoError("the video no longer gives the frame of keyframe " + std::to_string(*ids.begin()) +
                "; leave it as it is while a run works");
}

}  // namespace pmsp::tool
