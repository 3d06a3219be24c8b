// SPDX-License-Identifier: BSD-2-Clause
#include "view_filter/sharpness.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "cpu/executor_impl.h"
#include "pmsp/camera.h"
#include "random.h"
#include "util/median_of.h"

namespace pmsp {
namespace {

constexpr int kSide = 9;              ///< side of a patch [px of the depth map]
constexpr double kMinCosLat = 0.5;    ///< up to 60 degrees of latitude
constexpr float kMinVariance = 4.0F;  ///< [gray levels squared]; less is noise
constexpr std::size_t kMinCommon = 20;
constexpr std::size_t kMostMeasured = 256;  ///< per keyframe

using Patch = std::array<float, kSide * kSide>;

/// Returns the mean gray value (green counts twice) of box x box pixels from (x, y) on; x must be inside the image.
float box_mean(const ImageView<const Rgb>& image, int x, int y, int box) {
  int sum = 0;
  for (int j = y; j < y + box; ++j) {
    const Rgb* row = image.row(std::clamp(j, 0, image.height - 1));
    for (int i = x; i < x + box; ++i) {
      const Rgb& pixel = row[i < image.width ? i : i - image.width];
      sum += pixel.r + 2 * pixel.g + pixel.b;
    }
  }
  return static_cast<float>(sum) / static_cast<float>(4 * box * box);
}

/// Returns the patch around a direction, sampled and averaged at the pixel size of the depth map; wider towards the
/// poles.
std::optional<Patch> patch_around(const ImageView<const Rgb>& image, const Eigen::Vector3d& direction, int width) {
  const double cos_lat = std::hypot(direction.x(), direction.z()) / direction.norm();
  if (!(cos_lat >= kMinCosLat)) return std::nullopt;
  const double step = static_cast<double>(image.width) / width;
  const int box = std::max(1, static_cast<int>(std::lround(step)));
  const Eigen::Vector2d center = pixel_from_bearing(direction, image.width, image.height);
  std::array<int, kSide> columns{};  // first pixels of the boxes
  std::array<int, kSide> rows{};
  for (int i = 0; i < kSide; ++i) {
    const int from_center = i - kSide / 2;
    const double off = from_center * step;
    const int column = static_cast<int>(std::lround(center.x() + off / cos_lat - 0.5 * box)) % image.width;
    columns[static_cast<std::size_t>(i)] = column < 0 ? column + image.width : column;
    rows[static_cast<std::size_t>(i)] = static_cast<int>(std::lround(center.y() + off - 0.5 * box));
  }
  Patch patch{};
  float* sample = patch.data();
  for (const int row : rows) {
    for (const int column : columns) *sample++ = box_mean(image, column, row, box);
  }
  return patch;
}

/// Returns up to kMostMeasured landmarks, in the order of a hash of their ids, so that keyframes select common ones.
std::vector<const Landmark*> some_of(const std::vector<Landmark>& landmarks) {
  std::vector<const Landmark*> chosen;
  for (const Landmark& landmark : landmarks) chosen.push_back(&landmark);
  if (chosen.size() <= kMostMeasured) return chosen;
  const auto hash = [](const Landmark* landmark) {
    const std::uint64_t id = static_cast<std::uint64_t>(landmark->id);
    return std::pair(kernels::mix(static_cast<std::uint32_t>(id) ^ kernels::mix(static_cast<std::uint32_t>(id >> 32))),
                     id);
  };
  std::nth_element(chosen.begin(), chosen.begin() + kMostMeasured, chosen.end(),
                   [&](const Landmark* a, const Landmark* b) { return hash(a) < hash(b); });
  chosen.resize(kMostMeasured);
  return chosen;
}

std::optional<LandmarkSharpness> sharpness_of(std::int64_t id, const Patch& patch) {
  float mean = 0.0F;
  for (const float value : patch) mean += value / static_cast<float>(patch.size());
  float squares = 0.0F;
  for (const float value : patch) squares += (value - mean) * (value - mean);
  if (squares < kMinVariance * static_cast<float>(patch.size())) return std::nullopt;
  LandmarkSharpness result{id, 0.0F, 0.0F};
  const auto square = [](float value) { return value * value; };
  for (std::size_t j = 0; j < kSide; ++j) {
    for (std::size_t i = 0; i + 1 < kSide; ++i) {
      result.horizontal += square(patch[j * kSide + i + 1] - patch[j * kSide + i]) / squares;
      result.vertical += square(patch[(i + 1) * kSide + j] - patch[i * kSide + j]) / squares;
    }
  }
  return result;
}

}  // namespace

std::vector<LandmarkSharpness> landmark_sharpness(const Keyframe& keyframe, int width, const Executor* executor) {
  constexpr std::size_t kPerTask = 16;
  const std::vector<const Landmark*> landmarks = some_of(keyframe.landmarks);
  std::vector<std::optional<LandmarkSharpness>> found(landmarks.size());
  const auto find = [&](int task) {
    const std::size_t first = static_cast<std::size_t>(task) * kPerTask;
    for (std::size_t i = first; i < std::min(first + kPerTask, landmarks.size()); ++i) {
      const Landmark& landmark = *landmarks[i];
      const auto patch = patch_around(keyframe.image, keyframe.cam_from_world * landmark.position_world, width);
      if (patch) found[i] = sharpness_of(landmark.id, *patch);
    }
  };
  for_each(executor, static_cast<int>((landmarks.size() + kPerTask - 1) / kPerTask), find);
  std::vector<LandmarkSharpness> result;
  for (const auto& sharpness : found) {
    if (sharpness) result.push_back(*sharpness);
  }
  std::sort(result.begin(), result.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
  return result;
}

double relative_sharpness(const std::vector<LandmarkSharpness>& image, const std::vector<LandmarkSharpness>& other) {
  std::vector<double> horizontal;
  std::vector<double> vertical;
  auto match = other.begin();
  for (const LandmarkSharpness& here : image) {
    while (match != other.end() && match->id < here.id) ++match;
    if (match == other.end()) break;
    if (match->id != here.id) continue;
    constexpr float kTiny = 1e-6F;
    horizontal.push_back(static_cast<double>((here.horizontal + kTiny) / (match->horizontal + kTiny)));
    vertical.push_back(static_cast<double>((here.vertical + kTiny) / (match->vertical + kTiny)));
  }
  if (horizontal.size() < kMinCommon) return 1.0;
  return std::min(median(horizontal), median(vertical));
}

}  // namespace pmsp
