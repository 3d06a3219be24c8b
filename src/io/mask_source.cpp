// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <tuple>
#include <utility>

#include "mask_rectangles.h"
#include "pmsp/error.h"
#include "pmsp/io/mask.h"

namespace pmsp {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kKept = 4;  ///< masks of different sizes

bool is_yaml(const fs::path& path) { return path.extension() == ".yaml" || path.extension() == ".yml"; }

void ignore_rectangle(Image<std::uint8_t>& mask, const io::MaskRectangle& r) {
  const auto span = [](double from, double to, int size) {
    return std::pair(static_cast<int>(std::floor(from * size)), static_cast<int>(std::ceil(to * size)));
  };
  const auto [left, right] = span(r.x_min, r.x_max, mask.width());
  const auto [top, bottom] = span(r.y_min, r.y_max, mask.height());
  for (int y = top; y < bottom; ++y) std::fill(mask.row(y) + left, mask.row(y) + right, std::uint8_t{0});
}

}  // namespace

struct MaskSource::Impl {
  MaskOptions options;
  bool folder = false;
  std::vector<io::MaskRectangle> rectangles;
  std::map<std::tuple<fs::path, int, int>, Image<std::uint8_t>> masks;  ///< by file and size

  fs::path name_of(const fs::path& image) const {
    const fs::path relative = options.images.empty() ? fs::path() : image.lexically_relative(options.images);
    return relative.empty() || *relative.begin() == ".." ? image.filename() : relative;
  }

  Image<std::uint8_t> make(const fs::path& file, int width, int height) const {
    Image<std::uint8_t> mask =
        file.empty() || is_yaml(file) ? Image<std::uint8_t>(width, height, 255) : read_mask(file, width, height);
    for (const io::MaskRectangle& rectangle : rectangles) ignore_rectangle(mask, rectangle);
    const double rows = options.nadir_deg / 180.0 * height;
    const int first = std::clamp(static_cast<int>(std::floor(height - rows)), 0, height);
    for (int y = first; y < height; ++y) std::fill(mask.row(y), mask.row(y) + width, std::uint8_t{0});
    if (std::none_of(mask.pixels().begin(), mask.pixels().end(), [](std::uint8_t v) { return v != 0; }))
      throw InvalidInput(file.string() + ": the mask and the cap at the nadir leave no pixel to use");
    return mask;
  }
};

MaskSource::MaskSource(const MaskOptions& options) : impl_(std::make_unique<Impl>()) {
  if (!(options.nadir_deg >= 0.0 && options.nadir_deg <= 90.0))
    throw InvalidOption("mask_nadir: expected a radius of 0 to 90 degrees");
  impl_->options = options;
  if (options.path.empty()) return;
  std::error_code error;
  impl_->folder = fs::is_directory(options.path, error);
  if (impl_->folder) return;
  if (!fs::exists(options.path, error)) throw IoError(options.path.string() + ": there is no such mask");
  if (is_yaml(options.path)) impl_->rectangles = io::read_mask_rectangles(options.path);
}

MaskSource::~MaskSource() = default;

bool MaskSource::is_folder() const { return impl_->folder; }

fs::path MaskSource::file_for(const fs::path& image) const {
  if (!impl_->folder) return impl_->options.path;
  const fs::path name = impl_->name_of(image);
  std::error_code ignored;
  const fs::path exact = impl_->options.path / (name.string() + ".png");
  if (fs::is_regular_file(exact, ignored)) return exact;
  const fs::path replaced = impl_->options.path / fs::path(name).replace_extension(".png");
  // Masks that lie among the images must not be the images themselves.
  if (fs::is_regular_file(replaced, ignored) && !fs::equivalent(replaced, image, ignored)) return replaced;
  return {};
}

std::size_t MaskSource::count(const std::vector<fs::path>& images) const {
  const auto found =
      std::count_if(images.begin(), images.end(), [&](const fs::path& i) { return !file_for(i).empty(); });
  if (impl_->folder && found == 0 && !images.empty()) {
    const fs::path name = impl_->name_of(images.front());
    throw InvalidInput(impl_->options.path.string() + ": holds no mask for any of the " +
                       std::to_string(images.size()) + " images; expected " + name.string() + ".png or " +
                       fs::path(name).replace_extension(".png").string() + " for " + name.string());
  }
  return static_cast<std::size_t>(found);
}

ImageView<const std::uint8_t> MaskSource::mask_for(const fs::path& image, int width, int height) {
  const fs::path file = file_for(image);
  if (file.empty() && impl_->options.nadir_deg == 0.0) return {};
  const auto key = std::tuple(file, width, height);
  auto found = impl_->masks.find(key);
  if (found == impl_->masks.end()) {
    if (impl_->folder || impl_->masks.size() >= kKept) impl_->masks.clear();
    found = impl_->masks.emplace(key, impl_->make(file, width, height)).first;
  }
  return static_cast<const Image<std::uint8_t>&>(found->second).view();
}

}  // namespace pmsp
