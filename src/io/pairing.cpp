// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "pmsp/camera.h"
#include "pmsp/error.h"
#include "pmsp/io/image_source.h"

namespace pmsp {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr int kRadius = 4;  ///< patches are 9 x 9 samples
constexpr int kSide = 2 * kRadius + 1;
constexpr int kSamples = kSide * kSide;
constexpr double kSpacingPx = 2.0;   ///< between samples, in pixels of the camera
constexpr std::size_t kHistory = 4;  ///< keyframes whose patches are kept
/// Measured on a synthetic and a real mission, 1920 and 640 px wide: 84 to 94 % of the patches of the right images
/// reach this correlation, 29 to 48 % with images one frame off (0.12 m of flight), 9 to 30 % with images of other
/// keyframes.
constexpr float kAlikeNcc = 0.7F;
constexpr double kFlatDeviation =
    1.5;  ///< gray levels; a keypoint lies on a corner, so a flatter patch is no keypoint's
constexpr double kMaxScaleChange = 2.0;  ///< of the distance, beyond which a patch is not resampled
constexpr int kConclusive = 200;
constexpr double kMinAgreement = 0.5;
constexpr int kExpectedPercent = 75;

struct Sighting {
  std::int64_t landmark_id = 0;
  int axis = 0;           ///< world axis that the patch's rows follow, the same in all sightings of a chain
  double distance = 0.0;  ///< at which one sample is kSpacingPx wide [scene units]
  bool flat = false;
  std::array<float, kSamples> patch;  ///< zero mean, unit norm
};

struct Frame {
  std::vector<Sighting> sightings;  ///< ascending landmark_id

  const Sighting* find(std::int64_t landmark_id) const {
    const auto at = std::lower_bound(sightings.begin(), sightings.end(), landmark_id,
                                     [](const Sighting& s, std::int64_t id) { return s.landmark_id < id; });
    return at != sightings.end() && at->landmark_id == landmark_id ? &*at : nullptr;
  }
};

/// Bilinear gray value; `x`, `y` in pixels from the image's corner. x wraps, y is clamped.
double sample_gray(ImageView<const Rgb> image, double x, double y) {
  const double fx = x - 0.5;
  const double fy = std::clamp(y - 0.5, 0.0, image.height - 1.0);
  const double x_floor = std::floor(fx);
  const auto y0 = static_cast<int>(fy);
  const int y1 = std::min(y0 + 1, image.height - 1);
  auto x0 = static_cast<int>(std::fmod(x_floor, image.width));
  if (x0 < 0) x0 += image.width;
  const int x1 = x0 + 1 < image.width ? x0 + 1 : 0;
  const auto gray = [&](int px, int py) {
    const Rgb c = image(px, py);
    return 0.299 * c.r + 0.587 * c.g + 0.114 * c.b;
  };
  const double ax = fx - x_floor;
  const double ay = fy - y0;
  return (1.0 - ay) * ((1.0 - ax) * gray(x0, y0) + ax * gray(x1, y0)) +
         ay * ((1.0 - ax) * gray(x0, y1) + ax * gray(x1, y1));
}

/// Shifts values to zero mean and scales them to unit norm; false when there is nothing to see.
bool normalise(std::array<float, kSamples>& patch) {
  double sum = 0.0;
  double squares = 0.0;
  for (const float v : patch) {
    sum += v;
    squares += static_cast<double>(v) * v;
  }
  const double mean = sum / kSamples;
  const double variance = squares / kSamples - mean * mean;
  if (!(variance > kFlatDeviation * kFlatDeviation)) return false;
  const double scale = 1.0 / std::sqrt(variance * kSamples);
  for (float& v : patch) v = static_cast<float>((v - mean) * scale);
  return true;
}

/// How a patch that is fixed to the world lies in the image: pixels per sample along its two axes. So turning,
/// approaching and the panorama's stretch near the poles don't make sightings of one landmark look different.
struct PatchAxes {
  Eigen::Vector2d u, v;
};

bool patch_axes(const RigidTransform& cam_from_world, const Eigen::Vector3d& to_landmark, int axis, double sample_rad,
                int width, int height, PatchAxes& out) {
  const Eigen::Vector3d direction = to_landmark.normalized();
  const Eigen::Vector3d u = Eigen::Vector3d::Unit(axis).cross(direction).normalized();
  const Eigen::Vector3d v = direction.cross(u);
  const double reach = sample_rad * kRadius;
  const Eigen::Matrix3d& rotation = cam_from_world.rotation;
  const Eigen::Vector2d centre = pixel_from_bearing(rotation * direction, width, height);
  const auto step = [&](const Eigen::Vector3d& tangent) {
    Eigen::Vector2d d = pixel_from_bearing(rotation * (direction + reach * tangent), width, height) - centre;
    d.x() -= width * std::round(d.x() / width);
    return Eigen::Vector2d(d / kRadius);
  };
  out = {step(u), step(v)};
  return out.u.allFinite() && out.v.allFinite();
}

}  // namespace

struct PairingVerifier::Impl {
  const SlamMap* map = nullptr;
  std::deque<Frame> history;
  int comparisons = 0;
  int alike = 0;

  const Sighting* last_sighting(std::int64_t landmark_id) const {
    for (auto frame = history.rbegin(); frame != history.rend(); ++frame)
      if (const Sighting* found = frame->find(landmark_id)) return found;
    return nullptr;
  }

  /// Samples the patch at an observation; false where the map gives no sensible geometry.
  bool look(const MapKeyframe& keyframe, const MapObservation& observation, ImageView<const Rgb> image,
            const Sighting*& previous, Sighting& out) const {
    const MapLandmark* landmark = map->find_landmark(observation.landmark_id);
    if (landmark == nullptr || !observation.pixel.allFinite()) return false;
    const MapCamera& camera = map->cameras[static_cast<std::size_t>(keyframe.camera)];
    const Eigen::Vector3d to_landmark = landmark->position_world - keyframe.cam_from_world.center();
    const double distance = to_landmark.norm();
    if (!(distance > 0.0) || !std::isfinite(distance)) return false;
    if (previous != nullptr &&
        (distance > previous->distance * kMaxScaleChange || distance * kMaxScaleChange < previous->distance))
      previous = nullptr;
    out.landmark_id = observation.landmark_id;
    out.distance = previous != nullptr ? previous->distance : distance;
    if (previous != nullptr) {
      out.axis = previous->axis;
    } else {
      to_landmark.cwiseAbs().minCoeff(&out.axis);
    }
    // An image smaller than the camera's has no finer detail than its own pixels.
    const double spacing_px = std::max(kSpacingPx, static_cast<double>(camera.width) / image.width);
    const double sample_rad = 2.0 * kPi * spacing_px / camera.width * out.distance / distance;
    PatchAxes axes;
    if (!patch_axes(keyframe.cam_from_world, to_landmark, out.axis, sample_rad, image.width, image.height, axes))
      return false;
    const Eigen::Vector2d centre = observation.pixel.cast<double>() * (static_cast<double>(image.width) / camera.width);
    std::size_t i = 0;
    for (int row = -kRadius; row <= kRadius; ++row)
      for (int col = -kRadius; col <= kRadius; ++col) {
        const Eigen::Vector2d at = centre + col * axes.u + row * axes.v;
        out.patch[i++] = static_cast<float>(sample_gray(image, at.x(), at.y()));
      }
    out.flat = !normalise(out.patch);
    return true;
  }

  void compare(const Sighting& a, const Sighting& b) {
    ++comparisons;
    if (a.flat || b.flat) return;
    float ncc = 0.0F;
    for (std::size_t i = 0; i < a.patch.size(); ++i) ncc += a.patch[i] * b.patch[i];
    if (ncc > kAlikeNcc) ++alike;
  }
};

PairingVerifier::PairingVerifier(const SlamMap& map) : impl_(std::make_unique<Impl>()) { impl_->map = &map; }

PairingVerifier::~PairingVerifier() = default;

void PairingVerifier::add(std::int64_t keyframe_id, ImageView<const Rgb> image) {
  const MapKeyframe* keyframe = impl_->map->find_keyframe(keyframe_id);
  if (keyframe == nullptr)
    throw InvalidInput("PairingVerifier::add: the map has no keyframe " + std::to_string(keyframe_id));
  if (image.empty())
    throw InvalidInput("PairingVerifier::add: the image of keyframe " + std::to_string(keyframe_id) + " is empty");
  Frame frame;
  frame.sightings.reserve(keyframe->observations.size());
  for (const MapObservation& observation : keyframe->observations) {
    const Sighting* previous = impl_->last_sighting(observation.landmark_id);
    Sighting sighting;
    if (!impl_->look(*keyframe, observation, image, previous, sighting)) continue;
    if (previous != nullptr) impl_->compare(*previous, sighting);
    frame.sightings.push_back(sighting);
  }
  std::sort(frame.sightings.begin(), frame.sightings.end(),
            [](const Sighting& a, const Sighting& b) { return a.landmark_id < b.landmark_id; });
  impl_->history.push_back(std::move(frame));
  if (impl_->history.size() > kHistory) impl_->history.pop_front();
}

PairingVerifier::Verdict PairingVerifier::verdict() const {
  Verdict verdict;
  verdict.comparisons = impl_->comparisons;
  verdict.conclusive = impl_->comparisons >= kConclusive;
  if (impl_->comparisons > 0) verdict.agreement = static_cast<double>(impl_->alike) / impl_->comparisons;
  verdict.belongs = !verdict.conclusive || verdict.agreement >= kMinAgreement;
  const std::string patches = std::to_string(verdict.comparisons) + " landmark patches";
  const std::string percent = std::to_string(std::lround(100.0 * verdict.agreement)) + " % of " + patches;
  if (!verdict.conclusive) {
    verdict.message = "cannot tell whether the images belong to their keyframes: only " + patches +
                      " could be compared between keyframes (at least " + std::to_string(kConclusive) + " needed)";
  } else if (verdict.belongs) {
    verdict.message = "the images belong to their keyframes: " + percent + " agree between keyframes";
  } else {
    verdict.message = "the images do not belong to these keyframes: only " + percent +
                      " agree between keyframes (expected over " + std::to_string(kExpectedPercent) +
                      " %); check --images, --video, --frame-offset and --fps, or use --no-verify";
  }
  return verdict;
}

}  // namespace pmsp
