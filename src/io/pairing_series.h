// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

#include "landmark_patch.h"
#include "pmsp/io/map.h"
#include "pmsp/types.h"

namespace pmsp::io {

/// Limits of the fit, between that of correct images (blurred, dark or overexposed ones included) and of images of
/// other keyframes or one frame off, which is higher where motion is small.
constexpr double kExpectedFit = 0.6;
constexpr double kLeastFit = 0.4;
constexpr double kLeastFitInNoise = 0.16;

/// Variant of an image: as is, flipped or turned.
struct Presentation {
  bool mirrored = false;  ///< left and right swapped
  bool flipped = false;   ///< top and bottom swapped; with `mirrored`: half a turn about the optical axis
  bool turned = false;    ///< half a turn about the vertical axis
};

/// Numbers of tries and hits. Those of one image are correlated, so the deviation is estimated between images.
class Tally {
 public:
  void add_image(int tries, int hits);

  int tries() const { return static_cast<int>(tries_); }
  int images() const { return images_; }
  double share() const { return tries_ > 0.0 ? hits_ / tries_ : 0.0; }

  /// Standard deviation of the share.
  double deviation() const;

 private:
  int images_ = 0;
  double tries_ = 0.0;
  double hits_ = 0.0;
  double tries_squared_ = 0.0;  ///< sums of products over images
  double hits_squared_ = 0.0;
  double tries_hits_ = 0.0;
};

/// Tracks landmarks through images assigned to keyframes. A landmark is *found* if its last patch correlates better at
/// its position than a few samples beside; that depends less on baseline and noise than the correlation itself.
class PairingSeries {
 public:
  /// `map` must outlive the series. `landmarks`: compared per image, the same ones from image to image.
  PairingSeries(const SlamMap& map, std::size_t landmarks) : map_(&map), landmarks_(landmarks) {}

  void add(const MapKeyframe& keyframe, ImageView<const Rgb> image, const Presentation& presentation = {});

  /// Sets the number of landmarks for the next images: a subset or superset of the current ones.
  void look_at(std::size_t landmarks) { landmarks_ = landmarks; }

  const Tally& found() const { return found_; }

  /// Hits of patches of other landmarks: chance in these images.
  const Tally& by_chance() const { return by_chance_; }

  /// Mean correlation of landmarks with their last patches, -1 to 1.
  double likeness() const { return found_.tries() > 0 ? likeness_ / found_.tries() : 0.0; }

  /// Mean squared correlation with other landmarks, 0 to 1: 1 / kPatchSamples in pure noise.
  double unrelated_likeness() const { return by_chance_.tries() > 0 ? unrelated_ / by_chance_.tries() : 0.0; }

  /// Share found beyond chance: 0 = chance, 1 = all; and its standard deviation.
  double fit() const;
  double fit_deviation() const;

  /// Minimum fit of correct images; lower in noise.
  double least_fit() const;

  int looked_at() const { return looked_at_; }  ///< number of landmarks in images
  int flat() const { return flat_; }            ///< textureless ones among these

 private:
  struct Sighting {
    std::int64_t landmark_id = 0;
    int axis = 0;              ///< see lay_patch; constant along a chain of patches
    double sample_size = 0.0;  ///< at the landmark [map units], constant along a chain of patches
    LandmarkPatch patch;
  };
  using Frame = std::vector<Sighting>;  ///< by landmark_id
  struct PlacedLandmark;

  std::vector<MapObservation> choose(const MapKeyframe& keyframe) const;
  const Sighting* last_sighting(std::int64_t landmark_id) const;
  bool place(const MapKeyframe& keyframe, const MapObservation& observation, ImageView<const Rgb> image,
             const Presentation& presentation, PlacedLandmark& placed) const;

  const SlamMap* map_;
  std::size_t landmarks_;
  std::deque<Frame> history_;
  Tally found_;
  Tally by_chance_;
  double likeness_ = 0.0;
  double unrelated_ = 0.0;
  int looked_at_ = 0;
  int flat_ = 0;
};

}  // namespace pmsp::io
