// SPDX-License-Identifier: BSD-2-Clause
#include "io/pairing.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "pairing_series.h"
#include "pmsp/error.h"
#include "util/percent.h"

namespace pmsp {
namespace {

constexpr std::size_t kLandmarks = 300;  ///< compared per image
constexpr std::size_t kLandmarksWhenClear = 100;
constexpr std::size_t kWrongLandmarks = 40;
constexpr std::size_t kWrongLandmarksWhenClear = 12;
constexpr int kConclusive = 200;
constexpr int kConclusiveImages = 2;  ///< images with landmarks of previous ones
constexpr int kClearImages = 8;       ///< after these, fewer landmarks are compared
constexpr int kWrongConclusive = 100;
constexpr int kMinNamedTries = 10;  ///< comparisons required to name a pairing
constexpr int kWrongEnough = 1000;
constexpr double kSigmas = 4.0;
constexpr double kClearlyBetter = 0.1;  ///< lead in the share of found landmarks

constexpr double kMostlyFlat = 0.9;  ///< share of textureless landmarks above which images are rejected
constexpr int kFewFound = 30;        ///< textured comparisons required for a verdict in spite of them

/// Alternative pairing, wrong if the tested one is right.
struct OtherPairing {
  const char* what;
  int shift = 0;  ///< in temporal order
  bool reversed = false;
  io::Presentation presentation;
};
const OtherPairing kOthers[] = {{"each paired with the previous keyframe", -1, false, {}},
                                {"each paired with the next keyframe", 1, false, {}},
                                {"in reverse order", 0, true, {}},
                                {"mirrored", 0, false, {true, false, false}},
                                {"flipped top to bottom", 0, false, {false, true, false}},
                                {"turned upside down", 0, false, {true, true, false}},
                                {"turned by half a turn", 0, false, {false, false, true}}};

}  // namespace

struct PairingVerifier::Impl {
  explicit Impl(const SlamMap& slam_map) : map(slam_map), given(slam_map, kLandmarks) {
    for (std::size_t k = 0; k < map.keyframes.size(); ++k) by_time.push_back(k);
    std::stable_sort(by_time.begin(), by_time.end(), [this](std::size_t a, std::size_t b) {
      return map.keyframes[a].timestamp < map.keyframes[b].timestamp;
    });
    rank.resize(by_time.size());
    for (std::size_t r = 0; r < by_time.size(); ++r) rank[by_time[r]] = r;
    for (std::size_t i = 0; i < std::size(kOthers); ++i) others.emplace_back(map, kWrongLandmarks);
  }

  const MapKeyframe* keyframe_for(const OtherPairing& other, const MapKeyframe& keyframe) const {
    const auto last = static_cast<std::ptrdiff_t>(by_time.size()) - 1;
    auto r = static_cast<std::ptrdiff_t>(rank[static_cast<std::size_t>(&keyframe - map.keyframes.data())]);
    r = (other.reversed ? last - r : r) + other.shift;
    return r < 0 || r > last ? nullptr : &map.keyframes[by_time[static_cast<std::size_t>(r)]];
  }

  /// Alternative with the largest share found; nullptr if there are too few comparisons.
  const OtherPairing* best_other(int least_tries) const {
    const OtherPairing* best = nullptr;
    double share = 0.0;
    for (std::size_t i = 0; i < others.size(); ++i) {
      const io::Tally& found = others[i].found();
      if (found.tries() < least_tries || found.share() <= share) continue;
      share = found.share();
      best = &kOthers[i];
    }
    return best;
  }

  const io::Tally& found_by(const OtherPairing& other) const {
    return others[static_cast<std::size_t>(&other - kOthers)].found();
  }

  bool clearly_better(const OtherPairing* other) const {
    if (other == nullptr) return false;
    const io::Tally& theirs = found_by(*other);
    const double deviation = std::hypot(theirs.deviation(), given.found().deviation());
    return theirs.share() - given.found().share() > kClearlyBetter + kSigmas * deviation;
  }

  const SlamMap& map;
  std::vector<std::size_t> by_time;  ///< indices of the map's keyframes
  std::vector<std::size_t> rank;     ///< per keyframe: index in by_time
  io::PairingSeries given;
  std::vector<io::PairingSeries> others;  ///< parallel to kOthers
};

PairingVerifier::PairingVerifier(const SlamMap& map) : impl_(std::make_unique<Impl>(map)) {}

PairingVerifier::~PairingVerifier() = default;

void PairingVerifier::add(std::int64_t keyframe_id, ImageView<const Rgb> image) {
  const MapKeyframe* keyframe = impl_->map.find_keyframe(keyframe_id);
  if (keyframe == nullptr)
    throw InvalidInput("PairingVerifier::add: the map has no keyframe " + std::to_string(keyframe_id));
  if (image.empty())
    throw InvalidInput("PairingVerifier::add: the image of keyframe " + std::to_string(keyframe_id) + " is empty");
  impl_->given.add(*keyframe, image);
  for (std::size_t i = 0; i < impl_->others.size(); ++i) {
    const MapKeyframe* other = impl_->keyframe_for(kOthers[i], *keyframe);
    if (other != nullptr && impl_->others[i].found().tries() < kWrongEnough)
      impl_->others[i].add(*other, image, kOthers[i].presentation);
  }
  const Verdict now = verdict();
  const bool is_clear = now.belongs && !now.doubtful && impl_->given.found().images() >= kClearImages;
  impl_->given.look_at(is_clear ? kLandmarksWhenClear : kLandmarks);
  for (io::PairingSeries& other : impl_->others) other.look_at(is_clear ? kWrongLandmarksWhenClear : kWrongLandmarks);
}

PairingVerifier::Verdict PairingVerifier::verdict() const {
  const io::PairingSeries& given = impl_->given;
  const io::Tally& found = given.found();
  const io::Tally& chance = given.by_chance();
  Verdict verdict;
  verdict.comparisons = found.tries();
  verdict.agreement = found.share();
  verdict.by_chance = chance.share();
  verdict.fit = given.fit();
  verdict.likeness = given.likeness();
  const double deviation = given.fit_deviation();

  const bool is_flat = given.looked_at() >= kConclusive && given.flat() > kMostlyFlat * given.looked_at() &&
                       !(found.tries() >= kFewFound && verdict.fit >= io::kLeastFit);
  verdict.conclusive = is_flat || (found.tries() >= kConclusive && found.images() >= kConclusiveImages);
  if (!verdict.conclusive) {
    verdict.message = "unknown whether the images belong to their keyframes: " + std::to_string(verdict.comparisons) +
                      " landmarks compared between keyframes, expected at least " + std::to_string(kConclusive);
    return verdict;
  }
  const double least = given.least_fit();
  const bool fits = verdict.fit + kSigmas * deviation >= least;
  const std::string advice = "check --images, --video, --frame-offset and --fps, or use --no-verify";
  verdict.belongs = !is_flat && fits && !impl_->clearly_better(impl_->best_other(kWrongConclusive));
  verdict.doubtful = verdict.belongs && verdict.fit < io::kExpectedFit;
  if (is_flat) {
    verdict.message = "the images do not belong to these keyframes: no texture at " +
                      percent(static_cast<double>(given.flat()) / given.looked_at()) + " of " +
                      std::to_string(given.looked_at()) + " landmarks; " + advice;
    return verdict;
  }
  const OtherPairing* other = impl_->best_other(kMinNamedTries);
  if (other != nullptr) {  // not named if it fits as little
    const double beyond_chance = impl_->found_by(*other).share() - verdict.by_chance;
    if (beyond_chance < least * std::max(0.5, 1.0 - verdict.by_chance)) other = nullptr;
  }
  std::string figures = percent(verdict.agreement) + " of " + std::to_string(verdict.comparisons) +
                        " landmarks are found where the map has them (by chance " + percent(verdict.by_chance);
  if (other != nullptr) {
    figures += std::string("; with the images ") + other->what + ", " + percent(impl_->found_by(*other).share());
  }
  figures += ")";
  if (!verdict.belongs) {
    verdict.message = "the images do not belong to these keyframes: only " + figures + "; " + advice;
  } else if (verdict.doubtful) {
    verdict.message = "the images may not belong to their keyframes: only " + figures +
                      (least < 0.5 * (io::kLeastFit + io::kLeastFitInNoise) ? ", as with strong noise" : "") +
                      "; inspect the result, and check --images, --video, --frame-offset and --fps";
  } else {
    verdict.message = "the images belong to their keyframes: " + figures;
  }
  return verdict;
}

}  // namespace pmsp
