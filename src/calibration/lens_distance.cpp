// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/calibration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <numeric>
#include <optional>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "cpu/executor_impl.h"
#include "equirect.h"
#include "pmsp/camera.h"
#include "util/median_of.h"
#include "util/patch_correlation.h"

namespace pmsp {
namespace {

constexpr std::size_t kStretches = 3;
constexpr std::size_t kStretch = 8;              ///< keyframes
constexpr int kMostWidth = 1920;                 ///< of the gray images
constexpr int kTaskRows = 32;                    ///< of a gray image, per task
constexpr std::size_t kKeyframeReach = 7;        ///< keyframes on either side in which a landmark is searched
constexpr std::size_t kShares = 8;               ///< parts of a keyframe's landmarks, for as many threads
constexpr std::size_t kMostLensLandmarks = 128;  ///< per keyframe, the nearest ones: they have most parallax

constexpr int kPatchRadius = 5;  ///< of a patch [px]
constexpr int kSearch = 6;       ///< search radius [px]
constexpr int kPatchSide = 2 * kPatchRadius + 1;
constexpr int kFieldRadius = kPatchRadius + kSearch;
constexpr int kField = 2 * kFieldRadius + 1;
constexpr float kMinDeviation = 6.0F;  ///< of a patch [gray levels]
constexpr float kMinScore = 0.8F;      ///< NCC
constexpr float kMinPeak = 0.02F;      ///< minimum drop of the score one pixel beside the maximum

constexpr double kSeam = 0.06;         ///< |z| of directions below which either lens, or both, may contribute
constexpr double kMaxLatitude = 0.85;  ///< sine of the latitude
constexpr double kMinCosView = 0.5;    ///< cosine of the angle between two views of a landmark
constexpr double kMaxZoom = 2.0;       ///< ratio of the distances of a landmark

constexpr std::size_t kFewestLensLandmarks = 25;
constexpr double kMinSigmas = 5.0;
constexpr double kMinShiftPx = 0.5;

/// Observation of a landmark in a keyframe.
struct Sighting {
  std::size_t view;
  Eigen::Vector3d bearing;  ///< unit, camera frame
};

/// Squared residual of a landmark by half the lens distance h: square * h^2 + 2 * slope * h + rest.
struct Term {
  double square = 0.0, slope = 0.0, rest = 0.0;
  int equations = 0;  ///< number of equations minus unknowns
  double distance = 0.0;
  std::size_t view = 0;  ///< keyframe of the patch

  double cost(double h) const { return (square * h + 2.0 * slope) * h + rest; }
};

double solution(const std::vector<Term>& terms, const std::vector<double>& weights) {
  double square = 0.0;
  double slope = 0.0;
  for (std::size_t i = 0; i < terms.size(); ++i) {
    square += weights[i] * terms[i].square;
    slope += weights[i] * terms[i].slope;
  }
  return square > 0.0 ? -slope / square : 0.0;
}

/// Gray image with uninitialised pixels: first touched by the threads that fill it, since page faults take as long as
/// they.
class GrayImage {
 public:
  GrayImage() = default;
  GrayImage(int width, int height) : width_(width), height_(height), pixels_(new std::uint8_t[size()]) {}

  int width() const { return width_; }
  int height() const { return height_; }
  std::size_t size() const { return static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_); }
  std::uint8_t* row(int y) { return pixels_.get() + static_cast<std::ptrdiff_t>(y) * width_; }
  const std::uint8_t* row(int y) const { return pixels_.get() + static_cast<std::ptrdiff_t>(y) * width_; }

 private:
  int width_ = 0;
  int height_ = 0;
  std::unique_ptr<std::uint8_t[]> pixels_;
};

}  // namespace

struct LensDistanceEstimator::View {
  std::int64_t id = 0;
  GrayImage gray;
  Image<std::uint8_t> mask;  ///< empty = none
  RigidTransform cam_from_world;
  Eigen::Vector3d center;
  std::vector<Landmark> landmarks;  ///< nearest first

  void take_place(const Keyframe& keyframe) {
    cam_from_world = keyframe.cam_from_world;
    center = keyframe.cam_from_world.center();
    landmarks = keyframe.landmarks;
    const auto nearer = [&](const Landmark& a, const Landmark& b) {
      const double one = (a.position_world - center).squaredNorm();
      const double other = (b.position_world - center).squaredNorm();
      return one != other ? one < other : a.id < b.id;
    };
    std::sort(landmarks.begin(), landmarks.end(), nearer);
    if (landmarks.size() > kMostLensLandmarks) landmarks.resize(kMostLensLandmarks);
  }

  float at(const Eigen::Vector3f& direction) const {
    const kernels::Pixel<float> pixel =
        kernels::project<float>({direction.x(), direction.y(), direction.z()}, static_cast<float>(gray.width()),
                                static_cast<float>(gray.height()));
    const float x = pixel.x - 0.5F;
    const float y = std::clamp(pixel.y - 0.5F, 0.0F, static_cast<float>(gray.height() - 1));
    const int left = static_cast<int>(std::floor(x));
    const int top = std::min(static_cast<int>(y), gray.height() - 2);
    const float right_share = x - static_cast<float>(left);
    const float low_share = y - static_cast<float>(top);
    const auto column = [&](int of) { return (of + gray.width()) % gray.width(); };
    const auto row = [&](int of) {
      const std::uint8_t* const pixels = gray.row(of);
      const float here = pixels[column(left)];
      return here + right_share * (static_cast<float>(pixels[column(left + 1)]) - here);
    };
    const float upper = row(top);
    return upper + low_share * (row(top + 1) - upper);
  }
  bool is_used(const Eigen::Vector3d& direction) const {
    if (std::abs(direction.z()) < kSeam || std::abs(direction.y()) > kMaxLatitude) return false;
    if (mask.empty()) return true;
    const Eigen::Vector2d at = pixel_from_bearing(direction, mask.width(), mask.height());
    const int x = std::clamp(static_cast<int>(at.x()), 0, mask.width() - 1);
    return mask.row(std::clamp(static_cast<int>(at.y()), 0, mask.height() - 1))[x] != 0;
  }
};

namespace {

using LensPatch = std::array<float, kPatchSide * kPatchSide>;
constexpr int kPlaces = 2 * kSearch + 1;                          ///< offsets of a patch in a field, along each axis
constexpr int kLanes = 16;                                        ///< kPlaces, rounded up
using SearchField = std::array<float, kField * kField + kLanes>;  ///< padded, since lanes read beyond the end

/// Returns the vertex of the parabola through three values relative to the middle one, which is the largest.
float top_of(float before, float middle, float after) {
  return 0.5F * (before - after) / (before - 2.0F * middle + after);
}

/// Returns the offset of the best match of the patch from the centre of the field [px].
std::optional<Eigen::Vector2d> find(const LensPatch& patch, const SearchField& field) {
  std::array<float, kPlaces * kPlaces> scores{};
  int best = 0;
  for (int v = 0; v < kPlaces; ++v) {
    const float* const rows = field.data() + v * kField;
    std::array<float, kField> sums{};  // of columns
    std::array<float, kField> squares{};
    std::array<float, kLanes> products{};
    for (int j = 0; j < kPatchSide; ++j) {
      const float* const row = rows + j * kField;
      for (int x = 0; x < kField; ++x) {
        sums[static_cast<std::size_t>(x)] += row[x];
        squares[static_cast<std::size_t>(x)] += row[x] * row[x];
      }
      for (int i = 0; i < kPatchSide; ++i) {
        const float known = patch[static_cast<std::size_t>(j * kPatchSide + i)];
        for (int u = 0; u < kLanes; ++u) products[static_cast<std::size_t>(u)] += known * row[i + u];
      }
    }
    for (int u = 0; u < kPlaces; ++u) {
      const float sum = std::accumulate(sums.begin() + u, sums.begin() + u + kPatchSide, 0.0F);
      const float square = std::accumulate(squares.begin() + u, squares.begin() + u + kPatchSide, 0.0F);
      const float variance = square - sum * sum / static_cast<float>(patch.size());
      const int place = v * kPlaces + u;
      scores[static_cast<std::size_t>(place)] =
          products[static_cast<std::size_t>(u)] / std::sqrt(std::max(variance, 1.0F));
      if (scores[static_cast<std::size_t>(place)] > scores[static_cast<std::size_t>(best)]) best = place;
    }
  }
  const int u = best % kPlaces;
  const int v = best / kPlaces;
  const auto score = [&](int du, int dv) { return scores[static_cast<std::size_t>(best + dv * kPlaces + du)]; };
  if (score(0, 0) < kMinScore || u == 0 || v == 0 || u == kPlaces - 1 || v == kPlaces - 1) return std::nullopt;
  for (const auto& [du, dv] : {std::pair{1, 0}, {0, 1}}) {
    if (score(0, 0) - 0.5F * (score(-du, -dv) + score(du, dv)) < kMinPeak) return std::nullopt;
  }
  const Eigen::Vector2d beside(top_of(score(-1, 0), score(0, 0), score(1, 0)),
                               top_of(score(0, -1), score(0, 0), score(0, 1)));
  return beside + Eigen::Vector2d(u - kSearch, v - kSearch);
}

/// Returns the term of a landmark of unknown position from its observations. `near`: approximate position.
template <class Views>
std::optional<Term> term_of(const std::vector<Sighting>& sightings, const Views& views, const Eigen::Vector3d& near) {
  Eigen::Matrix3d places = Eigen::Matrix3d::Zero();
  Eigen::Vector3d place_center = Eigen::Vector3d::Zero();
  Eigen::Vector3d place_lens = Eigen::Vector3d::Zero();
  Term term;
  for (const Sighting& sighting : sightings) {
    const auto& view = *views[sighting.view];
    const Eigen::Matrix3d world_from_cam = view.cam_from_world.rotation.transpose();
    const Eigen::Vector3d ray = world_from_cam * sighting.bearing;
    const double weight = 1.0 / (near - view.center).squaredNorm();
    const Eigen::Matrix3d across = weight * (Eigen::Matrix3d::Identity() - ray * ray.transpose());
    const Eigen::Vector3d center = view.center - near;
    const Eigen::Vector3d lens = (sighting.bearing.z() < 0.0 ? -1.0 : 1.0) * world_from_cam.col(2);
    places += across;
    place_center += across * center;
    place_lens += across * lens;
    term.square += lens.dot(across * lens);
    term.slope += lens.dot(across * center);
    term.rest += center.dot(across * center);
  }
  const Eigen::LDLT<Eigen::Matrix3d> solver(places + 1e-9 * places.trace() * Eigen::Matrix3d::Identity());
  if (solver.info() != Eigen::Success) return std::nullopt;
  const Eigen::Vector3d by_lens = solver.solve(place_lens);
  const Eigen::Vector3d by_center = solver.solve(place_center);
  term.square -= place_lens.dot(by_lens);
  term.slope -= place_lens.dot(by_center);
  term.rest -= place_center.dot(by_center);
  term.equations = 2 * static_cast<int>(sightings.size()) - 3;
  return term;
}

}  // namespace

LensDistanceEstimator::LensDistanceEstimator() = default;
LensDistanceEstimator::~LensDistanceEstimator() = default;
LensDistanceEstimator::LensDistanceEstimator(LensDistanceEstimator&&) noexcept = default;
LensDistanceEstimator& LensDistanceEstimator::operator=(LensDistanceEstimator&&) noexcept = default;

void LensDistanceEstimator::add(const Keyframe& keyframe, const Executor* executor) {
  auto view = std::make_unique<View>();
  const ImageView<const Rgb>& image = keyframe.image;
  const int box = std::max(1, (image.width + kMostWidth - 1) / kMostWidth);
  view->gray = GrayImage(image.width / box, image.height / box);
  const auto reduce_row = [&](int y) {
    std::uint8_t* const to = view->gray.row(y);
    if (box == 1) {
      std::transform(image.row(y), image.row(y) + view->gray.width(), to,
                     [](const Rgb& pixel) { return static_cast<std::uint8_t>((pixel.r + 2 * pixel.g + pixel.b) / 4); });
      return;
    }
    for (int x = 0; x < view->gray.width(); ++x) {
      int sum = 0;
      for (int j = 0; j < box; ++j) {
        const Rgb* const from = image.row(y * box + j) + static_cast<std::ptrdiff_t>(x) * box;
        for (int i = 0; i < box; ++i) sum += from[i].r + 2 * from[i].g + from[i].b;
      }
      to[x] = static_cast<std::uint8_t>(sum / (4 * box * box));
    }
  };
  const auto reduce_rows = [&](int band) {
    for (int y = band * kTaskRows; y < std::min((band + 1) * kTaskRows, view->gray.height()); ++y) reduce_row(y);
  };
  for_each(executor, (view->gray.height() + kTaskRows - 1) / kTaskRows, reduce_rows);
  if (!keyframe.mask.empty()) {
    view->mask = Image<std::uint8_t>(keyframe.mask.width, keyframe.mask.height);
    for (int y = 0; y < view->mask.height(); ++y) {
      std::copy_n(keyframe.mask.row(y), view->mask.width(), view->mask.row(y));
    }
  }
  view->id = keyframe.id;
  view->take_place(keyframe);
  views_.push_back(std::move(view));
}

void LensDistanceEstimator::move(const Keyframe& keyframe) {
  for (const std::unique_ptr<View>& view : views_) {
    if (view->id == keyframe.id) view->take_place(keyframe);
  }
}

void LensDistanceEstimator::remove(std::int64_t keyframe_id) {
  const auto is_it = [&](const std::unique_ptr<View>& view) { return view->id == keyframe_id; };
  views_.erase(std::remove_if(views_.begin(), views_.end(), is_it), views_.end());
}

std::size_t LensDistanceEstimator::bytes() const {
  std::size_t bytes = 0;
  for (const std::unique_ptr<View>& view : views_) bytes += view->gray.size() + view->mask.size();
  return bytes;
}

LensDistance LensDistanceEstimator::estimate(const Executor& executor) const {
  std::vector<std::vector<Term>> found(views_.size() * kShares);
  pool_of(executor).for_each(static_cast<int>(found.size()), [&](int number) {
    const std::size_t own = static_cast<std::size_t>(number) / kShares;
    const View& view = *views_[own];
    const double step = 2.0 * kernels::kPi / view.gray.width();
    for (std::size_t at = static_cast<std::size_t>(number) % kShares; at < view.landmarks.size(); at += kShares) {
      const Landmark& landmark = view.landmarks[at];
      const Eigen::Vector3d here = view.cam_from_world * landmark.position_world;
      const double depth = here.norm();
      const Eigen::Vector3d bearing = here / depth;
      if (!(depth > 0.0) || !view.is_used(bearing)) continue;
      const Eigen::Vector3d right = step * Eigen::Vector3d(bearing.z(), 0.0, -bearing.x()).normalized();
      const Eigen::Vector3d down = bearing.cross(right);
      std::optional<LensPatch> patch;
      std::vector<Sighting> sightings{{own, bearing}};
      for (std::size_t k = own > kKeyframeReach ? own - kKeyframeReach : 0;
           k < std::min(views_.size(), own + kKeyframeReach + 1); ++k) {
        const View& other = *views_[k];
        const Eigen::Vector3d there = other.cam_from_world * landmark.position_world;
        const double zoom = there.norm() / depth;
        if (k == own || !(zoom > 1.0 / kMaxZoom && zoom < kMaxZoom) || !other.is_used(there.normalized())) continue;
        const Eigen::Matrix3d turn = other.cam_from_world.rotation * view.cam_from_world.rotation.transpose();
        if (there.normalized().dot(turn * bearing) < kMinCosView) continue;
        if (!patch) {
          patch.emplace();
          float* to = patch->data();
          for (int j = -kPatchRadius; j <= kPatchRadius; ++j) {
            for (int i = -kPatchRadius; i <= kPatchRadius; ++i)
              *to++ = view.at((bearing + i * right + j * down).cast<float>());
          }
          if (!normalise(*patch, kMinDeviation)) break;
        }
        // The patch is taken as part of a surface perpendicular to the ray.
        const Eigen::Vector3f center = (there / depth).cast<float>();
        const Eigen::Vector3f along = (turn * right).cast<float>();
        const Eigen::Vector3f across = (turn * down).cast<float>();
        SearchField field{};
        float* to = field.data();
        for (int j = -kFieldRadius; j <= kFieldRadius; ++j) {
          for (int i = -kFieldRadius; i <= kFieldRadius; ++i) {
            *to++ = other.at(center + static_cast<float>(i) * along + static_cast<float>(j) * across);
          }
        }
        const std::optional<Eigen::Vector2d> offset = find(*patch, field);
        if (!offset) continue;
        const Eigen::Vector3d direction = there / depth + turn * (offset->x() * right + offset->y() * down);
        sightings.push_back({k, direction.normalized()});
      }
      const auto is_forward = [](const Sighting& sighting) { return sighting.bearing.z() > 0.0; };
      const auto forward = std::count_if(sightings.begin(), sightings.end(), is_forward);
      if (sightings.size() < 3 || forward == 0 || forward == static_cast<std::ptrdiff_t>(sightings.size())) continue;
      std::optional<Term> term = term_of(sightings, views_, landmark.position_world);
      if (!term) continue;
      term->distance = depth;
      term->view = own;
      found[static_cast<std::size_t>(number)].push_back(*term);
    }
  });
  std::vector<Term> terms;
  for (const std::vector<Term>& of_share : found) terms.insert(terms.end(), of_share.begin(), of_share.end());
  LensDistance result;
  result.landmarks = static_cast<std::int64_t>(terms.size());
  if (terms.size() < kFewestLensLandmarks) return result;

  // Outliers, from wrong matches or landmarks that are two points, get less weight.
  std::vector<double> weights(terms.size(), 1.0);
  double half = 0.0;
  for (int round = 0; round < 10; ++round) {
    half = solution(terms, weights);
    std::vector<double> costs;
    for (const Term& term : terms) costs.push_back(std::max(term.cost(half), 0.0) / term.equations);
    std::vector<double> sorted = costs;
    const double usual = median(sorted) + 1e-12;
    for (std::size_t i = 0; i < terms.size(); ++i) {
      const double excess = costs[i] / (4.0 * usual);
      weights[i] = 1.0 / ((1.0 + excess) * (1.0 + excess));
    }
  }
  // The error is estimated from differences of keyframes: landmarks of a keyframe share the error of its pose.
  std::map<std::size_t, std::pair<double, double>> of_views;
  double square = 0.0;
  std::vector<double> distances;
  for (std::size_t i = 0; i < terms.size(); ++i) {
    auto& [own_square, own_slope] = of_views[terms[i].view];
    own_square += weights[i] * terms[i].square;
    own_slope += weights[i] * terms[i].slope;
    square += weights[i] * terms[i].square;
    distances.push_back(terms[i].distance);
  }
  double spread = 0.0;
  for (const auto& [view, own] : of_views) spread += (own.second + half * own.first) * (own.second + half * own.first);
  result.distance = 2.0 * half;
  result.standard_error = 2.0 * std::sqrt(spread) / square;
  result.shift_px = std::abs(half) / median(distances) * kMostWidth / (2.0 * kernels::kPi);
  result.significant = std::abs(result.distance) > kMinSigmas * result.standard_error && result.shift_px > kMinShiftPx;
  return result;
}

std::vector<std::int64_t> keyframes_for_lens_distance(const std::vector<std::int64_t>& keyframe_ids) {
  if (keyframe_ids.size() <= kStretches * kStretch) return keyframe_ids;
  std::vector<std::int64_t> result;
  for (std::size_t k = 0; k < kStretches; ++k) {
    const std::size_t first = (keyframe_ids.size() - kStretch) * k / (kStretches - 1);
    result.insert(result.end(), keyframe_ids.begin() + static_cast<std::ptrdiff_t>(first),
                  keyframe_ids.begin() + static_cast<std::ptrdiff_t>(first + kStretch));
  }
  return result;
}

}  // namespace pmsp
