// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/calibration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "cpu/executor_impl.h"
#include "equirect.h"
#include "pmsp/camera.h"
#include "sphere/area_resize.h"

namespace pmsp {
namespace {

constexpr int kWidth = RigMaskEstimator::kWidth;
constexpr int kHeight = kWidth / 2;
constexpr std::size_t kPixels = static_cast<std::size_t>(kWidth) * kHeight;
constexpr float kPixelsPerRadian = static_cast<float>(kWidth / (2.0 * kernels::kPi));

constexpr std::array<std::size_t, 4> kSteps{1, 2, 3, 5};  ///< distances of the keyframes of a pair
constexpr float kMinMotion = 4.0F;                        ///< minimum motion of the world between two keyframes [px]
constexpr float kSameAnyway = 1e9F;                       ///< similarity in case of less motion
constexpr float kMinGradient = 3.0F;                      ///< RMS of a window [gray levels / px]
constexpr int kWindowRadius = 2;                          ///< of a window [px]
constexpr float kSame = 0.5F;                             ///< minimum agreement of equal gradients
constexpr float kOther = 0.3F;                            ///< ... maximum of different gradients
constexpr float kMinCosLatitude = 0.1F;

constexpr double kNearShare = 0.25;  ///< quantile of landmark distances assumed for the largest motion
constexpr double kFarShare = 0.9;    ///< ... for the smallest motion, times
constexpr double kFarFactor = 1.5;
constexpr std::size_t kFewestRigLandmarks = 10;
constexpr float kHorizon = 0.2F;   ///< sine of the depression, below which surfaces may be infinitely far
constexpr float kInfinity = 1e6F;  ///< factor on the distance of landmarks

constexpr int kFewestPairs = 10;
constexpr float kCertain = 0.7F;          ///< minimum share of pairs without motion, of a rig
constexpr float kLikely = 0.4F;           ///< ... connected with such pixels
constexpr double kMinRegionShare = 1e-3;  ///< minimum share of the sphere, of a connected region
constexpr int kGap = 4;                   ///< closed between regions [px]
constexpr float kClosed = 0.6F;           ///< minimum share of rig in a ring around a pole
constexpr float kHalfClosed = 0.25F;      ///< ... near the pole, with little world
constexpr float kSmallCap = 0.42F;        ///< sine of the radius around a pole
constexpr int kMargin = 1;                ///< added around the rig [px]

constexpr std::size_t kBands = 8;  ///< of the lower hemisphere

/// `down`: sine of the angle below the horizon, 0 to 1.
std::size_t band_of(float down) {
  const double share = std::asin(std::min(down, 1.0F)) / (0.5 * kernels::kPi);
  return std::min(kBands - 1, static_cast<std::size_t>(share * kBands));
}

double quantile(std::vector<double>& values, double share) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

using PixelValues = std::vector<float>;  ///< kPixels

struct Directions {
  std::vector<Eigen::Vector3f> bearing;  ///< by pixel
  std::vector<float> cos_latitude;       ///< by row
};

const Directions& directions() {
  static const Directions all = [] {
    Directions d;
    for (int y = 0; y < kHeight; ++y) {
      const double lat = (0.5 - (y + 0.5) / kHeight) * kernels::kPi;
      d.cos_latitude.push_back(static_cast<float>(std::cos(lat)));
      for (int x = 0; x < kWidth; ++x)
        d.bearing.push_back(bearing_from_pixel({x + 0.5, y + 0.5}, kWidth, kHeight).cast<float>());
    }
    return d;
  }();
  return all;
}

/// Means of windows; columns wrap around, rows end at the borders.
void box_filter(PixelValues& field) {
  PixelValues sums(kPixels);
  for (int y = 0; y < kHeight; ++y) {
    const float* const from = field.data() + static_cast<std::ptrdiff_t>(y) * kWidth;
    float* const to = sums.data() + static_cast<std::ptrdiff_t>(y) * kWidth;
    for (int x = 0; x < kWidth; ++x) {
      float sum = 0.0F;
      for (int i = -kWindowRadius; i <= kWindowRadius; ++i) sum += from[(x + i + kWidth) % kWidth];
      to[x] = sum;
    }
  }
  for (int y = 0; y < kHeight; ++y) {
    const int first = std::max(0, y - kWindowRadius), last = std::min(kHeight - 1, y + kWindowRadius);
    float* const to = field.data() + static_cast<std::ptrdiff_t>(y) * kWidth;
    std::fill(to, to + kWidth, 0.0F);
    for (int row = first; row <= last; ++row) {
      const float* const from = sums.data() + static_cast<std::ptrdiff_t>(row) * kWidth;
      for (int x = 0; x < kWidth; ++x) to[x] += from[x];
    }
    const float scale = 1.0F / static_cast<float>((last - first + 1) * (2 * kWindowRadius + 1));
    for (int x = 0; x < kWidth; ++x) to[x] *= scale;
  }
}

struct Gradients {
  PixelValues right, down;  ///< [gray levels / px of the equator]
};

/// Content of a pixel's window in a pair of keyframes.
enum Shows : std::uint8_t { kNothing, kMotion, kNoMotion };

enum class Kind : std::uint8_t { kUnknown, kWorld, kLikelyRig, kRig };

using Kinds = std::vector<Kind>;
using Flags = std::vector<std::uint8_t>;

/// Returns the solid angle of a pixel as a share of the sphere.
double pixel_solid_angle(std::size_t pixel) {
  return directions().cos_latitude[pixel / kWidth] * kernels::kPi / (2.0 * kPixels);
}

/// Returns connected regions of likely pixels of at least kMinRegionShare that contain a certain one.
Flags regions_of(const Kinds& kinds) {
  Flags kept(kPixels, 0), seen(kPixels, 0);
  for (std::size_t start = 0; start < kPixels; ++start) {
    if (kinds[start] != Kind::kRig || seen[start] != 0) continue;
    std::vector<std::size_t> region{start};
    seen[start] = 1;
    double share = 0.0;
    for (std::size_t next = 0; next < region.size(); ++next) {
      share += pixel_solid_angle(region[next]);
      const int x = static_cast<int>(region[next] % kWidth), y = static_cast<int>(region[next] / kWidth);
      for (int j = std::max(0, y - 1); j <= std::min(kHeight - 1, y + 1); ++j) {
        for (int i = x - 1; i <= x + 1; ++i) {
          const auto at = static_cast<std::size_t>(j) * kWidth + static_cast<std::size_t>((i + kWidth) % kWidth);
          if (seen[at] != 0 || kinds[at] < Kind::kLikelyRig) continue;
          seen[at] = 1;
          region.push_back(at);
        }
      }
    }
    if (share < kMinRegionShare) continue;
    for (const std::size_t at : region) kept[at] = 1;
  }
  return kept;
}

/// Fills columns from flagged pixels to the pole of their hemisphere, except pixels with motion, and everything inside
/// a ring around the pole that is mostly rig; near the pole less rig suffices if there is little world.
void fill_to_poles(Flags& flags, const Kinds& kinds) {
  for (const int step : {1, -1}) {
    std::vector<std::uint8_t> inside(kWidth, 0);
    bool is_cap = false;
    for (int y = step > 0 ? kHeight / 2 : kHeight / 2 - 1; y >= 0 && y < kHeight; y += step) {
      const auto row = static_cast<std::ptrdiff_t>(y) * kWidth;
      for (int x = 0; x < kWidth; ++x) {
        const auto at = static_cast<std::size_t>(row + x);
        std::uint8_t& is_inside = inside[static_cast<std::size_t>(x)];
        is_inside = flags[at] != 0 || is_cap || (is_inside != 0 && kinds[at] != Kind::kWorld) ? 1 : 0;
        flags[at] = is_inside;
      }
      const auto rig = static_cast<float>(std::count(inside.begin(), inside.end(), 1));
      const auto world =
          static_cast<float>(std::count(kinds.begin() + row, kinds.begin() + row + kWidth, Kind::kWorld));
      const bool is_near_pole = directions().cos_latitude[static_cast<std::size_t>(y)] < kSmallCap;
      is_cap = is_cap || rig > kClosed * kWidth ||
               (is_near_pole && rig > kHalfClosed * kWidth && rig > kClosed * (rig + world));
    }
  }
}

/// Dilates flags of `value` by an angle [px of the equator]; with 0, erodes.
Flags dilate(const Flags& flags, int radius, std::uint8_t value = 1) {
  Flags rows = flags;
  for (int y = 0; y < kHeight; ++y) {
    const float across =
        static_cast<float>(radius) / std::max(directions().cos_latitude[static_cast<std::size_t>(y)], kMinCosLatitude);
    const int reach = std::min(kWidth / 2, static_cast<int>(std::lround(across)));
    for (int x = 0; x < kWidth; ++x) {
      if (flags[static_cast<std::size_t>(y) * kWidth + static_cast<std::size_t>(x)] != value) continue;
      for (int i = x - reach; i <= x + reach; ++i) {
        rows[static_cast<std::size_t>(y) * kWidth + static_cast<std::size_t>((i + kWidth) % kWidth)] = value;
      }
    }
  }
  Flags grown = rows;
  for (int y = 0; y < kHeight; ++y) {
    for (int j = std::max(0, y - radius); j <= std::min(kHeight - 1, y + radius); ++j) {
      for (int x = 0; x < kWidth; ++x) {
        if (rows[static_cast<std::size_t>(j) * kWidth + static_cast<std::size_t>(x)] == value)
          grown[static_cast<std::size_t>(y) * kWidth + static_cast<std::size_t>(x)] = value;
      }
    }
  }
  return grown;
}

}  // namespace

RigMask rig_mask_of(Image<std::uint8_t> mask) {
  RigMask result;
  for (std::size_t at = 0; at < kPixels; ++at) {
    if (mask.pixels()[at] == 0) result.share += pixel_solid_angle(at);
  }
  result.mask = std::move(mask);
  return result;
}

void hide_rig(const Image<std::uint8_t>& rig, Image<std::uint8_t>& mask) {
  for (int y = 0; y < mask.height() && !rig.empty(); ++y) {
    const std::uint8_t* const from = rig.row(y * rig.height() / mask.height());
    for (int x = 0; x < mask.width(); ++x) mask(x, y) = std::min(mask(x, y), from[x * rig.width() / mask.width()]);
  }
}

struct RigMaskEstimator::View {
  std::int64_t id = 0;
  std::vector<std::uint8_t> gray;  ///< kPixels
  Flags hidden;                    ///< by the mask of the keyframe; empty = none
  RigidTransform cam_from_world;
  float near = 0.0F;              ///< distance of near landmarks [map units]; 0 = too few landmarks
  std::array<float, kBands> far;  ///< distance of far landmarks by band, from the horizon to the nadir

  void take_place(const Keyframe& keyframe) {
    cam_from_world = keyframe.cam_from_world;
    std::vector<double> all;
    std::array<std::vector<double>, kBands> of_band;
    for (const Landmark& landmark : keyframe.landmarks) {
      const Eigen::Vector3d at = cam_from_world * landmark.position_world;
      all.push_back(at.norm());
      if (at.y() > 0.0) of_band[band_of(static_cast<float>(at.y() / at.norm()))].push_back(at.norm());
    }
    near = 0.0F;
    if (all.size() < kFewestRigLandmarks) return;
    near = static_cast<float>(quantile(all, kNearShare));
    float farthest = static_cast<float>(kFarFactor * quantile(all, kFarShare));
    for (std::size_t band = 0; band < kBands; ++band) {
      std::vector<double>& distances = of_band[band];
      if (distances.size() >= kFewestRigLandmarks)
        farthest = std::min(farthest, static_cast<float>(kFarFactor * quantile(distances, kFarShare)));
      far[band] = farthest;
    }
  }

  /// Sobel gradients; 0 at masked pixels.
  Gradients gradients() const {
    Gradients g{PixelValues(kPixels, 0.0F), PixelValues(kPixels, 0.0F)};
    for (int y = 0; y < kHeight; ++y) {
      const float across = 1.0F / std::max(directions().cos_latitude[static_cast<std::size_t>(y)], kMinCosLatitude);
      const int step = static_cast<int>(std::lround(across));  // about a pixel of the equator
      const float per_pixel = across / (8.0F * static_cast<float>(step));
      const auto value = [&](int x, int row) {
        const int j = std::clamp(row, 0, kHeight - 1);
        return static_cast<float>(
            gray[static_cast<std::size_t>(j) * kWidth + static_cast<std::size_t>((x + kWidth) % kWidth)]);
      };
      for (int x = 0; x < kWidth; ++x) {
        const auto at = static_cast<std::size_t>(y) * kWidth + static_cast<std::size_t>(x);
        if (!hidden.empty() && hidden[at] != 0) continue;
        const auto column = [&](int i) { return value(i, y - 1) + 2.0F * value(i, y) + value(i, y + 1); };
        const auto row = [&](int j) { return value(x - step, j) + 2.0F * value(x, j) + value(x + step, j); };
        g.right[at] = (column(x + step) - column(x - step)) * per_pixel;
        g.down[at] = (row(y + 1) - row(y - 1)) / 8.0F;
      }
    }
    return g;
  }

  /// Returns Shows for each pixel of this keyframe.
  Flags compare(const View& other, const Gradients& here, const Gradients& there) const {
    const Eigen::Matrix3f turn = (other.cam_from_world.rotation * cam_from_world.rotation.transpose()).cast<float>();
    const Eigen::Vector3f shift =
        (other.cam_from_world.translation -
         other.cam_from_world.rotation * cam_from_world.rotation.transpose() * cam_from_world.translation)
            .cast<float>();
    const Directions& d = directions();
    const auto agreement = [](const Gradients& a, std::size_t i, const Gradients& b, std::size_t k) {
      return a.right[i] * b.right[k] + a.down[i] * b.down[k];
    };
    // Similarity, in this keyframe, of a window and its displacement by the motion of the world.
    const auto alike = [&](std::size_t at, float depth) {
      const Eigen::Vector3f moved = (turn * d.bearing[at] * depth + shift).normalized();
      if (kPixelsPerRadian * (moved - d.bearing[at]).norm() < kMinMotion) return kSameAnyway;
      const int to = kernels::pixel_index(kernels::Vec3<float>{moved.x(), moved.y(), moved.z()}, kWidth, kHeight);
      return agreement(here, at, here, static_cast<std::size_t>(to));
    };
    PixelValues product(kPixels), greater(kPixels);
    for (std::size_t at = 0; at < kPixels; ++at) {
      greater[at] = std::max(agreement(here, at, here, at), agreement(there, at, there, at));
      product[at] = agreement(here, at, there, at);
    }
    for (PixelValues* field : {&product, &greater}) box_filter(*field);
    const auto has_texture = [&](std::size_t at) { return greater[at] >= kMinGradient * kMinGradient; };
    PixelValues around(kPixels);  // above 0 in windows of pixels with texture
    for (std::size_t at = 0; at < kPixels; ++at) around[at] = has_texture(at) ? 1.0F : 0.0F;
    box_filter(around);
    PixelValues nearest(kPixels), farthest(kPixels);
    for (std::size_t at = 0; at < kPixels; ++at) {
      if (around[at] == 0.0F) continue;
      nearest[at] = alike(at, near);
      const float down = d.bearing[at].y();
      farthest[at] = alike(at, down < kHorizon ? kInfinity * near : far[band_of(down)]);
    }
    for (PixelValues* field : {&nearest, &farthest}) box_filter(*field);
    Flags shows(kPixels, kNothing);
    for (std::size_t at = 0; at < kPixels; ++at) {
      if (!has_texture(at) || std::max(nearest[at], farthest[at]) > kOther * greater[at]) continue;
      shows[at] = product[at] > kSame * greater[at] ? kNoMotion : kMotion;
    }
    return shows;
  }
};

RigMaskEstimator::RigMaskEstimator() = default;
RigMaskEstimator::~RigMaskEstimator() = default;
RigMaskEstimator::RigMaskEstimator(RigMaskEstimator&&) noexcept = default;
RigMaskEstimator& RigMaskEstimator::operator=(RigMaskEstimator&&) noexcept = default;

void RigMaskEstimator::add(const Keyframe& keyframe, const Executor& executor) {
  auto view = std::make_unique<View>();
  view->id = keyframe.id;
  const Image<float> gray = area_resize_gray(keyframe.image, kWidth, kHeight, pool_of(executor));
  view->gray.reserve(kPixels);
  for (const float value : gray.pixels()) view->gray.push_back(static_cast<std::uint8_t>(std::lround(value)));
  const ImageView<const std::uint8_t>& mask = keyframe.mask;
  if (!mask.empty()) {
    view->hidden.resize(kPixels);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const bool used =
            mask(static_cast<int>(static_cast<std::int64_t>(2 * x + 1) * mask.width / (2 * kWidth)),
                 static_cast<int>(static_cast<std::int64_t>(2 * y + 1) * mask.height / (2 * kHeight))) != 0;
        view->hidden[static_cast<std::size_t>(y) * kWidth + static_cast<std::size_t>(x)] = used ? 0 : 1;
      }
    }
    view->hidden = dilate(view->hidden, kMargin);
  }
  view->take_place(keyframe);
  views_.push_back(std::move(view));
}

void RigMaskEstimator::move(const Keyframe& keyframe) {
  for (const std::unique_ptr<View>& view : views_) {
    if (view->id == keyframe.id) view->take_place(keyframe);
  }
}

void RigMaskEstimator::remove(std::int64_t keyframe_id) {
  const auto is_it = [&](const std::unique_ptr<View>& view) { return view->id == keyframe_id; };
  views_.erase(std::remove_if(views_.begin(), views_.end(), is_it), views_.end());
}

std::size_t RigMaskEstimator::bytes() const {
  std::size_t bytes = 0;
  for (const std::unique_ptr<View>& view : views_) bytes += view->gray.size() + view->hidden.size();
  return bytes;
}

RigMask RigMaskEstimator::estimate(const Executor& executor) const {
  if (views_.size() < kFewestKeyframes) return {};
  ThreadPool& pool = pool_of(executor);
  std::vector<Gradients> gradients(views_.size());
  pool.for_each(static_cast<int>(views_.size()), [&](int i) {
    gradients[static_cast<std::size_t>(i)] = views_[static_cast<std::size_t>(i)]->gradients();
  });
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (const std::size_t step : kSteps) {
    for (std::size_t i = 0; i + step < views_.size(); ++i) {
      if (views_[i]->near != 0.0F) pairs.emplace_back(i, i + step);
    }
  }
  std::vector<Flags> shown(pairs.size());
  pool.for_each(static_cast<int>(pairs.size()), [&](int number) {
    const auto [i, k] = pairs[static_cast<std::size_t>(number)];
    shown[static_cast<std::size_t>(number)] = views_[i]->compare(*views_[k], gradients[i], gradients[k]);
  });
  Kinds kinds(kPixels, Kind::kUnknown);
  pool.for_each(kHeight, [&](int row) {
    for (std::size_t at = static_cast<std::size_t>(row) * kWidth; at < static_cast<std::size_t>(row + 1) * kWidth;
         ++at) {
      int seen = 0, same = 0;
      for (const Flags& shows : shown) {
        seen += shows[at] != kNothing ? 1 : 0;
        same += shows[at] == kNoMotion ? 1 : 0;
      }
      if (seen < std::min(kFewestPairs, static_cast<int>(views_.size()) - 2)) continue;
      const float share = static_cast<float>(same) / static_cast<float>(seen);
      kinds[at] = share >= kCertain ? Kind::kRig : share >= kLikely ? Kind::kLikelyRig : Kind::kWorld;
    }
  });
  Flags rig = regions_of(kinds);
  if (std::none_of(rig.begin(), rig.end(), [](std::uint8_t it) { return it != 0; })) return {};
  rig = dilate(dilate(rig, kGap), kGap, 0);
  fill_to_poles(rig, kinds);
  rig = dilate(rig, kMargin);
  Image<std::uint8_t> mask(kWidth, kHeight, 255);
  for (std::size_t at = 0; at < kPixels; ++at) {
    if (rig[at] != 0) mask.pixels()[at] = 0;
  }
  return rig_mask_of(std::move(mask));
}

}  // namespace pmsp
