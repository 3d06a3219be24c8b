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

/// Measured on two real SLAM maps, one with a real camera, and their images with neighbouring keyframes, every 2nd to
/// 6th of them, at 320 to 1920 px, blurred by up to 10 px, dark, overexposed: right images fit by 0.6 to 0.97, those
/// one frame off (0.12 m of flight at 5 m) by 0.07 to 0.25, of other keyframes by -0.03 to 0.13, where the motion is
/// small by up to 0.34.
constexpr double kExpectedFit = 0.6;
constexpr double kLeastFit = 0.4;
constexpr double kLeastFitInNoise = 0.16;

/// How an image shows what the camera saw: as it is, or flipped or turned.
struct Presentation {
  bool mirrored = false;  ///< left and right swapped
  bool flipped = false;   ///< top and bottom swapped; with `mirrored`: turned by half a turn about the optical axis
  bool turned = false;    ///< by half a turn about the vertical axis
};

/// Hits among tries. Those of one image go together, so the deviation is taken between images.
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
  double tries_squared_ = 0.0;  ///< sums over images of products
  double hits_squared_ = 0.0;
  double tries_hits_ = 0.0;
};

/// Follows landmarks through images that are taken for those of certain keyframes. A landmark is *found* where the
/// image looks more like its last sighting right where the map has it than a few samples beside. Large baselines
/// and noise change that less than the likeness itself.
class PairingSeries {
 public:
  /// `map` must outlive the series. So many landmarks of an image are looked at, the same ones in image after image.
  PairingSeries(const SlamMap& map, std::size_t landmarks) : map_(&map), landmarks_(landmarks) {}

  void add(const MapKeyframe& keyframe, ImageView<const Rgb> image, const Presentation& presentation = {});

  /// Of the next images so many landmarks: some of those of before, or all of them and more.
  void look_at(std::size_t landmarks) { landmarks_ = landmarks; }

  const Tally& found() const { return found_; }

  /// The same with the last sighting of another landmark instead: what chance gives in these images.
  const Tally& by_chance() const { return by_chance_; }

  /// Mean correlation of landmarks with their last sightings, -1 to 1.
  double likeness() const { return found_.tries() > 0 ? likeness_ / found_.tries() : 0.0; }

  /// Mean square of the correlation of landmarks with others, 0 to 1: 1 / kPatchSamples where there is only noise.
  double unrelated_likeness() const { return by_chance_.tries() > 0 ? unrelated_ / by_chance_.tries() : 0.0; }

  /// Landmarks found beyond chance: 0 = as by chance, 1 = all; and its standard deviation.
  double fit() const;
  double fit_deviation() const;

  /// What right images at least reach: less, where noise hides what they show.
  double least_fit() const;

  int looked_at() const { return looked_at_; }  ///< landmarks in images
  int flat() const { return flat_; }            ///< of these, where there is nothing to see

 private:
  struct Sighting {
    std::int64_t landmark_id = 0;
    int axis = 0;              ///< as lay_patch, the same in all sightings of a chain
    double sample_size = 0.0;  ///< at the landmark [scene units], the same in all sightings of a chain
    LandmarkPatch patch;
  };
  using Frame = std::vector<Sighting>;  ///< ascending landmark_id
  struct Look;

  std::vector<MapObservation> choose(const MapKeyframe& keyframe) const;
  const Sighting* last_sighting(std::int64_t landmark_id) const;
  bool place(const MapKeyframe& keyframe, const MapObservation& observation, ImageView<const Rgb> image,
             const Presentation& presentation, Look& look) const;

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
