// SPDX-License-Identifier: BSD-2-Clause
#include "patch_sweep.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

#include <Eigen/Geometry>

#include "elementary.h"
#include "pmsp/camera.h"

namespace pmsp::io {
namespace {

constexpr int kSweepWidth = 512;      ///< maximum width of the gray images [px]
constexpr int kCell = 12;             ///< side of the squares with one patch each [px]
constexpr double kMaxLatitude = 1.2;  ///< [rad]
constexpr int kRadius = 2;            ///< patch radius [samples]
constexpr int kSide = 2 * kRadius + 1;
constexpr int kSamples = kSide * kSide;
constexpr int kLanes = 4;
constexpr int kStored = (kSamples + kLanes - 1) / kLanes * kLanes;
constexpr double kSpacing = 1.5;  ///< between samples [px]
constexpr std::size_t kComparedNeighbours = 6;
constexpr double kNearest = 0.4;  ///< minimum depth [distance to the farthest source view]
constexpr double kFarthest = 60.0;
constexpr int kDepths = 160;           ///< evenly spaced in 1 / depth, hence in the images
constexpr int kPeakReach = 8;          ///< half width of a peak [depth steps]
constexpr float kMinDeviation = 5.0F;  ///< minimum standard deviation of a patch [gray levels]
constexpr float kMinScore = 0.8F;      ///< NCC
constexpr float kMinLead = 0.08F;      ///< over the best depth outside the peak
constexpr float kSeen = 0.7F;          ///< NCC above which a source view observes the landmark

constexpr int kFraction = 7;  ///< fractional bits of pixel coordinates
constexpr int kOne = 1 << kFraction;
constexpr float kLevel = static_cast<float>(kOne) * kOne;  ///< scale of samples [1/gray level]

/// Gray values, zero-padded to a multiple of the lanes.
using Samples = std::array<float, kStored>;

/// Position of a patch in an image, from the centre of the first pixel: centre and steps between samples [px].
struct SweepPlace {
  float x, y, right_x, right_y, down_x, down_y;
};

/// False if part of it is outside the padded image.
bool sample(const SweepImage& image, const SweepPlace& place, Samples& out) {
  const float reach_x = kRadius * (std::abs(place.right_x) + std::abs(place.down_x)) + 1.0F;
  const float reach_y = kRadius * (std::abs(place.right_y) + std::abs(place.down_y)) + 1.0F;
  if (!(reach_x < SweepImage::kMargin && place.y - reach_y > -SweepImage::kBorder &&
        place.y + reach_y < static_cast<float>(image.height() + SweepImage::kBorder - 1))) {
    return false;
  }
  constexpr int kBits = 16;
  const auto fixed = [](float v) { return static_cast<int>(v * (1 << kBits)); };
  const int right_x = fixed(place.right_x);
  const int right_y = fixed(place.right_y);
  const int down_x = fixed(place.down_x);
  const int down_y = fixed(place.down_y);
  int row_x = fixed(place.x + SweepImage::kMargin) - kRadius * (right_x + down_x);
  int row_y = fixed(place.y + SweepImage::kBorder) - kRadius * (right_y + down_y);
  const std::uint8_t* const origin = image.pixel(-SweepImage::kMargin, -SweepImage::kBorder);
  const int stride = image.stride();
  std::size_t i = 0;
  for (int row = 0; row < kSide; ++row, row_x += down_x, row_y += down_y) {
    int x = row_x;
    int y = row_y;
    for (int column = 0; column < kSide; ++column, x += right_x, y += right_y) {
      const std::uint8_t* const at = origin + static_cast<std::ptrdiff_t>(y >> kBits) * stride + (x >> kBits);
      const int across = (x >> (kBits - kFraction)) & (kOne - 1);
      const int down = (y >> (kBits - kFraction)) & (kOne - 1);
      const int upper = (at[0] << kFraction) + (at[1] - at[0]) * across;
      const int lower = (at[stride] << kFraction) + (at[stride + 1] - at[stride]) * across;
      out[i++] = static_cast<float>((upper << kFraction) + (lower - upper) * down);
    }
  }
  return true;
}

constexpr float kMinSquares = kMinDeviation * kMinDeviation * kLevel * kLevel * kSamples;

/// Normalises to zero mean and unit norm; false without texture.
bool normalise(Samples& samples) {
  float mean = 0.0F;
  for (int i = 0; i < kSamples; ++i) mean += samples[static_cast<std::size_t>(i)] / kSamples;
  float squares = 0.0F;
  for (int i = 0; i < kSamples; ++i) {
    float& value = samples[static_cast<std::size_t>(i)];
    value -= mean;
    squares += value * value;
  }
  if (squares < kMinSquares) return false;
  for (float& value : samples) value /= std::sqrt(squares);
  return true;
}

/// Correlation of a normalised patch with raw samples; 0 without texture.
float correlation(const Samples& patch, const Samples& samples) {
  std::array<float, kLanes> sums{};
  std::array<float, kLanes> squares{};
  std::array<float, kLanes> products{};
  for (std::size_t i = 0; i < kStored; i += kLanes) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const float value = samples[i + lane];
      sums[lane] += value;
      squares[lane] += value * value;
      products[lane] += value * patch[i + lane];
    }
  }
  const float sum = (sums[0] + sums[1]) + (sums[2] + sums[3]);
  const float rest = (squares[0] + squares[1]) + (squares[2] + squares[3]) - sum * sum / kSamples;
  if (rest < kMinSquares) return 0.0F;
  return ((products[0] + products[1]) + (products[2] + products[3])) / std::sqrt(rest);
}

/// Patch around a direction, on the plane facing its keyframe, warped into a view.
class Ray {
 public:
  Ray(const Eigen::Vector3d& bearing, const RigidTransform& view_from_ref, int width)
      : scale_(static_cast<float>(width / (2.0 * kernels::kPi))), middle_x_(0.5F * static_cast<float>(width) - 0.5F) {
    const Eigen::Vector3d right = Eigen::Vector3d::UnitY().cross(bearing).normalized();
    const double step = kSpacing * 2.0 * kernels::kPi / width;
    const Eigen::Matrix3d& turn = view_from_ref.rotation;
    bearing_ = (turn * bearing).cast<float>();
    right_ = (step * (turn * right)).cast<float>();
    down_ = (step * (turn * bearing.cross(right))).cast<float>();
    shift_ = view_from_ref.translation.cast<float>();
  }

  SweepPlace at(float inverse_depth, int height) const {
    const Eigen::Vector3f p = bearing_ + inverse_depth * shift_;
    const float across = p.x() * p.x() + p.z() * p.z() + 1e-12F;
    const float flat = std::sqrt(across);
    const float square = across + p.y() * p.y();
    const float by_x = scale_ / across;
    const float by_y = scale_ / (flat * square);
    SweepPlace place;
    place.x = middle_x_ + scale_ * kernels::atan2(p.x(), p.z());
    place.y = 0.5F * static_cast<float>(height) - 0.5F + scale_ * kernels::atan2(p.y(), flat);
    place.right_x = by_x * (p.z() * right_.x() - p.x() * right_.z());
    place.right_y = by_y * (right_.y() * across - p.y() * (p.x() * right_.x() + p.z() * right_.z()));
    place.down_x = by_x * (p.z() * down_.x() - p.x() * down_.z());
    place.down_y = by_y * (down_.y() * across - p.y() * (p.x() * down_.x() + p.z() * down_.z()));
    return place;
  }

 private:
  float scale_;
  float middle_x_;
  Eigen::Vector3f bearing_, right_, down_, shift_;
};

/// Size of the better two thirds of the views: the patch may be occluded in the others.
std::size_t that_count(std::size_t views) { return (2 * views + 2) / 3; }

using Scores = std::array<float, kComparedNeighbours>;

/// Inserts into `count` scores in descending order.
void insert(Scores& best, std::size_t count, float score) {
  for (std::size_t i = count; i-- > 0;) {
    if (best[i] >= score) {
      best[i + 1] = score;
      return;
    }
    best[i + 1] = best[i];
  }
  best[0] = score;
}

class DepthSearch {
 public:
  DepthSearch(const Samples& patch, double reach)
      : patch_(patch), farthest_(1.0 / (kFarthest * reach)), nearest_(1.0 / (kNearest * reach)) {}

  void add(const Ray& ray, const SweepImage& image) {
    rays_.push_back(ray);
    images_.push_back(&image);
  }

  double inverse_depth(double step) const { return farthest_ + (nearest_ - farthest_) * step / (kDepths - 1); }

  float correlation_of(std::size_t view, double inverse) const {
    Samples samples{};
    const SweepImage& image = *images_[view];
    if (!sample(image, rays_[view].at(static_cast<float>(inverse), image.height()), samples)) return 0.0F;
    return correlation(patch_, samples);
  }

  /// Mean of the best scores at a depth; any value below `least` if it cannot reach that.
  float score(int step, float least) const {
    const double inverse = inverse_depth(step);
    const std::size_t views = rays_.size();
    const std::size_t that = that_count(views);
    Scores best{};
    for (std::size_t k = 0; k < views; ++k) {
      insert(best, k, correlation_of(k, inverse));
      const std::size_t left = views - k - 1;
      if (left == 0 || left >= that) continue;
      float most = static_cast<float>(left);
      for (std::size_t i = 0; i < std::min(that - left, k + 1); ++i) most += best[i];
      if (most < least * static_cast<float>(that)) return -1.0F;
    }
    float sum = 0.0F;
    for (std::size_t i = 0; i < that; ++i) sum += best[i];
    return sum / static_cast<float>(that);
  }

  /// Returns 1 / depth if one depth fits clearly better than all others, else 0.
  double find() const {
    std::array<float, kDepths> scores{};
    for (int step = 0; step < kDepths; ++step) {
      scores[static_cast<std::size_t>(step)] = score(step, kMinScore - kMinLead);
    }
    const auto top = static_cast<int>(std::max_element(scores.begin(), scores.end()) - scores.begin());
    const auto at = [&](int step) { return scores[static_cast<std::size_t>(step)]; };
    if (at(top) < kMinScore || top == 0 || top == kDepths - 1) return 0.0;
    for (int step = 0; step < kDepths; ++step) {
      if (std::abs(step - top) > kPeakReach && at(step) > at(top) - kMinLead) return 0.0;
    }
    const float before = score(top - 1, -1.0F);
    const float after = score(top + 1, -1.0F);
    const float curvature = before - 2.0F * at(top) + after;
    const float shift = curvature < 0.0F ? 0.5F * (before - after) / curvature : 0.0F;
    return inverse_depth(top + static_cast<double>(std::clamp(shift, -0.5F, 0.5F)));
  }

 private:
  const Samples& patch_;
  double farthest_;
  double nearest_;
  std::vector<Ray> rays_;
  std::vector<const SweepImage*> images_;
};

cv::Mat gray_of(ImageView<const Rgb> image) {
  cv::Mat gray(image.height, image.width, CV_8UC1);
  for (int y = 0; y < image.height; ++y) {
    auto* const row = gray.ptr<std::uint8_t>(y);
    for (int x = 0; x < image.width; ++x) {
      const Rgb c = image(x, y);
      row[x] = static_cast<std::uint8_t>((77 * c.r + 150 * c.g + 29 * c.b) >> 8);
    }
  }
  return gray;
}

/// Pixels at which a patch does not touch the mask; empty = all.
cv::Mat room_in(ImageView<const std::uint8_t> mask, const cv::Size& size) {
  if (mask.empty()) return {};
  cv::Mat used(mask.height, mask.width, CV_8UC1);
  for (int y = 0; y < mask.height; ++y) {
    auto* const row = used.ptr<std::uint8_t>(y);
    for (int x = 0; x < mask.width; ++x) row[x] = mask(x, y) != 0 ? 255 : 0;
  }
  cv::Mat room;
  cv::resize(used, room, size, 0.0, 0.0, cv::INTER_NEAREST);
  cv::erode(room, room, cv::Mat::ones(2 * kSide, 2 * kSide, CV_8UC1));
  return room;
}

std::vector<Eigen::Vector2f> corners_of(const cv::Mat& gray, const cv::Mat& room) {
  cv::Mat strength;
  cv::cornerMinEigenVal(gray, strength, 5);
  std::vector<Eigen::Vector2f> corners;
  const int border = static_cast<int>(std::ceil(gray.rows * (0.5 - kMaxLatitude / kernels::kPi)));
  for (int top = border; top + kCell <= gray.rows - border; top += kCell) {
    for (int left = 0; left + kCell <= gray.cols; left += kCell) {
      float best = 0.0F;
      Eigen::Vector2i at(-1, -1);
      for (int y = top; y < top + kCell; ++y) {
        for (int x = left; x < left + kCell; ++x) {
          if (strength.at<float>(y, x) <= best || (!room.empty() && room.at<std::uint8_t>(y, x) == 0)) continue;
          best = strength.at<float>(y, x);
          at = {x, y};
        }
      }
      if (at.x() >= 0) corners.emplace_back(static_cast<float>(at.x()) + 0.5F, static_cast<float>(at.y()) + 0.5F);
    }
  }
  return corners;
}

}  // namespace

SweepImage::SweepImage(ImageView<const Rgb> image, ImageView<const std::uint8_t> mask)
    : width_(std::min(kSweepWidth, image.width)), height_(std::max(2, width_ / 2)) {
  cv::Mat gray;
  const cv::Size size(width_, height_);
  cv::resize(gray_of(image), gray, size, 0.0, 0.0, cv::INTER_AREA);
  corners_ = corners_of(gray, room_in(mask, size));
  gray_.reserve(static_cast<std::size_t>(stride()) * static_cast<std::size_t>(height_ + 2 * kBorder));
  for (int y = -kBorder; y < height_ + kBorder; ++y) {
    const auto* const row = gray.ptr<std::uint8_t>(std::clamp(y, 0, height_ - 1));
    for (int x = -kMargin; x < width_ + kMargin; ++x) gray_.push_back(row[(x + kMargin * width_) % width_]);
  }
}

PatchSweep::PatchSweep(std::vector<SweepView> views) : views_(std::move(views)) {
  for (const SweepView& view : views_) centers_.push_back(view.cam_from_world.center());
}

std::size_t PatchSweep::look(std::size_t i, std::size_t first, std::size_t stride,
                             std::vector<SweepPoint>& found) const {
  const std::vector<std::size_t> neighbours = neighbours_of(i);
  if (neighbours.empty()) return 0;
  const SweepView& reference = views_[i];
  const SweepImage& image = *reference.image;
  const double reach = distance(i, neighbours.front());
  const RigidTransform world_from_ref = reference.cam_from_world.inverse();
  std::vector<RigidTransform> from_reference;
  for (const std::size_t k : neighbours) from_reference.push_back(views_[k].cam_from_world * world_from_ref);
  std::size_t patches = 0;
  for (std::size_t at = first; at < image.corners().size(); at += stride) {
    const Eigen::Vector3d bearing =
        bearing_from_pixel(image.corners()[at].cast<double>(), image.width(), image.height());
    Samples patch{};
    if (!sample(image, Ray(bearing, {}, image.width()).at(0.0F, image.height()), patch) || !normalise(patch)) continue;
    ++patches;
    DepthSearch search(patch, reach);
    for (std::size_t k = 0; k < neighbours.size(); ++k) {
      const SweepImage& other = *views_[neighbours[k]].image;
      search.add(Ray(bearing, from_reference[k], other.width()), other);
    }
    const double inverse = search.find();
    if (!(inverse > 0.0)) continue;
    SweepPoint one{world_from_ref * (bearing / inverse), {i}};
    for (std::size_t k = 0; k < neighbours.size(); ++k) {
      if (search.correlation_of(k, inverse) >= kSeen) one.views.push_back(neighbours[k]);
    }
    if (one.views.size() > 1) found.push_back(std::move(one));
  }
  return patches;
}

/// Nearest other positions, the farthest first, since it excludes most depths.
std::vector<std::size_t> PatchSweep::neighbours_of(std::size_t i) const {
  std::vector<std::pair<double, std::size_t>> others;
  for (std::size_t k = 0; k < views_.size(); ++k) {
    if (k != i && distance(i, k) > 0.0) others.emplace_back(distance(i, k), k);
  }
  const auto last = others.begin() + static_cast<std::ptrdiff_t>(std::min(kComparedNeighbours, others.size()));
  std::partial_sort(others.begin(), last, others.end());
  std::vector<std::size_t> result;
  for (auto it = last; it != others.begin();) result.push_back((--it)->second);
  return result;
}

}  // namespace pmsp::io
