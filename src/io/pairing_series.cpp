// SPDX-License-Identifier: BSD-2-Clause
#include "pairing_series.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "elementary.h"

namespace pmsp::io {
namespace {

constexpr double kSpacingPx = 2.0;       ///< between samples [px of the camera]
constexpr float kSameLook = 0.8F;        ///< correlation above which a neighbouring patch is indistinguishable
constexpr std::size_t kLeastPlaces = 3;  ///< minimum number of distinguishable neighbours, of four
constexpr double kMaxRescaling = 2.0;    ///< of a patch, relative to the camera's resolution
constexpr std::size_t kHistory = 16;     ///< keyframes whose patches are cached
constexpr double kClustering = 4.0;      ///< minimum number of correlated tries in an image that count as one

/// Root mean square correlation of unrelated patches in clear images, and in noise, where it approaches 1 / 9 (one over
/// the root of the number of samples).
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
  const double careful = (hits_ + 2.0) / (tries_ + 4.0);  // smoothed: shares of 0 or 1 of few tries are uncertain
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

/// Landmark in an image.
struct PairingSeries::PlacedLandmark {
  Sighting sighting;
  PatchPlace place;
  const Sighting* last = nullptr;
};

/// Selects the observations with the smallest hashed ids: the same landmarks in all images.
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

const PairingSeries::Sighting* PairingSeries::last_sighting(std::int64_t landmark_id) const {
  for (auto frame = history_.rbegin(); frame != history_.rend(); ++frame) {
    const auto at = std::lower_bound(frame->begin(), frame->end(), landmark_id,
                                     [](const Sighting& s, std::int64_t id) { return s.landmark_id < id; });
    if (at != frame->end() && at->landmark_id == landmark_id) return &*at;
  }
  return nullptr;
}

/// False if the geometry is degenerate.
bool PairingSeries::place(const MapKeyframe& keyframe, const MapObservation& observation, ImageView<const Rgb> image,
                          const Presentation& presentation, PlacedLandmark& placed) const {
  const MapLandmark* landmark = map_->find_landmark(observation.landmark_id);
  const MapCamera& camera = map_->cameras[static_cast<std::size_t>(keyframe.camera)];
  const Eigen::Array2d position = observation.pixel.cast<double>().array() / camera.width;
  if (landmark == nullptr || !(position.abs() <= 1.0).all()) return false;
  const Eigen::Vector3d to_landmark = landmark->position_world - keyframe.cam_from_world.center();
  const double distance = to_landmark.norm();
  if (!(distance > 0.0) || !std::isfinite(distance)) return false;
  // Images smaller than the camera's have a coarser resolution.
  const double spacing_px = std::max(kSpacingPx, static_cast<double>(camera.width) / image.width);
  const double own_size = 2.0 * kernels::kPi * spacing_px / camera.width * distance;
  placed.last = last_sighting(observation.landmark_id);
  if (placed.last != nullptr &&
      (placed.last->sample_size > own_size * kMaxRescaling || own_size > placed.last->sample_size * kMaxRescaling))
    placed.last = nullptr;
  placed.sighting.landmark_id = observation.landmark_id;
  placed.sighting.sample_size = placed.last != nullptr ? placed.last->sample_size : own_size;
  if (placed.last != nullptr) {
    placed.sighting.axis = placed.last->axis;
  } else {
    to_landmark.cwiseAbs().minCoeff(&placed.sighting.axis);
  }
  if (!lay_patch(keyframe.cam_from_world, to_landmark, placed.sighting.axis, placed.sighting.sample_size / distance,
                 image.width, image.height, placed.place))
    return false;
  placed.place.centre = position.matrix() * image.width;
  placed.place = presented(placed.place, presentation, image.width, image.height);
  return true;
}

void PairingSeries::add(const MapKeyframe& keyframe, ImageView<const Rgb> image, const Presentation& presentation) {
  Frame frame;
  frame.reserve(std::min(landmarks_, keyframe.observations.size()));
  const LandmarkPatch* other = nullptr;  // last patch of another landmark
  int tries = 0;
  int hits = 0;
  int chance_tries = 0;
  int chance_hits = 0;
  for (const MapObservation& observation : choose(keyframe)) {
    PlacedLandmark it;
    if (!place(keyframe, observation, image, presentation, it)) continue;
    const bool comparable = it.last != nullptr && !it.last->patch.flat;
    PatchWithNeighbours seen;
    if (comparable) {
      seen = sample_with_neighbours(image, it.place);
    } else {
      seen.here = sample_patch(image, it.place);
    }
    ++looked_at_;
    flat_ += seen.here.flat;
    it.sighting.patch = seen.here;
    frame.push_back(it.sighting);
    if (!comparable || seen.here.flat) continue;
    std::size_t places = 0;
    for (const LandmarkPatch& beside : seen.beside)
      if (!beside.flat && correlation(beside, seen.here) <= kSameLook) seen.beside[places++] = beside;
    if (places < kLeastPlaces) continue;
    const auto finds = [&](const LandmarkPatch& last) {
      const float likeness = correlation(last, seen.here);
      return std::all_of(seen.beside.begin(), seen.beside.begin() + static_cast<std::ptrdiff_t>(places),
                         [&](const LandmarkPatch& beside) { return correlation(last, beside) < likeness; });
    };
    ++tries;
    hits += finds(it.last->patch);
    likeness_ += correlation(it.last->patch, seen.here);
    if (other != nullptr) {
      ++chance_tries;
      chance_hits += finds(*other);
      const double unrelated = correlation(*other, seen.here);
      unrelated_ += unrelated * unrelated;
    }
    other = &it.last->patch;
  }
  found_.add_image(tries, hits);
  by_chance_.add_image(chance_tries, chance_hits);
  std::sort(frame.begin(), frame.end(),
            [](const Sighting& a, const Sighting& b) { return a.landmark_id < b.landmark_id; });
  history_.push_back(std::move(frame));
  if (history_.size() > kHistory) history_.pop_front();
}

}  // namespace pmsp::io
