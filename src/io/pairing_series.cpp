// SPDX-License-Identifier: BSD-2-Clause
#include "pairing_series.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>

#include "elementary.h"

namespace pmsp::io {
namespace {

constexpr double kSpacingPx = 2.0;       ///< between samples, in pixels of the camera
constexpr float kSameLook = 0.8F;        ///< correlation from which on a place beside looks like the landmark itself
constexpr std::size_t kLeastPlaces = 3;  ///< of the four beside that look different; else nothing can be told
constexpr double kMaxRescaling = 2.0;    ///< of a patch against the camera's own resolution
constexpr double kWideAngle = 0.25;      ///< sine of the angle between rays from which on slanted surfaces are tried
constexpr double kSlant = 0.8;           ///< tangent of their angle with the one that faces both cameras
constexpr double kLeastCosine = 0.2;     ///< of the angle between a surface's normal and a ray
constexpr std::size_t kHistory = 16;     ///< keyframes whose patches are kept
constexpr double kClustering = 4.0;      ///< at least so many tries in one image count as one

/// Correlation of unrelated patches (root mean square): 0.25 to 0.5 in the same images, 1 / 9 in noise. With noise of
/// 60, 90 and 120 gray levels it is 0.21, 0.16 and 0.14, and the right images fit by 0.6, 0.4 and 0.3, the wrong ones
/// by 0.05 at most.
constexpr double kClearLikeness = 0.32;
constexpr double kNoiseLikeness = 0.16;

std::uint64_t hash(std::int64_t id) {
  auto h = static_cast<std::uint64_t>(id) * 0x9E3779B97F4A7C15ULL;
  h = (h ^ (h >> 29U)) * 0xBF58476D1CE4E5B9ULL;
  return h ^ (h >> 32U);
}

PatchPlace presented(PatchPlace place, const Presentation& how, int width, int height) {
  const Eigen::Vector2d flip(how.mirrored ? -1.0 : 1.0, how.flipped ? -1.0 : 1.0);
  place.centre = place.centre.cwiseProduct(flip);
  if (how.mirrored) place.centre.x() += width;
  if (how.flipped) place.centre.y() += height;
  if (how.turned) place.centre.x() += place.centre.x() < 0.5 * width ? 0.5 * width : -0.5 * width;
  place.u = place.u.cwiseProduct(flip);
  place.v = place.v.cwiseProduct(flip);
  return place;
}

/// Normals of surfaces that a landmark may be on, by the rays to it: facing both cameras, and with a wide angle between
/// the rays four slanted ones. Only surfaces that both cameras see.
std::vector<Eigen::Vector3d> surface_normals(const Eigen::Vector3d& ray, const Eigen::Vector3d& other_ray) {
  const Eigen::Vector3d a = ray.normalized();
  const Eigen::Vector3d b = other_ray.normalized();
  const Eigen::Vector3d facing = (a + b).normalized();
  std::vector<Eigen::Vector3d> normals{facing};
  const Eigen::Vector3d across = a.cross(b);
  if (across.norm() < kWideAngle) return normals;
  const Eigen::Vector3d axis = across.normalized();
  for (const Eigen::Vector3d& slant : {axis, Eigen::Vector3d(axis.cross(facing))})
    for (const double side : {-kSlant, kSlant}) {
      const Eigen::Vector3d normal = (facing + side * slant).normalized();
      if (std::min(normal.dot(a), normal.dot(b)) > kLeastCosine) normals.push_back(normal);
    }
  return normals;
}

}  // namespace

void Tally::add_image(int tries, int hits) {
  if (tries == 0) return;
  ++images_;
  tries_ += tries;
  hits_ += hits;
  tries_squared_ += static_cast<double>(tries) * tries;
  hits_squared_ += static_cast<double>(hits) * hits;
  tries_hits_ += static_cast<double>(tries) * hits;
}

double Tally::deviation() const {
  if (tries_ == 0.0) return 1.0;
  const double p = share();
  const double careful = (hits_ + 2.0) / (tries_ + 4.0);  // a share of 0 or 1 in a few tries is not certain
  double variance = kClustering * tries_ * careful * (1.0 - careful);
  if (images_ > 1) {
    const double between = hits_squared_ - 2.0 * p * tries_hits_ + p * p * tries_squared_;
    variance = std::max(variance, between * images_ / (images_ - 1.0));
  }
  return std::sqrt(variance) / tries_;
}

double PairingSeries::fit() const {
  return (found_.share() - by_chance_.share()) / std::max(0.5, 1.0 - by_chance_.share());
}

double PairingSeries::fit_deviation() const {
  return std::hypot(found_.deviation(), by_chance_.deviation()) / std::max(0.5, 1.0 - by_chance_.share());
}

double PairingSeries::least_fit() const {
  const double likeness = std::sqrt(unrelated_likeness());
  const double clear = std::clamp((likeness - kNoiseLikeness) / (kClearLikeness - kNoiseLikeness), 0.0, 1.0);
  return kLeastFitInNoise + clear * (kLeastFit - kLeastFitInNoise);
}

/// A landmark in an image.
struct PairingSeries::Look {
  Sighting sighting;
  PatchPlace place;
  const Sighting* earlier = nullptr;
  std::vector<PatchPlace> as_earlier;  ///< places of the patch of `earlier`, one for each surface that it may be on
};

/// The same ones for all images that see them: those whose ids have the smallest hashes.
std::vector<MapObservation> PairingSeries::choose(const MapKeyframe& keyframe) const {
  std::vector<MapObservation> chosen = keyframe.observations;
  const auto before = [](const MapObservation& a, const MapObservation& b) {
    return hash(a.landmark_id) < hash(b.landmark_id);
  };
  if (chosen.size() > landmarks_) {
    std::nth_element(chosen.begin(), chosen.begin() + static_cast<std::ptrdiff_t>(landmarks_), chosen.end(), before);
    chosen.resize(landmarks_);
  }
  std::sort(chosen.begin(), chosen.end(), before);
  return chosen;
}

/// The earlier sighting from the nearest direction at about the same scale; nullptr = none.
const PairingSeries::Sighting* PairingSeries::earlier_sighting(const Sighting& of) const {
  const Sighting* nearest = nullptr;
  double best = -2.0;
  for (const Frame& frame : history_) {
    const auto at = std::lower_bound(frame.begin(), frame.end(), of.landmark_id,
                                     [](const Sighting& s, std::int64_t id) { return s.landmark_id < id; });
    if (at == frame.end() || at->landmark_id != of.landmark_id) continue;
    const double scale = at->sample_size / of.sample_size;
    if (!(scale <= kMaxRescaling && scale * kMaxRescaling >= 1.0)) continue;
    const double cosine = at->to_landmark.normalized().dot(of.to_landmark.normalized());
    if (cosine < best) continue;
    best = cosine;
    nearest = &*at;
  }
  return nearest;
}

/// False where the map gives no sensible geometry.
bool PairingSeries::place(const MapKeyframe& keyframe, const MapObservation& observation, ImageView<const Rgb> image,
                          const Presentation& presentation, Look& look) const {
  const MapLandmark* landmark = map_->find_landmark(observation.landmark_id);
  const MapCamera& camera = map_->cameras[static_cast<std::size_t>(keyframe.camera)];
  const Eigen::Array2d position = observation.pixel.cast<double>().array() / camera.width;
  if (landmark == nullptr || !(position.abs() <= 1.0).all()) return false;
  const Eigen::Vector3d to_landmark = landmark->position_world - keyframe.cam_from_world.center();
  const double distance = to_landmark.norm();
  if (!(distance > 0.0) || !std::isfinite(distance)) return false;
  // An image smaller than the camera's has no finer detail than its own pixels.
  const double spacing_px = std::max(kSpacingPx, static_cast<double>(camera.width) / image.width);
  const double own_size = 2.0 * kernels::kPi * spacing_px / camera.width * distance;
  look.sighting.landmark_id = observation.landmark_id;
  look.sighting.to_landmark = to_landmark;
  look.sighting.sample_size = own_size;
  const auto lay = [&](const PatchSteps& steps, PatchPlace& to) {
    if (!lay_patch(keyframe.cam_from_world, to_landmark, steps, image.width, image.height, to)) return false;
    to.centre = position.matrix() * image.width;
    to = presented(to, presentation, image.width, image.height);
    return true;
  };
  if (!lay(steps_across(to_landmark, own_size), look.place)) return false;
  look.earlier = earlier_sighting(look.sighting);
  if (look.earlier == nullptr) return true;
  const Eigen::Vector3d& ray = look.earlier->to_landmark;
  const PatchSteps steps = steps_across(ray, look.earlier->sample_size);
  for (const Eigen::Vector3d& normal : surface_normals(ray, to_landmark)) {
    PatchPlace place;
    if (lay(steps - ray * (normal.transpose() * steps) / normal.dot(ray), place)) look.as_earlier.push_back(place);
  }
  return true;
}

void PairingSeries::add(const MapKeyframe& keyframe, ImageView<const Rgb> image, const Presentation& presentation) {
  Frame frame;
  frame.reserve(std::min(landmarks_, keyframe.observations.size()));
  const LandmarkPatch* other = nullptr;  // an earlier sighting of another landmark
  int tries = 0;
  int hits = 0;
  int chance_tries = 0;
  int chance_hits = 0;
  for (const MapObservation& observation : choose(keyframe)) {
    Look it;
    if (!place(keyframe, observation, image, presentation, it)) continue;
    it.sighting.patch = sample_patch(image, it.place);
    ++looked_at_;
    flat_ += it.sighting.patch.flat;
    frame.push_back(it.sighting);
    if (it.earlier == nullptr || it.earlier->patch.flat) continue;
    std::vector<PatchWithNeighbours> seen;
    for (const PatchPlace& place : it.as_earlier) {
      PatchWithNeighbours patches = sample_with_neighbours(image, place);
      if (patches.here.flat) continue;
      std::size_t places = 0;
      for (LandmarkPatch& beside : patches.beside) {
        beside.flat = beside.flat || correlation(beside, patches.here) > kSameLook;
        places += !beside.flat;
      }
      if (places >= kLeastPlaces) seen.push_back(patches);
    }
    if (seen.empty()) continue;
    // The surface that fits best has the landmark here, not beside.
    const auto finds = [&](const LandmarkPatch& earlier) {
      float here = -1.0F;
      float beside = -1.0F;
      for (const PatchWithNeighbours& patches : seen) {
        here = std::max(here, correlation(earlier, patches.here));
        for (const LandmarkPatch& patch : patches.beside)
          if (!patch.flat) beside = std::max(beside, correlation(earlier, patch));
      }
      return beside < here;
    };
    ++tries;
    hits += finds(it.earlier->patch);
    likeness_ += correlation(it.earlier->patch, seen.front().here);
    if (other != nullptr) {
      ++chance_tries;
      chance_hits += finds(*other);
      const double unrelated = correlation(*other, seen.front().here);
      unrelated_ += unrelated * unrelated;
    }
    other = &it.earlier->patch;
  }
  found_.add_image(tries, hits);
  by_chance_.add_image(chance_tries, chance_hits);
  std::sort(frame.begin(), frame.end(),
            [](const Sighting& a, const Sighting& b) { return a.landmark_id < b.landmark_id; });
  history_.push_back(std::move(frame));
  if (history_.size() > kHistory) history_.pop_front();
}

}  // namespace pmsp::io
