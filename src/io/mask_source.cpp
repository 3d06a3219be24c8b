// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <utility>

#include "export/files.h"
#include "image_naming.h"
#include "mask_image.h"
#include "mask_names.h"
#include "mask_rectangles.h"
#include "pmsp/calibration.h"
#include "pmsp/error.h"
#include "pmsp/io/images.h"
#include "zip_member.h"

namespace pmsp {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kKept = 4;            ///< cached masks of different sizes
constexpr std::size_t kSampledImages = 16;  ///< sampled images
constexpr const char* kMasksFolder = "masks";

bool is_yaml(const fs::path& path) { return path.extension() == ".yaml" || path.extension() == ".yml"; }

void ignore_rectangle(Image<std::uint8_t>& mask, const io::MaskRectangle& r) {
  const auto span = [](double from, double to, int size) {
    return std::pair(static_cast<int>(std::floor(from * size)), static_cast<int>(std::ceil(to * size)));
  };
  const auto [left, right] = span(r.x_min, r.x_max, mask.width());
  const auto [top, bottom] = span(r.y_min, r.y_max, mask.height());
  for (int y = top; y < bottom; ++y) std::fill(mask.row(y) + left, mask.row(y) + right, std::uint8_t{0});
}

void ignore_rows(Image<std::uint8_t>& mask, int first, int last) {
  for (int y = std::max(first, 0); y < std::min(last, mask.height()); ++y)
    std::fill(mask.row(y), mask.row(y) + mask.width(), std::uint8_t{0});
}

/// Members of archives are known to exist.
bool can_be_read(const fs::path& file) { return is_file(file) || !io::archive_of(file).empty(); }

bool is_blank(const Image<std::uint8_t>& mask) {
  return std::none_of(mask.pixels().begin(), mask.pixels().end(), [](std::uint8_t v) { return v != 0; });
}

fs::path clean(const fs::path& path) {
  std::error_code error;
  const fs::path whole = fs::absolute(path, error).lexically_normal();
  return whole.has_filename() ? whole : whole.parent_path();
}

enum class Place { kNone, kFolder, kNamed, kMasks, kBeside };

struct FoundMask {
  Place place = Place::kNone;
  fs::path file;
};

}  // namespace

struct MaskSource::Impl {
  MaskOptions options;
  bool folder = false;
  std::vector<io::MaskRectangle> rectangles;
  io::MaskNames names;
  Image<std::uint8_t> rig;                                                        ///< mask of the rig; empty = none
  std::map<fs::path, FoundMask> files;                                            ///< by image
  std::map<std::tuple<fs::path, fs::path, int, int>, Image<std::uint8_t>> masks;  ///< by file, image and size

  fs::path name_of(const fs::path& image) const {
    const fs::path relative = options.images.empty() ? fs::path() : image.lexically_relative(options.images);
    return relative.empty() || *relative.begin() == ".." ? image.filename() : relative;
  }

  const FoundMask& find(const fs::path& image) {
    const auto [found, is_new] = files.try_emplace(image);
    if (is_new) found->second = folder ? in_folder(image) : beside(image);
    return found->second;
  }

  /// By the image's name in the image folder, or without leading subfolders.
  FoundMask in_folder(const fs::path& image) {
    for (fs::path under = name_of(image).parent_path();; under = under.lexically_relative(*under.begin())) {
      if (under == ".") under.clear();
      fs::path file = names.in_folder(options.path / under, image);
      if (!file.empty()) return {Place::kFolder, std::move(file)};
      if (under.empty()) return {};
    }
  }

  /// Mask beside the image, or in a folder `masks` beside any of the image's folders.
  FoundMask beside(const fs::path& image) {
    if (!options.found) return {};
    const auto named = options.named.find(image);
    if (named != options.named.end() && can_be_read(named->second)) return {Place::kNamed, named->second};
    if (options.images.empty()) return {};
    const fs::path root = clean(options.images);
    fs::path under;
    for (fs::path at = clean(image).parent_path(); at.has_relative_path(); at = at.parent_path()) {
      fs::path file = names.in_folder(at.parent_path() / kMasksFolder / under, image);
      if (!file.empty()) return {Place::kMasks, std::move(file)};
      if (at == root) break;
      under = under.empty() ? at.filename() : at.filename() / under;
    }
    fs::path file = names.beside(image);
    return {file.empty() ? Place::kNone : Place::kBeside, std::move(file)};
  }

  bool is_of_instances(const fs::path& file) const {
    return options.named_are_instances && !io::archive_of(file).empty();
  }

  /// True if something is hidden in all images.
  bool is_everywhere() const { return options.nadir_deg > 0.0 || options.zenith_deg > 0.0 || !rig.empty(); }

  bool may_have_alpha(const fs::path& image) const { return options.found && pmsp::may_have_alpha(image); }

  /// `image`: whose alpha channel is used; "" = none.
  Image<std::uint8_t> make(const fs::path& file, const fs::path& image, int width, int height) const {
    Image<std::uint8_t> mask = file.empty() || is_yaml(file) ? Image<std::uint8_t>(width, height, 255)
                               : is_of_instances(file)
                                   ? io::scale_mask(file.string(), io::decode_mask(file, true).usable, width, height)
                                   : read_mask(file, width, height);
    const cv::Mat opacity = image.empty() ? cv::Mat() : io::image_opacity(image);
    if (!opacity.empty()) {
      const Image<std::uint8_t> alpha = io::scale_mask(image.string(), opacity, width, height);
      for (std::size_t i = 0; i < alpha.size(); ++i) mask.pixels()[i] = std::min(mask.pixels()[i], alpha.pixels()[i]);
    }
    hide_rig(rig, mask);
    for (const io::MaskRectangle& rectangle : rectangles) ignore_rectangle(mask, rectangle);
    const auto rows = [height](double degrees) { return degrees / 180.0 * height; };
    ignore_rows(mask, static_cast<int>(std::floor(height - rows(options.nadir_deg))), height);
    ignore_rows(mask, 0, static_cast<int>(std::ceil(rows(options.zenith_deg))));
    if (file.empty() && opacity.empty() && !is_everywhere()) return {};
    if (is_blank(mask))
      throw InvalidInput(
          (file.empty() ? image : file).string() +
          ": the mask, the alpha channel, the rig and the caps at nadir and zenith leave no pixel to use");
    return mask;
  }

  /// Hidden share of the sphere; for the first file also its description.
  double hidden_by_file(const fs::path& file, MaskSummary& summary) const {
    if (is_yaml(file)) {
      constexpr int kWidth = 1024;
      Image<std::uint8_t> mask(kWidth, kWidth / 2, 255);
      for (const io::MaskRectangle& rectangle : rectangles) ignore_rectangle(mask, rectangle);
      return io::hidden_share(mask.view());
    }
    const io::MaskImage mask = io::decode_mask(file, is_of_instances(file));
    if (file == summary.first) {
      summary.colours = mask.colours;
      summary.by_alpha = mask.by_alpha;
    }
    return io::hidden_share(
        {mask.usable.data, mask.usable.cols, mask.usable.rows, static_cast<std::ptrdiff_t>(mask.usable.step)});
  }

  std::vector<fs::path> unmatched(const std::vector<fs::path>& images) {
    std::set<fs::path> known;
    for (const fs::path& image : images) {
      known.insert(clean(image));
      known.insert(clean(find(image).file));
    }
    std::vector<fs::path> others;
    std::error_code error;
    for (fs::recursive_directory_iterator at(options.path, error); !error && at != fs::recursive_directory_iterator();
         at.increment(error)) {
      if (io::is_image_name(at->path()) && known.count(clean(at->path())) == 0) others.push_back(at->path());
    }
    std::sort(others.begin(), others.end());
    return others;
  }
};

MaskSource::MaskSource(const MaskOptions& options) : impl_(std::make_unique<Impl>()) {
  for (const auto& [name, degrees] :
       {std::pair("mask_nadir", options.nadir_deg), {"mask_zenith", options.zenith_deg}}) {
    if (!(degrees >= 0.0 && degrees <= 90.0))
      throw InvalidOption(std::string(name) + ": expected a radius of 0 to 90 degrees");
  }
  impl_->options = options;
  if (options.path.empty()) return;
  std::error_code error;
  impl_->folder = fs::is_directory(options.path, error);
  if (impl_->folder) return;
  if (!fs::exists(options.path, error)) throw IoError(options.path.string() + ": there is no such mask");
  if (is_yaml(options.path)) impl_->rectangles = io::read_mask_rectangles(options.path);
}

MaskSource::~MaskSource() = default;

Image<std::uint8_t> MaskSource::set_rig(Image<std::uint8_t> mask) {
  impl_->masks.clear();
  return std::exchange(impl_->rig, std::move(mask));
}

bool MaskSource::is_folder() const { return impl_->folder; }

fs::path MaskSource::file_for(const fs::path& image) const {
  return impl_->folder || impl_->options.path.empty() ? impl_->find(image).file : impl_->options.path;
}

bool MaskSource::is_per_image(const fs::path& image) const {
  return impl_->folder || (impl_->options.path.empty() && !impl_->find(image).file.empty()) ||
         impl_->may_have_alpha(image);
}

bool MaskSource::has_mask(const fs::path& image) const {
  return impl_->is_everywhere() || !file_for(image).empty() || impl_->may_have_alpha(image);
}

MaskSummary MaskSource::summarise(const std::vector<fs::path>& images, int width, int height) {
  MaskSummary summary;
  summary.images = images.size();
  std::vector<fs::path> masked;
  for (const fs::path& image : images) {
    const auto named = impl_->options.named.find(image);
    const bool is_missing = named != impl_->options.named.end() && !can_be_read(named->second);
    if (is_missing && summary.named_missing++ == 0) summary.first_missing = named->second;
    if (!has_mask(image)) continue;
    masked.push_back(image);
    const fs::path file = file_for(image);
    if (summary.first.empty()) summary.first = file;
    const Place place = impl_->options.path.empty() || impl_->folder ? impl_->find(image).place : Place::kNone;
    summary.in_folder += place == Place::kFolder;
    summary.named += place == Place::kNamed;
    summary.in_masks += place == Place::kMasks;
    summary.beside += place == Place::kBeside;
  }
  if (impl_->folder && summary.in_folder == 0 && !images.empty()) {
    const fs::path name = impl_->name_of(images.front());
    const std::string stem = fs::path(name).replace_extension().string();
    throw InvalidInput(impl_->options.path.string() + ": holds no mask for any of the " +
                       std::to_string(images.size()) + " images; expected " + name.string() + ".png, " + stem +
                       ".png, " + stem + "_mask.png or " + stem + ".mask.png for " + name.string());
  }
  if (impl_->folder) summary.unmatched = impl_->unmatched(images);
  add_to_summary(masked, width, height, summary);
  return summary;
}

ImageView<const std::uint8_t> MaskSource::mask_for(const fs::path& image, int width, int height) {
  const fs::path file = file_for(image);
  const fs::path with_alpha = impl_->may_have_alpha(image) ? image : fs::path();
  if (file.empty() && with_alpha.empty() && !impl_->is_everywhere()) return {};
  const auto key = std::tuple(file, with_alpha, width, height);
  auto found = impl_->masks.find(key);
  if (found == impl_->masks.end()) {
    if (is_per_image(image) || impl_->masks.size() >= kKept) impl_->masks.clear();
    found = impl_->masks.emplace(key, impl_->make(file, with_alpha, width, height)).first;
  }
  return static_cast<const Image<std::uint8_t>&>(found->second).view();
}

/// Evaluates a sample of the images, all of which may have a mask.
void MaskSource::add_to_summary(const std::vector<fs::path>& images, int width, int height, MaskSummary& summary) {
  std::map<fs::path, double> hidden_by;  // by file
  const std::size_t count = std::min(kSampledImages, images.size());
  for (std::size_t i = 0; i < count; ++i) {
    const fs::path& image = images[images.size() * i / count];
    const double hidden = io::hidden_share(mask_for(image, width, height));
    summary.hidden += hidden / static_cast<double>(count);
    summary.least = i == 0 ? hidden : std::min(summary.least, hidden);
    summary.most = std::max(summary.most, hidden);
    if (impl_->options.found && !io::image_opacity(image).empty()) ++summary.with_alpha;
    const auto [file, is_new] = hidden_by.try_emplace(file_for(image), 0.0);
    if (is_new && !file->first.empty()) file->second = impl_->hidden_by_file(file->first, summary);
    summary.hidden_by_files += file->second / static_cast<double>(count);
  }
  summary.looked_at = count;
}

}  // namespace pmsp
