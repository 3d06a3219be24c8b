// SPDX-License-Identifier: BSD-2-Clause
#include "external_depths.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <system_error>
#include <utility>

#include "io/prior_depths.h"
#include "io/zip_member.h"
#include "mission_input.h"
#include "numbers.h"
#include "pmsp/camera.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"

namespace pmsp::tool {
namespace {

/// Substitute for the unknown photometric score; approximately doubles expected errors.
constexpr float kUnknownScore = 0.5F;
/// Ratio of depths to those of landmarks, or its inverse, above which units are considered different.
constexpr double kOtherUnit = 1.15;
constexpr double kLeastCosine = 0.01;  ///< between a given normal and the ray

bool is_filtered(const DepthFolder& folder) { return folder.kind() == "filtered"; }

/// `file`: "" = none.
bool is_in(const std::filesystem::path& file, const std::filesystem::path& folder) {
  std::error_code error;
  return !file.empty() && std::filesystem::equivalent(file.parent_path(), folder, error);
}

/// Nearest-neighbour resampling.
template <class T>
Image<T> resampled(Image<T> image, int width, int height) {
  if (image.empty() || (image.width() == width && image.height() == height)) return image;
  Image<T> result(width, height, image(0, 0));
  const auto nearest = [](int at, int size, int of) {
    return static_cast<int>((2 * std::int64_t{at} + 1) * of / (2 * std::int64_t{size}));
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      result(x, y) = image(nearest(x, width, image.width()), nearest(y, height, image.height()));
  }
  return result;
}

}  // namespace

void set_fuse_defaults(DensifierOptions& options, const Arguments& arguments) {
  const DepthFolder folder(arguments.external_depths, arguments.images);
  options.width = options.height = 0;
  options.lens_distance = folder.lens_distance();
  options.advanced.view_filter.enabled = false;
  options.advanced.median.enabled = options.advanced.median.enabled && !is_filtered(folder);
  options.advanced.median.weighted = false;  // edges were set by the source of the depth maps
  options.advanced.consistency.enabled = options.advanced.consistency.enabled && !is_filtered(folder);
}

ExternalDepths::ExternalDepths(const Arguments& arguments)
    : arguments_(arguments), folder_(arguments.external_depths, arguments.images) {}

std::vector<SkippedKeyframe> ExternalDepths::look(const SlamMap& map, const ImageSource& source,
                                                  DensifierOptions& options) {
  map_ = &map;
  masks_.emplace(mask_options(arguments_, map, source));
  with_image_ = source.keyframe_ids().size();
  std::vector<SkippedKeyframe> skipped;
  std::vector<PlanKeyframe> planned;
  std::vector<double> ratios;
  for (const std::int64_t id : source.keyframe_ids()) {
    const MapKeyframe* const in_map = map.find_keyframe(id);
    const std::filesystem::path image = source.origin(id).name();
    if (in_map == nullptr) continue;
    std::filesystem::path file = folder_.file_for(id, image);
    if (file.empty() && is_in(io::archive_of(in_map->prior_depth), arguments_.external_depths)) {
      file = in_map->prior_depth;
    }
    if (file.empty()) continue;
    const Keyframe keyframe = keyframe_of(map, *in_map);
    try {
      Found found = add_image(keyframe, file, options, ratios);
      found.image = image;
      found_[id] = std::move(found);
      planned.push_back(plan_keyframe(keyframe, options));
    } catch (const Error& error) {
      skipped.push_back({id, error.what()});
    }
  }
  if (found_.empty()) {
    const std::string all = arguments_.external_depths.string() + ": contains no depth image ";
    if (!skipped.empty()) throw InvalidInput(all + "that can be used; the first one: " + skipped.front().reason);
    throw InvalidInput(all + "of any of the " + std::to_string(with_image_) + " keyframes with an image; expected " +
                       (folder_.is_indexed() ? "their keyframe ids in its index.json"
                                             : "a/7.pfm, a/7.exr, a/7.npy or a/7.png for a/7.jpg, or an index.json"));
  }
  check_unit(std::move(ratios));
  options_ = options;
  plan_ = make_plan(planned, options_);
  executor_ = std::make_unique<Executor>(options.threads, options.simd);
  return skipped;
}

/// Determines scale and usability of a depth image.
ExternalDepths::Found ExternalDepths::add_image(const Keyframe& keyframe, const std::filesystem::path& file,
                                                DensifierOptions& options, std::vector<double>& ratios) {
  Found found;
  found.file = file;
  const Image<float> values = folder_.read(file);
  io::require_shape(values, file, 2, 1);  // of every panorama
  found.alignment.scale = arguments_.depth_scale.value_or(0.0);
  if (is_aligned()) found.alignment = align_prior_depth(values.view(), keyframe);
  if (!found.alignment.why_not.empty()) throw InvalidInput(file.string() + ": " + found.alignment.why_not);
  const Image<float> depth = aligned_depth(values.view(), found.alignment);
  if (std::none_of(depth.pixels().begin(), depth.pixels().end(), [](float d) { return d > 0.0F; }))
    throw InvalidInput(file.string() + ": no pixel has a depth > 0");
  const double ratio = depth_ratio(depth.view(), keyframe);
  if (ratio > 0.0) ratios.push_back(ratio);
  const auto even = [](double size) { return 2 * static_cast<int>(size / 2.0); };
  const double shape = static_cast<double>(values.width()) / values.height();
  if (options.width == 0)
    options.width = options.height > 0 ? even(options.height * shape + 1.0) : even(values.width());
  if (options.height == 0) options.height = even(options.width / shape + 1.0);
  return found;
}

void ExternalDepths::check_unit(std::vector<double> ratios) const {
  if (is_aligned() || arguments_.no_verify || ratios.empty()) return;
  const double ratio = percentile(ratios, 50.0);
  if (ratio <= kOtherUnit && ratio >= 1.0 / kOtherUnit) return;
  std::ostringstream text;
  text.precision(3);
  text << arguments_.external_depths.string() << ": depths are " << ratio << " times those of the landmarks (median of "
       << ratios.size() << " keyframes); expected distances along the rays in map units; give --depth-scale "
       << *arguments_.depth_scale / ratio
       << ", or --depth-scale auto to estimate scale and shift of each image, or --no-verify to use them unchanged";
  throw InvalidInput(text.str());
}

std::string ExternalDepths::summary() const {
  return "depth: " + std::to_string(found_.size()) + " of " + std::to_string(with_image_) + " keyframes have it in " +
         arguments_.external_depths.string() + (folder_.kind().empty() ? "" : " (" + folder_.kind() + ")") +
         ", used at " + size_text(options_.width, options_.height);
}

nlohmann::ordered_json ExternalDepths::report() const {
  nlohmann::ordered_json json{{"folder", arguments_.external_depths.string()},
                              {"kind", folder_.kind()},
                              {"maps", nlohmann::ordered_json::array()}};
  for (const auto& [id, found] : found_) {
    nlohmann::ordered_json entry{{"keyframe_id", id}};
    entry.update(is_aligned() ? io::to_json(found.alignment)
                              : nlohmann::ordered_json{{"scale", found.alignment.scale}});
    json["maps"].push_back(std::move(entry));
  }
  return json;
}

std::unique_ptr<PlannedDensifier> ExternalDepths::densifier(PlannedCallbacks callbacks) {
  PlaneReuses reuses;
  std::vector<std::int64_t> ids;
  for (const PlanEntry& entry : plan_.entries) {
    if (!entry.has_depth_map()) continue;
    ids.push_back(entry.id);
    reuses.keyframes[entry.id] = {PlaneReuse::Planes::kStart, 0};
  }
  reuses.load = [this](std::int64_t id) { return planes_of(id); };
  return std::make_unique<PlannedDensifier>(options_, plan_, ids, std::move(callbacks), std::move(reuses));
}

void ExternalDepths::set_image_size(std::int64_t keyframe_id, int width, int height) {
  Found& found = found_.at(keyframe_id);
  found.width = width;
  found.height = height;
}

Keyframe ExternalDepths::without_image(std::int64_t keyframe_id) {
  if (blank_.empty()) blank_ = Image<Rgb>(options_.width, options_.height);
  Keyframe keyframe = keyframe_of(*map_, *map_->find_keyframe(keyframe_id));
  keyframe.image = static_cast<const Image<Rgb>&>(blank_).view();
  return keyframe;
}

PlaneMap ExternalDepths::planes_of(std::int64_t keyframe_id) {
  const Found& found = found_.at(keyframe_id);
  if (found.width == 0) return PlaneMap(options_.width, options_.height);
  DepthMap map = read(keyframe_id, found);
  leave_out_masked(map, found);
  find_normals(map);
  FilterStats filtered;
  PlaneMap planes = median_filter(plane_map_of(map, *executor_), options_.advanced.median, *executor_, &filtered);
  ++stats_.depth_maps;
  stats_.pixels_matched += filtered.before;
  stats_.pixels_after_median += filtered.after;
  return planes;
}

/// Reads a depth map in the size of the run.
DepthMap ExternalDepths::read(std::int64_t keyframe_id, const Found& found) const {
  const Image<float> values = folder_.read(found.file);
  io::require_shape(values, found.file, found.width, found.height);
  DepthMap map;
  map.keyframe_id = keyframe_id;
  map.cam_from_world = map_->find_keyframe(keyframe_id)->cam_from_world;
  map.depth = aligned_depth(values.view(), found.alignment);
  map.normal = folder_.read_normals(keyframe_id);
  map.confidence = folder_.read_confidence(keyframe_id);
  const auto differs = [&](const auto& image) {
    return !image.empty() && (image.width() != values.width() || image.height() != values.height());
  };
  if (differs(map.normal) || differs(map.confidence)) {
    throw InvalidInput(found.file.string() + ": is " + size_text(values.width(), values.height()) +
                       ", but the normals or confidences that index.json names beside it are not");
  }
  if (map.confidence.empty()) map.confidence = Image<float>(values.width(), values.height(), kUnknownScore);
  map.depth = resampled(std::move(map.depth), options_.width, options_.height);
  map.normal = resampled(std::move(map.normal), options_.width, options_.height);
  map.confidence = resampled(std::move(map.confidence), options_.width, options_.height);
  for (float& confidence : map.confidence.pixels()) confidence = confidence > 0.0F ? std::min(confidence, 1.0F) : 0.0F;
  return map;
}

/// Estimates normals where none is given that faces the camera.
void ExternalDepths::find_normals(DepthMap& map) const {
  const Image<Eigen::Vector3f> given = std::move(map.normal);
  map.normal = estimate_normals(map.depth, *executor_);
  if (given.empty()) return;
  for (int y = 0; y < given.height(); ++y) {
    for (int x = 0; x < given.width(); ++x) {
      const Eigen::Vector3d ray = bearing_from_pixel({x + 0.5, y + 0.5}, given.width(), given.height());
      if (given(x, y).cast<double>().dot(ray) < -kLeastCosine * static_cast<double>(given(x, y).norm()))
        map.normal(x, y) = given(x, y);
    }
  }
}

/// Removes masked pixels and counts unmasked ones.
void ExternalDepths::leave_out_masked(DepthMap& map, const Found& found) {
  const ImageView<const std::uint8_t> mask = masks_->mask_for(found.image, found.width, found.height);
  stats_.pixels += static_cast<std::int64_t>(map.depth.size());
  if (mask.empty()) return;
  const Image<std::uint8_t> usable = shrink_mask(mask, map.depth.width(), map.depth.height());
  for (std::size_t i = 0; i < usable.size(); ++i) {
    if (usable.pixels()[i] != 0) continue;
    map.depth.pixels()[i] = 0.0F;
    --stats_.pixels;
  }
}

void ExternalDepths::count_pixels(DensifierStats& stats) const {
  stats.depth_maps = stats_.depth_maps;
  stats.pixels = stats_.pixels;
  stats.pixels_matched = stats_.pixels_matched;
  stats.pixels_after_median = stats_.pixels_after_median;
}

}  // namespace pmsp::tool
