// SPDX-License-Identifier: BSD-2-Clause
#include "view_images.h"

#include <algorithm>
#include <fstream>
#include <set>
#include <string>
#include <tuple>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "export/files.h"
#include "io/image_decode.h"
#include "mission_input.h"
#include "pmsp/error.h"
#include "tool_files.h"

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
  write_file(path, io::encoded(".jpg", bgr, path.string() + ": cannot be encoded as JPEG",
                               {cv::IMWRITE_JPEG_QUALITY, kQuality}));
}

}  // namespace

std::vector<unsigned char> mask_png(ImageView<const std::uint8_t> mask, int width, int height) {
  cv::Mat gray(height, width, CV_8UC1, cv::Scalar(255));
  for (int y = 0; y < mask.height; ++y) {
    std::transform(mask.row(y), mask.row(y) + width, gray.ptr<std::uint8_t>(y),
                   [](std::uint8_t use) { return use != 0 ? std::uint8_t{255} : std::uint8_t{0}; });
  }
  return io::encoded(".png", gray, "a mask cannot be encoded as PNG");
}

ViewImages::ViewImages(const Arguments& arguments, const SlamMap& map, const ImageSource& source, MaskSource& masks)
    : arguments_(arguments), map_(map), masks_(masks) {
  for (const std::int64_t id : source.keyframe_ids()) origins_[id] = source.origin(id);
}

std::vector<OutputView> ViewImages::put(const fs::path& folder, const Similarity& file_from_map) const {
  std::vector<OutputView> views;
  std::map<std::int64_t, std::string> decoded;
  std::set<std::string> names;
  for (const auto& [id, size] : sizes_) {
    const MapKeyframe* keyframe = map_.find_keyframe(id);
    const auto origin = origins_.find(id);
    if (keyframe == nullptr || origin == origins_.end()) continue;
    const bool is_frame = !origin->second.frame.empty();
    const bool is_turned = !is_frame && is_turned_by_exif(origin->second.file);
    std::string name = is_frame ? numbered_name("", id, ".jpg") : origin->second.file.filename().string();
    if (is_turned) name = fs::path(name).replace_extension(".jpg").string();
    if (!names.insert(name).second) {  // same name in another subfolder
      name = numbered_name("", id, "_" + name);
      names.insert(name);
    }
    if (is_frame || is_turned) {  // trainers ignore EXIF data
      decoded[id] = name;
    } else {
      copy_image(origin->second.file, folder / "images" / name);
    }
    const RigidTransform pose = file_from_map * keyframe->cam_from_world.inverse();
    views.push_back({id, keyframe->timestamp, pose.inverse(), name, size.width, size.height});
  }
  if (!decoded.empty()) write_decoded(folder / "images", decoded);
  put_masks(folder, views);
  return views;
}

void ViewImages::put_masks(const fs::path& folder, std::vector<OutputView>& views) const {
  const auto file_of = [&](const OutputView& view) { return origins_.at(view.keyframe_id).name(); };
  const bool is_wanted =
      std::any_of(views.begin(), views.end(), [&](const OutputView& view) { return masks_.has_mask(file_of(view)); });
  if (!is_wanted) return;
  make_folder(folder / "masks");
  std::vector<unsigned char> encoded;
  std::tuple<fs::path, int, int> encoded_of;
  for (OutputView& view : views) {
    const std::tuple<fs::path, int, int> wanted(masks_.file_for(file_of(view)), view.width, view.height);
    if (encoded.empty() || wanted != encoded_of || masks_.is_per_image(file_of(view))) {
      encoded = mask_png(masks_.mask_for(file_of(view), view.width, view.height), view.width, view.height);
      encoded_of = wanted;
    }
    write_file(folder / "masks" / (view.name + ".png"), encoded);
    view.has_mask = true;
  }
}

void ViewImages::write_decoded(const fs::path& folder, const std::map<std::int64_t, std::string>& names) const {
  std::set<std::int64_t> ids;
  for (const auto& [id, name] : names) ids.insert(id);
  const std::unique_ptr<ImageSource> source = open_images(arguments_, map_);
  source->restrict_to(ids);
  while (const std::optional<ImageSource::Item> item = source->next()) {
    write_jpeg(folder / names.at(item->keyframe_id), item->image);
    ids.erase(item->keyframe_id);
  }
  if (ids.empty()) return;
  throw IoError("the image of keyframe " + std::to_string(*ids.begin()) +
                " no longer exists; do not change images or video during a run");
}

}  // namespace pmsp::tool
